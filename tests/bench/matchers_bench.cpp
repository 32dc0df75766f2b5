// Time of every matcher of ours beside OpenCV's, on the same pictures, interleaved in one process. The
// machine's load falls on all alike, so quote the ratios.
#include <benchmark/benchmark.h>
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <array>
#include <cstdint>
#include <cstdio>
#include <exception>
#include <map>
#include <memory>
#include <opencv2/core/utility.hpp>
#include <string>
#include <utility>
#include <vector>

#include "cli/compared_matchers.hpp"
#include "core/arena.hpp"
#include "core/error.hpp"
#include "pipeline/worker_pool.hpp"
#include "stereo/vector_units.hpp"
#include "synth/renderer.hpp"

namespace groundline {
namespace {

using cli::ComparedMatcher;
using cli::MatcherChoice;
using cli::MatchSize;

// What the ratios compare with; always measured.
constexpr std::array kBaselines = {"bm15/filtered", "sgbm_3way/filtered"};
// A visit to a matcher matches as many frames as make up this many voxels, so that small pictures do not pay
// for the caches that the matcher before them filled.
constexpr std::int64_t kVoxelsPerVisit = 20'000'000;

struct Options {
    std::vector<std::string> sizes = {"320x240x32", "640x480x64", "1280x720x128"};
    std::vector<std::string> matchers;
    int threads = 1;
    int repetitions = 9;
    bool growth = false;
    bool units = false;
    std::string json;
    // For counting instructions: match one pair so often and print nothing.
    bool list = false;
    std::string match;
    int frames = 1;
    std::string unit;
};

std::int64_t voxels_of(const MatchSize& size) {
    return std::int64_t{size.width} * size.height * size.disparities;
}

MatchSize size_of(const std::string& text) {
    MatchSize size;
    char end = '\0';
    const int found =
        std::sscanf(text.c_str(), "%dx%dx%d%c", &size.width, &size.height, &size.disparities, &end);
    if (found != 3 || size.width < 64 || size.height < 32 || size.width > 8192 || size.height > 8192 ||
        size.disparities < 16 || size.disparities > 256 || size.disparities % 16 != 0)
        throw Refusal(ExitStatus::kUsage,
                      fmt::format("'{}' is no size; expected WIDTHxHEIGHTxDISPARITIES as in 640x480x64, "
                                  "disparities a multiple of 16 from 16 to 256",
                                  text));
    return size;
}

std::string text_of(const MatchSize& size) {
    return fmt::format("{}x{}x{}", size.width, size.height, size.disparities);
}

stereo::VectorUnit unit_called(const std::string& name) {
    std::string known;
    for (const stereo::VectorUnit unit : stereo::vector_units()) {
        if (name == stereo::name_of(unit)) return unit;
        known += fmt::format("{}{}", known.empty() ? "" : ", ", stereo::name_of(unit));
    }
    throw Refusal(ExitStatus::kUsage,
                  fmt::format("this processor has no vector unit '{}'; it has {}", name, known));
}

// The first pair of the rendered drive.
struct Pair {
    Arena arena;
    Luma left;
    Luma right;

    explicit Pair(const MatchSize& size) {
        const synth::Scene scene =
            synth::scene_by_name(fmt::format("drive?width={}&height={}", size.width, size.height));
        left = arena.image<std::uint8_t>(size.width, size.height);
        right = arena.image<std::uint8_t>(size.width, size.height);
        Serial serial;
        synth::Renderer(scene).render(0, serial, left, {}, right);
    }
};

// One cell of the tables: a matcher at one size, on one vector unit where it is ours.
struct Case {
    std::string size;
    std::string matcher;
    MatchSize voxels;
    stereo::VectorUnit unit = 0;
    const Pair* pair = nullptr;
    std::unique_ptr<ComparedMatcher> run;
    double median_ms = 0.0;

    std::string name() const { return size + "/" + matcher; }
    void match() const {
        stereo::use_vector_unit(unit);
        run->match(pair->left, pair->right);
    }
};

class Bench {
  public:
    explicit Bench(const Options& options) : options_(options), pool_(options.threads) {
        cv::setNumThreads(options.threads);
        std::vector<std::string> wanted = options.matchers;
        if (!wanted.empty()) wanted.insert(wanted.end(), kBaselines.begin(), kBaselines.end());
        choices_ = cli::choose_matchers(wanted);
        std::vector<std::string> sizes = options.sizes;
        if (options.growth)
            for (const std::vector<std::string>& line : kGrowth)
                sizes.insert(sizes.end(), line.begin(), line.end());
        for (const std::string& size : sizes)
            add_size(size_of(size));
    }

