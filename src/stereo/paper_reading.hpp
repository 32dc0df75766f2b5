// How the paper is read where its text leaves a choice: two cellular-automaton rules, window, truncation.
#pragma once

#include <cstdint>

namespace groundline::stereo {

// Rule 1: a cost that differs by less than half of itself from the cost of either neighbouring disparity is
// replaced over its 3x3 neighbourhood at the same disparity.
enum class RuleOne : std::uint8_t {
    kOff,
    kMean9,  // by the mean of the nine costs
    kSum9,   // by their sum ("further aggregated" taken literally)
};

// Rule 2: a cost from which enough neighbours at the same disparity differ by less than half of it is divided
// by 1.3. Lower is better, so support is rewarded.
enum class RuleTwo : std::uint8_t {
    kOff,
    kSevenOfEight,  // of the eight neighbours
    kSevenOfNine,   // counting the centre itself, so six neighbours where the cost is not 0
};

// Weights of the 11x11 window over the Euclidean distance from its centre.
enum class Window : std::uint8_t {
    kGauss5,   // sigma = 5/3: the border is the centre of the outermost pixel
    kGauss55,  // sigma = 5.5/3: the border is the outermost pixel's edge
    kBox,      // equal weights
};

// The defaults are the reading that every published figure of `paper` refers to. All readings with a mean in
// rule 1 lie within 0.4 points of bad-1 of each other.
struct PaperReading {
    RuleOne rule_one = RuleOne::kMean9;
    RuleTwo rule_two = RuleTwo::kSevenOfEight;
    // Rule 2 looks at the costs before rule 1 instead of after it, and scales what rule 1 made of them.
    bool rules_at_once = false;
    Window window = Window::kGauss5;
    // Most that one pixel adds to a cost, grey levels: 4 % of 255 is 10.2, integer images make it 10.
    // 1 .. 28 (14 with kSum9), so that every sum fits 16 bits.
    int truncation = 10;
};

// Reach of the window to each side, px.
inline constexpr int kWindowReach = 5;

}  // namespace groundline::stereo
