#include "verdict/camera_policy.hpp"

#include <algorithm>

namespace groundline::verdict {
namespace {

using Kind = CameraEvent::Kind;

std::int64_t wait_after(int failures, std::int64_t longest_ns, const CameraLimits& limits) {
    std::int64_t wait_ns = limits.first_retry_ns;
    for (int i = 1; i < failures && wait_ns < longest_ns; ++i)
        wait_ns *= 2;
    return std::min(wait_ns, longest_ns);
}

void tell(CameraStep& step) {
    const CameraNews news{step.life.state, step.life.fault, step.life.silent_eye};
    step.say = news != step.life.said;
    step.life.said = news;
}

void give_up(CameraStep& step, CameraState state, std::int64_t now_ns, const CameraLimits& limits) {
    CameraLife& life = step.life;
    step.action = CameraAction::kClose;  // also after a failed opening, which may have got half way
    life.state = state;
    if (state == CameraState::kAbsent) life.failures = 0;
    life.retry_ns = now_ns + (state == CameraState::kAbsent
                                  ? wait_after(++life.absences, limits.longest_absent_retry_ns, limits)
                                  : wait_after(++life.failures, limits.longest_retry_ns, limits));
    tell(step);
}

void stall(CameraStep& step, std::array<bool, 2> silent, std::int64_t now_ns, const CameraLimits& limits) {
    step.life.fault = CameraFault::kNone;
    step.life.silent_eye = silent[0] && silent[1] ? 2 : silent[1] ? 1 : 0;
    give_up(step, CameraState::kStalled, now_ns, limits);
}

void on_tick(CameraStep& step, std::int64_t now_ns, const CameraLimits& limits) {
    const CameraLife& life = step.life;
    if (life.closed()) {
        if (now_ns >= life.retry_ns) step.action = CameraAction::kOpen;
        return;
    }
    if (life.state == CameraState::kStarting) {
        if (now_ns - life.since_ns > limits.start_ns)
            stall(step, {!life.seen[0], !life.seen[1]}, now_ns, limits);
        return;
    }
    const auto silent = [&](std::size_t eye) { return now_ns - life.picture_ns[eye] > limits.stall_ns; };
    if (silent(0) || silent(1)) stall(step, {silent(0), silent(1)}, now_ns, limits);
}

void on_picture(CameraStep& step, int eye, std::int64_t now_ns, const CameraLimits& limits) {
    CameraLife& life = step.life;
    for (int each = 0; each < 2; ++each) {
        if (eye != each && eye != 2) continue;
        life.seen[static_cast<std::size_t>(each)] = true;
        life.picture_ns[static_cast<std::size_t>(each)] = now_ns;
    }
    if (life.state == CameraState::kStarting && life.seen[0] && life.seen[1]) {
        life.state = CameraState::kRunning;
        life.since_ns = now_ns;
        life.picture_ns = {now_ns, now_ns};
        life.fault = CameraFault::kNone;
        life.silent_eye = -1;
        tell(step);
    }
    const std::int64_t both_until_ns = std::min(life.picture_ns[0], life.picture_ns[1]);
    if (life.state == CameraState::kRunning && both_until_ns - life.since_ns >= limits.steady_ns)
        life.failures = 0;
}

}  // namespace

CameraStep step(const CameraLife& life, const CameraEvent& event, std::int64_t now_mono_ns,
                const CameraLimits& limits) {
    CameraStep step;
    step.life = life;
    switch (event.kind) {
        case Kind::kTick:
            on_tick(step, now_mono_ns, limits);
            break;
        case Kind::kPicture:
            on_picture(step, event.eye, now_mono_ns, limits);
            break;
        case Kind::kOpened:
            step.life.state = CameraState::kStarting;
            step.life.since_ns = now_mono_ns;
            step.life.seen = {};
            step.life.absences = 0;
            break;
        case Kind::kFault:
            step.life.fault = event.fault;
            step.life.silent_eye = -1;
            give_up(step,
                    event.fault == CameraFault::kAbsent ? CameraState::kAbsent : CameraState::kBackingOff,
                    now_mono_ns, limits);
            break;
    }
    return step;
}

}  // namespace groundline::verdict
