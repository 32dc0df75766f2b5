#include "capture/driver_module.hpp"

#include <dlfcn.h>
#include <fmt/format.h>

#include <system_error>

#include "core/error.hpp"

namespace groundline::capture {

std::vector<std::filesystem::path> module_folders() {
    std::vector<std::filesystem::path> folders;
    std::error_code error;
    const std::filesystem::path program = std::filesystem::read_symlink("/proc/self/exe", error);
    if (error) return folders;
    folders.push_back(program.parent_path());
    // Seen from the programs, so that one build can be installed or packaged for any prefix.
    folders.push_back((program.parent_path() / GROUNDLINE_MODULE_FOLDER).lexically_normal());
    return folders;
}

std::unique_ptr<CameraDriver> load_driver(std::string_view name, const CameraSetup& setup,
                                          std::span<const std::filesystem::path> folders) {
    const std::string file = fmt::format("groundline-{}.so", name);
    std::string looked_in;
    for (const std::filesystem::path& folder : folders) {
        const std::filesystem::path path = folder / file;
        std::error_code error;
        if (!std::filesystem::exists(path, error)) {
            looked_in += (looked_in.empty() ? "" : ", ") + folder.string();
            continue;
        }
        void* module = dlopen(path.c_str(), RTLD_NOW | RTLD_LOCAL);
        if (module == nullptr)
            throw Refusal(ExitStatus::kConfig,
                          fmt::format("capture.driver: {} does not load: {}", name, dlerror()));
        const auto version = reinterpret_cast<ModuleVersion*>(dlsym(module, kModuleVersionName));
        const auto driver = reinterpret_cast<ModuleDriver*>(dlsym(module, kModuleDriverName));
        if (version == nullptr || driver == nullptr || std::string_view(version()) != GROUNDLINE_VERSION)
            throw Refusal(
                ExitStatus::kConfig,
                fmt::format("capture.driver: {} is of another version ({}) than this program ({}): "
                            "install both of one version",
                            path.string(), version != nullptr ? version() : "unknown", GROUNDLINE_VERSION));
        return std::unique_ptr<CameraDriver>(driver(setup));
    }
    throw Refusal(ExitStatus::kConfig,
                  fmt::format("capture.driver: {} needs {}, which is not in {}: install the package "
                              "groundline-{}",
                              name, file, looked_in, name));
}

}  // namespace groundline::capture
