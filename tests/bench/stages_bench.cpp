// Time of each stage but matching on a rendered scene; matchers: matchers_bench.cpp.
#include <benchmark/benchmark.h>

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
        stereo::MatcherConfig config;
        config.disparities = kDisparities;
        stereo::make_matcher(config, map.width(), map.height(), 1, arena)
            ->match(frame.left, frame.right, map, serial);
    }
};

Pair& pair() {
    static Pair instance;
    return instance;
}

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
        classifier.classify(given.map, found, terrain::GroundUse::kOwn, finder.surface(), mask,
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
