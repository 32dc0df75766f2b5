#include "publish/health.hpp"

namespace groundline::publish {
namespace {

constexpr double kNsPerMs = 1e6;
constexpr std::int64_t kRateWindowNs = 1'000'000'000;

double rate_hz(std::uint64_t before, std::uint64_t after, std::int64_t elapsed_ns) {
    return static_cast<double>(after - before) * 1e9 / static_cast<double>(elapsed_ns);
}

// A file's stamps are of another day, and an unknown one may be anything.
bool is_of_this_clock(StampSource source) {
    return source != StampSource::kUnknown && source != StampSource::kFile;
}

}  // namespace

LatencySummary summary_of(const LatencyHistogram& histogram) {
    if (histogram.count() == 0) return {};
    return {static_cast<double>(histogram.percentile_ns(0.50)) / kNsPerMs,
            static_cast<double>(histogram.percentile_ns(0.99)) / kNsPerMs,
            static_cast<double>(histogram.max_ns()) / kNsPerMs};
}

HealthTracker::HealthTracker(const Counters* counters, std::int64_t stale_after_ns)
    : counters_(counters), stale_after_ns_(stale_after_ns) {}

void HealthTracker::note(const FrameResult& result, std::int64_t publish_ns, std::int64_t now_mono_ns) {
    // The result's own time for publishing, if any, is that of the frame before in the same slot.
    constexpr auto kPublish = static_cast<std::size_t>(Stage::kPublish);
    std::int64_t work_ns = publish_ns;
    for (std::size_t stage = 0; stage < stages_.size(); ++stage) {
        if (stage == kPublish || result.times_ns[stage] <= 0) continue;
        stages_[stage].add(result.times_ns[stage]);
        if (stage != static_cast<std::size_t>(Stage::kRead)) work_ns += result.times_ns[stage];
    }
    stages_[kPublish].add(publish_ns);
    all_stages_.add(work_ns);
    if (is_of_this_clock(result.stamp.source))
        exposure_to_publish_.add(now_mono_ns - result.stamp.exposure_mono_ns);

    Note& note = *notes_.begin_write();
    note.published = ++published_;
    note.mono_ns = now_mono_ns;
    const PairEvidence& pair = result.evidence.pair;
    note.epipolar_offset_px = pair.row_features > 0 ? pair.row_offset_px : kNotMeasured;
    HealthReport& report = note.report;
    report.exposure_mono_ns = result.stamp.exposure_mono_ns;
    report.stamp_source = result.stamp.source;
    report.sequence = result.stamp.sequence;
    report.verdict = result.verdict;
    report.reasons = result.reasons;
    report.pair_skew_ms = static_cast<double>(result.stamp.skew_ns) / kNsPerMs;
    report.brightness_gain = result.evidence.photometric.gain;
    report.brightness_offset = result.evidence.photometric.offset;
    notes_.commit();
}

const HealthTracker::Note& HealthTracker::newest_note() {
    if (const Note* note = notes_.newest()) last_ = *note;
    return last_;
}

bool HealthTracker::silent(std::int64_t now_mono_ns) {
    const Note& last = newest_note();
    return last.published == 0 || now_mono_ns - last.mono_ns > stale_after_ns_;
}

HealthTracker::Totals HealthTracker::totals(std::int64_t now_mono_ns, std::uint64_t published) const {
    Totals now{now_mono_ns, 0, 0, published};
    if (counters_ != nullptr) {
        now.read = counters_->get(Count::kFramesRead);
        now.processed = counters_->get(Count::kFramesProcessed);
    }
    return now;
}

void HealthTracker::update_rates(std::int64_t now_mono_ns, std::uint64_t published) {
    const Totals now = totals(now_mono_ns, published);
    const std::int64_t elapsed_ns = now_mono_ns - window_.mono_ns;
    if (window_open_ && elapsed_ns < kRateWindowNs) return;
    if (window_open_) {
        publish_rate_hz_ = rate_hz(window_.published, now.published, elapsed_ns);
        if (counters_ != nullptr) {
            source_rate_hz_ = rate_hz(window_.read, now.read, elapsed_ns);
            process_rate_hz_ = rate_hz(window_.processed, now.processed, elapsed_ns);
        }
    }
    window_ = now;
    window_open_ = true;
}

HealthReport HealthTracker::report(std::int64_t now_utime_us, std::int64_t now_mono_ns) {
    const bool no_pairs = silent(now_mono_ns);
    update_rates(now_mono_ns, last_.published);
    HealthReport report = last_.report;
    report.utime_us = now_utime_us;
    report.host = host_;
    report.camera = camera_;
    if (last_.published > 0) report.host.epipolar_offset_px = last_.epipolar_offset_px;
    report.source_rate_hz = source_rate_hz_;
    report.process_rate_hz = process_rate_hz_;
    report.publish_rate_hz = publish_rate_hz_;
    report.state = stopping_              ? LifeState::kStopping
                   : last_.published == 0 ? LifeState::kStarting
                   : no_pairs             ? LifeState::kStalled
                                          : LifeState::kRunning;
    if (last_.published > 0) report.result_age_s = static_cast<double>(now_mono_ns - last_.mono_ns) / 1e9;
    if (no_pairs) {
        report.verdict = Verdict::kBlind;
        report.reasons = Reasons();
        report.reasons.add(Reason::kNoFrames);
    }
    if (camera_.out_of_step) {
        report.reasons.add(Reason::kUnsynchronised);
        report.pair_skew_ms = camera_.skew_ms;
        if (report.verdict == Verdict::kTrusted) report.verdict = Verdict::kDegraded;
    }
    for (std::size_t stage = 0; stage < stages_.size(); ++stage)
        report.stages[stage] = summary_of(stages_[stage]);
    report.all_stages = summary_of(all_stages_);
    report.exposure_to_publish = summary_of(exposure_to_publish_);
    if (counters_ != nullptr)
        for (std::size_t which = 0; which < report.counts.size(); ++which)
            report.counts[which] = static_cast<std::int64_t>(counters_->get(static_cast<Count>(which)));
    return report;
}

}  // namespace groundline::publish
