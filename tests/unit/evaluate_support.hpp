// A test that runs commands of the program and keeps what they print and how they end.
#pragma once

#include <gtest/gtest.h>

#include <string>

#include "core/error.hpp"

namespace groundline::cli {

class CommandTest : public testing::Test {
  protected:
    // Returns the status that the command returns or refuses with.
    template <typename Command>
    int kept(Command command) {
        testing::internal::CaptureStdout();
        testing::internal::CaptureStderr();
        int status = -1;
        sentence_.clear();
        try {
            status = command();
        } catch (const Refusal& refusal) {
            status = static_cast<int>(refusal.status());
            sentence_ = refusal.what();
        }
        out_ = testing::internal::GetCapturedStdout();
        err_ = testing::internal::GetCapturedStderr();
        return status;
    }

    std::string out_, err_;
    std::string sentence_;  // of a refusal
};

}  // namespace groundline::cli
