// Time of every stage but matching on a rendered scene, the terrain stage part by part, beside OpenCV's SGBM
// 3-way on the same pair in the same run. Matchers: matchers_bench.cpp.
#include <benchmark/benchmark.h>
#include <fmt/format.h>

#include <functional>
#include <map>
#include <memory>
#include <opencv2/core/utility.hpp>
#include <string>
#include <vector>

#include "cli/compared_matchers.hpp"
#include "core/arena.hpp"
#include "core/parallel.hpp"
#include "rig/pair_monitor.hpp"
#include "rig/photometric.hpp"
#include "stereo/matcher.hpp"
#include "synth/renderer.hpp"
#include "terrain/classifier.hpp"
#include "terrain/elevation_grid.hpp"
#include "terrain/ground_finder.hpp"
#include "terrain/sectors.hpp"
#include "terrain/shares.hpp"
#include "terrain/v_disparity.hpp"

namespace groundline {
namespace {

constexpr int kDisparities = 64;
constexpr const char* kYardstick = "OpenCV SGBM 3-way";

// One 640x480 pair, matched and its ground found once.
struct Pair {
    Arena arena;
    Serial serial;
    synth::Scene scene;
    StereoFrame frame;
    DisparityMap map;
    VDisparity v_disparity;
    GroundEvidence evidence;
    Ground ground;
    Mask mask;
    FixedVector<Obstacle, kMaxObstacles> obstacles;
    FixedVector<Sector, kMaxSectors> sectors;
    TerrainGrid grid;
    std::array<double, kTerrainClasses> share{};
    double range_limit_m = 0.0;
    terrain::TerrainConfig config;
    terrain::GroundFinder finder;
    terrain::Classifier classifier;
    terrain::SectorFinder sector_finder;
    terrain::ElevationGrid grid_finder;
    rig::PairMonitor monitor;

    explicit Pair(const std::string& spec)
        : scene(synth::scene_by_name(spec)),
          frame(StereoFrame::make(arena, scene.rig.width, scene.rig.height, true)),
          map(DisparityMap::make(arena, scene.rig.width, scene.rig.height)),
          v_disparity(terrain::make_v_disparity(arena, map.height(), 0, kDisparities)),
          mask(arena.image<TerrainClass>(map.width(), map.height())),
          grid(terrain::make_terrain_grid(terrain::GridConfig{true}, arena)),
          finder(config, scene.rig, 0, kDisparities, arena),
          classifier(config, scene.rig, 0, kDisparities, arena),
          sector_finder(config, scene.rig, 0, kDisparities, arena),
          grid_finder(terrain::GridConfig{true}, config, scene.rig, 0, kDisparities, arena),
          monitor(scene.rig, 0, kDisparities, {}, {}, arena) {
        synth::Renderer(scene).render(0, serial, frame.left, frame.left_bgr, frame.right);
        stereo::MatcherConfig matcher;
        matcher.disparities = kDisparities;
        stereo::make_matcher(matcher, map.width(), map.height(), 1, arena)
            ->match(frame.left, frame.right, map, serial);
        find_ground();
        classify();
    }
    void find_ground() { finder.find(map, v_disparity, serial, nullptr, evidence, ground); }
    void classify() {
        classifier.classify(map, ground, terrain::GroundUse::kOwn, finder.surface(), mask, obstacles,
                            range_limit_m, serial);
    }
    void find_sectors() { sector_finder.find(map, ground, mask, range_limit_m, sectors); }
};

// What each part takes, in the order of a frame; the totals hold their parts and what lies between them.
class Stages {
  public:
    explicit Stages(Pair& pair) : pair_(pair) {
        fit_.take(arena_, pair.map.width(), pair.map.height());
        surface_.take(arena_, pair.map.width(), pair.map.height(), 0, kDisparities);
        fit_.sample(pair.map, 0.0);
        sgbm_ = cli::choose_matchers({"sgbm_3way/filtered"})
                    .front()
                    .make({pair.map.width(), pair.map.height(), 0, kDisparities}, pair.serial);
        add(kYardstick, [this] { sgbm_->match(pair_.frame.left, pair_.frame.right); });
        add("brightness of the two views",
            [this] { rig::measure_photometric(pair_.frame.left, pair_.frame.right, pair_.serial); });
        add("pair monitor",
            [this] { pair_.monitor.measure(pair_.frame.left, pair_.frame.right, 1.0, pair_.serial); });
        add("terrain: ground, in all", [this] { pair_.find_ground(); });
        add("  v-disparity",
            [this] { terrain::build_v_disparity(pair_.map, pair_.v_disparity, pair_.serial); });
        add("  samples for the plane", [this] { fit_.sample(pair_.map, 0.0); });
        add("  15 rough planes", [this] {
            for (int i = 0; i < 15; ++i)
                fit_.approach(pair_.ground.plane);
        });
        add("  a plane followed", [this] { fit_.converge(pair_.ground.plane); });
        add("  the plane's last fit", [this] { fit_.fit(pair_.ground.plane, pair_.serial); });
        add("  the ground's shape", [this] {
            surface_.find(pair_.map, pair_.ground.plane, 0.0, pair_.scene.rig.focal_px,
                          pair_.config.tolerance_up_m / pair_.ground.pose.height_m, pair_.serial);
            surface_.settle(pair_.ground.plane.dv);
        });
        add("terrain: classes and obstacles, in all", [this] { pair_.classify(); });
        add("terrain: shares", [this] { terrain::shares_of(pair_.mask, pair_.share); });
        add("terrain: sectors", [this] { pair_.find_sectors(); });
        add("graded ground (off by default)",
            [this] { pair_.grid_finder.find(pair_.map, pair_.ground, pair_.mask, pair_.grid); });
    }

