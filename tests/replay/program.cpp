#include "replay/program.hpp"

#include <fcntl.h>
#include <gtest/gtest.h>
#include <poll.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <csignal>
#include <fstream>
#include <iterator>
#include <sstream>
#include <thread>

namespace groundline::test {

std::vector<std::string> command_of(const std::string& program, const std::vector<std::string>& words) {
    std::istringstream emulator(GROUNDLINE_EMULATOR);
    std::vector<std::string> command{std::istream_iterator<std::string>(emulator), {}};
    command.push_back(program);
    command.insert(command.end(), words.begin(), words.end());
    return command;
}

Outcome run_groundline(const std::vector<std::string>& words, const std::filesystem::path& interrupt_at) {
    std::array<int, 2> out{};
    std::array<int, 2> err{};
    if (pipe(out.data()) != 0 || pipe(err.data()) != 0) return {};
    const std::vector<std::string> command = command_of(GROUNDLINE_PROGRAM, words);
    std::vector<char*> arguments;
    arguments.reserve(command.size() + 1);
    for (const std::string& word : command)
        arguments.push_back(const_cast<char*>(word.c_str()));
    arguments.push_back(nullptr);
    const pid_t child = fork();
    if (child == 0) {
        dup2(out[1], STDOUT_FILENO);
        dup2(err[1], STDERR_FILENO);
        for (const int end : {out[0], out[1], err[0], err[1]})
            close(end);
        execv(arguments.front(), arguments.data());
        _exit(127);
    }
    close(out[1]);
    close(err[1]);
    std::jthread interrupter;
    if (!interrupt_at.empty())
        interrupter = std::jthread([=](const std::stop_token& ended) {
            std::error_code absent;
            while (!ended.stop_requested() && (!std::filesystem::exists(interrupt_at, absent) ||
                                               std::filesystem::file_size(interrupt_at, absent) == 0))
                std::this_thread::sleep_for(std::chrono::milliseconds(10));
            if (!ended.stop_requested()) kill(child, SIGINT);
        });
    Outcome outcome;
    std::array<pollfd, 2> open{{{out[0], POLLIN, 0}, {err[0], POLLIN, 0}}};
    for (int left = 2; left > 0;) {
        if (poll(open.data(), open.size(), -1) < 0) continue;
        for (std::size_t i = 0; i < open.size(); ++i) {
            if (open[i].fd < 0 || open[i].revents == 0) continue;
            std::array<char, 4096> buffer{};
            const ssize_t got = read(open[i].fd, buffer.data(), buffer.size());
            if (got > 0) {
                (i == 0 ? outcome.out : outcome.err).append(buffer.data(), static_cast<std::size_t>(got));
            } else {
                close(open[i].fd);
                open[i].fd = -1;
                --left;
            }
        }
    }
    interrupter.request_stop();
    if (interrupter.joinable()) interrupter.join();
    int status = 0;
    waitpid(child, &status, 0);
    outcome.status = WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status);
    return outcome;
}

std::vector<std::string> names(const std::filesystem::path& folder) {
    std::vector<std::string> found;
    if (!std::filesystem::exists(folder)) return found;
    for (const auto& entry : std::filesystem::recursive_directory_iterator(folder))
        if (entry.is_regular_file()) found.push_back(entry.path().lexically_relative(folder).string());
    std::sort(found.begin(), found.end());
    return found;
}

std::string contents(const std::filesystem::path& folder, const std::vector<std::string>& without) {
    std::ostringstream all;
    for (const std::string& name : names(folder)) {
        if (std::find(without.begin(), without.end(), name) != without.end()) continue;
        all << name << '\n' << std::ifstream(folder / name, std::ios::binary).rdbuf() << '\n';
    }
    return all.str();
}

Folder::Folder() {
    std::string name = (std::filesystem::temp_directory_path() / "groundline-test-XXXXXX").string();
    if (mkdtemp(name.data()) == nullptr) throw std::runtime_error("no temporary folder");
    path_ = name;
}

Folder::~Folder() {
    std::error_code ignored;
    std::filesystem::remove_all(path_, ignored);
}

void write_text(const std::filesystem::path& file, const std::string& text) {
    std::filesystem::create_directories(file.parent_path());
    std::ofstream(file, std::ios::binary) << text;
}

}  // namespace groundline::test
