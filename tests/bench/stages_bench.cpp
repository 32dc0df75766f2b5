// Time of each stage on a rendered scene, beside OpenCV's block matcher in the same run: quote the ratios.
#include <benchmark/benchmark.h>

#include <opencv2/calib3d.hpp>
#include <opencv2/core.hpp>

#include "core/arena.hpp"
#include "core/parallel.hpp"
#include "stereo/matcher.hpp"
#include "synth/renderer.hpp"
#include "terrain/classifier.hpp"
#include "terrain/ground_finder.hpp"
#include "terrain/sectors.hpp"
#include "terrain/v_disparity.hpp"

namespace groundline {
namespace {

constexpr int kDisparities = 64;

// One 640x480 pair of the demo drive, rendered once.
struct Pair {
    Arena arena;
    Serial serial;
    synth::Scene scene = synth::scene_by_name("drive");
    StereoFrame frame = StereoFrame::make(arena, scene.rig.width, scene.rig.height, true);
    DisparityMap map = DisparityMap::make(arena, scene.rig.width, scene.rig.height);

    Pair() {
        synth::Renderer renderer(scene);
        renderer.render(0, serial, frame.left, frame.left_bgr, frame.right);
        match(true);
    }
    void match(bool checks) {
        stereo::MatcherConfig config;
        config.disparities = kDisparities;
        config.checks = checks;
        stereo::make_matcher(config, map.width(), map.height(), 1, arena)
            ->match(frame.left, frame.right, map, serial);
    }
};

Pair& pair() {
    static Pair instance;
    return instance;
}

cv::Mat mat(Luma image) {
    return {image.height, image.width, CV_8UC1, image.data, static_cast<std::size_t>(image.stride)};
}

void paper(benchmark::State& state, bool normalise, bool checks) {
    Pair& given = pair();
    Arena arena;
    stereo::MatcherConfig config;
    config.disparities = kDisparities;
    config.normalise_local_mean = normalise;
    config.checks = checks;
    const auto matcher = stereo::make_matcher(config, given.map.width(), given.map.height(), 1, arena);
    const DisparityMap map = DisparityMap::make(arena, given.map.width(), given.map.height());
    for (auto _ : state)
        matcher->match(given.frame.left, given.frame.right, map, given.serial);
    state.counters["state_kB"] = static_cast<double>(matcher->state_bytes()) * 1e-3;
}
BENCHMARK_CAPTURE(paper, pure, false, false)->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(paper, checked, false, true)->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(paper, local_mean_checked, true, true)->Unit(benchmark::kMillisecond);

void opencv_block_matcher_15(benchmark::State& state) {
    Pair& given = pair();
    cv::setNumThreads(1);
    const cv::Ptr<cv::StereoBM> matcher = cv::StereoBM::create(kDisparities, 15);
    matcher->setUniquenessRatio(10);
    matcher->setSpeckleWindowSize(100);
    matcher->setSpeckleRange(1);
    matcher->setDisp12MaxDiff(1);
    cv::Mat disparity;
    for (auto _ : state)
        matcher->compute(mat(given.frame.left), mat(given.frame.right), disparity);
}
BENCHMARK(opencv_block_matcher_15)->Unit(benchmark::kMillisecond);

void ground(benchmark::State& state) {
    Pair& given = pair();
    Arena arena;
    terrain::GroundFinder finder({}, given.scene.rig, 0, kDisparities, arena);
    VDisparity v_disparity = terrain::make_v_disparity(arena, given.map.height(), 0, kDisparities);
    GroundEvidence evidence;
    Ground found;
    for (auto _ : state)
        finder.find(given.map, v_disparity, given.serial, nullptr, evidence, found);
}
BENCHMARK(ground)->Unit(benchmark::kMillisecond);

void classes_and_sectors(benchmark::State& state) {
    Pair& given = pair();
    Arena arena;
    terrain::GroundFinder finder({}, given.scene.rig, 0, kDisparities, arena);
    terrain::Classifier classifier({}, given.scene.rig, 0, kDisparities, arena);
    terrain::SectorFinder sector_finder({}, given.scene.rig, 0, kDisparities, arena);
    VDisparity v_disparity = terrain::make_v_disparity(arena, given.map.height(), 0, kDisparities);
    const Mask mask = arena.image<TerrainClass>(given.map.width(), given.map.height());
    GroundEvidence evidence;
    Ground found;
    finder.find(given.map, v_disparity, given.serial, nullptr, evidence, found);
    FixedVector<Obstacle, kMaxObstacles> obstacles;
    FixedVector<Sector, kMaxSectors> sectors;
    double range_limit_m = 0.0;
    for (auto _ : state) {
        classifier.classify(given.map, found, terrain::GroundUse::kOwn, finder.supported_rows(), mask,
                            obstacles, range_limit_m, given.serial);
        sector_finder.find(given.map, found, mask, sectors);
    }
}
BENCHMARK(classes_and_sectors)->Unit(benchmark::kMillisecond);

void render(benchmark::State& state) {
    Pair& given = pair();
    synth::Renderer renderer(given.scene);
    for (auto _ : state)
        renderer.render(0, given.serial, given.frame.left, given.frame.left_bgr, given.frame.right);
}
BENCHMARK(render)->Unit(benchmark::kMillisecond);

}  // namespace
}  // namespace groundline

BENCHMARK_MAIN();
