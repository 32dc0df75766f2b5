// Writes results into a folder: images per frame, lines per frame, one summary.
#pragma once

#include <filesystem>
#include <nlohmann/json_fwd.hpp>
#include <string>

#include "core/counters.hpp"
#include "core/sink.hpp"
#include "io/png.hpp"

namespace groundline::io {

// One object of frames.jsonl without its line end: keys and decimals fixed, independent of the locale, so
// that equal results are equal bytes. Degrees and metres; null where there is no value.
std::string frame_line(const FrameResult& result);

// Used by one thread. Each image and the summary appear whole under their name; each line of frames.jsonl and
// timing.jsonl goes out in one write, so a killed run leaves whole lines and a summary that says
// "complete": false.
class ResultWriter final : public Sink {
  public:
    // Only looks: `folder` must not exist, be empty, or hold an earlier result of ours, known by the key
    // "groundline" in its summary.json. Throws Refusal(kInput) otherwise. Disparities outside what the file
    // can hold are counted in `counters` (borrowed) as kDisparityClamped.
    ResultWriter(std::filesystem::path folder, Counters& counters);
    ~ResultWriter() override;

    // Creates the folders, takes away what an earlier result left under our names and writes a first
    // summary.json: `summary` with "complete": false. Throws Refusal(kFailed).
    void begin(const nlohmann::ordered_json& summary);
    // After begin(): disparity, mask, overlay, v-disparity and the two lines of one frame, named by its
    // position in the source.
    bool consume(const FrameResult& result) override;
    const std::string& error() const override { return error_; }
    // Closes the line files and replaces summary.json. Throws std::runtime_error.
    void finish(const nlohmann::ordered_json& summary, bool complete);

    const std::filesystem::path& folder() const { return folder_; }

  private:
    void write_images(const FrameResult& result);
    void write_summary(const nlohmann::ordered_json& summary, bool complete) const;

    std::filesystem::path folder_;
    Counters& counters_;
    int frames_file_ = -1;
    int timing_file_ = -1;
    Image16 disparity_;
    Image8 picture_;
    std::string error_;
};

}  // namespace groundline::io
