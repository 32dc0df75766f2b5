#include "capture/libcamera/camera_names.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <charconv>
#include <numeric>
#include <vector>

namespace groundline::capture {
namespace {

std::string listed(std::span<const std::string> ids) {
    return ids.empty() ? "none" : fmt::format("{}", fmt::join(ids, ", "));
}

}  // namespace

Fault find_camera(std::string_view name, std::span<const std::string> ids, std::size_t& index) {
    const std::string wanted(name);
    if (name.empty())
        return {CameraFault::kRefused,
                Sentence::of("no camera is named; libcamera has: %s", listed(ids).c_str())};
    const auto whole = std::find(ids.begin(), ids.end(), name);
    if (whole != ids.end()) {
        index = static_cast<std::size_t>(whole - ids.begin());
        return {};
    }
    std::size_t number = 0;
    const auto [end, error] = std::from_chars(name.data(), name.data() + name.size(), number);
    if (error == std::errc{} && end == name.data() + name.size()) {
        if (number >= ids.size())
            return {CameraFault::kAbsent, Sentence::of("libcamera has no camera number %s; it has: %s",
                                                       wanted.c_str(), listed(ids).c_str())};
        std::vector<std::size_t> order(ids.size());
        std::iota(order.begin(), order.end(), std::size_t{0});
        std::sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) { return ids[a] < ids[b]; });
        index = order[number];
        return {};
    }
    const auto fits = [&](const std::string& id) { return id.find(name) != std::string::npos; };
    const auto count = std::count_if(ids.begin(), ids.end(), fits);
    if (count == 0)
        return {CameraFault::kAbsent, Sentence::of("libcamera has no camera '%s'; it has: %s", wanted.c_str(),
                                                   listed(ids).c_str())};
    if (count > 1)
        return {CameraFault::kRefused, Sentence::of("'%s' fits several of libcamera's cameras: %s",
                                                    wanted.c_str(), listed(ids).c_str())};
    index = static_cast<std::size_t>(std::find_if(ids.begin(), ids.end(), fits) - ids.begin());
    return {};
}

}  // namespace groundline::capture
