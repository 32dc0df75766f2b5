// The vector kernels equal their plain statements on every unit this machine has.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <vector>

#include "support/vector_units.hpp"
#include "terrain/classify_kernels.hpp"
#include "terrain/plane_kernels.hpp"
#include "terrain_scene.hpp"

namespace groundline::terrain::kernels {
namespace {

using test::Dice;

TEST(ClassifyKernel, EqualsItsPlainStatementOnEveryUnit) {
    constexpr int kSize = 16 * 64 + 1;
    Dice dice(17);
    std::vector<Limit> table(2 * kSize);
    std::vector<std::int16_t> disparity(kClassColumns + 16);
    std::vector<Invalid> invalid(kClassColumns + 16);
    std::vector<std::int32_t> certified(kClassColumns + 16);
    std::vector<int> seen(4, 0);
    std::vector<int> seen_even(4, 0);
    on_every_vector_unit([&] {
        for (int trial = 0; trial < 300; ++trial) {
            ClassRow row{};
            row.first_q4 = 16 * static_cast<int>(dice.bits() % 32) - 16;
            row.ground_q20 = static_cast<std::int32_t>(dice.between(-4.0, 40.0) * 16 * 65536);
            row.ground_step_q20 = static_cast<std::int32_t>(dice.between(-0.2, 0.2) * 16 * 65536);
            row.last_q20 = static_cast<std::int32_t>(dice.between(0.0, 40.0) * 16 * 65536);
            row.count = trial % 3 == 0 ? kClassColumns : 1 + static_cast<int>(dice.bits() % kClassColumns);
            for (Limit& limit : table) {
                limit.up_q20 = static_cast<std::int32_t>(dice.between(-4.0, 40.0) * 16 * 65536);
                limit.down_q20 =
                    limit.up_q20 + static_cast<std::int32_t>(dice.between(0.0, 20.0) * 16 * 65536);
            }
            for (std::size_t u = 0; u < disparity.size(); ++u) {
                disparity[u] =
                    static_cast<std::int16_t>(row.first_q4 - 40 + static_cast<int>(dice.bits() % 1200));
                const std::uint32_t roll = dice.bits() % 4;
                invalid[u] = roll == 0   ? Invalid::kRangeEdge
                             : roll == 1 ? static_cast<Invalid>(dice.bits() % 9)
                                         : Invalid::kNone;
                certified[u] = row.first_q4 + static_cast<int>(dice.bits() % 300);
            }
            row.disparity_q4 = disparity.data();
            row.invalid = invalid.data();
            row.certified_q4 = certified.data();
            const ClassLimits limits{table.data(), kSize};
            std::vector<TerrainClass> plain(kClassColumns + 16);
            std::vector<TerrainClass> fast(kClassColumns + 16);
            classify_columns_plain(row, limits, plain.data());
            classify_columns(row, limits, fast.data());
            EvenLimits even{};
            even.up_q16 = static_cast<std::int32_t>(dice.between(-0.5, 0.3) * 65536);
            even.down_q16 = static_cast<std::int32_t>(dice.between(0.3, 2.0) * 65536);
            even.offset_q20 =
                trial % 2 == 0 ? 0 : static_cast<std::int32_t>(dice.between(-3.0, 3.0) * 1048576);
            even.up_off_q20 = even.offset_q20 / 2;
            even.down_off_q20 = even.offset_q20 * 2;
            even.uncertain_q20 = static_cast<std::int32_t>(dice.between(0.0, 2.0) * 1048576);
            even.level = trial % 5 != 0;
            std::vector<TerrainClass> plain_even(kClassColumns + 16);
            std::vector<TerrainClass> fast_even(kClassColumns + 16);
            classify_columns_plain(row, even, plain_even.data());
            classify_columns(row, even, fast_even.data());
            for (int u = 0; u < row.count; ++u) {
                const auto at = static_cast<std::size_t>(u);
                ASSERT_EQ(fast_even[at], plain_even[at]) << "trial " << trial << " column " << u;
                ++seen_even[static_cast<std::size_t>(plain_even[at])];
                ASSERT_EQ(fast[at], plain[at]) << "trial " << trial << " column " << u;
                ++seen[static_cast<std::size_t>(plain[at])];
            }
        }
    });
    for (const auto& counts : {seen, seen_even})
        for (const int count : counts)
            EXPECT_GT(count, 1000);  // the trials reach every class
}

// The statement: eight partial sums of floats, each operation rounded by itself.
PlaneMoments plain_moments(const Samples& samples, const PlaneWeights& plane) {
    float partial[9][kSampleLanes] = {};
    for (std::size_t i = 0; i < samples.count; ++i) {
        const float u = samples.u[i];
        const float v = samples.v[i];
        const float expected = plane.du * u + plane.dv * v + plane.d0;
        const float ground = expected - plane.offset_px;
        const float residual = samples.d_px[i] - expected;
        const float t = residual / reach_px(plane.tolerance_px, ground);
        const float inside = std::max(0.0F, 1.0F - t * t);
        const float w = ground >= 1.0F ? inside * inside : 0.0F;
        const float terms[9] = {w,
                                w * u,
                                w * v,
                                w * u * u,
                                w * u * v,
                                w * v * v,
                                w * residual,
                                w * residual * u,
                                w * residual * v};
        for (int k = 0; k < 9; ++k)
            partial[k][i % kSampleLanes] += terms[k];
    }
    PlaneMoments moments{};
    for (std::size_t k = 0; k < 9; ++k)
        for (const float each : partial[k])
            moments[k] += static_cast<double>(each);
    return moments;
}

TEST(PlaneKernels, GiveTheSameBitsOnEveryUnit) {
    constexpr std::size_t kCount = 2048;
    Dice dice(23);
    std::vector<float> u(kCount), v(kCount), d(kCount);
    on_every_vector_unit([&] {
        for (int trial = 0; trial < 40; ++trial) {
            const PlaneWeights plane{
                static_cast<float>(dice.between(-0.02, 0.02)), static_cast<float>(dice.between(0.02, 0.3)),
                static_cast<float>(dice.between(5.0, 30.0)), trial % 4 == 0 ? 3.5F : 0.0F,
                static_cast<float>(dice.between(1.0, 5.0))};
            const PlaneWeights other{plane.du, plane.dv, plane.d0 + 3.0F, plane.offset_px, 1.5F};
            std::size_t beneath = 0;
            double own = 0.0;
            for (std::size_t i = 0; i < kCount; ++i) {
                u[i] = std::floor(static_cast<float>(dice.between(-320.0, 320.0)));
                v[i] = std::floor(static_cast<float>(dice.between(-240.0, 240.0)));
                const float expected = plane.du * u[i] + plane.dv * v[i] + plane.d0;
                d[i] = i % 50 == 0 ? kNoSample : expected + static_cast<float>(3.0 * dice.normal());
                const float ground = expected - plane.offset_px;
                beneath += i % 50 != 0 && d[i] - expected < -1.5F && ground >= 8.0F ? 1 : 0;
            }
            const Samples samples{u.data(), v.data(), d.data(), kCount};
            const PlaneMoments fast = plane_moments(samples, plane);
            const PlaneMoments plain = plain_moments(samples, plane);
            EXPECT_GT(plain[0], 10.0);
            for (std::size_t k = 0; k < fast.size(); ++k)
                ASSERT_EQ(fast[k], plain[k]) << "sum " << k;
            ASSERT_EQ(count_beneath(samples, plane, 1.5F, 8.0F), static_cast<double>(beneath));
            for (std::size_t i = 0; i < kCount; ++i) {
                const Samples one{&u[i], &v[i], &d[i], 1};
                if (plain_moments(one, other)[0] == 0.0) own += plain_moments(one, plane)[0];
            }
            ASSERT_NEAR(own_moment(samples, plane, other), own, 1e-3 * (1.0 + own));
        }
    });
}

}  // namespace
}  // namespace groundline::terrain::kernels
