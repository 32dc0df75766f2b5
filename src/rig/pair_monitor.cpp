#include "rig/pair_monitor.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>

namespace groundline::rig {
namespace {

// The shrunk picture, at most.
constexpr int kShrunkWidth = 448;
constexpr int kShrunkPixels = 320 * 240;
constexpr int kMostBands = 12;
constexpr int kCells = 10;  // of a band, one feature each
constexpr int kPatch = 8;   // shrunk px
constexpr int kPatchPixels = kPatch * kPatch;
// Sum of the steps along the row over a patch below which there is nothing to follow: 4 grey levels a pixel,
// where noise of 2 levels has 1.
constexpr int kLeastSteps = kPatchPixels * 4;
// Correlation of a match, and by how much all others (2 px and more away) must be further from 1: on 25 real
// sets at most 3 of 100 such matches are wrong.
constexpr double kLeastMatch = 0.85;
constexpr double kUnique = 2.0;
constexpr double kLeastMargin = 0.02;  // and by this, where the best is perfect: the posts of a fence

constexpr int kFine = 12;  // full px
constexpr int kFinePixels = kFine * kFine;
constexpr int kRows = 3;     // searched up and down
constexpr int kColumns = 3;  // to either side: the shrunk match is good to a quarter of its pixels
constexpr double kLeastFine = 0.8;
// The correlation must fall by half of this a pixel away, and not be a ridge: on one a place along it is as
// good as another.
constexpr double kLeastCurve = 0.02;
constexpr double kLeastApart = 0.25;

// A pair of which less than one in so many patches is found again is tried with the right view's rows so far
// down and up.
constexpr int kLostShare = 8;
constexpr int kShiftedRows = 3;

// This near to infinity the sign of a disparity says nothing: calibrations are off by a pixel.
constexpr double kNearInfinityPx = 2.0;
// For the gain from pairs of features: grey levels between them, and pairs.
constexpr double kLeastSpread = 8.0;
constexpr std::size_t kLeastPairs = 8;

std::int32_t dot(const std::int16_t* a, const std::int16_t* b, int count) {
    std::int32_t sum = 0;
    for (int i = 0; i < count; ++i)
        sum += std::int32_t{a[i]} * b[i];
    return sum;
}

// A band of kPatch shrunk rows, column by column, so that a patch is contiguous.
struct Columns {
    std::array<std::int16_t, static_cast<std::size_t>(kShrunkWidth* kPatch)> pixels;
    std::array<std::int32_t, kShrunkWidth> sum;     // over the patch that begins there
    std::array<std::int32_t, kShrunkWidth> square;  // likewise

    const std::int16_t* at(int x) const { return &pixels[static_cast<std::size_t>(x * kPatch)]; }

    // Means over squares of `scale` px, from row `top` of the full picture on.
    void take(ConstLuma image, int top, int scale, int width) {
        for (int j = 0; j < kPatch; ++j) {
            switch (scale) {
                case 1:
                    take_row<1>(image, top + j, 1, width, j);
                    break;
                case 2:
                    take_row<2>(image, top + j * 2, 2, width, j);
                    break;
                case 3:
                    take_row<3>(image, top + j * 3, 3, width, j);
                    break;
                case 4:
                    take_row<4>(image, top + j * 4, 4, width, j);
                    break;
                case 5:
                    take_row<5>(image, top + j * 5, 5, width, j);
                    break;
                case 6:
                    take_row<6>(image, top + j * 6, 6, width, j);
                    break;
                default:
                    take_row<0>(image, top + j * scale, scale, width, j);
            }
        }
        std::array<std::int32_t, kShrunkWidth> sums;
        std::array<std::int32_t, kShrunkWidth> squares;
        std::int32_t s = 0;
        std::int32_t q = 0;
        for (int x = 0; x < width; ++x) {
            const std::int16_t* column = at(x);
            std::int32_t column_sum = 0;
            for (int j = 0; j < kPatch; ++j)
                column_sum += column[j];
            sums[static_cast<std::size_t>(x)] = column_sum;
            squares[static_cast<std::size_t>(x)] = dot(column, column, kPatch);
            s += sums[static_cast<std::size_t>(x)];
            q += squares[static_cast<std::size_t>(x)];
            const int first = x - kPatch + 1;
            if (first < 0) continue;
            sum[static_cast<std::size_t>(first)] = s;
            square[static_cast<std::size_t>(first)] = q;
            s -= sums[static_cast<std::size_t>(first)];
            q -= squares[static_cast<std::size_t>(first)];
        }
    }

