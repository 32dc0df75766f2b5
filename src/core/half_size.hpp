// The picture at half its size: how geometry goes there and back.
#pragma once

#include "core/ground.hpp"
#include "core/image.hpp"
#include "core/parallel.hpp"
#include "core/rectified_rig.hpp"

namespace groundline {

// A half-size pixel (i, j) stands for the pixels (2 i, 2 j) to (2 i + 1, 2 j + 1): u = 2 i + 0.5, because a
// pixel's coordinates are those of its middle. Disparities are half as many px, depths the same.

// Columns or rows of the half-size picture; the last stands for one where the size is odd.
constexpr int halved(int size) {
    return (size + 1) / 2;
}

// The camera that sees the half-size picture: f / 2, c' = (c - 0.5) / 2.
RectifiedRig halved(const RectifiedRig& rig);

// The same ground by half-size pixels and disparities, and back: d' = d / 2 at u = 2 u' + 0.5. The covariance
// goes along; pose and its deviations are metric and stay.
Ground halved(const Ground& ground);
Ground doubled(const Ground& ground);

// Each pixel of `half` to the pixels it stands for, value by `convert`. `half` is halved() as large as
// `full`.
template <typename T, typename Convert>
void double_pixels(ImageView<const T> half, ImageView<T> full, Parallel& parallel, Convert convert) {
    assert(half.same_size(halved(full.width), halved(full.height)));
    constexpr int kRowsPerTask = 16;
    const int tasks = (half.height + kRowsPerTask - 1) / kRowsPerTask;
    parallel.for_each(tasks, [&](int task, int) {
        for (int y = task * kRowsPerTask; y < half.height && y < (task + 1) * kRowsPerTask; ++y) {
            const T* source = half.row(y);
            T* above = full.row(2 * y);
            const int pairs = full.width / 2;
            for (int x = 0; x < pairs; ++x)
                above[2 * x] = above[2 * x + 1] = convert(source[x]);
            if (full.width % 2 != 0) above[full.width - 1] = convert(source[pairs]);
            if (2 * y + 1 == full.height) continue;
            T* below = full.row(2 * y + 1);
            for (int x = 0; x < full.width; ++x)
                below[x] = above[x];
        }
    });
}

}  // namespace groundline
