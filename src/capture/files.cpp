#include "capture/files.hpp"

#include <utility>

namespace groundline::capture {
namespace {

class FilesSource final : public FrameSource {
  public:
    explicit FilesSource(std::unique_ptr<io::PairReader> reader) : reader_(std::move(reader)) {}

    const SourceInfo& info() const override { return reader_->info(); }
    const std::string& error() const override { return reader_->error(); }
    bool rewind() override { return reader_->rewind(); }

    Pull next(StereoFrame& frame) override {
        const Pull pull = reader_->next(frame);
        frame.stamp.sequence = sequence_;
        if (pull == Pull::kFrame) ++sequence_;
        return pull;
    }

  private:
    std::unique_ptr<io::PairReader> reader_;
    std::int64_t sequence_ = 0;
};

}  // namespace

std::unique_ptr<FrameSource> open_files(const std::vector<std::string>& source) {
    return files_source(io::open_pairs(source).reader);
}

std::unique_ptr<FrameSource> files_source(std::unique_ptr<io::PairReader> reader) {
    return std::make_unique<FilesSource>(std::move(reader));
}

}  // namespace groundline::capture
