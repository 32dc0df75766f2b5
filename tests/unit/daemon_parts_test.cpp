// Parts of the daemon by themselves: the sentence of its status, the computer's sensors, the manager's
// socket.
#include <gtest/gtest.h>
#include <sys/prctl.h>
#include <sys/ptrace.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <atomic>
#include <chrono>
#include <cmath>
#include <csignal>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <thread>

#include "daemon/host_health.hpp"
#include "daemon/log.hpp"
#include "daemon/service_manager.hpp"
#include "daemon/status.hpp"
#include "daemon/threads.hpp"

namespace groundline::daemon {
namespace {

namespace fs = std::filesystem;
using publish::HealthReport;
using publish::LifeState;

HealthReport report(LifeState state, Verdict verdict, std::initializer_list<Reason> reasons) {
    HealthReport report;
    report.state = state;
    report.verdict = verdict;
    for (const Reason reason : reasons)
        report.reasons.add(reason);
    report.publish_rate_hz = 29.84;
    report.result_age_s = 12.3;
    return report;
}

TEST(Status, IsOneSentence) {
    EXPECT_EQ(status_of(report(LifeState::kStarting, Verdict::kBlind, {Reason::kNoFrames})),
              "waiting for pairs");
    HealthReport none = report(LifeState::kStalled, Verdict::kBlind, {Reason::kNoFrames});
    EXPECT_EQ(status_of(none), "no pairs for 12 s, waiting for pairs");
    none.camera.state = verdict::CameraState::kStarting;
    EXPECT_EQ(status_of(none), "no pairs for 12 s, waiting for cameras");
    none.camera.state = verdict::CameraState::kRunning;
    EXPECT_EQ(status_of(none), "no pairs for 12 s, waiting for pairs");
    none.counts[static_cast<std::size_t>(Count::kFramesBad)] = 3;
    EXPECT_EQ(status_of(none), "no pairs for 12 s, the pictures cannot be read");
    none.camera.out_of_step = true;
    EXPECT_EQ(status_of(none), "no pairs for 12 s, the cameras are out of step");
    none.camera.state = verdict::CameraState::kAbsent;
    EXPECT_EQ(status_of(none), "no pairs for 12 s, waiting for cameras");
    EXPECT_EQ(status_of(report(LifeState::kStopping, Verdict::kBlind, {})), "stopping");
    EXPECT_EQ(status_of(report(LifeState::kRunning, Verdict::kTrusted, {Reason::kNoMountPrior})),
              "running: 29.8 pairs/s, trusted");
    EXPECT_EQ(status_of(report(LifeState::kRunning, Verdict::kDegraded,
                               {Reason::kNoMountPrior, Reason::kDark, Reason::kOverload})),
              "running: 29.8 pairs/s, degraded (dark, overload)");
    EXPECT_EQ(status_of(report(LifeState::kRunning, Verdict::kTrusted, {Reason::kOverload})),
              "running: 29.8 pairs/s, trusted");
    HealthReport first = report(LifeState::kRunning, Verdict::kTrusted, {});
    first.publish_rate_hz = publish::kNotMeasured;
    EXPECT_EQ(status_of(first), "running: trusted");
}

class Sys : public testing::Test {
  protected:
    void SetUp() override {
        std::string name = (fs::temp_directory_path() / "groundline-sys-XXXXXX").string();
        root_ = mkdtemp(name.data());
    }
    void TearDown() override { fs::remove_all(root_); }
    void write(const std::string& file, const std::string& text) {
        fs::create_directories((root_ / file).parent_path());
        std::ofstream(root_ / file) << text << "\n";
    }
    publish::HostHealth read() const {
        publish::HostHealth host;
        HostSensors(root_).read(host);
        return host;
    }
    fs::path root_;
};

TEST_F(Sys, NothingThereIsNotMeasured) {
    EXPECT_TRUE(std::isnan(read().temperature_c));
    EXPECT_EQ(read().throttled, -1);
}

TEST_F(Sys, TheHottestZoneCounts) {
    write("class/thermal/thermal_zone0/temp", "48312");
    write("class/thermal/thermal_zone1/temp", "61500");
    write("class/thermal/thermal_zone2/temp", "-274000");  // off
    write("class/thermal/thermal_zone3/temp", "broken");
    write("class/thermal/cooling_device0/temp", "99000");
    EXPECT_EQ(read().temperature_c, 61.5);
}

TEST_F(Sys, AProcessorBelowWhatItCanDoIsThrottled) {
    write("devices/system/cpu/cpufreq/policy0/scaling_max_freq", "1800000");
    write("devices/system/cpu/cpufreq/policy0/cpuinfo_max_freq", "1800000");
    EXPECT_EQ(read().throttled, 0);
    write("devices/system/cpu/cpufreq/policy4/scaling_max_freq", "1500000");
    write("devices/system/cpu/cpufreq/policy4/cpuinfo_max_freq", "2400000");
    EXPECT_EQ(read().throttled, 1);
}

TEST_F(Sys, TheFirmwareKnowsBetterThanFrequencies) {
    write("devices/system/cpu/cpufreq/policy0/scaling_max_freq", "1500000");
    write("devices/system/cpu/cpufreq/policy0/cpuinfo_max_freq", "1800000");
    const char* firmware = "devices/platform/soc/soc:firmware/get_throttled";
    write(firmware, "50000");  // was so since the start, is not now
    EXPECT_EQ(read().throttled, 0);
    write(firmware, "50005");
    EXPECT_EQ(read().throttled, 1);
}

// A socket of the manager's at that address ('@' first: abstract), and what comes in.
class Manager {
  public:
    explicit Manager(const std::string& address) : socket_(socket(AF_UNIX, SOCK_DGRAM, 0)) {
        sockaddr_un name{};
        name.sun_family = AF_UNIX;
        address.copy(name.sun_path, address.size());
        if (address[0] == '@') name.sun_path[0] = '\0';
        const auto length = static_cast<socklen_t>(offsetof(sockaddr_un, sun_path) + address.size());
        EXPECT_EQ(bind(socket_, reinterpret_cast<const sockaddr*>(&name), length), 0);
    }
    ~Manager() { close(socket_); }
    Manager(const Manager&) = delete;
    Manager& operator=(const Manager&) = delete;
    std::string next() const {
        std::array<char, 256> buffer{};
        const ssize_t got = recv(socket_, buffer.data(), buffer.size(), MSG_DONTWAIT);
        return {buffer.data(), static_cast<std::size_t>(got > 0 ? got : 0)};
    }

