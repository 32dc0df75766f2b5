#include "stereo/pyramid_kernels.hpp"

#include <algorithm>
#include <array>
#include <bit>
#include <cstring>

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "stereo/pyramid_kernels.cpp"
#include <hwy/foreach_target.h>  // NOLINT(misc-header-include-cycle): includes this file once per unit
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace groundline::stereo::kernels::HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

// Vectors of at most 32 bytes: a block and its margins are three of them.
using D = hn::CappedTag<std::uint8_t, 32>;
using V = hn::Vec<D>;
constexpr int kLanes = static_cast<int>(hn::MaxLanes(D()));
constexpr int kSpan = kBlock + 2 * kBlockMargin;
static_assert(kSpan % kLanes == 0 && kBlock % kLanes == 0 && kFineWindowReach <= kBlockMargin);

HWY_INLINE V Distance(V a, V b) {
    return hn::Or(hn::SaturatedSub(a, b), hn::SaturatedSub(b, a));
}
HWY_INLINE auto AtMost(V a, V b) {
    return hn::Eq(hn::Min(a, b), a);
}

// Differing bits of the words at columns x .. of one row, the right ones `shift` columns further left.
HWY_INLINE V Differences(const CensusPair& row, int x, std::ptrdiff_t shift) {
    static_assert(kNarrowPairs == 0xFF, "the low bytes");
    const D d;
    return hn::PopulationCount(hn::Xor(hn::LoadU(d, row.left + x), hn::LoadU(d, row.right + x - shift)));
}

// Sums down `kRows` rows for `count` rows, over columns `begin` .. `end` - 1 of a block and its margins; row
// r sums rows r .. r + kRows - 1.
template <int kRows>
HWY_INLINE void SumColumns(const CensusPair* rows, int count, int first_x, std::ptrdiff_t shift, int begin,
                           int end, std::uint8_t* differences, std::uint8_t* sums) {
    const D d;
    constexpr int kVectors = kSpan / kLanes;
    V sum[kVectors];
    HWY_UNROLL(8)
    for (V& each : sum)
        each = hn::Zero(d);
    const int first = begin / kLanes;
    const int last = end / kLanes;
    for (int r = 0; r < count + kRows - 1; ++r) {
        const CensusPair row = rows[r];
        HWY_UNROLL(8)
        for (int v = 0; v < kVectors; ++v) {
            if (v < first || v >= last) continue;
            const int i = v * kLanes;
            const V here = Differences(row, first_x - kBlockMargin + i, shift);
            hn::Store(here, d, differences + r * kSpan + i);
            sum[v] = hn::Add(sum[v], here);
            if (r < kRows - 1) continue;
            const int top = r - (kRows - 1);
            hn::Store(sum[v], d, sums + top * kSpan + i);
            sum[v] = hn::Sub(sum[v], hn::Load(d, differences + top * kSpan + i));
        }
    }
}

// Repeats the columns at the image's ends, where a block's margins lie outside; `reach` of them are read.
HWY_INLINE void RepeatEnds(int count, int first_x, int width, int reach, std::uint8_t* sums) {
    const int last = width - first_x + kBlockMargin;  // one behind the last column
    for (int r = 0; r < count; ++r) {
        std::uint8_t* const row = sums + r * kSpan;
        if (first_x == 0)
            for (int i = 1; i <= reach; ++i)
                row[kBlockMargin - i] = row[kBlockMargin];
        for (int i = 0; i < reach && last + i < kSpan; ++i)
            row[last + i] = row[last - 1];
    }
}

