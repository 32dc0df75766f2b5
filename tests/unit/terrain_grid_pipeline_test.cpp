// The terrain grid as a processor makes it from rendered pairs: on and off, trusted and blind, any lanes.
#include <gtest/gtest.h>

#include <algorithm>
#include <bit>
#include <vector>

#include "core/error.hpp"
#include "pipeline/processor.hpp"
#include "synth/renderer.hpp"
#include "unit/terrain_scene.hpp"

namespace groundline::pipeline {
namespace {

rig::StereoCalibration calibration_of(const RectifiedRig& rig) {
    rig::StereoCalibration calibration;
    calibration.rectified = true;
    for (rig::CameraModel* camera : {&calibration.left, &calibration.right}) {
        camera->width = rig.width;
        camera->height = rig.height;
        camera->fx = camera->fy = rig.focal_px;
        camera->cx = rig.cx_px;
        camera->cy = rig.cy_px;
    }
    calibration.translation_m = {-rig.baseline_m, 0.0, 0.0};
    return calibration;
}

struct OnePair {
    synth::Renderer renderer{synth::scene_by_name("synthetic:boxes?seed=3")};
    Arena arena;
    rig::Rectifier rectifier;
    Processor processor;
    FrameResult result;
    StereoFrame frame;

    OnePair(bool on, Parallel& parallel)
        : rectifier(calibration_of(rig()), rig().width, rig().height, arena),
          processor(config_of(on), rectifier, parallel, arena),
          result(processor.make_result(arena)),
          frame(StereoFrame::make(arena, rig().width, rig().height, false)) {
        renderer.render(0, parallel, frame.left, {}, frame.right);
    }
    const RectifiedRig& rig() const { return renderer.scene().rig; }
    static ProcessorConfig config_of(bool on) {
        ProcessorConfig config;
        config.matcher.disparities = 112;
        config.grid.on = on;
        return config;
    }
    int count(TerrainClass kind) const {
        return static_cast<int>(std::count_if(result.grid.cells.begin(), result.grid.cells.end(),
                                              [&](const GridCell& cell) { return cell.kind == kind; }));
    }
};

TEST(GridOfAPair, IsThereWhereAskedFor) {
    Serial serial;
    OnePair run(true, serial);
    run.processor.process(run.frame, run.result);
    ASSERT_EQ(run.result.verdict, Verdict::kTrusted);
    EXPECT_GT(run.count(TerrainClass::kTraversable), 1500);
    EXPECT_GT(run.count(TerrainClass::kObstacle), 20);
    const auto good = std::count_if(run.result.grid.cells.begin(), run.result.grid.cells.end(),
                                    [](const GridCell& cell) { return cell.index > 0.9F; });
    EXPECT_GT(good, run.count(TerrainClass::kTraversable) / 2) << "flat ground is easy";

    OnePair off(false, serial);
    off.processor.process(off.frame, off.result);
    EXPECT_TRUE(off.result.grid.cells.empty());
    EXPECT_LT(off.arena.bytes(), run.arena.bytes());
}

TEST(GridOfAPair, IsUnknownAllOverWhenBlind) {
    Serial serial;
    OnePair run(true, serial);
    run.processor.process(run.frame, run.result);
    ASSERT_GT(run.count(TerrainClass::kTraversable), 0);
    fill_pixels(run.frame.left, 0);
    fill_pixels(run.frame.right, 0);
    while (run.result.verdict != Verdict::kBlind) {
        run.frame.stamp.exposure_mono_ns += 1'000'000'000;
        ASSERT_LT(run.frame.stamp.exposure_mono_ns, 60'000'000'000) << "never blind in the dark";
        run.processor.process(run.frame, run.result);
        EXPECT_EQ(run.count(TerrainClass::kTraversable), 0);
    }
    EXPECT_EQ(run.count(TerrainClass::kUnknown), static_cast<int>(run.result.grid.cells.size()));
}

TEST(GridOfAPair, IsTheSameForAnyLanes) {
    Serial serial;
    test::Threads threads(3);
    OnePair one(true, serial);
    OnePair three(true, threads);
    one.processor.process(one.frame, one.result);
    three.processor.process(three.frame, three.result);
    const auto bits = [](const GridCell& cell) {
        std::vector<std::uint32_t> all{static_cast<std::uint32_t>(cell.kind),
                                       static_cast<std::uint32_t>(cell.points)};
        for (const float value :
             {cell.elevation_m, cell.highest_m, cell.slope_rad, cell.roughness_m, cell.step_m, cell.index})
            all.push_back(std::bit_cast<std::uint32_t>(value));
        return all;
    };
    for (std::size_t i = 0; i < one.result.grid.cells.size(); ++i)
        ASSERT_EQ(bits(one.result.grid.cells[i]), bits(three.result.grid.cells[i])) << i;
}

TEST(GridOfAPair, IsRefusedAtTheStartWhereItFitsNoMessage) {
    Serial serial;
    Arena arena;
    const synth::Scene scene = synth::scene_by_name("synthetic:boxes");
    const rig::Rectifier rectifier(calibration_of(scene.rig), scene.rig.width, scene.rig.height, arena);
    ProcessorConfig config = OnePair::config_of(true);
    config.grid.cell_m = 0.05;
    EXPECT_THROW(Processor(config, rectifier, serial, arena), Refusal);
    config.grid.on = false;
    EXPECT_NO_THROW(Processor(config, rectifier, serial, arena));
}

}  // namespace
}  // namespace groundline::pipeline
