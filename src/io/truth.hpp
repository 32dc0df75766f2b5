// The truth an evaluation compares with: disparity and, for rendered scenes, classes and heights.
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "io/png.hpp"

namespace groundline::io {

struct TruthFrame {
    Image16 disparity_q8;  // 1/256 px, left view, 0 = none
    Image8 classes;        // class ids; empty (width 0) where the folder has none
    Image16 height_mm;     // above the ground + 32768; empty where the folder has none
    Image8 occluded;       // not 0 where the right camera does not see the point; empty where there is none
};

// A folder with disp.png or disp/ and, where known, class/, height/, occluded/ (or class.png and so on beside
// disp.png) and truth.json.
class Truth {
  public:
    // Only lists. Throws Refusal(kInput): no truth here, an empty disp/, names that another folder lacks.
    explicit Truth(const std::filesystem::path& folder);

    int frames() const { return static_cast<int>(disparity_.size()); }
    bool has_classes() const { return !classes_.empty(); }
    bool has_heights() const { return !heights_.empty(); }
    bool has_occlusion() const { return !occluded_.empty(); }
    // The text of truth.json, empty where there is none.
    const std::string& json_text() const { return json_text_; }

    // `position` counts from 0 as the output files of a replay do. Throws std::runtime_error with the file:
    // unreadable, or not the size of its disparity.
    TruthFrame read(int position) const;

  private:
    std::vector<std::filesystem::path> disparity_, classes_, heights_, occluded_;
    std::string json_text_;
};

}  // namespace groundline::io