void ThinBlockAny(const ThinBlock& block) {
    const D d;
    alignas(64) std::uint8_t differences[(kMostThinRows + kThinRows) * kSpan];
    alignas(64) std::uint8_t sums[kMostThinRows * kSpan + 64];
    alignas(64) std::uint8_t predicted[kMostThinRows * kBlock];  // lowest cost where it was predicted
    alignas(64) std::uint8_t nearer[kMostThinRows * kBlock];     // lowest cost nearer than that
    std::memset(predicted, 255, sizeof predicted);
    std::memset(nearer, 255, sizeof nearer);
    const int used = std::min(kBlock, block.width - block.first_x);
    // Predicted in each row.
    std::array<int, kMostThinRows> farthest_of;
    std::array<int, kMostThinRows> nearest_of;
    int farthest = 255;
    for (int r = 0; r < block.count; ++r) {
        const std::uint8_t* const row = block.predicted + r * block.predicted_stride;
        const auto at = static_cast<std::size_t>(r);
        farthest_of[at] = *std::min_element(row, row + used);
        nearest_of[at] = *std::max_element(row, row + used);
        farthest = std::min(farthest, farthest_of[at]);
        std::memset(block.nearer + r * block.nearer_stride, 0, kBlock);
    }
    const V within = hn::Set(d, kThinPredictedWithin);
    const V apart = hn::Set(d, kThinNearer);
    for (int k = std::max(0, farthest - kThinPredictedWithin); k < block.disparities; ++k) {
        SumColumns<kThinRows>(block.rows, block.count, block.first_x, block.min_disparity + k, 0, kSpan,
                              differences, sums);
        RepeatEnds(block.count, block.first_x, block.width, 1, sums);
        const V index = hn::Set(d, static_cast<std::uint8_t>(k));
        for (int r = 0; r < block.count; ++r) {
            const std::uint8_t* const row = sums + r * kSpan + kBlockMargin;
            const std::uint8_t* const at_row = block.predicted + r * block.predicted_stride;
            const auto cost_at = [&](int i) HWY_ATTR {
                return hn::Add(hn::Add(hn::LoadU(d, row + i - 1), hn::LoadU(d, row + i)),
                               hn::LoadU(d, row + i + 1));
            };
            const int farthest_here = farthest_of[static_cast<std::size_t>(r)];
            const int nearest_here = nearest_of[static_cast<std::size_t>(r)];
            if (k >= farthest_here - kThinPredictedWithin && k <= nearest_here + kThinPredictedWithin)
                for (int i = 0; i < used; i += kLanes) {
                    const auto is_predicted = AtMost(Distance(index, hn::LoadU(d, at_row + i)), within);
                    std::uint8_t* const lowest = predicted + r * kBlock + i;
                    const V old = hn::Load(d, lowest);
                    hn::Store(hn::IfThenElse(is_predicted, hn::Min(old, cost_at(i)), old), d, lowest);
                }
            if (k >= farthest_here + kThinNearer)
                for (int i = 0; i < used; i += kLanes) {
                    const V cost = cost_at(i);
                    std::uint8_t* const lowest = nearer + r * kBlock + i;
                    std::uint8_t* const which = block.nearer + r * block.nearer_stride + i;
                    const V best = hn::Load(d, lowest);
                    const auto is_nearer = AtMost(apart, hn::SaturatedSub(index, hn::LoadU(d, at_row + i)));
                    const auto wins = hn::And(is_nearer, hn::Lt(cost, best));
                    hn::Store(hn::IfThenElse(wins, cost, best), d, lowest);
                    hn::StoreU(hn::IfThenElse(wins, index, hn::LoadU(d, which)), d, which);
                }
        }
    }
    for (int r = 0; r < block.count; ++r) {
        std::uint8_t* const which = block.nearer + r * block.nearer_stride;
        for (int i = 0; i < used; ++i) {
            const int cost = nearer[r * kBlock + i];
            const int match = block.first_x + i - block.min_disparity - which[i];
            const bool good = 2 * cost < predicted[r * kBlock + i] && cost <= kThinHighest && match >= 0 &&
                              match < block.width;
            which[i] = static_cast<std::uint8_t>(good ? which[i] : 0);
        }
    }
}

void PredictRowAny(const PredictRow& row, const Prediction& out) {
    const hn::Full128<std::int16_t> d;
    const hn::Full64<std::uint8_t> d8;
    const int lowest = kDisparityOne * row.min_disparity;
    const auto least = hn::Set(d, static_cast<std::int16_t>(lowest));
    const auto most = hn::Set(d, static_cast<std::int16_t>(lowest + kDisparityOne * (row.disparities - 1)));
    const auto half = hn::Set(d, kDisparityOne / 2);
    const auto low_byte = hn::Set(d, 255);
    const auto none = hn::Zero(d);
    const auto put = [&](auto q4, auto against, int x) HWY_ATTR {
        q4 = hn::Min(hn::Max(hn::SaturatedAdd(q4, q4), least), most);
        if (row.thin != nullptr) {
            const auto thin = hn::PromoteTo(d, hn::LoadU(d8, row.thin + x));
            const auto found = hn::Gt(thin, none);
            q4 = hn::IfThenElse(found, hn::Add(hn::ShiftLeft<4>(thin), least), q4);
            against = hn::IfThenZeroElse(found, against);
        }
        hn::StoreU(hn::DemoteTo(d8, hn::And(q4, low_byte)), d8, out.low + x);
        const auto index = hn::ShiftRight<4>(hn::Add(hn::Sub(q4, least), half));
        hn::StoreU(hn::DemoteTo(d8, index), d8, out.index + x);
        hn::StoreU(hn::DemoteTo(d8, against), d8, reinterpret_cast<std::uint8_t*>(out.against) + x);
    };
    for (int x = 0; x < row.width; x += 16) {
        const auto q4 = hn::LoadU(d, row.disparity_q4 + x / 2);
        const auto against =
            hn::PromoteTo(d, hn::LoadU(d8, reinterpret_cast<const std::uint8_t*>(row.invalid) + x / 2));
        put(hn::InterleaveLower(d, q4, q4), hn::InterleaveLower(d, against, against), x);
        put(hn::InterleaveUpper(d, q4, q4), hn::InterleaveUpper(d, against, against), x + 8);
    }
    const int blocks = (row.width + kBlock - 1) / kBlock * kBlock;
    const auto rest = static_cast<std::size_t>(blocks - row.width);
    std::memset(out.low + row.width, out.low[row.width - 1], rest);
    std::memset(out.index + row.width, out.index[row.width - 1], rest);
    std::memset(out.against + row.width, static_cast<int>(out.against[row.width - 1]), rest);
}

