#include "core/half_size.hpp"

namespace groundline {

RectifiedRig halved(const RectifiedRig& rig) {
    RectifiedRig half = rig;
    half.width = halved(rig.width);
    half.height = halved(rig.height);
    half.focal_px = 0.5 * rig.focal_px;
    half.cx_px = 0.5 * (rig.cx_px - 0.5);
    half.cy_px = 0.5 * (rig.cy_px - 0.5);
    half.cx_right_px = 0.5 * (rig.cx_right_px - 0.5);
    return half;
}

namespace {

// d0 becomes scale d0 + along (du + dv); du and dv stay.
Ground with_offset(const Ground& ground, double scale, double along) {
    Ground result = ground;
    const DisparityPlane& plane = ground.plane;
    result.plane.d0 = scale * plane.d0 + along * (plane.du + plane.dv);
    const std::array<double, 9>& c = ground.covariance;
    const double to_du = scale * c[2] + along * (c[0] + c[1]);
    const double to_dv = scale * c[5] + along * (c[3] + c[4]);
    const double sums = c[0] + 2.0 * c[1] + c[4];
    result.covariance[2] = result.covariance[6] = to_du;
    result.covariance[5] = result.covariance[7] = to_dv;
    result.covariance[8] = scale * scale * c[8] + 2.0 * scale * along * (c[2] + c[5]) + along * along * sums;
    return result;
}

}  // namespace

// d' = (du (2 u' + 0.5) + dv (2 v' + 0.5) + d0) / 2.
Ground halved(const Ground& ground) {
    return ground.found ? with_offset(ground, 0.5, 0.25) : ground;
}

// d = 2 (du (u - 0.5) / 2 + dv (v - 0.5) / 2 + d0').
Ground doubled(const Ground& ground) {
    return ground.found ? with_offset(ground, 2.0, -0.5) : ground;
}

}  // namespace groundline
