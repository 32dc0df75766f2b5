// Runs a check on every set of vector instructions that the kernels are built for and this processor has.
#pragma once

#include <gtest/gtest.h>

#include <cstdio>

#include "stereo/vector_units.hpp"

namespace groundline {

// Prints which ran, so that a log says what was proved where.
template <typename Check>
void on_every_vector_unit(Check check) {
    ASSERT_FALSE(stereo::vector_units().empty());
    for (const stereo::VectorUnit unit : stereo::vector_units()) {
        SCOPED_TRACE(stereo::name_of(unit));
        std::printf("vector unit %s\n", stereo::name_of(unit));
        stereo::use_vector_unit(unit);
        check();
    }
    stereo::use_best_vector_unit();
}

}  // namespace groundline
