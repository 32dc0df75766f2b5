#include "io/pair_reader.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <array>
#include <fstream>
#include <stdexcept>
#include <utility>

#include "core/error.hpp"
#include "io/image_decoder.hpp"
#include "io/image_integrity.hpp"
#include "io/pair_list.hpp"
#include "io/video_reader.hpp"

namespace groundline::io {
namespace {

namespace fs = std::filesystem;

std::string size_text(int width, int height) {
    return fmt::format("{}x{}", width, height);
}

// The middle one of the intervals: a pause in a recording does not change it.
double median_rate_hz(const std::vector<PairFiles>& pairs) {
    std::vector<std::int64_t> intervals_ns;
    for (std::size_t i = 1; i < pairs.size(); ++i)
        intervals_ns.push_back(pairs[i].stamp_ns - pairs[i - 1].stamp_ns);
    if (intervals_ns.empty()) return 0.0;
    const auto middle = intervals_ns.begin() + static_cast<std::ptrdiff_t>(intervals_ns.size() / 2);
    std::nth_element(intervals_ns.begin(), middle, intervals_ns.end());
    return *middle > 0 ? 1e9 / static_cast<double>(*middle) : 0.0;
}

class ImagePairReader final : public PairReader {
  public:
    ImagePairReader(PairList list, std::string name) : list_(std::move(list)) {
        const PairFiles& first = list_.pairs.front();
        try {
            const ImageShape left = left_.load(first.left);
            const ImageShape right = right_.load(first.right);
            if (!left.same_size(right))
                throw std::runtime_error(fmt::format(
                    "the left image '{}' has {} pixels, the right one '{}' {}; expected the same size",
                    first.left.string(), size_text(left.width, left.height), first.right.string(),
                    size_text(right.width, right.height)));
            info_.width = left.width;
            info_.height = left.height;
            info_.colour = left.colour;
        } catch (const std::runtime_error& problem) {
            throw Refusal(ExitStatus::kInput, problem.what());
        }
        info_.name = std::move(name);
        info_.length = static_cast<std::int64_t>(list_.pairs.size());
        if (list_.stamped) info_.rate_hz = median_rate_hz(list_.pairs);
    }

    const SourceInfo& info() const override { return info_; }
    const std::string& error() const override { return error_; }
    const std::string& note() const override { return list_.note; }

    bool rewind() override {
        position_ = 0;
        return true;
    }

    Pull next(StereoFrame& frame) override {
        error_.clear();
        if (position_ >= list_.pairs.size()) return Pull::kEnd;
        const PairFiles& pair = list_.pairs[position_];
        set_stamp(pair, frame.stamp);
        ++position_;
        try {
            load(left_, pair.left);
            load(right_, pair.right);
            left_.copy_luma(frame.left);
            right_.copy_luma(frame.right);
            if (!frame.left_bgr.empty()) left_.copy_bgr(frame.left_bgr);
        } catch (const std::exception& problem) {
            error_ = problem.what();
            return Pull::kBad;
        }
        return Pull::kFrame;
    }

  private:
    void set_stamp(const PairFiles& pair, FrameStamp& stamp) const {
        stamp.position = static_cast<std::int64_t>(position_);
        stamp.exposure_mono_ns =
            list_.stamped ? pair.stamp_ns
                          : static_cast<std::int64_t>(static_cast<double>(position_) * 1e9 / kNominalRateHz);
        stamp.utime_us = stamp.exposure_mono_ns / 1000;
        stamp.skew_ns = pair.skew_ns;
        stamp.source = list_.stamped ? StampSource::kFile : StampSource::kUnknown;
        stamp.set_name(pair.left.filename().string());
    }

    void load(ImageDecoder& decoder, const fs::path& path) const {
        const ImageShape shape = decoder.load(path);
        if (shape.width != info_.width || shape.height != info_.height)
            throw std::runtime_error(
                fmt::format("the image '{}' has {} pixels; expected {} like the first pair", path.string(),
                            size_text(shape.width, shape.height), size_text(info_.width, info_.height)));
    }

    PairList list_;
    SourceInfo info_;
    ImageDecoder left_;
    ImageDecoder right_;
    std::size_t position_ = 0;
    std::string error_;
};

// By its first bytes: a video may be larger than memory.
bool is_image(const fs::path& path) {
    std::ifstream file(path, std::ios::binary);
    std::array<char, 16> head{};
    file.read(head.data(), head.size());
    if (file.gcount() == 0)
        throw Refusal(ExitStatus::kInput, fmt::format("the file '{}' is empty or cannot be read; expected {}",
                                                      path.string(), accepted_layouts()));
    return looks_like_image(
        {reinterpret_cast<const std::uint8_t*>(head.data()), static_cast<std::size_t>(file.gcount())});
}

void require_known(const fs::path& path) {
    std::error_code error;
    if (!fs::exists(path, error))
        throw Refusal(ExitStatus::kInput, fmt::format("there is no file or folder '{}'; expected {}",
                                                      path.string(), accepted_layouts()));
}

}  // namespace

OpenedPairs open_pairs(const std::vector<std::string>& words) {
    if (words.size() == 2) {
        for (const std::string& word : words) {
            require_known(word);
            if (fs::is_directory(word))
                throw Refusal(ExitStatus::kInput,
                              fmt::format("'{}' is a folder where one of two images was expected; name the "
                                          "folder that holds both sides",
                                          word));
        }
        PairList list = list_two_images(words[0], words[1]);
        const fs::path folder = list.folder;
        return {std::make_unique<ImagePairReader>(std::move(list), fmt::format("{} {}", words[0], words[1])),
                folder, false};
    }
    if (words.size() != 1)
        throw Refusal(ExitStatus::kUsage,
                      fmt::format("a source has one or two words; expected {}", accepted_layouts()));
    const fs::path path = words[0];
    require_known(path);
    if (fs::is_directory(path)) {
        PairList list = list_pairs(path);
        const bool colour_pair = list.colour_pair;
        return {std::make_unique<ImagePairReader>(std::move(list), words[0]), path, colour_pair};
    }
    if (is_image(path))
        throw Refusal(ExitStatus::kInput, fmt::format("'{}' is one image; expected a left and a right image, "
                                                      "or a folder or video that holds both sides",
                                                      path.string()));
    const fs::path folder = path.parent_path();
    return {open_video(path), folder.empty() ? fs::path(".") : folder, false};
}

}  // namespace groundline::io