  private:
    int socket_;
};

void set(const char* name, const std::string& value) {
    ASSERT_EQ(setenv(name, value.c_str(), 1), 0);
}

TEST(ServiceManager, IsToldAtAPathAndAtAnAbstractAddress) {
    const std::string number = std::to_string(getpid());
    for (const std::string& address :
         {(fs::temp_directory_path() / ("groundline-notify-" + number)).string(), "@groundline-" + number}) {
        const Manager manager(address);
        set("NOTIFY_SOCKET", address);
        set("WATCHDOG_USEC", "3000000");
        set("WATCHDOG_PID", number);
        const ServiceManager service;
        EXPECT_EQ(std::getenv("NOTIFY_SOCKET"), nullptr) << "no child may see it";
        EXPECT_EQ(std::getenv("WATCHDOG_USEC"), nullptr);
        EXPECT_EQ(service.watchdog_ns(), 3'000'000'000);
        EXPECT_TRUE(service.tell("READY=1\nSTATUS=x")) << address;
        EXPECT_EQ(manager.next(), "READY=1\nSTATUS=x");
        fs::remove(address);
    }
}

TEST(ServiceManager, IsNotThere) {
    for (const std::string& address :
         {std::string(), std::string("relative"), std::string("@"), std::string(200, '/')}) {
        set("NOTIFY_SOCKET", address);
        EXPECT_TRUE(ServiceManager().tell("READY=1")) << address;
    }
    unsetenv("NOTIFY_SOCKET");
    EXPECT_TRUE(ServiceManager().tell("READY=1"));
    set("NOTIFY_SOCKET", "/nonexistent/notify");
    EXPECT_FALSE(ServiceManager().tell("READY=1")) << "it was there once, and may be back";
}

TEST(ServiceManager, SaysWhatItCouldNotTell) {
    const std::string address = "@groundline-full-" + std::to_string(getpid());
    const Manager manager(address);
    set("NOTIFY_SOCKET", address);
    const ServiceManager service;
    int told = 0;
    while (told < 100'000 && service.tell("WATCHDOG=1"))
        ++told;
    ASSERT_LT(told, 100'000) << "nobody reads, and yet there is room";
    EXPECT_EQ(manager.next(), "WATCHDOG=1");
    EXPECT_TRUE(service.tell("READY=1"));
}

// A reader of the log that stops costs lines, never time, and how many is known.
TEST(Log, CountsTheLinesThatNobodyTook) {
    std::array<int, 2> ends{};
    ASSERT_EQ(pipe(ends.data()), 0);
    const int before = dup(2);
    dup2(ends[1], 2);
    const std::size_t lost_before = lost_lines();
    for (int i = 0; i < 2000; ++i)  // 200 KB: a pipe holds 64 KB
        log().info("{}", std::string(100, 'x'));
    const std::size_t lost = lost_lines() - lost_before;
    dup2(before, 2);
    close(before);
    close(ends[1]);
    std::array<char, 4096> taken{};
    while (read(ends[0], taken.data(), taken.size()) > 0) {
    }
    close(ends[0]);
    close_log();
    EXPECT_GT(lost, 0U);
    EXPECT_LT(lost, 2000U);
}

// Stopped by another process for as long as it lives.
TEST(Threads, OnlyOneThatIsStoppedCounts) {
    std::array<int, 2> ends{};
    ASSERT_EQ(pipe(ends.data()), 0);
    std::atomic<pid_t> waiting{0};
    std::jthread waits([&] {
        waiting = gettid();
        char byte = 0;
        EXPECT_EQ(read(ends[0], &byte, 1), 1);
    });
    while (waiting == 0)
        std::this_thread::yield();
    EXPECT_FALSE(a_thread_is_stopped());
    std::array<int, 2> said{};
    ASSERT_EQ(pipe(said.data()), 0);
    const pid_t debugger = fork();
    if (debugger == 0) {
        char may = 0;
        if (read(said[0], &may, 1) != 1) _exit(1);
        const bool stopped = ptrace(PTRACE_SEIZE, waiting.load(), nullptr, nullptr) == 0 &&
                             ptrace(PTRACE_INTERRUPT, waiting.load(), nullptr, nullptr) == 0 &&
                             waitpid(waiting, nullptr, __WALL) == waiting;
        if (stopped) pause();
        _exit(1);
    }
    prctl(PR_SET_PTRACER, debugger);
    ASSERT_EQ(write(said[1], "1", 1), 1);
    const auto wait = [](const auto& so) {
        const auto end = std::chrono::steady_clock::now() + std::chrono::seconds(10);
        while (!so() && std::chrono::steady_clock::now() < end)
            std::this_thread::yield();
    };
    bool stopped = false;
    bool refused = false;
    wait([&] {
        stopped = a_thread_is_stopped();
        refused = waitpid(debugger, nullptr, WNOHANG) != 0;
        return stopped || refused;
    });
    if (!refused) {
        EXPECT_TRUE(stopped);
        kill(debugger, SIGKILL);
        waitpid(debugger, nullptr, 0);
    }
    wait([] { return !a_thread_is_stopped(); });
    EXPECT_FALSE(a_thread_is_stopped());
    EXPECT_EQ(write(ends[1], "1", 1), 1);
    waits.join();
    for (const int end : {ends[0], ends[1], said[0], said[1]})
        close(end);
    if (refused) GTEST_SKIP() << "a child may not stop a thread of this process here";
}

TEST(ServiceManager, AnotherProcessesWatchdogIsNotOurs) {
    for (const char* usec : {"1000000", "0", "-5", "soon", ""}) {
        set("NOTIFY_SOCKET", "/nonexistent/notify");
        set("WATCHDOG_USEC", usec);
        set("WATCHDOG_PID", std::string(usec) == "1000000" ? "1" : std::to_string(getpid()));
        EXPECT_EQ(ServiceManager().watchdog_ns(), 0) << usec;
    }
}

}  // namespace
}  // namespace groundline::daemon