void VoteRowAny(int width, int disparities, const std::uint8_t* against, const CensusWinners& winners,
                std::uint16_t* keys, std::uint8_t* invalid) {
    const D d;
    for (int x = 0; x < width; x += kLanes) {
        const V known = hn::LoadU(d, invalid + x);
        hn::StoreU(hn::IfThenElse(hn::Eq(known, hn::Zero(d)), hn::LoadU(d, against + x), known), d,
                   invalid + x);
    }
    const hn::Half<D> d8;
    const hn::Rebind<std::uint16_t, hn::Half<D>> d16;
    for (int x = 0; x < width; x += kLanes / 2) {
        const auto silent = hn::Not(hn::VecFromMask(d8, hn::Eq(hn::LoadU(d8, against + x), hn::Zero(d8))));
        const auto best = hn::PromoteTo(d16, hn::Or(hn::LoadU(d8, winners.best + x), silent));
        const auto rank = hn::PromoteTo(d16, hn::Not(hn::LoadU(d8, winners.index + x)));
        hn::StoreU(hn::Or(hn::ShiftLeft<8>(best), rank), d16, keys + x);
    }
    std::uint16_t* const at_right = winners.at_right + disparities - 1;
    std::fill_n(winners.at_right, width + disparities - 1, std::uint16_t{0xFFFF});
    const std::uint8_t* const index = winners.index;
    HWY_UNROLL(4)
    for (std::ptrdiff_t x = 0; x < width; ++x) {
        std::uint16_t& there = at_right[x - index[x]];
        there = std::min(there, keys[x]);
    }
}

// Distance from the prediction in 1/16 px, from the low bytes of both; right where it is below 8 px.
HWY_INLINE V OffPrediction(V disparity_low, V predicted_low) {
    const D d;
    const hn::RebindToSigned<D> ds;
    return hn::BitCast(d, hn::Abs(hn::BitCast(ds, hn::Sub(disparity_low, predicted_low))));
}

// A set of disparity indices.
class IndexSet {
  public:
    void add(int index) {
        words_[static_cast<std::size_t>(index) / 64] |= std::uint64_t{1}
                                                        << (static_cast<unsigned>(index) % 64);
    }
    bool has(int index) const {
        if (index < 0 || index > 255) return false;
        return (words_[static_cast<std::size_t>(index) / 64] >> (static_cast<unsigned>(index) % 64) & 1U) !=
               0;
    }
    // With every index that is one away from a member.
    IndexSet widened() const {
        IndexSet wide = *this;
        for (std::size_t i = 0; i < words_.size(); ++i) {
            wide.words_[i] |= words_[i] << 1U | words_[i] >> 1U;
            if (i > 0) wide.words_[i] |= words_[i - 1] >> 63U;
            if (i + 1 < words_.size()) wide.words_[i] |= words_[i + 1] << 63U;
        }
        return wide;
    }
    void merge(const IndexSet& other) {
        for (std::size_t i = 0; i < words_.size(); ++i)
            words_[i] |= other.words_[i];
    }
    // The smallest member, 256 if there is none; the largest, -1 if there is none.
    int first() const {
        for (std::size_t i = 0; i < words_.size(); ++i)
            if (words_[i] != 0) return static_cast<int>(64 * i) + std::countr_zero(words_[i]);
        return 256;
    }
    int last() const {
        for (std::size_t i = words_.size(); i-- > 0;)
            if (words_[i] != 0) return static_cast<int>(64 * i) + 63 - std::countl_zero(words_[i]);
        return -1;
    }

