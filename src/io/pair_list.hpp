// Finds the image pairs of a folder, whatever its layout, with their time stamps.
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

namespace groundline::io {

struct PairFiles {
    std::filesystem::path left;
    std::filesystem::path right;
    std::int64_t stamp_ns = 0;  // of the left image, since the epoch or since the start of the recording
    std::int64_t skew_ns = 0;   // right stamp minus left stamp
};

struct PairList {
    std::string layout;            // for people, e.g. "KITTI image_0 and image_1"
    std::filesystem::path folder;  // where calibration is looked for; empty: nowhere
    bool colour_pair = false;      // KITTI's colour cameras, whose calibration is P2 and P3
    bool stamped = false;          // the stamps come from the data
    std::string note;              // one sentence about images left out, else empty
    std::vector<PairFiles> pairs;  // in order, at least one
};

// The layouts are tried in this order: left/ and right/ with the same names; left.* and right.*; Middlebury
// im0.* and im1.*; KITTI raw image_00/data, image_02/data; KITTI stereo image_0, image_2, colored_0;
// EuRoC/ASL mav0/cam0, or cam0 in the folder itself. Names are sorted with numbers by their value, so that
// "2" comes before "10". Stamps come from EuRoC's data.csv, KITTI's timestamps.txt (its local time taken as
// UTC) and times.txt, or names of 19 digits (ns since the epoch). EuRoC images are paired by stamp, at most
// kMaxSkewNs apart; single ones are left out and told in `note`. No image is opened.
// Throws Refusal(kInput): nothing known, one side only, names on one side only, malformed stamps.
PairList list_pairs(const std::filesystem::path& folder);

// A pair given as two files. The folder is the one that holds both, or the parent of left/ and right/ that
// hold one each; else it is empty: a calibration found higher up, as in a home folder, may be of another rig.
PairList list_two_images(const std::filesystem::path& left, const std::filesystem::path& right);

// Names of the image files of a folder, by extension, in the order of list_pairs; hidden files are none.
// Throws Refusal(kInput) where the folder cannot be read.
std::vector<std::filesystem::path> images_in(const std::filesystem::path& folder);

// Two exposures of one trigger differ by less than this; half of what 100 Hz would allow.
inline constexpr std::int64_t kMaxSkewNs = 5'000'000;

// For messages: everything that list_pairs and open_pairs accept.
std::string accepted_layouts();

}  // namespace groundline::io
