#include "stereo/speckle.hpp"

#include <algorithm>
#include <array>
#include <bit>
#include <cassert>
#include <cstddef>
#include <utility>

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "stereo/speckle.cpp"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace groundline::stereo::HWY_NAMESPACE {
namespace {

namespace hn = hwy::HWY_NAMESPACE;

using Patch = SpeckleScratch::Patch;
using Row = SpeckleScratch::Row;

constexpr int kWordBits = 64;

std::size_t word_of(int x) {
    return static_cast<std::size_t>(x) / kWordBits;
}

// Writes a bit for each pixel: valid; disparity like that of the right neighbour; like that of the pixel
// above.
void compare_neighbours(const std::int16_t* here, const std::int16_t* above, const Invalid* invalid,
                        int width, std::uint64_t* valid, std::uint64_t* like_right,
                        std::uint64_t* like_above) {
    const hn::CappedTag<std::int16_t, kRowPadding / sizeof(std::int16_t)> words;
    const hn::Rebind<std::uint8_t, decltype(words)> bytes;
    constexpr std::size_t kLanes = hn::MaxLanes(words);
    const auto unlike = hn::Set(words, std::int16_t{kDisparityOne + 1});
    const auto alike = [&](auto a, auto b) HWY_ATTR {
        return hn::Lt(hn::Max(hn::SaturatedSub(a, b), hn::SaturatedSub(b, a)), unlike);
    };
    const auto store = [&](auto mask, std::uint64_t* row, std::size_t x) HWY_ATTR {
        if constexpr (kLanes >= 8) {
            static_assert(std::endian::native == std::endian::little);
            hn::StoreMaskBits(words, mask, reinterpret_cast<std::uint8_t*>(row) + x / 8);
        } else {  // less than a byte at a time
            std::array<std::uint8_t, 8> bits;
            hn::StoreMaskBits(words, mask, bits.data());
            std::uint64_t& word = row[x / kWordBits];
            word = (x % kWordBits == 0 ? 0 : word) | std::uint64_t{bits[0]} << x % kWordBits;
        }
    };
    const auto* reasons = reinterpret_cast<const std::uint8_t*>(invalid);
    for (std::size_t x = 0; x < static_cast<std::size_t>(width); x += hn::Lanes(words)) {
        const auto disparity = hn::LoadU(words, here + x);
        const auto reason = hn::PromoteTo(words, hn::LoadU(bytes, reasons + x));
        store(hn::Eq(reason, hn::Zero(words)), valid, x);
        store(alike(disparity, hn::LoadU(words, here + x + 1)), like_right, x);
        store(alike(disparity, hn::LoadU(words, above + x)), like_above, x);
    }
    const int rest = width % kWordBits;
    if (rest != 0) valid[word_of(width)] &= ~std::uint64_t{0} >> (kWordBits - rest);
}

// Calls use(x) for each set bit of a word whose first bit is pixel x0.
template <typename Use>
HWY_INLINE void for_each_bit(std::uint64_t word, int x0, Use use) {
    for (; word != 0; word &= word - 1)
        use(x0 + std::countr_zero(word));
}

// The number of the run that pixel x lies in.
HWY_INLINE std::size_t run_of(const Row& row, int x) {
    const std::size_t word = word_of(x);
    const std::uint64_t up_to_x = ~std::uint64_t{0} >> (kWordBits - 1 - x % kWordBits);
    return static_cast<std::size_t>(row.rank[word] + std::popcount(row.first[word] & up_to_x) - 1);
}

HWY_INLINE Patch& at(std::span<Patch> patches, std::int32_t index) {
    return patches[static_cast<std::size_t>(index)];
}

HWY_INLINE std::int32_t root_of(std::span<Patch> patches, std::int32_t index) {
    for (;;) {
        std::int32_t& parent = at(patches, index).parent;
        if (parent == index) return index;
        parent = at(patches, parent).parent;  // halve the path
        index = parent;
    }
}

// Finds the runs of the row: `joined` and `first` from the comparisons, the last pixel of each run.
void find_runs(Row& row, SpeckleScratch& scratch) {
    std::uint64_t pairs_before = 0;  // valid and like its right neighbour
    for (std::size_t i = 0; i < row.valid.size(); ++i) {
        const std::uint64_t valid = row.valid[i];
        const std::uint64_t pairs = valid & scratch.like_right[i];
        row.joined[i] = valid & (pairs << 1U | pairs_before >> (kWordBits - 1));
        row.first[i] = valid & ~row.joined[i];
        pairs_before = pairs;
    }
    int begun = 0;
    int ended = 0;
    for (std::size_t i = 0; i < row.valid.size(); ++i) {
        const std::uint64_t joined_next = i + 1 < row.joined.size() ? row.joined[i + 1] : 0;
        const std::uint64_t goes_on = row.joined[i] >> 1U | joined_next << (kWordBits - 1);
        row.rank[i] = begun;
        begun += std::popcount(row.first[i]);
        for_each_bit(row.valid[i] & ~goes_on, static_cast<int>(i) * kWordBits,
                     [&](int x) HWY_ATTR { scratch.last[static_cast<std::size_t>(ended++)] = x; });
    }
    row.runs = begun;
}

HWY_INLINE SpeckleScratch::Run& run_at(SpeckleScratch& scratch, std::int32_t index) {
    return scratch.runs[static_cast<std::size_t>(index)];
}

HWY_INLINE void drop_list(Patch& patch, SpeckleScratch& scratch) {
    if (patch.head == SpeckleScratch::kNoList) return;
    run_at(scratch, patch.tail).next = scratch.unused_run;
    scratch.unused_run = patch.head;
    patch.head = SpeckleScratch::kNoList;
}

// Lists a run of a patch that has a list, or is new.
HWY_INLINE void list_run(Patch& patch, const SpeckleScratch::Run& run, SpeckleScratch& scratch) {
    const std::int32_t index = scratch.unused_run;
    if (index == SpeckleScratch::kNoList) return drop_list(patch, scratch);
    scratch.unused_run = run_at(scratch, index).next;
    run_at(scratch, index) = run;
    run_at(scratch, index).next = patch.head;
    if (patch.head == SpeckleScratch::kNoList) patch.tail = index;
    patch.head = index;
}

// Makes `other` part of `own`.
void unite(std::int32_t own_index, std::int32_t other_index, int smallest, SpeckleScratch& scratch) {
    Patch& own = at(scratch.patches, own_index);
    Patch& other = at(scratch.patches, other_index);
    other.parent = own_index;
    own.size += other.size;
    own.compared += other.compared;
    own.alike += other.alike;
    if (own.size >= smallest || own.head == SpeckleScratch::kNoList ||
        other.head == SpeckleScratch::kNoList) {
        drop_list(own, scratch);
        drop_list(other, scratch);
        return;
    }
    run_at(scratch, own.tail).next = other.head;
    own.tail = other.tail;
}

// Gives each run the patch of a run above that it touches and unites the others it touches with that.
void join_above(Row& row, const Row& above, int smallest, SpeckleScratch& scratch) {
    const auto patches = scratch.patches;
    std::fill_n(row.patch.begin(), row.runs, -1);
    std::uint64_t links_before = 0;
    for (std::size_t i = 0; i < row.valid.size(); ++i) {
        const std::uint64_t links = row.valid[i] & above.valid[i] & scratch.like_above[i];
        // A link says nothing new if the pixels to its left are linked too and belong to the same two runs.
        const std::uint64_t links_left = links << 1U | links_before >> (kWordBits - 1);
        links_before = links;
        const std::uint64_t news = links & ~(links_left & row.joined[i] & above.joined[i]);
        for_each_bit(news, static_cast<int>(i) * kWordBits, [&](int x) HWY_ATTR {
            std::int32_t other = root_of(patches, above.patch[run_of(above, x)]);
            std::int32_t& own = row.patch[run_of(row, x)];
            if (own < 0) {
                own = other;
                return;
            }
            own = root_of(patches, own);
            if (own == other) return;
            if (at(patches, own).size < at(patches, other).size) std::swap(own, other);
            unite(own, other, smallest, scratch);
        });
    }
}

HWY_INLINE bool alike(int a, int b) {
    return a - b <= kDisparityOne && b - a <= kDisparityOne;
}

// Marks the patch that pixel (x, y) belongs to where no list of its runs is at hand, run by run. The walk
// notes in the reasons where it entered a run and goes back there when it has seen the run's neighbours
// below, from left to right, and above, from right to left. So it needs no memory however large the patch,
// and meets each pixel a fixed number of times.
void erase_by_walk(const DisparityMap& map, int x, int y, Invalid reason) {
    constexpr auto kPassed = static_cast<Invalid>(128);     // in a run not yet done with; above every reason
    constexpr auto kFromAbove = static_cast<Invalid>(129);  // the same, and entered here
    constexpr auto kFromBelow = static_cast<Invalid>(130);
    constexpr auto kFromNowhere = static_cast<Invalid>(131);
    const int width = map.width();
    const int height = map.height();
    std::int16_t* disparity = map.disparity_q4.row(y);
    Invalid* invalid = map.invalid.row(y);
    const auto turn_to_row = [&](int to) HWY_ATTR {
        y = to;
        disparity = map.disparity_q4.row(y);
        invalid = map.invalid.row(y);
    };
    // Marks the run around x and leaves x at its left end.
    const auto enter = [&](Invalid from) HWY_ATTR {
        const auto joins = [&](int a, int b) HWY_ATTR {
            return invalid[b] == Invalid::kNone && alike(disparity[a], disparity[b]);
        };
        invalid[x] = from;
        for (int end = x; end + 1 < width && joins(end, end + 1); ++end)
            invalid[end + 1] = kPassed;
        for (; x > 0 && joins(x, x - 1); --x)
            invalid[x - 1] = kPassed;
    };
    const auto in_same_run = [&](int a, int b) HWY_ATTR {
        return invalid[b] >= kPassed && alike(disparity[a], disparity[b]);
    };
    // Steps along the run until x has a neighbour in row `to`; false at the run's end.
    const auto find_neighbour = [&](int to, int step, int end) HWY_ATTR {
        const bool inside = to >= 0 && to < height;
        const std::int16_t* other_disparity = map.disparity_q4.row(inside ? to : y);
        const Invalid* other_invalid = map.invalid.row(inside ? to : y);  // in row y none is left to find
        for (;; x += step) {
            if (other_invalid[x] == Invalid::kNone && alike(other_disparity[x], disparity[x])) return true;
            if (x == end || !in_same_run(x, x + step)) return false;
        }
    };
    enter(kFromNowhere);
    for (bool down = true;;) {
        if (down) {
            if (find_neighbour(y + 1, 1, width - 1)) {
                turn_to_row(y + 1);
                enter(kFromAbove);
                continue;
            }
            down = false;
        }
        if (find_neighbour(y - 1, -1, 0)) {
            turn_to_row(y - 1);
            enter(kFromBelow);
            down = true;
            continue;
        }
        Invalid from = kPassed;
        int entry = x;
        for (bool more = true; more; ++x) {
            more = x + 1 < width && in_same_run(x, x + 1);
            if (invalid[x] != kPassed) {
                from = invalid[x];
                entry = x;
            }
            invalid[x] = reason;
            disparity[x] = 0;
        }
        if (from == kFromNowhere) return;
        x = entry;
        down = from == kFromAbove;
        turn_to_row(down ? y - 1 : y + 1);
    }
}

void erase(Patch& patch, Invalid because, SpeckleScratch& scratch, const DisparityMap& map) {
    if (patch.head == SpeckleScratch::kNoList)
        return erase_by_walk(map, patch.seed % map.width(), patch.seed / map.width(), because);
    std::int32_t left = patch.size;
    for (std::int32_t index = patch.head; left > 0; index = run_at(scratch, index).next) {
        const SpeckleScratch::Run& run = run_at(scratch, index);
        std::int16_t* const disparity = map.disparity_q4.row(run.y);
        Invalid* const invalid = map.invalid.row(run.y);
        for (int x = run.first; x <= run.last; ++x) {
            disparity[x] = 0;
            invalid[x] = because;
        }
        left -= run.last - run.first + 1;
    }
    drop_list(patch, scratch);
}

// The views in one row and kComparedRows above and below it.
struct PairRows {
    std::array<const std::uint8_t*, 3> left{};
    std::array<const std::uint8_t*, 3> right{};
    int width = 0;
    bool inside = false;

    PairRows(ConstLuma left_view, ConstLuma right_view, int y)
        : width(left_view.width), inside(y >= kComparedRows && y + kComparedRows < left_view.height) {
        if (!inside) return;
        left = {left_view.row(y - kComparedRows), left_view.row(y), left_view.row(y + kComparedRows)};
        right = {right_view.row(y - kComparedRows), right_view.row(y), right_view.row(y + kComparedRows)};
    }
};

// Compares the views around the pixels x .. last of a run and adds what was found to its patch.
void compare_views(const PairRows& rows, const std::int16_t* disparity_q4, int x, int last, Patch& patch) {
    if (!rows.inside) return;
    const auto within = [&](int column) HWY_ATTR {
        return column >= kComparedReach && column + kComparedReach < rows.width;
    };
    const auto alike = [](const std::uint8_t* left, const std::uint8_t* right, int apart) HWY_ATTR {
        const auto order = [apart](const std::uint8_t* pixel) HWY_ATTR {
            return (pixel[apart] > pixel[-apart] ? 1 : 0) - (pixel[apart] < pixel[-apart] ? 1 : 0);
        };
        return order(left) == order(right) ? 1 : 0;
    };
    for (; x <= last; ++x) {
        const int match = x - whole_px(disparity_q4[x]);
        if (!within(x) || !within(match)) continue;
        patch.compared += 4;
        patch.alike += alike(rows.left[1] + x, rows.right[1] + match, 2) +
                       alike(rows.left[1] + x, rows.right[1] + match, 4) +
                       alike(rows.left[0] + x, rows.right[0] + match, 3) +
                       alike(rows.left[2] + x, rows.right[2] + match, 3);
    }
}

// Ends what runs of this row belonged to before it was found to go no further than row `y` - 1, or to be part
// of another patch.
int end_patches(const Row& row, int y, const PatchLimits& limits, int unused, SpeckleScratch& scratch,
                const DisparityMap& map) {
    for (int run = 0; run < row.runs; ++run) {
        const std::int32_t index = row.patch[static_cast<std::size_t>(run)];
        Patch& patch = at(scratch.patches, index);
        if (patch.parent == index) {
            if (patch.last_row == y) continue;  // goes on, or ended by an earlier run
            if (patch.size < limits.smallest)
                erase(patch, Invalid::kSpeckle, scratch, map);
            else if (patch.size < kLargestJudged && 100 * patch.alike < limits.alike_percent * patch.compared)
                erase(patch, Invalid::kCost, scratch, map);
        }
        patch.parent = index;
        patch.last_row = y;
        scratch.unused[static_cast<std::size_t>(unused++)] = index;
    }
    return unused;
}

void remove_speckles(const DisparityMap& map, ConstLuma left, ConstLuma right, const PatchLimits& limits,
                     SpeckleScratch& scratch) {
    const int width = map.width();
    const int height = map.height();
    Row* row = &scratch.rows[0];
    Row* above = &scratch.rows[1];
    std::fill(above->valid.begin(), above->valid.end(), 0);
    above->runs = 0;
    // Runs of two rows at most have patches: there are always enough.
    int unused = static_cast<int>(scratch.unused.size());
    for (int i = 0; i < unused; ++i)
        scratch.unused[static_cast<std::size_t>(i)] = i;
    for (std::size_t i = 0; i < scratch.runs.size(); ++i)
        scratch.runs[i].next = static_cast<std::int32_t>(i) - 1;
    scratch.unused_run = static_cast<std::int32_t>(scratch.runs.size()) - 1;
    for (int y = 0; y < height; ++y) {
        compare_neighbours(map.disparity_q4.row(y), map.disparity_q4.row(std::max(y - 1, 0)),
                           map.invalid.row(y), width, row->valid.data(), scratch.like_right.data(),
                           scratch.like_above.data());
        find_runs(*row, scratch);
        join_above(*row, *above, limits.smallest, scratch);
        const PairRows pair(left, right, y);
        std::size_t next = 0;
        for (std::size_t i = 0; i < row->first.size(); ++i)
            for_each_bit(row->first[i], static_cast<int>(i) * kWordBits, [&](int x) HWY_ATTR {
                const int last = scratch.last[next];
                std::int32_t& index = row->patch[next++];
                const bool is_new = index < 0;
                index = is_new ? scratch.unused[static_cast<std::size_t>(--unused)]
                               : root_of(scratch.patches, index);
                Patch& patch = at(scratch.patches, index);
                if (is_new) patch = {index, 0, 0, 0, y * width + x, y, SpeckleScratch::kNoList, 0};
                const bool listed = is_new || patch.head != SpeckleScratch::kNoList;
                if (limits.alike_percent > 0 && patch.size < kLargestJudged)
                    compare_views(pair, map.disparity_q4.row(y), x, last, patch);
                patch.size += last - x + 1;
                patch.last_row = y;
                if (patch.size >= limits.smallest)
                    drop_list(patch, scratch);
                else if (listed)
                    list_run(patch, {0, y, x, last}, scratch);
            });
        unused = end_patches(*above, y, limits, unused, scratch, map);
        std::swap(row, above);
    }
    end_patches(*above, height, limits, unused, scratch, map);
}

}  // namespace
}  // namespace groundline::stereo::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace groundline::stereo {

