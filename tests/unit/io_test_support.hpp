// What the tests of files share: a folder that goes away, small pictures, and the sentence of a refusal.
#pragma once

#include <gtest/gtest.h>
#include <stdlib.h>

#include <algorithm>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <string>
#include <utility>
#include <vector>

#include "core/error.hpp"
#include "core/image.hpp"
#include "io/png.hpp"

namespace groundline::io::testing {

class TempFolder {
  public:
    TempFolder() {
        std::string pattern = (std::filesystem::temp_directory_path() / "groundline_XXXXXX").string();
        path_ = ::mkdtemp(pattern.data());
    }
    TempFolder(const TempFolder&) = delete;
    TempFolder& operator=(const TempFolder&) = delete;
    ~TempFolder() {
        std::error_code error;
        std::filesystem::remove_all(path_, error);
    }
    std::filesystem::path operator/(const std::filesystem::path& below) const { return path_ / below; }
    const std::filesystem::path& path() const { return path_; }

  private:
    std::filesystem::path path_;
};

inline std::string read_text(const std::filesystem::path& path) {
    std::ifstream file(path, std::ios::binary);
    return {std::istreambuf_iterator<char>(file), {}};
}

inline void write_text(const std::filesystem::path& path, const std::string& text) {
    std::filesystem::create_directories(path.parent_path());
    std::ofstream(path, std::ios::binary) << text;
}

// A grey picture: value + x + 3 y, so that sides, rows and columns cannot be exchanged unseen.
inline Image8 ramp(int width, int height, int value) {
    Image8 image;
    image.width = width;
    image.height = height;
    for (int y = 0; y < height; ++y)
        for (int x = 0; x < width; ++x)
            image.bytes.push_back(static_cast<std::uint8_t>(value + x + 3 * y));
    return image;
}

inline void write_ramp(const std::filesystem::path& path, int width, int height, int value) {
    std::filesystem::create_directories(path.parent_path());
    write_png(path, ramp(width, height, value).luma());
}

// All files below a folder with their contents, sorted: equal before and after means untouched.
inline std::vector<std::string> listing(const std::filesystem::path& folder) {
    std::vector<std::string> names;
    if (std::filesystem::exists(folder))
        for (const auto& entry : std::filesystem::recursive_directory_iterator(folder)) {
            std::string name = entry.path().lexically_relative(folder).string();
            name += entry.is_regular_file() ? '=' : '/';
            if (entry.is_regular_file()) name += read_text(entry.path());
            names.push_back(std::move(name));
        }
    std::sort(names.begin(), names.end());
    return names;
}

inline std::vector<std::string> temporary_files(const std::filesystem::path& folder) {
    std::vector<std::string> names;
    for (const auto& entry : std::filesystem::recursive_directory_iterator(folder))
        if (entry.path().extension() == ".tmp") names.push_back(entry.path().string());
    return names;
}

// The sentence of the Refusal that `action` must throw with `status`.
template <typename Action>
std::string refusal(ExitStatus status, Action action) {
    try {
        action();
    } catch (const Refusal& refused) {
        EXPECT_EQ(static_cast<int>(refused.status()), static_cast<int>(status)) << refused.what();
        const std::string sentence = refused.what();
        EXPECT_EQ(sentence.find('\n'), std::string::npos) << sentence;
        return sentence;
    }
    ADD_FAILURE() << "nothing was refused";
    return {};
}

#define EXPECT_HAS(text, part) EXPECT_NE((text).find(part), std::string::npos) << (text)

}  // namespace groundline::io::testing
