#include "stereo/vector_units.hpp"

#include <hwy/highway.h>

namespace groundline::stereo {

namespace {

void choose() {
    hwy::GetChosenTarget().Update(hwy::SupportedTargets());
}

}  // namespace

std::vector<VectorUnit> vector_units() {
    const VectorUnit in_use = hwy::SupportedTargets();
    hwy::SetSupportedTargetsForTest(0);
    std::vector<VectorUnit> units = hwy::SupportedAndGeneratedTargets();
    if (in_use != hwy::SupportedTargets()) hwy::SetSupportedTargetsForTest(in_use);
    return units;
}

const char* name_of(VectorUnit unit) {
    return hwy::TargetName(unit);
}

VectorUnit vector_unit_in_use() {
    return hwy::SupportedAndGeneratedTargets().front();
}

void use_vector_unit(VectorUnit unit) {
    hwy::SetSupportedTargetsForTest(unit);
    choose();
}

void use_best_vector_unit() {
    hwy::SetSupportedTargetsForTest(0);
    choose();
}

}  // namespace groundline::stereo
