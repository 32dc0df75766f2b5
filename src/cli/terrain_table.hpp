// `groundline evaluate --terrain`: the terrain stage beside a baseline, on sets with truth or rendered
// scenes.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

namespace groundline::cli {

struct TerrainTableOptions {
    std::string suite;              // a folder of sets with truth, or as terrain_suite() takes it
    std::vector<std::string> sets;  // of a folder, as truth_sets() takes them
    int seeds = 0;                  // of rendered scenes, 0: as many as usual
    std::filesystem::path config;   // as for a replay
    std::vector<std::string> set;
    int threads = 0;  // that share the frames, 0: one a processor
    bool json = false;
};

// Runs both on every frame, in this process, a processor for each set and for each rendered frame; prints the
// table or JSON to stdout and what is missing to stderr. All but the times is the same text on every run and
// for any number of threads. Returns 0; 66 where a frame could not be read; the first status of a set that
// could not be run (the others are); 130 when interrupted, with what was done until then printed. Throws
// Refusal: kUsage for an unknown scene or --sets with rendered ones, kInput as truth_sets(), kConfig as
// settings do.
int run_terrain_table(const TerrainTableOptions& options);

}  // namespace groundline::cli
