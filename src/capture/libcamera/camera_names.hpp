// How an operator names a libcamera camera, and which of those at hand that is.
#pragma once

#include <optional>
#include <span>
#include <string>
#include <string_view>

#include "capture/camera_driver.hpp"

namespace groundline::capture {

// `name` is a whole id as `cam -l` prints it, a part of one that only one camera has ("imx219@10", "i2c@1"),
// or a number: the place among the ids in alphabetical order, from 0. Fills `index` into `ids`. kAbsent where
// no camera fits, kRefused where several do or the name is empty; both say what is there.
Fault find_camera(std::string_view name, std::span<const std::string> ids, std::size_t& index);

}  // namespace groundline::capture
