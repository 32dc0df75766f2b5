#include "io/result_writer.hpp"

#include <fcntl.h>
#include <fmt/core.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <charconv>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <fstream>
#include <nlohmann/json.hpp>
#include <string_view>
#include <system_error>
#include <utility>

#include "core/clock.hpp"
#include "core/deterministic_math.hpp"
#include "core/error.hpp"
#include "io/atomic_file.hpp"
#include "io/picture.hpp"

namespace groundline::io {
namespace {

namespace fs = std::filesystem;

constexpr std::array<std::string_view, 4> kImageFolders = {"disparity", "mask", "overlay", "vdisparity"};
constexpr std::array<std::string_view, 3> kTextFiles = {"frames.jsonl", "timing.jsonl", "summary.json"};
constexpr std::string_view kOurKey = "groundline";

// Fixed decimals by the language's own conversion, which knows no locale; -0 is written 0.
void append_fixed(std::string& line, double value, int decimals) {
    if (!std::isfinite(value)) {
        line += "null";
        return;
    }
    std::array<char, 400> text{};  // the largest double has 309 digits
    const auto [end, error] =
        std::to_chars(text.data(), text.data() + text.size(), value, std::chars_format::fixed, decimals);
    std::string_view digits(text.data(), static_cast<std::size_t>(end - text.data()));
    if (digits.front() == '-' && digits.find_first_not_of("-0.") == std::string_view::npos)
        digits.remove_prefix(1);
    line += digits;
}

// Writes "key":value pairs with their commas.
class ObjectLine {
  public:
    explicit ObjectLine(std::string& line) : line_(line) { line_ += '{'; }

    std::string& key(std::string_view name) {
        if (!first_) line_ += ',';
        first_ = false;
        line_ += '"';
        line_ += name;
        line_ += "\":";
        return line_;
    }
    void number(std::string_view name, double value, int decimals) {
        append_fixed(key(name), value, decimals);
    }
    void number_or_null(std::string_view name, bool present, double value, int decimals) {
        if (present)
            number(name, value, decimals);
        else
            key(name) += "null";
    }
    void integer(std::string_view name, std::int64_t value) { key(name) += std::to_string(value); }
    // For words of our own, which need no escapes.
    void word(std::string_view name, std::string_view value) { ((key(name) += '"') += value) += '"'; }
    void close() { line_ += '}'; }

