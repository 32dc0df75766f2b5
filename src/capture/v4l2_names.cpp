#include "capture/v4l2_names.hpp"

#include <fstream>
#include <string_view>
#include <system_error>
#include <vector>

namespace groundline::capture {
namespace {

namespace fs = std::filesystem;

constexpr std::string_view kSerial = "serial:";

std::string first_line(const fs::path& file) {
    std::ifstream stream(file);
    std::string line;
    std::getline(stream, line);
    while (!line.empty() && (line.back() == ' ' || line.back() == '\r'))
        line.pop_back();
    return line;
}

// The serial number is the USB device's; a video node belongs to one of its interfaces.
std::string serial_of(const fs::path& node) {
    std::error_code error;
    const fs::path interface = fs::canonical(node / "device", error);
    return error ? std::string{} : first_line(interface.parent_path() / "serial");
}

Fault find_serial(std::string_view serial, const V4l2Places& places, std::string& path) {
    std::vector<std::string> found;
    std::error_code error;
    for (fs::directory_iterator it(places.classes, error), end; !error && it != end; it.increment(error)) {
        // A camera has further nodes, for metadata; the first one gives pictures.
        if (first_line(it->path() / "index") != "0" || serial_of(it->path()) != serial) continue;
        found.push_back((places.devices / it->path().filename()).string());
    }
    const int length = static_cast<int>(serial.size());
    if (found.empty())
        return {CameraFault::kAbsent,
                Sentence::of("no camera with serial number %.*s is connected", length, serial.data())};
    if (found.size() > 1)
        return {
            CameraFault::kRefused,
            Sentence::of("serial number %.*s is that of %s and of %s; name the cameras by-path/... instead",
                         length, serial.data(), found[0].c_str(), found[1].c_str())};
    path = found[0];
    return {};
}

}  // namespace

Fault find_v4l2_device(const std::string& name, const V4l2Places& places, std::string& path) {
    if (name.empty())
        return {
            CameraFault::kRefused,
            Sentence("no camera is named; set capture.left and capture.right, or capture.device for one that "
                     "gives both eyes side by side")};
    if (name.starts_with(kSerial))
        return find_serial(std::string_view(name).substr(kSerial.size()), places, path);
    if (name.starts_with("/"))
        path = name;
    else if (name.starts_with("by-id/") || name.starts_with("by-path/"))
        path = (places.devices / "v4l" / name).string();
    else
        path = (places.devices / name).string();
    return {};
}

}  // namespace groundline::capture
