// Camera drivers in shared objects of their own, loaded by name when the configuration asks for one.
#pragma once

#include <filesystem>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "capture/camera_driver.hpp"
#include "capture/camera_setup.hpp"

namespace groundline::capture {

// What a module exports, with C linkage and these names. Program and module are of one build: the interface
// between them is C++, so the version is compared before anything else is called.
using ModuleVersion = const char*();
using ModuleDriver = CameraDriver*(const CameraSetup& setup);
inline constexpr const char* kModuleVersionName = "groundline_module_version";
inline constexpr const char* kModuleDriverName = "groundline_module_driver";

// Beside the running program, then where the packages put them.
std::vector<std::filesystem::path> module_folders();

// The driver of module `name` ("libcamera": groundline-libcamera.so) in the first of `folders` that has it.
// Throws Refusal(kConfig) where none has, or where it does not load: what it links is missing, or another
// version. A loaded module stays for the life of the program.
std::unique_ptr<CameraDriver> load_driver(std::string_view name, const CameraSetup& setup,
                                          std::span<const std::filesystem::path> folders);

}  // namespace groundline::capture
