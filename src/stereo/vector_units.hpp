// Which vector instructions the kernels use: picked by the processor, or by a test.
#pragma once

#include <cstdint>
#include <vector>

namespace groundline::stereo {

// One set of vector instructions that the kernels are built for, e.g. AVX2. The kernels give the same bytes
// on each.
using VectorUnit = std::int64_t;

// Those this processor has, best first; never empty.
std::vector<VectorUnit> vector_units();
const char* name_of(VectorUnit unit);
// The best, which kernels use unless use_vector_unit() said otherwise.
VectorUnit vector_unit_in_use();

// For tests and benchmarks: from now on every kernel of the process runs on `unit`, one of vector_units().
// Not while a matcher runs.
void use_vector_unit(VectorUnit unit);
void use_best_vector_unit();

}  // namespace groundline::stereo
