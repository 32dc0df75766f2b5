// The life of a pair of cameras: when to open, when to give up waiting, how long to leave a device alone.
#pragma once

#include <array>
#include <cstdint>
#include <string_view>

namespace groundline::verdict {

// What a device can answer with. kNone: it did what was asked.
enum class CameraFault : std::uint8_t {
    kNone,
    kAbsent,   // no such device (any more)
    kBusy,     // another program has it
    kRefused,  // it is there, but not for us: no permission, another size or format
    kFailed,   // it was there and gave an error
};
inline constexpr std::array<std::string_view, 5> kCameraFaultNames = {"none", "absent", "busy", "refused",
                                                                      "failed"};

enum class CameraState : std::uint8_t {
    kAbsent,      // closed: not there; tried again and again
    kBackingOff,  // closed: there, but not to be had, or broken; tried again later
    kStalled,     // closed: gave no picture for too long; opened again later
    kStarting,    // open; not both eyes have given a picture yet
    kRunning,     // both do
};
inline constexpr std::array<std::string_view, 5> kCameraStateNames = {"absent", "backing_off", "stalled",
                                                                      "starting", "running"};

struct CameraLimits {
    // From the start to the first picture of both eyes: cameras that warm up, boot or renegotiate take
    // seconds.
    std::int64_t start_ns = 10'000'000'000;
    // Between two pictures of one eye, after that.
    std::int64_t stall_ns = 2'000'000'000;
    // Back-off: the first wait, doubled with each failure up to the longest. What is not there costs one
    // system call to look for and shall be back soon after it is; what fails may need rest.
    std::int64_t first_retry_ns = 250'000'000;
    std::int64_t longest_absent_retry_ns = 1'000'000'000;
    std::int64_t longest_retry_ns = 4'000'000'000;
    // Good pictures of both eyes for this long forgive all failures: what an opening was good for. Less, and
    // a device that dies as soon as it runs would be opened four times a second for ever.
    std::int64_t steady_ns = 1'000'000'000;
};

enum class CameraAction : std::uint8_t {
    kNone,
    kOpen,   // open and start the devices, then report kOpened or kFault
    kClose,  // close them in full
};

struct CameraEvent {
    enum class Kind : std::uint8_t {
        kTick,     // nothing came; time has passed
        kOpened,   // kOpen was done
        kPicture,  // a good picture of one eye (0 left, 1 right) or of both (2)
        kFault,    // from opening or from running
    };
    Kind kind = Kind::kTick;
    int eye = 0;                               // of kPicture
    CameraFault fault = CameraFault::kFailed;  // of kFault

    static CameraEvent tick() { return {}; }
    static CameraEvent opened() { return {Kind::kOpened}; }
    static CameraEvent picture(int eye) { return {Kind::kPicture, eye}; }
    static CameraEvent failed(CameraFault fault) { return {Kind::kFault, 0, fault}; }
};

// What an operator is told, once.
struct CameraNews {
    CameraState state = CameraState::kStarting;
    CameraFault fault = CameraFault::kNone;
    int silent_eye = -1;  // with kStalled: 0 left, 1 right, 2 both
    bool operator==(const CameraNews&) const = default;
};

struct CameraLife {
    CameraState state = CameraState::kAbsent;
    CameraFault fault = CameraFault::kNone;  // of the last failure
    int silent_eye = -1;                     // of the last stall
    int absences = 0;                        // times it was not there, since it last was
    int failures = 0;                        // other faults and stalls, since it ran steadily or was gone
    std::int64_t since_ns = 0;               // with kStarting and kRunning: when that began
    std::int64_t retry_ns = 0;               // closed: when to open
    std::array<bool, 2> seen{};              // since the start
    std::array<std::int64_t, 2> picture_ns{};
    CameraNews said;

    bool closed() const { return state < CameraState::kStarting; }
};

struct CameraStep {
    CameraLife life;
    CameraAction action = CameraAction::kNone;
    bool say = false;  // life.said is news
};

// A new life wants to open at its first tick. Pure. `now_mono_ns` may be any clock that does not go back.
// - A stall is seen only at a tick: whoever calls takes first what the devices have ready, so that a caller
// that was
//   itself held up finds no stall.
// - Every fault and stall leads to kClose, then, after a wait, to kOpen: nothing is mended half. After steady
//   running the wait is the first and shortest, whatever the fault: an unplugged camera may say anything.
//   Found absent, a device is another one when it is back, without failures.
// - News are kRunning, faults and stalls; the same as last told are not told again, so that a device that
// stays away is
//   one line.
CameraStep step(const CameraLife& life, const CameraEvent& event, std::int64_t now_mono_ns,
                const CameraLimits& limits);

}  // namespace groundline::verdict
