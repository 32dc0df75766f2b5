// What a frame's own pixels say about one image row of the ground found in it.
#pragma once

#include <cstdint>

namespace groundline::terrain {

enum class RowSupport : std::uint8_t {
    kNone,          // nothing: too few pixels lie on the ground
    kSupported,     // enough of the row's pixels lie on the ground
    kContradicted,  // from this row or a nearer one on, what is seen is level but not on the ground found
};

}  // namespace groundline::terrain