  private:
    // kScale 0: only known at run time.
    template <int kScale>
    void take_row(ConstLuma image, int top, int run_scale, int width, int j) {
        const int scale = kScale > 0 ? kScale : run_scale;
        std::array<std::uint32_t, kShrunkWidth> total{};
        for (int k = 0; k < scale; ++k) {
            const std::uint8_t* row = image.row(top + k);
            for (int x = 0; x < width; ++x) {
                std::uint32_t here = 0;
                for (int i = 0; i < scale; ++i)
                    here += row[x * scale + i];
                total[static_cast<std::size_t>(x)] += here;
            }
        }
        const auto area = static_cast<std::uint32_t>(scale * scale);
        for (int x = 0; x < width; ++x)
            pixels[static_cast<std::size_t>(x * kPatch + j)] =
                static_cast<std::int16_t>(total[static_cast<std::size_t>(x)] / area);
    }
};

// Correlation of a patch with others: sign and square of the coefficient are exact functions of integers.
class Correlation {
  public:
    Correlation(std::int32_t pixels, std::int32_t sum, std::int32_t square)
        : pixels_(pixels),
          sum_(sum),
          spread_(std::max(static_cast<double>(pixels) * square - static_cast<double>(sum) * sum, 1.0)) {}

    double squared(std::int32_t product, std::int32_t other_sum, std::int32_t other_square) const {
        const double covariance = pixels_ * product - sum_ * other_sum;
        const double other = pixels_ * other_square - static_cast<double>(other_sum) * other_sum;
        return covariance * std::abs(covariance) / (spread_ * std::max(other, 1.0));
    }