  private:
    std::array<std::uint64_t, 4> words_{};
};

// The indices predicted for kGroup pixels of some rows; `judged`: by those that nothing speaks against.
constexpr int kGroup = 32;
static_assert(kGroup % kLanes == 0 && kBlock % kGroup == 0 && 2 * kBlockMargin % kLanes == 0);
template <std::size_t kRows>
IndexSet PredictedIndices(const std::array<Prediction, kRows>& rows, int first, bool judged) {
    const D d;
    V least = hn::Set(d, 255);
    V most = hn::Zero(d);
    for (const Prediction& row : rows)
        for (int x = first; x < first + kGroup; x += kLanes) {
            const V index = hn::LoadU(d, row.index + x);
            const V against = hn::LoadU(d, reinterpret_cast<const std::uint8_t*>(row.against) + x);
            const V out = hn::VecFromMask(d, hn::Ne(against, hn::Set(d, judged ? 0 : 255)));
            const V kept = judged ? hn::Not(out) : out;  // reasons never are 255
            least = hn::Min(least, hn::Or(index, hn::Not(kept)));
            most = hn::Max(most, hn::And(index, kept));
        }
    alignas(64) std::uint8_t lanes[2][kLanes];
    hn::Store(least, d, lanes[0]);
    hn::Store(most, d, lanes[1]);
    const int lowest = *std::min_element(lanes[0], lanes[0] + kLanes);
    const int highest = *std::max_element(lanes[1], lanes[1] + kLanes);
    IndexSet set;
    if (highest - lowest <= 2) {  // one surface, as mostly
        for (int index = lowest; index <= highest; ++index)
            set.add(index);
        return set;
    }
    for (const Prediction& row : rows)
        for (int x = first; x < first + kGroup; ++x)
            if (!judged || row.against[x] == Invalid::kNone) set.add(row.index[x]);
    return set;
}