    // Google Benchmark does the measuring, in random order, and writes the file.
    void measure() {
        for (Case& each : cases_) {
            each.match();  // memory that is taken at the first frame
            benchmark::internal::Benchmark* const registered =
                benchmark::RegisterBenchmark(each.name().c_str(), [&each](benchmark::State& state) {
                    for (auto _ : state)
                        each.match();
                    state.counters["voxels_per_second"] =
                        benchmark::Counter(static_cast<double>(voxels_of(each.voxels)),
                                           benchmark::Counter::kIsIterationInvariantRate);
                });
            registered->Iterations(std::max<std::int64_t>(1, kVoxelsPerVisit / voxels_of(each.voxels)))
                ->Repetitions(options_.repetitions)
                ->ReportAggregatesOnly()
                ->Unit(benchmark::kMillisecond);
            if (options_.threads > 1) registered->MeasureProcessCPUTime()->UseRealTime();
        }
        std::vector<std::string> words = {"bench_matchers", "--benchmark_enable_random_interleaving=true"};
        if (!options_.json.empty()) {
            words.push_back("--benchmark_out=" + options_.json);
            words.emplace_back("--benchmark_out_format=json");
        }
        std::vector<char*> pointers;
        pointers.reserve(words.size());
        for (std::string& word : words)
            pointers.push_back(word.data());
        int count = static_cast<int>(pointers.size());
        benchmark::Initialize(&count, pointers.data());
        benchmark::AddCustomContext("matcher_threads", std::to_string(options_.threads));
        benchmark::AddCustomContext("vector_unit", best_unit_);
        benchmark::AddCustomContext("opencv", cv::getVersionString());
        Collector collector(*this);
        benchmark::RunSpecifiedBenchmarks(&collector);
        stereo::use_best_vector_unit();
    }

    void print() const {
        std::vector<std::string> sizes = options_.sizes;
        sizes.erase(std::unique(sizes.begin(), sizes.end()), sizes.end());
        for (const std::string& size : sizes)
            print_size(text_of(size_of(size)));
        if (options_.growth) print_growth();
        fmt::print("Medians of {} visits in random order; {} {}; OpenCV {}; vector unit {}. Scene: drive.\n",
                   options_.repetitions, options_.threads,
                   options_.threads == 1 ? "thread, its processor time" : "threads, elapsed time",
                   cv::getVersionString(), best_unit_);
    }

  private:
    inline static const std::vector<std::vector<std::string>> kGrowth = {
        {"320x480x64", "640x480x64", "1280x480x64"},
        {"640x240x64", "640x480x64", "640x960x64"},
        {"640x480x32", "640x480x64", "640x480x128"}};

    // Takes the medians out of what Google Benchmark reports.
    class Collector final : public benchmark::BenchmarkReporter {
      public:
        explicit Collector(Bench& bench) : bench_(bench) {}
        bool ReportContext(const Context&) override { return true; }
        void ReportRuns(const std::vector<Run>& runs) override {
            for (const Run& run : runs) {
                if (run.run_type != Run::RT_Aggregate || run.aggregate_name != "median") continue;
                for (Case& each : bench_.cases_)
                    if (run.run_name.function_name == each.name())
                        each.median_ms = bench_.options_.threads == 1 ? run.GetAdjustedCPUTime()
                                                                      : run.GetAdjustedRealTime();
            }
        }

      private:
        Bench& bench_;
    };

    void add_size(const MatchSize& size) {
        const std::string text = text_of(size);
        if (std::any_of(cases_.begin(), cases_.end(), [&](const Case& each) { return each.size == text; }))
            return;
        const auto picture = fmt::format("{}x{}", size.width, size.height);
        std::unique_ptr<Pair>& pair = pairs_[picture];
        if (!pair) pair = std::make_unique<Pair>(size);
        std::vector<stereo::VectorUnit> units = {stereo::vector_unit_in_use()};
        if (options_.units) units = stereo::vector_units();
        for (const MatcherChoice& choice : choices_)
            for (const stereo::VectorUnit unit : units) {
                if (!choice.ours && unit != units.front()) continue;
                Case added;
                added.size = text;
                added.voxels = size;
                added.matcher = choice.name;
                if (choice.ours && options_.units) added.matcher += fmt::format(" {}", stereo::name_of(unit));
                added.unit = unit;
                added.pair = pair.get();
                added.run = choice.make(size, pool_);
                cases_.push_back(std::move(added));
            }
    }

    const Case* find(const std::string& size, const std::string& matcher) const {
        for (const Case& each : cases_)
            if (each.size == size && each.matcher == matcher) return &each;
        return nullptr;
    }

    std::size_t name_width() const {
        std::size_t width = 0;
        for (const Case& each : cases_)
            width = std::max(width, each.matcher.size());
        return width;
    }

