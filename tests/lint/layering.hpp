// Reads sources for what the layout forbids: arrows between rooms that point up, and impure pure rooms.
#pragma once

#include <string>
#include <string_view>
#include <vector>

namespace groundline::lint {

// Every breach in the source file `path` (relative to src/, "room/name.hpp") with this text, one sentence
// each: "room/name.hpp:12: ...". The rules:
//   - a room includes only itself and rooms before it in
//     core <- rig, stereo, terrain, synth <- verdict <- pipeline <- io <- capture, publish <- settings <-
//     setup <- cli, daemon;
//   - core, rig, stereo, terrain, synth and verdict are pure: no OpenCV, LCM, files, threads, console, random
//     devices or containers without an order, and none of the C library's transcendental functions, whose
//     last bit differs between machines (core/deterministic_math.hpp has its own);
//   - no source names a place on one machine.
std::vector<std::string> breaches(std::string_view path, std::string_view text);

}  // namespace groundline::lint
