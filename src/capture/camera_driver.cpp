#include "capture/camera_driver.hpp"

#include <cstdarg>
#include <cstdio>

namespace groundline::capture {

Sentence Sentence::of(const char* format, ...) {
    Sentence sentence;
    va_list arguments;
    va_start(arguments, format);
    std::vsnprintf(sentence.text_.data(), sentence.text_.size(), format, arguments);
    va_end(arguments);
    return sentence;
}

}  // namespace groundline::capture
