#include "io/video_reader.hpp"

#include <fmt/core.h>

#include <array>
#include <cmath>
#include <opencv2/core.hpp>
#include <opencv2/videoio.hpp>
#include <utility>

#include "core/error.hpp"
#include "io/image_decoder.hpp"
#include "io/pair_list.hpp"

namespace groundline::io {
namespace {

namespace fs = std::filesystem;

// Named, because OpenCV's "any" would also take the name as a numbered image sequence or as a GStreamer
// pipeline description.
constexpr std::array<int, 3> kBackends = {cv::CAP_FFMPEG, cv::CAP_GSTREAMER, cv::CAP_OPENCV_MJPEG};

class VideoReader final : public PairReader {
  public:
    explicit VideoReader(fs::path path) : path_(std::move(path)) {
        cv::Mat first;
        if (!open() || !capture_.read(first) || first.empty())
            throw Refusal(
                ExitStatus::kInput,
                fmt::format("cannot read '{}' as a video: no frame in it can be decoded; expected {}",
                            path_.string(), accepted_layouts()));
        if (first.cols % 2 != 0)
            throw Refusal(ExitStatus::kInput, fmt::format("the video '{}' is {} pixels wide; expected an "
                                                          "even width, left and right view side by side",
                                                          path_.string(), first.cols));
        info_.name = path_.string();
        info_.width = first.cols / 2;
        info_.height = first.rows;
        info_.colour = true;
        const double rate_hz = capture_.get(cv::CAP_PROP_FPS);
        if (std::isfinite(rate_hz) && rate_hz >= 0.1 && rate_hz <= 1000.0) info_.rate_hz = rate_hz;
        const double count = capture_.get(cv::CAP_PROP_FRAME_COUNT);
        if (std::isfinite(count) && count >= 1.0 && count < 1e9) info_.length = std::llround(count);
        if (!rewind())
            throw Refusal(ExitStatus::kInput,
                          fmt::format("the video '{}' cannot be opened a second time", path_.string()));
    }

    const SourceInfo& info() const override { return info_; }
    const std::string& error() const override { return error_; }
    const std::string& note() const override { return note_; }

    bool rewind() override {
        position_ = 0;
        return open();
    }

    Pull next(StereoFrame& frame) override {
        error_.clear();
        try {
            if (!capture_.read(image_) || image_.empty()) return end();
            set_stamp(frame.stamp);
            ++position_;
            if (image_.cols != 2 * info_.width || image_.rows != info_.height || image_.type() != CV_8UC3) {
                error_ = fmt::format(
                    "frame {} of '{}' is {}x{} pixels; expected {}x{} in colour like the first one",
                    position_ - 1, path_.string(), image_.cols, image_.rows, 2 * info_.width, info_.height);
                return Pull::kBad;
            }
            const auto stride = static_cast<std::ptrdiff_t>(image_.step[0]);
            const BgrView left{image_.data, info_.width, info_.height, stride};
            const BgrView right{image_.data + 3 * static_cast<std::ptrdiff_t>(info_.width), info_.width,
                                info_.height, stride};
            luma_from_bgr(left, frame.left);
            luma_from_bgr(right, frame.right);
            if (!frame.left_bgr.empty())
                for (int y = 0; y < info_.height; ++y)
                    std::copy_n(left.row(y), 3 * info_.width, frame.left_bgr.row(y));
        } catch (const std::exception& problem) {
            error_ =
                fmt::format("cannot read frame {} of '{}': {}", position_, path_.string(), problem.what());
            return Pull::kEnd;
        }
        return Pull::kFrame;
    }

  private:
    bool open() {
        for (const int backend : kBackends)
            if (capture_.open(path_.string(), backend)) return true;
        return false;
    }

    // Containers only estimate their number of frames, some by length times rate: what ends a hundredth
    // early has ended, what ends earlier is damaged.
    Pull end() {
        if (position_ < info_.length - 2 - info_.length / 100)
            error_ =
                fmt::format("the video '{}' ends after {} of {} frames; the file is damaged or truncated",
                            path_.string(), position_, info_.length);
        return Pull::kEnd;
    }

    void set_stamp(FrameStamp& stamp) const {
        const bool known = info_.rate_hz > 0.0;
        const double rate_hz = known ? info_.rate_hz : kNominalRateHz;
        stamp.position = position_;
        stamp.exposure_mono_ns =
            static_cast<std::int64_t>(static_cast<double>(position_) * 1e9 / rate_hz + 0.5);
        stamp.utime_us = stamp.exposure_mono_ns / 1000;
        stamp.skew_ns = 0;
        stamp.source = known ? StampSource::kFile : StampSource::kUnknown;
        stamp.set_name(fmt::format("{}#{}", path_.filename().string(), position_));
    }

    fs::path path_;
    cv::VideoCapture capture_;
    cv::Mat image_;
    SourceInfo info_;
    std::int64_t position_ = 0;
    std::string error_;
    std::string note_;
};

}  // namespace

std::unique_ptr<PairReader> open_video(const fs::path& path) {
    try {
        return std::make_unique<VideoReader>(path);
    } catch (const cv::Exception& problem) {
        throw Refusal(ExitStatus::kInput,
                      fmt::format("cannot read '{}' as a video: {}", path.string(), problem.err));
    }
}

}  // namespace groundline::io
