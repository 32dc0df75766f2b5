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
    if (units.empty())
        units.push_back(HWY_STATIC_TARGET);  // built for one alone, which Highway does not look for
    return units;
}

const char* name_of(VectorUnit unit) {
    return hwy::TargetName(unit);
}

VectorUnit vector_unit_in_use() {
    const std::vector<VectorUnit> units = hwy::SupportedAndGeneratedTargets();
    return units.empty() ? HWY_STATIC_TARGET : units.front();
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
