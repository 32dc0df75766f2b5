// What a pair of cameras looks like to the rest of the program, whatever drives it.
#pragma once

#include <array>
#include <cstdint>
#include <string_view>

#include "core/frame.hpp"
#include "core/image.hpp"
#include "verdict/camera_exposure.hpp"
#include "verdict/camera_policy.hpp"

namespace groundline::capture {

using verdict::CameraFault;
using verdict::ExposureValues;

enum class Eye : std::uint8_t {
    kLeft = 0,
    kRight = 1,
    kBoth = 2,  // side by side in one picture
};

// A text with its room inside; what does not fit is cut off.
class Sentence {
  public:
    Sentence() = default;
    Sentence(std::string_view text) {  // NOLINT: implicit on purpose, like a string
        const std::size_t kept = text.size() < text_.size() ? text.size() : text_.size() - 1;
        text.copy(text_.data(), kept);
    }
    [[gnu::format(printf, 1, 2)]] static Sentence of(const char* format, ...);
    std::string_view view() const { return {text_.data()}; }
    const char* c_str() const { return text_.data(); }
    bool empty() const { return text_[0] == '\0'; }

  private:
    std::array<char, 256> text_{};
};

// How a call on a device went. `sentence` is for an operator: which device, what was expected, what to do.
struct Fault {
    CameraFault kind = CameraFault::kNone;
    Sentence sentence;

    bool ok() const { return kind == CameraFault::kNone; }
};

// One picture that waits in a buffer of the driver. The buffer is the caller's until release().
struct CameraFrame {
    Eye eye = Eye::kLeft;
    int buffer = -1;            // the driver's number for it; unique among the frames not yet released
    std::int64_t sequence = 0;  // counts the device's pictures since start(), those lost included
    std::int64_t exposure_mono_ns = 0;  // on CLOCK_MONOTONIC, whatever clock the device stamps with
    StampSource source =
        StampSource::kUnknown;         // what instant that is; kArrival where the device does not say
    std::int64_t arrival_mono_ns = 0;  // when it was taken from the device
    std::int64_t lost = 0;             // pictures missing before this one, by the device's own numbers
    bool damaged = false;              // the device says so; not to be used
};

// Drives one pair of cameras: two devices or one that gives both eyes side by side. One thread uses it. Life:
//
//   open() - start() - wait(), copy(), release() ... - close()        and again from open()
//
// Nothing throws. Whatever fails returns a Fault; after one from any call but copy() and the exposure calls
// the driver is good only for close(), which always leaves everything given back, from any state and on a
// device that is gone. wait(), copy() and release() allocate nothing.
class CameraDriver {
  public:
    enum class Waited : std::uint8_t { kFrame, kNothing, kFault };

    CameraDriver() = default;
    CameraDriver(const CameraDriver&) = delete;
    CameraDriver& operator=(const CameraDriver&) = delete;
    virtual ~CameraDriver() = default;

    // Finds the devices by the names of the setup it was made with, sets format, rate, exposure and takes
    // buffers. May take as long as the devices do (a second and more on USB).
    virtual Fault open() = 0;
    // From now on pictures come.
    virtual Fault start() = 0;
    // Waits for a picture until `deadline_mono_ns`; one that is already there is taken also after it. kFault
    // fills `fault`.
    virtual Waited wait(std::int64_t deadline_mono_ns, CameraFrame& frame, Fault& fault) = 0;
    // Writes one eye's luma of `frame` into `into`, which has the size of one eye: the only copy there is. A
    // picture that cannot be used (cut short, a damaged JPEG) is a fault kFailed that says so; the driver
    // goes on.
    virtual Fault copy(const CameraFrame& frame, Eye eye, Luma into) = 0;
    // Gives the buffer back. What goes wrong here is told by the next wait().
    virtual void release(const CameraFrame& frame) = 0;
    virtual void close() = 0;

    // Buffers that may be held at one time without a device running dry; valid after open().
    virtual int buffers_to_hold() const = 0;
    // One sentence on what was opened: devices, format, size, rate; valid after open().
    virtual std::string_view description() const = 0;
    // Pictures left out since open(): before the first good one (stale or empty buffers).
    virtual std::int64_t left_out() const = 0;

    // Sets what is not NaN, by hand, and ends that eye's automatic for it.
    virtual Fault set_exposure(Eye eye, const ExposureValues& wanted) = 0;
    // What the eye uses now. May take a millisecond on USB: not for every frame.
    virtual ExposureValues read_exposure(Eye eye) = 0;
};

}  // namespace groundline::capture