    void print(const std::map<std::string, double>& median_ms) const {
        const double yardstick_ms = median_ms.at(kYardstick);
        double terrain_ms = 0.0;
        fmt::print("\n{:<40}  {:>8}  {:>10}\n", "part, one thread, median", "ms", "of SGBM");
        const auto line = [&](const std::string& name, double ms) {
            fmt::print("{:<40}  {:>8.3f}  {:>8.1f} %\n", name, ms, 100.0 * ms / yardstick_ms);
        };
        for (const std::string& name : names_) {
            line(name, median_ms.at(name));
            if (name.starts_with("terrain")) terrain_ms += median_ms.at(name);
        }
        line("terrain in all", terrain_ms);
        fmt::print("SGBM 3-way takes {:.1f} times as long as the terrain stage.\n",
                   yardstick_ms / terrain_ms);
    }

  private:
    void add(const std::string& name, std::function<void()> part) {
        names_.push_back(name);
        benchmark::RegisterBenchmark(name.c_str(), [part = std::move(part)](benchmark::State& state) {
            for (auto _ : state)
                part();
        })->Unit(benchmark::kMillisecond);
    }

    Pair& pair_;
    Arena arena_;
    terrain::PlaneFit fit_;
    terrain::GroundSurface surface_;
    std::unique_ptr<cli::ComparedMatcher> sgbm_;
    std::vector<std::string> names_;
};

// Keeps the medians that Google Benchmark reports.
class Medians final : public benchmark::BenchmarkReporter {
  public:
    std::map<std::string, double> ms;
    bool ReportContext(const Context&) override { return true; }
    void ReportRuns(const std::vector<Run>& runs) override {
        for (const Run& run : runs)
            if (run.run_type == Run::RT_Aggregate && run.aggregate_name == "median")
                ms[run.run_name.function_name] = run.GetAdjustedCPUTime();
    }
};

}  // namespace
}  // namespace groundline

// The scene may be given; anything else goes to Google Benchmark.
int main(int argc, char** argv) {
    using namespace groundline;
    std::vector<std::string> words = {argv[0], "--benchmark_enable_random_interleaving=true",
                                      "--benchmark_repetitions=9", "--benchmark_min_time=0.02"};
    std::string scene = "drive";
    for (int i = 1; i < argc; ++i) {
        const std::string word = argv[i];
        if (word.starts_with("--scene="))
            scene = word.substr(8);
        else
            words.push_back(word);
    }
    std::vector<char*> arguments;
    for (std::string& word : words)
        arguments.push_back(word.data());
    int count = static_cast<int>(arguments.size());
    benchmark::Initialize(&count, arguments.data());
    if (benchmark::ReportUnrecognizedArguments(count, arguments.data())) return 2;
    cv::setNumThreads(1);
    Pair pair(scene);
    Stages stages(pair);
    Medians medians;
    benchmark::RunSpecifiedBenchmarks(&medians);
    stages.print(medians.ms);
    return 0;
}