HWY_EXPORT(remove_speckles);

SpeckleScratch::SpeckleScratch(int width, Arena& arena) {
    const auto columns = static_cast<std::size_t>(width);
    const std::size_t words = (columns + 63) / 64;
    for (Row& row : rows) {
        for (auto* bits : {&row.valid, &row.joined, &row.first})
            *bits = arena.take<std::uint64_t>(words);
        row.rank = arena.take<std::int32_t>(words);
        row.patch = arena.take<std::int32_t>(columns);
    }
    like_right = arena.take<std::uint64_t>(words);
    like_above = arena.take<std::uint64_t>(words);
    last = arena.take<std::int32_t>(columns);
    patches = arena.take<Patch>(2 * columns);
    unused = arena.take<std::int32_t>(2 * columns);
    // Three times what the rendered drive needs with either matcher. Having too few costs time, nothing else.
    runs = arena.take<Run>(2 * columns);
}

void remove_speckles(const DisparityMap& map, ConstLuma left, ConstLuma right, const PatchLimits& limits,
                     SpeckleScratch& scratch) {
    assert(static_cast<std::size_t>(map.width()) == scratch.last.size());
    assert(left.same_size(map.width(), map.height()) && right.same_size(map.width(), map.height()));
    HWY_DYNAMIC_DISPATCH(remove_speckles)(map, left, right, limits, scratch);
}

}  // namespace groundline::stereo
#endif