    void print_size(const std::string& size) const {
        fmt::print("{:<{}}  times as fast as\n{:<{}}", size, name_width(), "", name_width());
        for (const char* baseline : kBaselines)
            fmt::print("  {:>18}", baseline);
        fmt::print("  {:>9}  {:>8}\n", "ms", "ns/voxel");
        for (const Case& each : cases_) {
            if (each.size != size) continue;
            fmt::print("{:<{}}", each.matcher, name_width());
            for (const char* baseline : kBaselines)
                fmt::print("  {:>18.2f}", find(size, baseline)->median_ms / each.median_ms);
            fmt::print("  {:>9.2f}  {:>8.3f}\n", each.median_ms, ns_per_voxel(each));
        }
        fmt::print("\n");
    }

    static double ns_per_voxel(const Case& each) {
        return each.median_ms * 1e6 / static_cast<double>(voxels_of(each.voxels));
    }

    void print_growth() const {
        constexpr std::array kWhat = {"width", "height", "disparities"};
        for (std::size_t i = 0; i < kGrowth.size(); ++i) {
            fmt::print("{:<{}}", fmt::format("ns/voxel with {}", kWhat[i]), name_width());
            for (const std::string& size : kGrowth[i])
                fmt::print("  {:>12}", size);
            fmt::print("\n");
            for (const Case& first : cases_) {
                if (first.size != kGrowth[i].front()) continue;
                fmt::print("{:<{}}", first.matcher, name_width());
                for (const std::string& size : kGrowth[i])
                    fmt::print("  {:>12.3f}", ns_per_voxel(*find(size, first.matcher)));
                fmt::print("\n");
            }
            fmt::print("\n");
        }
    }

    Options options_;
    std::string best_unit_ = stereo::name_of(stereo::vector_unit_in_use());
    pipeline::WorkerPool pool_;
    std::vector<MatcherChoice> choices_;
    std::map<std::string, std::unique_ptr<Pair>> pairs_;  // by width and height
    std::vector<Case> cases_;
};

// For a program that counts this one's instructions.
int match_only(const Options& options) {
    if (!options.unit.empty()) stereo::use_vector_unit(unit_called(options.unit));
    cv::setNumThreads(1);
    const MatchSize size = size_of(options.sizes.front());
    const Pair pair(size);
    Serial serial;
    const auto matcher = cli::choose_matchers({options.match}).front().make(size, serial);
    for (int frame = 0; frame < options.frames; ++frame)
        matcher->match(pair.left, pair.right);
    return 0;
}

int list(const Options& options) {
    for (const MatcherChoice& choice : cli::choose_matchers(options.matchers))
        fmt::print("{} {}\n", choice.ours ? "ours" : "opencv", choice.name);
    for (const stereo::VectorUnit unit : stereo::vector_units())
        fmt::print("unit {}\n", stereo::name_of(unit));
    return 0;
}

int run(int argc, char** argv) {
    Options options;
    CLI::App app("Every matcher of groundline beside OpenCV's: ratios, milliseconds, nanoseconds a voxel.");
    app.add_option("--sizes", options.sizes, "WIDTHxHEIGHTxDISPARITIES, comma between")
        ->delimiter(',')
        ->capture_default_str();
    app.add_option(
           "--matchers", options.matchers,
           "Only these and what the ratios compare with, comma between: paper, bm15, census/dense ...")
        ->delimiter(',');
    app.add_option("--threads", options.threads, "For ours and for OpenCV's")
        ->check(CLI::Range(1, 64))
        ->capture_default_str();
    app.add_option("--repetitions", options.repetitions, "Visits to each matcher at each size")
        ->check(CLI::Range(1, 10000))
        ->capture_default_str();
    app.add_flag("--growth", options.growth, "Also tables over width, height and disparities");
    app.add_flag("--units", options.units, "Ours on each vector unit this processor has");
    app.add_option("--json", options.json, "File for Google Benchmark's JSON");
    app.add_flag("--list", options.list, "Print the names of matchers and vector units");
    app.add_option("--match", options.match,
                   "Match with this one only, print nothing: to count instructions");
    app.add_option("--frames", options.frames, "With --match: so often")->check(CLI::Range(1, 1000000));
    app.add_option("--unit", options.unit, "With --match: on this vector unit");
    try {
        app.parse(argc, argv);
    } catch (const CLI::Success& help) {
        return app.exit(help);
    } catch (const CLI::ParseError& misuse) {
        fmt::print(stderr, "bench_matchers: {}; see --help\n", misuse.what());
        return 2;
    }
    if (options.list) return list(options);
    if (!options.match.empty()) return match_only(options);
    Bench bench(options);
    bench.measure();
    bench.print();
    return 0;
}

}  // namespace
}  // namespace groundline

int main(int argc, char** argv) {
    try {
        return groundline::run(argc, argv);
    } catch (const groundline::Refusal& refusal) {
        fmt::print(stderr, "bench_matchers: {}\n", refusal.what());
        return static_cast<int>(refusal.status());
    } catch (const std::exception& failure) {
        fmt::print(stderr, "bench_matchers: {}\n", failure.what());
        return 1;
    }
}