void FineBlockAny(const FineBlock& block) {
    const D d;
    constexpr int kGroups = kBlock / kGroup;  // what a whole group has no use for is skipped
    constexpr int kWindow = 2 * kFineWindowReach + 1;
    // A candidate is within 1 px of an index predicted in its group; its neighbours, within 2 px, are needed
    // for the sub-pixel fit.
    static_assert(kFineReachQ4 < kDisparityOne + kDisparityOne / 2);
    std::array<IndexSet, kGroups> candidates;
    std::array<IndexSet, kGroups> needed;
    IndexSet all;
    for (int group = 0; group < kGroups; ++group) {
        const IndexSet predicted = PredictedIndices(block.predictions, group * kGroup, block.checks);
        candidates[static_cast<std::size_t>(group)] = predicted.widened();
        needed[static_cast<std::size_t>(group)] = predicted.widened().widened();
        all.merge(needed[static_cast<std::size_t>(group)]);
    }
    // The pixels of all groups that have index k in their set, as one range.
    struct Range {
        int begin;
        int end;
    };
    const auto range_of = [](const std::array<IndexSet, kGroups>& sets, int k) {
        Range range{kBlock, 0};
        for (int group = 0; group < kGroups; ++group) {
            if (!sets[static_cast<std::size_t>(group)].has(k)) continue;
            range.begin = std::min(range.begin, group * kGroup);
            range.end = (group + 1) * kGroup;
        }
        return range;
    };
    const int last = block.disparities - 1;

    alignas(64) std::uint8_t differences[(kFineRows + kWindow) * kSpan];
    alignas(64) std::uint8_t sums[kFineRows * kSpan + 64];
    alignas(64) std::uint8_t costs[3][kFineRows * kBlock];  // of index k at k % 3
    std::memset(costs, 255, sizeof costs);
    for (const CensusWinners& row : block.winners) {
        std::memset(row.best, 255, kBlock);
        std::memset(row.index, 0, kBlock);
    }
    const V reach = hn::Set(d, kFineReachQ4);
    const V near = hn::Set(d, 1);
    for (int k = all.first(); k <= std::min(last, all.last()) + 1; ++k) {
        std::uint8_t* const here = costs[k % 3];
        const Range wanted = range_of(needed, k);
        if (k <= last && wanted.begin < wanted.end) {
            SumColumns<kWindow>(block.rows.data(), kFineRows, block.first_x, block.min_disparity + k,
                                wanted.begin, wanted.end + 2 * kBlockMargin, differences, sums);
            RepeatEnds(kFineRows, block.first_x, block.width, kFineWindowReach, sums);
            const V disparity_low =
                hn::Set(d, static_cast<std::uint8_t>(kDisparityOne * (block.min_disparity + k)));
            for (int pair = 0; pair < kFineRows / 2; ++pair) {
                const std::uint8_t* const low = block.predictions[static_cast<std::size_t>(pair)].low;
                for (int i = wanted.begin; i < wanted.end; i += kLanes) {
                    const V off = OffPrediction(disparity_low, hn::LoadU(d, low + i));
                    for (int r = 2 * pair; r < 2 * pair + 2; ++r) {
                        const std::uint8_t* const sum = sums + r * kSpan + kBlockMargin + i;
                        const auto at = [&](int x) HWY_ATTR { return hn::LoadU(d, sum + x); };
                        const V centre = at(0);
                        const V outer = hn::AverageRound(hn::Add(at(-3), at(3)), hn::Add(at(-2), at(2)));
                        const V inner = hn::AverageRound(hn::Add(at(-1), at(1)), hn::Add(centre, centre));
                        hn::Store(hn::SaturatedAdd(hn::Add(outer, inner), off), d, here + r * kBlock + i);
                    }
                }
            }
        }
        // The candidates of index k - 1, now that both its neighbours are known.
        const int candidate = k - 1;
        const Range judged = range_of(candidates, candidate);
        if (judged.begin >= judged.end) continue;
        const std::uint8_t* const centre = costs[candidate % 3];
        const std::uint8_t* const below = costs[(candidate + 2) % 3];
        const V index = hn::Set(d, static_cast<std::uint8_t>(candidate));
        const V disparity_low =
            hn::Set(d, static_cast<std::uint8_t>(kDisparityOne * (block.min_disparity + candidate)));
        for (int pair = 0; pair < kFineRows / 2; ++pair) {
            const Prediction predicted = block.predictions[static_cast<std::size_t>(pair)];
            const CensusWinners outs[2] = {block.winners[static_cast<std::size_t>(2 * pair)],
                                           block.winners[static_cast<std::size_t>(2 * pair + 1)]};
            for (int i = judged.begin; i < judged.end; i += kLanes) {
                const V off = OffPrediction(disparity_low, hn::LoadU(d, predicted.low + i));
                const V apart = Distance(index, hn::LoadU(d, predicted.index + i));
                const auto is_near = hn::And(AtMost(apart, near), AtMost(off, reach));
                for (int j = 0; j < 2; ++j) {
                    const CensusWinners& out = outs[j];
                    const int at = (2 * pair + j) * kBlock + i;
                    const V cost = hn::Load(d, centre + at);
                    const V best = hn::LoadU(d, out.best + i);
                    const auto wins = hn::And(is_near, hn::Lt(cost, best));
                    const auto put = [&](std::uint8_t* row, V value) HWY_ATTR {
                        hn::StoreU(hn::IfThenElse(wins, value, hn::LoadU(d, row + i)), d, row + i);
                    };
                    hn::StoreU(hn::IfThenElse(wins, cost, best), d, out.best + i);
                    put(out.index, index);
                    put(out.lower, hn::Load(d, below + at));
                    put(out.upper, hn::Load(d, here + at));
                }
            }
        }
    }
}

}  // namespace groundline::stereo::kernels::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace groundline::stereo::kernels {

HWY_EXPORT(ThinBlockAny);
HWY_EXPORT(PredictRowAny);
HWY_EXPORT(FineBlockAny);
HWY_EXPORT(VoteRowAny);

void thin_block(const ThinBlock& block) {
    HWY_DYNAMIC_DISPATCH(ThinBlockAny)(block);
}
void predict_row(const PredictRow& row, const Prediction& out) {
    HWY_DYNAMIC_DISPATCH(PredictRowAny)(row, out);
}
void vote_row(int width, int disparities, const Invalid* against, const CensusWinners& winners,
              std::uint16_t* keys, Invalid* invalid) {
    HWY_DYNAMIC_DISPATCH(VoteRowAny)
    (width, disparities, reinterpret_cast<const std::uint8_t*>(against), winners, keys,
     reinterpret_cast<std::uint8_t*>(invalid));
}
void fine_block(const FineBlock& block) {
    HWY_DYNAMIC_DISPATCH(FineBlockAny)(block);
}

}  // namespace groundline::stereo::kernels
#endif