  private:
    double pixels_;
    double sum_;
    double spread_;  // pixels times the sum of squared differences to the mean
};

// Adds (or takes away) a row to sums over columns.
template <int kWide>
void add_row(const std::uint8_t* row, int sign,
             std::array<std::int32_t, static_cast<std::size_t>(kWide)>& sums,
             std::array<std::int32_t, static_cast<std::size_t>(kWide)>& squares) {
    for (int i = 0; i < kWide; ++i) {
        const std::int32_t p = row[i];
        sums[static_cast<std::size_t>(i)] += sign * p;
        squares[static_cast<std::size_t>(i)] += sign * p * p;
    }
}

int scale_for(int width, int height) {
    int scale = 1;
    while (width / scale > kShrunkWidth || (width / scale) * (height / scale) > kShrunkPixels)
        ++scale;
    return scale;
}

// Where the highest of three lies about the middle one.
double peak_of(double before, double here, double after) {
    const double curve = 2.0 * here - before - after;
    return curve > 0.0 ? 0.5 * (after - before) / curve : 0.0;
}

}  // namespace

PairMonitor::PairMonitor(const RectifiedRig& rig, int min_disparity, int disparities,
                         ConstImageView<std::uint8_t> excluded_left,
                         ConstImageView<std::uint8_t> excluded_right, Arena& arena)
    : width_(rig.width),
      height_(rig.height),
      scale_(scale_for(rig.width, rig.height)),
      reach_((std::max(std::abs(min_disparity), std::abs(min_disparity + disparities)) + scale_ - 1) /
             scale_),
      bands_(std::min(kMostBands, rig.height / (kPatch * scale_))),
      infinity_px_(rig.calibrated ? rig.offset_px() : std::min(min_disparity, 0)),
      excluded_left_(excluded_left),
      excluded_right_(excluded_right),
      features_(arena.take<Feature>(static_cast<std::size_t>(kMostBands * kCells))),
      placed_(arena.take<std::size_t>(static_cast<std::size_t>(kMostBands * kCells))),
      sorted_(arena.take<double>(static_cast<std::size_t>(kMostBands * kCells))) {}

bool PairMonitor::is_free(ConstImageView<std::uint8_t> excluded, int x, int y, int reach) const {
    if (excluded.empty()) return true;
    for (int j = -1; j <= 1; ++j)
        for (int i = -1; i <= 1; ++i) {
            const int u = std::clamp(x + i * reach, 0, width_ - 1);
            const int v = std::clamp(y + j * reach, 0, height_ - 1);
            if (excluded.at(u, v) != 0) return false;
        }
    return true;
}

// Left column of the 12 rows from `top` where steps along and across the row are both strong: the middle of
// the shrunk patch about x may be plain.
int PairMonitor::most_textured(ConstLuma left, int x, int top) const {
    const int first = std::max(1, x - kPatch * scale_ / 2);
    const int end = std::min(width_ - 1, x + kPatch * scale_ / 2);
    constexpr int kMost = 64;
    std::array<std::int32_t, kMost> along{};
    std::array<std::int32_t, kMost> across{};
    const int count = std::min(kMost, end - first);
    for (int n = 0; n < kFine; ++n) {
        const std::uint8_t* row = left.row(top + n) + first;
        const std::uint8_t* above = left.row(top + n - 1) + first;
        const std::uint8_t* below = left.row(top + n + 1) + first;
        for (int i = 0; i < count; ++i) {
            along[static_cast<std::size_t>(i)] += std::abs(row[i + 1] - row[i - 1]);
            across[static_cast<std::size_t>(i)] += std::abs(below[i] - above[i]);
        }
    }
    std::int32_t sum_along = 0;
    std::int32_t sum_across = 0;
    std::int32_t most = -1;
    int best = first;
    for (int i = 0; i < count; ++i) {
        sum_along += along[static_cast<std::size_t>(i)];
        sum_across += across[static_cast<std::size_t>(i)];
        if (i < kFine - 1) continue;
        const int begin = i - kFine + 1;
        if (std::min(sum_along, sum_across) > most) {
            most = std::min(sum_along, sum_across);
            best = first + begin;
        }
        sum_along -= along[static_cast<std::size_t>(begin)];
        sum_across -= across[static_cast<std::size_t>(begin)];
    }
    return best;
}

// The full pictures about the place that the shrunk ones gave.
void PairMonitor::place(ConstLuma left, ConstLuma right, int x, int y, int shift, Feature& feature) const {
    constexpr int kWide = kFine + 2 * kColumns;
    constexpr int kHigh = kFine + 2 * kRows;
    constexpr int kAcross = 2 * kColumns + 1;
    constexpr int kDown = 2 * kRows + 1;
    const int top = y - kFine / 2;
    if (top < 1 || top + kFine + 1 > height_) return;
    const int x_left = most_textured(left, x, top);
    const int x_right = x_left - static_cast<int>(std::floor(feature.disparity_px + 0.5)) - kColumns;
    const int top_right = top + shift - kRows;
    if (top_right < 1 || top_right + kHigh + 1 > height_) return;
    if (x_left < 1 || x_left + kFine + 1 > width_ || x_right < 1 || x_right + kWide + 1 > width_) return;

    // Column by column; the patch with zeros below its columns, so that one run over contiguous memory
    // correlates it with any place of the window.
    constexpr int kRun = (kFine - 1) * kHigh + kFine;
    std::array<std::int16_t, static_cast<std::size_t>(kRun)> patch{};
    std::array<std::int16_t, static_cast<std::size_t>(kWide * kHigh)> window;
    std::int32_t sum = 0;
    for (int n = 0; n < kFine; ++n) {
        const std::uint8_t* row = left.row(top + n) + x_left;
        for (int i = 0; i < kFine; ++i) {
            patch[static_cast<std::size_t>(i * kHigh + n)] = row[i];
            sum += row[i];
        }
    }
    std::array<std::int32_t, static_cast<std::size_t>(kWide)> sums{};
    std::array<std::int32_t, static_cast<std::size_t>(kWide)> squares{};
    for (int n = 0; n < kHigh; ++n) {
        const std::uint8_t* row = right.row(top_right + n) + x_right;
        for (int i = 0; i < kWide; ++i)
            window[static_cast<std::size_t>(i * kHigh + n)] = row[i];
        if (n < kFine) add_row<kWide>(row, 1, sums, squares);
    }
    const Correlation correlation(kFinePixels, sum, dot(patch.data(), patch.data(), kRun));

    std::array<std::array<double, static_cast<std::size_t>(kAcross)>, static_cast<std::size_t>(kDown)> scores;
    double best = -1.0;
    int best_i = 0;
    int best_j = 0;
    for (int j = 0; j < kDown; ++j) {
        std::int32_t other_sum = 0;
        std::int32_t other_square = 0;
        for (int n = 0; n < kFine; ++n) {
            other_sum += sums[static_cast<std::size_t>(n)];
            other_square += squares[static_cast<std::size_t>(n)];
        }
        for (int i = 0; i < kAcross; ++i) {
            const double score =
                correlation.squared(dot(patch.data(), &window[static_cast<std::size_t>(i * kHigh + j)], kRun),
                                    other_sum, other_square);
            scores[static_cast<std::size_t>(j)][static_cast<std::size_t>(i)] = score;
            if (score > best) {
                best = score;
                best_i = i;
                best_j = j;
            }
            if (i + 1 == kAcross) break;
            other_sum += sums[static_cast<std::size_t>(i + kFine)] - sums[static_cast<std::size_t>(i)];
            other_square +=
                squares[static_cast<std::size_t>(i + kFine)] - squares[static_cast<std::size_t>(i)];
        }
        if (j + 1 == kDown) break;
        add_row<kWide>(right.row(top_right + j) + x_right, -1, sums, squares);
        add_row<kWide>(right.row(top_right + j + kFine) + x_right, 1, sums, squares);
    }
    if (best < kLeastFine * kLeastFine || best_i == 0 || best_i == kAcross - 1) return;
    feature.mean_left = sum / static_cast<double>(kFinePixels);
    feature.mean_right = 0.0;
    for (int n = 0; n < kFine; ++n)
        for (int i = 0; i < kFine; ++i)
            feature.mean_right += window[static_cast<std::size_t>((best_i + i) * kHigh + best_j + n)];
    feature.mean_right /= kFinePixels;
    if (best_j == 0 || best_j == kDown - 1) {
        // So far off that it may be more: the outermost row stands for it.
        feature.placed = true;
        feature.row_px = shift + best_j - kRows;
        return;
    }
    const auto score = [&](int i, int j) {
        return std::sqrt(std::max(
            0.0, scores[static_cast<std::size_t>(best_j + j)][static_cast<std::size_t>(best_i + i)]));
    };
    const double gu = 0.5 * (score(1, 0) - score(-1, 0));
    const double gv = 0.5 * (score(0, 1) - score(0, -1));
    const double uu = score(1, 0) + score(-1, 0) - 2.0 * score(0, 0);
    const double vv = score(0, 1) + score(0, -1) - 2.0 * score(0, 0);
    const double uv = 0.25 * (score(1, 1) + score(-1, -1) - score(1, -1) - score(-1, 1));
    const double determinant = uu * vv - uv * uv;
    if (!(uu < -kLeastCurve) || !(vv < -kLeastCurve) || !(determinant > kLeastApart * uu * vv)) return;
    const double dv = -(uu * gv - uv * gu) / determinant;
    if (!(std::abs(dv) <= 1.0)) return;
    feature.placed = true;
    feature.exact = true;
    feature.row_px = shift + best_j - kRows + dv;

    // Steps along the row and across it, at the whole pixel.
    std::int64_t left_left = 0;
    std::int64_t right_right = 0;
    std::int64_t left_right = 0;
    for (int n = 0; n < kFine; ++n) {
        const std::uint8_t* a = left.row(top + n) + x_left;
        const std::uint8_t* b = right.row(top_right + best_j + n) + x_right + best_i;
        for (int i = 0; i < kFine; ++i) {
            const int ax = a[i + 1] - a[i - 1];
            const int bx = b[i + 1] - b[i - 1];
            const int ay = a[i + left.stride] - a[i - left.stride];
            const int by = b[i + right.stride] - b[i - right.stride];
            left_left += ax * ax + ay * ay;
            right_right += bx * bx + by * by;
            left_right += ax * bx + ay * by;
        }
    }
    feature.left_on_right =
        static_cast<double>(left_right) / static_cast<double>(std::max<std::int64_t>(right_right, 1));
    feature.right_on_left =
        static_cast<double>(left_right) / static_cast<double>(std::max<std::int64_t>(left_left, 1));
}

void PairMonitor::measure_band(ConstLuma left, ConstLuma right, int band, int shift) {
    const int width = width_ / scale_;
    const int high = kPatch * scale_;  // full px, as wide
    const int top = (2 * band + 1) * height_ / (2 * bands_) - high / 2;
    const auto cells = features_.subspan(static_cast<std::size_t>(band * kCells), kCells);
    std::fill(cells.begin(), cells.end(), Feature{});
    if (top + shift < 0 || top + shift + high > height_) return;
    Columns a;
    Columns b;
    a.take(left, top, scale_, width);
    b.take(right, top + shift, scale_, width);

    // Steps along the row, of each column and of the patch that begins there.
    std::array<std::int32_t, kShrunkWidth> steps{};
    for (int x = 1; x + 1 < width; ++x) {
        std::int32_t total = 0;
        for (int j = 0; j < kPatch; ++j)
            total += std::abs(a.at(x + 1)[j] - a.at(x - 1)[j]);
        steps[static_cast<std::size_t>(x)] = total;
    }
    const int places = width - kPatch + 1;
    std::array<double, kShrunkWidth> scores;
    for (int cell = 0; cell < kCells; ++cell) {
        Feature& feature = cells[static_cast<std::size_t>(cell)];
        const int first = cell * places / kCells;
        const int end = (cell + 1) * places / kCells;
        int chosen = -1;
        std::int32_t most = kLeastSteps - 1;
        std::int32_t here = 0;
        for (int x = first; x < first + kPatch - 1; ++x)
            here += steps[static_cast<std::size_t>(x)];
        for (int x = first; x < end; ++x) {
            here += steps[static_cast<std::size_t>(x + kPatch - 1)];
            if (here > most) {
                most = here;
                chosen = x;
            }
            here -= steps[static_cast<std::size_t>(x)];
        }
        if (chosen < 0) continue;
        feature.tried = true;
        const int x = chosen * scale_ + high / 2;
        const int y = top + high / 2;
        if (!is_free(excluded_left_, x, y, high / 2)) continue;

        const std::int32_t sum = a.sum[static_cast<std::size_t>(chosen)];
        const Correlation correlation(kPatchPixels, sum, a.square[static_cast<std::size_t>(chosen)]);
        const int low = std::max(0, chosen - reach_);
        const int last = std::min(places - 1, chosen + reach_);
        double best = 0.0;
        int best_at = -1;
        for (int place = low; place <= last; ++place) {
            const auto at = static_cast<std::size_t>(place);
            scores[at] =
                correlation.squared(dot(a.at(chosen), b.at(place), kPatchPixels), b.sum[at], b.square[at]);
            if (scores[at] > best) {
                best = scores[at];
                best_at = place;
            }
        }
        if (best < kLeastMatch * kLeastMatch || best_at <= low || best_at >= last) continue;
        double second = 0.0;
        for (int place = low; place <= last; ++place)
            if (place < best_at - 2 || place > best_at + 2)
                second = std::max(second, scores[static_cast<std::size_t>(place)]);
        if (1.0 - std::sqrt(second) < kUnique * (1.0 - std::sqrt(best)) + kLeastMargin) continue;
        const double refined = peak_of(scores[static_cast<std::size_t>(best_at - 1)], best,
                                       scores[static_cast<std::size_t>(best_at + 1)]);
        feature.disparity_px = (chosen - best_at - refined) * scale_;
        const int x_right = x - static_cast<int>(std::floor(feature.disparity_px + 0.5));
        if (!is_free(excluded_right_, x_right, y + shift, high / 2)) continue;
        feature.matched = true;
        place(left, right, x, y, shift, feature);
    }
}

double PairMonitor::median(std::size_t count) {
    const auto middle = sorted_.begin() + static_cast<std::ptrdiff_t>(count / 2);
    std::nth_element(sorted_.begin(), middle, sorted_.begin() + static_cast<std::ptrdiff_t>(count));
    return *middle;
}

// Median over pairs of features of different brightness of how many times their difference the left view has.
double PairMonitor::gain_of_features(double otherwise) {
    std::size_t placed = 0;
    for (std::size_t i = 0; i < features_.size(); ++i)
        if (features_[i].placed) placed_[placed++] = i;
    std::size_t count = 0;
    for (std::size_t i = 0; i < placed; ++i) {
        // A third of all features on: somewhere else in the picture.
        const Feature& one = features_[placed_[i]];
        const Feature& other = features_[placed_[(i + placed / 3) % placed]];
        const double in_right = one.mean_right - other.mean_right;
        if (std::abs(in_right) < kLeastSpread) continue;
        sorted_[count++] = (one.mean_left - other.mean_left) / in_right;
    }
    return count >= kLeastPairs ? median(count) : otherwise;
}

void PairMonitor::count(PairEvidence& evidence) const {
    int behind = 0;
    for (const Feature& feature : features_) {
        evidence.patches += feature.tried ? 1 : 0;
        if (!feature.matched) continue;
        ++evidence.matched;
        evidence.row_features += feature.placed ? 1 : 0;
        const double nearer_px = feature.disparity_px - infinity_px_;
        if (std::abs(nearer_px) < kNearInfinityPx) continue;
        ++evidence.features;
        behind += nearer_px < 0.0 ? 1 : 0;
    }
    if (evidence.features > 0) evidence.behind_share = static_cast<double>(behind) / evidence.features;
}

PairEvidence PairMonitor::measure(ConstLuma left, ConstLuma right, double gain, Parallel& parallel) {
    PairEvidence evidence;
    int rows = 0;
    const auto search = [&](int shift) {
        parallel.for_each(bands_, [&](int band, int) { measure_band(left, right, band, shift); });
        evidence = {};
        count(evidence);
        rows = shift;
    };
    search(0);
    // Shrunk patches bear to be off by about a row of theirs.
    const auto lost = [&] { return evidence.matched * kLostShare < evidence.patches; };
    if (lost()) {
        const PairEvidence level = evidence;
        search(-kShiftedRows);
        if (lost()) search(kShiftedRows);
        if (lost()) {
            evidence = level;
            return evidence;
        }
    }
    if (evidence.row_features == 0) return evidence;
    const auto median_over = [&](auto taken, auto value) {
        std::size_t count = 0;
        for (const Feature& feature : features_)
            if (feature.*taken) sorted_[count++] = value(feature);
        return count > 0 ? median(count) : 0.0;
    };
    const double middle = median_over(&Feature::placed, [](const Feature& f) { return f.row_px; });
    const double spread =
        median_over(&Feature::placed, [=](const Feature& f) { return std::abs(f.row_px - middle); });
    evidence.row_offset_px = middle;
    // Of a median: sqrt(pi / 2) times that of a mean; of the median deviation, 1.4826 is one sigma.
    evidence.row_sigma_px = 1.2533 * 1.4826 * spread / std::sqrt(static_cast<double>(evidence.row_features));
    // Two estimates of the gain, of which the one counts that explains more: brightness ranks mislead in
    // noise and darkness, features where they are few.
    const double gain_seen = gain_of_features(gain);
    evidence.left_sharper = median_over(&Feature::exact, [](const Feature& f) { return f.left_on_right; }) /
                            std::max(gain, gain_seen);
    evidence.right_sharper = median_over(&Feature::exact, [](const Feature& f) { return f.right_on_left; }) *
                             std::min(gain, gain_seen);
    return evidence;
}

}  // namespace groundline::rig
