// Runs the program `groundline` as a user would and keeps what it said.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

namespace groundline::test {

struct Outcome {
    int status = -1;  // exit status, or 128 + signal
    std::string out;
    std::string err;

    // One sentence for the operator: a single line that begins with the program's name.
    bool one_sentence() const {
        return err.starts_with("groundline: ") && err.find('\n') == err.size() - 1 && err.size() > 20;
    }
};

// The program, the words behind it; in front of it the emulator where this is built for another processor.
std::vector<std::string> command_of(const std::string& program, const std::vector<std::string>& words);

// Waits for the end. Sends SIGINT as soon as there is something in the file `interrupt_at`, where one is
// named.
Outcome run_groundline(const std::vector<std::string>& words, const std::filesystem::path& interrupt_at = {});

// Every file below `folder` with its bytes as one text, for comparing whole results; `without` are left out.
std::string contents(const std::filesystem::path& folder, const std::vector<std::string>& without = {});

// Relative names of all files below `folder`, sorted.
std::vector<std::string> names(const std::filesystem::path& folder);

// A new empty folder for the running test, removed with the object.
class Folder {
  public:
    Folder();
    ~Folder();
    Folder(const Folder&) = delete;
    Folder& operator=(const Folder&) = delete;
    std::filesystem::path operator/(const std::string& name) const { return path_ / name; }
    std::string at(const std::string& name) const { return (path_ / name).string(); }
    const std::filesystem::path& path() const { return path_; }

  private:
    std::filesystem::path path_;
};

void write_text(const std::filesystem::path& file, const std::string& text);

}  // namespace groundline::test
