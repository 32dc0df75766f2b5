// The kernels' own source once more, in another namespace and in its plain form.
#include "unit/stereo_plain_kernels.hpp"

namespace groundline::stereo::plain_kernels {
using kernels::kNoCost;
}

#define GROUNDLINE_PLAIN_KERNELS
#define kernels plain_kernels
#include "../../src/stereo/paper_kernels.cpp"  // NOLINT(bugprone-suspicious-include)