  private:
    std::string& line_;
    bool first_ = true;
};

void append_pose(ObjectLine& object, bool present, const GroundPose& pose) {
    object.number_or_null("pitch_deg", present, det::degrees(pose.pitch_rad), 6);
    object.number_or_null("roll_deg", present, det::degrees(pose.roll_rad), 6);
    object.number_or_null("height_m", present, pose.height_m, 6);
}

void append_ground(std::string& line, const Ground& ground) {
    ObjectLine object(line);
    std::string& plane = object.key("plane");
    if (ground.found) {
        plane += '[';
        append_fixed(plane, ground.plane.du, 9);
        plane += ',';
        append_fixed(plane, ground.plane.dv, 9);
        plane += ',';
        append_fixed(plane, ground.plane.d0, 6);
        plane += ']';
    } else {
        plane += "null";
    }
    const bool metric = ground.found && ground.metric;
    append_pose(object, metric, ground.pose);
    ObjectLine sigma(object.key("sigma"));
    append_pose(sigma, metric, ground.sigma);
    sigma.close();
    object.close();
}

void append_sector(std::string& line, const Sector& sector) {
    ObjectLine object(line);
    object.number("bearing_deg", det::degrees(sector.bearing_rad), 4);
    object.number("width_deg", det::degrees(sector.width_rad), 4);
    object.key("blocked") += sector.blocked ? "true" : "false";
    object.key("held") += sector.held ? "true" : "false";
    object.word("kind", kTerrainClassNames[static_cast<std::size_t>(sector.kind)]);
    object.number_or_null("nearest_m", sector.blocked, sector.nearest_m, 4);
    object.number_or_null("sigma_m", sector.blocked, sector.nearest_sigma_m, 4);
    object.number("free_range_m", sector.free_range_m, 4);
    object.number("coverage", sector.coverage, 6);
    object.close();
}

std::string timing_line(const FrameResult& result, std::int64_t write_ns) {
    std::string line;
    ObjectLine object(line);
    object.integer("frame", result.stamp.position);
    for (std::size_t i = 0; i < kStageNames.size(); ++i) {
        const bool own = i == static_cast<std::size_t>(Stage::kWrite);
        const std::int64_t ns = own ? write_ns : result.times_ns[i];
        object.number(fmt::format("{}_ms", kStageNames[i]), static_cast<double>(ns) / 1e6, 3);
    }
    object.close();
    return line;
}

std::string file_name(std::int64_t position) {
    std::array<char, 32> name{};
    std::snprintf(name.data(), name.size(), "%06lld.png", static_cast<long long>(position));
    return name.data();
}

// NNNNNN.png, or the temporary name of one that a killed run left.
bool is_our_image(std::string_view name) {
    if (name.starts_with('.') && name.ends_with(".tmp")) name = name.substr(1, name.size() - 5);
    if (!name.ends_with(".png")) return false;
    name.remove_suffix(4);
    return name.size() >= 6 && name.find_first_not_of("0123456789") == std::string_view::npos;
}

bool is_our_result(const fs::path& folder) {
    std::ifstream file(folder / "summary.json");
    if (!file) return false;
    const auto summary = nlohmann::json::parse(file, nullptr, false);
    return summary.is_object() && summary.contains(kOurKey);
}

// One call, so that a line is in the file whole or not at all.
void append_line(int file, std::string line, const fs::path& path) {
    line += '\n';
    std::string_view rest = line;
    while (!rest.empty()) {
        const ssize_t written = ::write(file, rest.data(), rest.size());
        if (written < 0 && errno == EINTR) continue;
        if (written < 0)
            throw std::runtime_error(
                fmt::format("cannot write '{}': {}", path.string(), std::strerror(errno)));
        rest.remove_prefix(static_cast<std::size_t>(written));
    }
}

int open_lines(const fs::path& path) {
    const int file = ::open(path.c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_APPEND | O_CLOEXEC, 0666);
    if (file < 0)
        throw std::runtime_error(fmt::format("cannot write '{}': {}", path.string(), std::strerror(errno)));
    return file;
}

void close_lines(int& file) {
    if (file >= 0) ::close(file);
    file = -1;
}

}  // namespace

std::string frame_line(const FrameResult& result) {
    std::string line;
    line.reserve(1024 + 200 * result.sectors.size());
    ObjectLine object(line);
    object.integer("frame", result.stamp.position);
    object.key("source") += nlohmann::json(result.stamp.name_view())
                                .dump(-1, ' ', true, nlohmann::json::error_handler_t::replace);
    object.integer("utime_us", result.stamp.utime_us);
    object.word("verdict", kVerdictNames[static_cast<std::size_t>(result.verdict)]);
    std::string& reasons = object.key("reasons") += '[';
    for (int i = 0; i < kReasons; ++i) {
        if (!result.reasons.has(static_cast<Reason>(i))) continue;
        if (reasons.back() != '[') reasons += ',';
        ((reasons += '"') += kReasonNames[static_cast<std::size_t>(i)]) += '"';
    }
    reasons += ']';
    append_ground(object.key("ground"), result.ground);
    ObjectLine share(object.key("share"));
    for (std::size_t i = 0; i < result.share.size(); ++i)
        share.number(kTerrainClassNames[i], result.share[i], 6);
    share.close();
    std::string& sectors = object.key("sectors") += '[';
    for (const Sector& sector : result.sectors) {
        if (sectors.back() != '[') sectors += ',';
        append_sector(sectors, sector);
    }
    sectors += ']';
    object.close();
    return line;
}

ResultWriter::ResultWriter(fs::path folder, Counters& counters)
    : folder_(std::move(folder)), counters_(counters) {
    std::error_code error;
    if (!fs::exists(fs::symlink_status(folder_, error))) return;
    if (!fs::is_directory(folder_, error))
        throw Refusal(
            ExitStatus::kInput,
            fmt::format("the output '{}' is no folder; choose a new or an empty folder", folder_.string()));
    const fs::directory_iterator entries(folder_, error);
    if (error)
        throw Refusal(ExitStatus::kInput, fmt::format("the output folder '{}' cannot be read: {}",
                                                      folder_.string(), error.message()));
    if (entries != fs::directory_iterator() && !is_our_result(folder_))
        throw Refusal(ExitStatus::kInput, fmt::format("the output folder '{}' holds something else ({}) and "
                                                      "no earlier result; choose a new or an empty folder",
                                                      folder_.string(), entries->path().filename().string()));
}

ResultWriter::~ResultWriter() {
    close_lines(frames_file_);
    close_lines(timing_file_);
}

void ResultWriter::begin(const nlohmann::ordered_json& summary) {
    try {
        fs::create_directories(folder_);
        // The summary first: from here on the folder is known as ours, whatever happens.
        write_summary(summary, false);
        for (const std::string_view name : kImageFolders) {
            const fs::path images = folder_ / name;
            fs::create_directories(images);
            std::vector<fs::path> earlier;
            for (const fs::directory_entry& entry : fs::directory_iterator(images))
                if (is_our_image(entry.path().filename().string())) earlier.push_back(entry.path());
            for (const fs::path& image : earlier)
                fs::remove(image);
        }
        for (const std::string_view name : kTextFiles)
            fs::remove(folder_ / fmt::format(".{}.tmp", name));
        frames_file_ = open_lines(folder_ / "frames.jsonl");
        timing_file_ = open_lines(folder_ / "timing.jsonl");
    } catch (const std::exception& problem) {
        throw Refusal(ExitStatus::kFailed, problem.what());
    }
}

bool ResultWriter::consume(const FrameResult& result) {
    const std::int64_t start_ns = now_mono_ns();
    try {
        write_images(result);
        append_line(frames_file_, frame_line(result), folder_ / "frames.jsonl");
        append_line(timing_file_, timing_line(result, now_mono_ns() - start_ns), folder_ / "timing.jsonl");
    } catch (const std::exception& problem) {
        error_ = problem.what();
        return false;
    }
    return true;
}

void ResultWriter::write_images(const FrameResult& result) {
    const std::string name = file_name(result.stamp.position);
    const int width = result.disparity.width(), height = result.disparity.height();
    disparity_.width = width;
    disparity_.height = height;
    disparity_.pixels.resize(static_cast<std::size_t>(width) * static_cast<std::size_t>(height));
    std::uint64_t clamped = 0;
    std::uint16_t* value = disparity_.pixels.data();
    for (int y = 0; y < height; ++y) {
        const std::int16_t* disparity = result.disparity.disparity_q4.row(y);
        const Invalid* invalid = result.disparity.invalid.row(y);
        for (int x = 0; x < width; ++x, ++value) {
            const int q8 = disparity[x] * (256 / kDisparityOne);
            const int kept = std::clamp(q8, 1, 65535);
            const bool valid = invalid[x] == Invalid::kNone;
            clamped += valid && kept != q8;
            *value = static_cast<std::uint16_t>(valid ? kept : 0);
        }
    }
    counters_.add(Count::kDisparityClamped, clamped);
    write_png(folder_ / "disparity" / name, disparity_.view());
    write_png(folder_ / "mask" / name, ConstMask(result.mask));
    paint_overlay(result, picture_);
    write_png(folder_ / "overlay" / name, picture_.bgr());
    paint_v_disparity(result, picture_);
    write_png(folder_ / "vdisparity" / name, picture_.bgr());
}

void ResultWriter::write_summary(const nlohmann::ordered_json& summary, bool complete) const {
    nlohmann::ordered_json whole;
    whole[std::string(kOurKey)] = GROUNDLINE_VERSION;
    whole["complete"] = complete;
    for (const auto& [key, value] : summary.items())
        if (!whole.contains(key)) whole[key] = value;
    write_file_whole(folder_ / "summary.json",
                     whole.dump(2, ' ', false, nlohmann::json::error_handler_t::replace) + "\n");
}

void ResultWriter::finish(const nlohmann::ordered_json& summary, bool complete) {
    close_lines(frames_file_);
    close_lines(timing_file_);
    write_summary(summary, complete);
}

}  // namespace groundline::io
