// The documented exit statuses, and the one exception: a refusal before the first frame.
#pragma once

#include <stdexcept>
#include <string>

namespace groundline {

enum class ExitStatus : int {
    kDone = 0,
    kFailed = 1,         // failed at run time
    kUsage = 2,          // command-line misuse
    kInput = 66,         // input missing or unreadable
    kConfig = 78,        // configuration or calibration refused
    kInterrupted = 130,  // ended by Ctrl-C, with what was done written
};

// Thrown only before the first frame. The message is one sentence an operator can act on: what, where
// (file:line, device), what was expected, what to do.
class Refusal : public std::runtime_error {
  public:
    Refusal(ExitStatus status, const std::string& sentence) : std::runtime_error(sentence), status_(status) {}
    ExitStatus status() const { return status_; }

  private:
    ExitStatus status_;
};

}  // namespace groundline
