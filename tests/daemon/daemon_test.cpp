// The daemon as a service manager and a controller see it: start, health, reload, watchdog, end, refusals.
#include <gtest/gtest.h>

#include <fcntl.h>
#include <sched.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <csignal>
#include <fstream>
#include <map>
#include <regex>
#include <thread>

#include "daemon/service.hpp"
#include "groundline/attitude_t.hpp"
#include "groundline/health_t.hpp"
#include "groundline/mask_t.hpp"
#include "groundline/sectors_t.hpp"

namespace groundline::test {
namespace {

constexpr const char* kNoMulticast =
    "no multicast reaches this computer itself; to run this test, as root: "
    "ip link set lo up && ip route add 224.0.0.0/4 dev lo";

// A scene so small that rendering and matching take next to nothing.
std::vector<std::string> small(std::vector<std::string> more = {}) {
    std::vector<std::string> words{
        "--config", "",
        "--set",    "capture.driver=synthetic",
        "--set",    "capture.source=drive?width=160&height=120&focal=125&rate_hz=30",
        "--set",    "stereo.disparities=32",
        "--set",    "process.threads=1",
        "--set",    "realtime.scheduling=off"};
    words.insert(words.end(), more.begin(), more.end());
    return words;
}

class Daemon : public testing::Test {
  protected:
    void SetUp() override {
        if (!multicast_here()) GTEST_SKIP() << kNoMulticast;
        std::ofstream(config_) << "# all by default\n";
    }

    Start start(std::vector<std::string> more = {}) {
        Start start{small(std::move(more))};
        start.words[1] = config_.string();
        start.url = lcm_url();
        return start;
    }
    static bool ready(Service& service) {
        return eventually([&] { return service.told("READY=1") > 0; });
    }

    Folder folder_;
    std::filesystem::path config_ = folder_ / "groundline.yaml";
};

TEST_F(Daemon, SaysReadyPublishesAndEndsInOrder) {
    Receiver receiver(lcm_url());
    Service service(start());
    ASSERT_TRUE(ready(service)) << service.said();
    ASSERT_TRUE(receiver.until([&] { return receiver.on("GROUNDLINE_MASK").size() >= 5; })) << service.said();
    EXPECT_FALSE(receiver.on("GROUNDLINE_SECTORS").empty());
    EXPECT_FALSE(receiver.on("GROUNDLINE_GROUND").empty());
    const auto mask = receiver.last<mask_t>("GROUNDLINE_MASK");
    EXPECT_EQ(mask.width, 160);
    EXPECT_EQ(mask.stamp_source, mask_t::STAMP_ARRIVAL) << "recorded pairs count as taken when they are due";
    ASSERT_TRUE(eventually([&] { return service.told("STATUS=running") > 0; })) << service.said();
    int status = -1;
    service.end_ms(SIGTERM, status);
    EXPECT_EQ(status, 0) << service.said();
    EXPECT_EQ(service.told("STOPPING=1"), 1);
    receiver.until(
        [&] { return receiver.last<health_t>("GROUNDLINE_HEALTH").state == health_t::STATE_STOPPING; });
    EXPECT_EQ(receiver.last<health_t>("GROUNDLINE_HEALTH").state, health_t::STATE_STOPPING);
}

TEST_F(Daemon, HealthComesTenTimesASecondAndCountsEverything) {
    Receiver receiver(lcm_url());
    Service service(start());
    ASSERT_TRUE(receiver.until([&] { return receiver.on("GROUNDLINE_HEALTH").size() >= 40; }))
        << service.said();
    std::vector<double> steps_s;
    std::int64_t last = 0;
    for (const Receiver::Bytes& bytes : receiver.on("GROUNDLINE_HEALTH")) {
        health_t health{};
        ASSERT_GT(health.decode(bytes.data(), 0, static_cast<int>(bytes.size())), 0);
        if (last != 0) steps_s.push_back(static_cast<double>(health.utime - last) / 1e6);
        last = health.utime;
    }
    std::nth_element(steps_s.begin(), steps_s.begin() + 20, steps_s.end());
    EXPECT_GT(steps_s[20], 0.05);
    EXPECT_LT(steps_s[20], 0.2);

    const auto health = receiver.last<health_t>("GROUNDLINE_HEALTH");
    std::map<std::string, std::int64_t> counts;
    for (const counter_t& counter : health.counters)
        counts[counter.name] = counter.value;
    EXPECT_GT(counts["frames_read"], 0);
    EXPECT_GT(counts["results_delivered"], 0);
    for (const auto& [name, value] : counts)
        EXPECT_GE(value, 0) << name << " is not counted";
    EXPECT_EQ(health.realtime_scheduling, 0) << "it was not asked for";
    EXPECT_NE(health.memory_locked, -1);
    const auto& whole_way = health.latencies.back();
    EXPECT_EQ(whole_way.name, "exposure_to_publish");
    EXPECT_GT(whole_way.p50_ms, 0.0);
    EXPECT_LE(whole_way.p50_ms, whole_way.p99_ms);
    EXPECT_LE(whole_way.p99_ms, whole_way.max_ms);
}

TEST_F(Daemon, ReloadsWhatMayChangeAndNamesWhatNeedsARestart) {
    Receiver receiver(lcm_url());
    Service service(start());
    ASSERT_TRUE(ready(service)) << service.said();
    const auto tolerance = [&] { return receiver.last<mask_t>("GROUNDLINE_MASK").tolerance_m; };
    ASSERT_TRUE(receiver.until([&] { return tolerance() == 0.2; })) << tolerance();
    EXPECT_TRUE(receiver.on("GROUNDLINE_PREVIEW").empty());
    std::ofstream(config_) << "terrain.tolerance_m: 0.1\npublish.preview: on\nterrain.sectors: 16\n";
    service.signal(SIGHUP);
    ASSERT_TRUE(receiver.until([&] { return tolerance() == 0.1; })) << tolerance() << service.said();
    EXPECT_TRUE(receiver.until([&] { return !receiver.on("GROUNDLINE_PREVIEW").empty(); }));
    EXPECT_TRUE(eventually([&] { return service.says("need a restart: terrain.sectors"); }))
        << service.said();
    EXPECT_TRUE(service.says("taken over: terrain.tolerance_m, publish.preview")) << service.said();
    ASSERT_TRUE(eventually([&] { return service.told("READY=1") == 2; }));
    bool in_order = false;
    for (const std::string& told : service.told())
        in_order |= std::regex_match(told, std::regex("RELOADING=1\nMONOTONIC_USEC=[0-9]+"));
    EXPECT_TRUE(in_order);
}

TEST_F(Daemon, ABadConfigurationIsRefusedWholeAndTheOldOneStays) {
    Receiver receiver(lcm_url());
    Service service(start());
    ASSERT_TRUE(ready(service)) << service.said();
    std::ofstream(config_) << "terrain:\n  tolerance_m: 0.1\n  clearence_m: 1\n";
    service.signal(SIGHUP);
    ASSERT_TRUE(eventually([&] { return service.says(config_.string() + ":3"); })) << service.said();
    EXPECT_TRUE(service.says("did you mean 'terrain.clearance_m'?")) << service.said();
    ASSERT_TRUE(eventually([&] { return service.told("READY=1") == 2; })) << "a refused reload is over too";
    receiver.forget();
    ASSERT_TRUE(receiver.until([&] { return receiver.on("GROUNDLINE_MASK").size() >= 5; }));
    EXPECT_EQ(receiver.last<mask_t>("GROUNDLINE_MASK").tolerance_m, 0.2);
    int status = -1;
    service.end_ms(SIGINT, status);
    EXPECT_EQ(status, 0);
}

TEST_F(Daemon, AConfigurationThatCannotBeLookedAtStopsNothing) {
    Service service(start());
    ASSERT_TRUE(ready(service)) << service.said();
    std::filesystem::remove(config_);
    std::filesystem::create_symlink(config_.filename(), config_);  // to itself
    service.signal(SIGHUP);
    ASSERT_TRUE(eventually([&] { return service.says("stays in force"); })) << service.said();
    EXPECT_TRUE(eventually([&] { return service.told("READY=1") == 2; }));
    int status = -1;
    service.end_ms(SIGTERM, status);
    EXPECT_EQ(status, 0) << service.said();
}

// A file on a mount that hangs looks like a pipe that nobody writes to.
TEST_F(Daemon, EndsWhileItIsBeingSetUp) {
    const std::string hung = folder_.at("body.png");
    ASSERT_EQ(mkfifo(hung.c_str(), 0600), 0);
    Service service(start({"--set", "mount.body_mask=" + hung}));
    int writer = -1;
    ASSERT_TRUE(eventually([&] { return (writer = open(hung.c_str(), O_WRONLY | O_NONBLOCK)) >= 0; }))
        << "nobody reads the picture: " << service.said();
    service.signal(SIGTERM);
    EXPECT_EQ(service.wait(), 0) << service.said();
    close(writer);
    EXPECT_EQ(service.told("READY=1"), 0);
}

TEST_F(Daemon, WatchdogIsFedWhileEverythingMoves) {
    Start with = start();
    with.watchdog_us = 2'000'000;
    Service service(with);
    ASSERT_TRUE(ready(service)) << service.said();
    EXPECT_TRUE(eventually([&] { return service.told("WATCHDOG=1") >= 3; })) << service.said();
    EXPECT_EQ(service.told("WATCHDOG=trigger"), 0);
}

TEST_F(Daemon, WithoutAWatchdogNobodyFeedsOne) {
    Receiver receiver(lcm_url());
    Service service(start());
    ASSERT_TRUE(receiver.until([&] { return receiver.on("GROUNDLINE_HEALTH").size() >= 20; }));
    EXPECT_EQ(service.told("WATCHDOG"), 0);
}

// Each thread there is, libraries' too, stopped as a debugger stops it.
TEST_F(Daemon, AnyThreadThatStandsStillStarvesTheWatchdog) {
    const std::map<std::string, std::string> parts = {{"gl-capture", "capture"},
                                                      {"gl-process", "processing"},
                                                      {"gl-worker1", "processing"},
                                                      {"gl-sinks", "sinks"},
                                                      {"gl-health", "health"}};
    const std::string other = "the log, attitudes or a library";
    constexpr std::chrono::seconds kLimit(4);
    std::size_t count = 1;
    for (std::size_t number = 0; number < count; ++number) {
        Start with = start({"--set", "process.threads=2", "--set", "attitude.input=on"});
        with.watchdog_us = std::chrono::microseconds(kLimit).count();
        Service service(with);
        ASSERT_TRUE(eventually([&] { return service.says("pairs come"); })) << service.said();
        ASSERT_TRUE(eventually([&] { return service.threads().size() >= 9; }))  // LCM's own is the last
            << service.threads().size();
        const std::vector<Service::Thread> threads = service.threads();
        count = threads.size();
        ASSERT_LT(number, count);
        const Service::Thread& thread = threads[number];
        const bool supervisor = thread.id == service.pid();  // which then can say and feed nothing
        const auto known = parts.find(thread.name);
        const std::string named = "the thread for " + (known == parts.end() ? other : known->second);
        SCOPED_TRACE(thread.name);
        {
            const Service::Stopped stopped(thread.id);
            if (!stopped.stopped()) GTEST_SKIP() << "threads of other programs may not be stopped here";
            if (supervisor) {
                const std::size_t told = service.told().size();
                std::this_thread::sleep_for(kLimit);
                EXPECT_EQ(service.told().size(), told);
            } else {
                ASSERT_TRUE(eventually([&] { return service.told("WATCHDOG=trigger") > 0; }))
                    << service.said();
                EXPECT_EQ(service.told().back().find("WATCHDOG=1"), std::string::npos) << "fed after that";
                EXPECT_TRUE(thread.name == "gl-log" || service.says(named)) << service.said();
            }
        }
        const int fed = service.told("WATCHDOG=1");
        EXPECT_TRUE(eventually([&] { return service.told("WATCHDOG=1") > fed; })) << service.said();
        if (supervisor) continue;
        EXPECT_TRUE(eventually([&] { return service.says("every thread moves again"); })) << service.said();
        EXPECT_TRUE(service.says(named)) << service.said();
        EXPECT_EQ(service.told("WATCHDOG=trigger"), 1);
    }
}

TEST_F(Daemon, TakesAttitudesWhereItIsToldTo) {
    Receiver robot(lcm_url());
    const auto refused = [&] {
        for (const counter_t& counter : robot.last<health_t>("GROUNDLINE_HEALTH").counters)
            if (counter.name == "attitudes_refused") return counter.value;
        return std::int64_t{-1};
    };
    Service service(start({"--set", "attitude.input=on"}));
    ASSERT_TRUE(ready(service)) << service.said();
    EXPECT_TRUE(eventually([&] { return service.says("no attitudes for 1 s"); })) << service.said();
    attitude_t attitude{};  // of 1970
    ASSERT_TRUE(robot.until([&] { return robot.send("GROUNDLINE_ATTITUDE", attitude) && refused() > 0; }))
        << service.said();
    EXPECT_TRUE(robot.until([&] {
        const auto now = std::chrono::system_clock::now().time_since_epoch();
        attitude.utime = std::chrono::duration_cast<std::chrono::microseconds>(now).count();
        return robot.send("GROUNDLINE_ATTITUDE", attitude) && service.says("attitudes come");
    })) << service.said();
    int status = -1;
    service.end_ms(SIGTERM, status);
    EXPECT_EQ(status, 0);
}

// The log's thread then waits for ever, which is in order.
TEST_F(Daemon, AJournalThatHangsStarvesNoWatchdogAndHoldsUpNoEnd) {
    Start with = start();
    with.watchdog_us = 1'000'000;
    with.deaf = true;
    Service service(with);
    ASSERT_TRUE(ready(service));
    EXPECT_TRUE(eventually([&] { return service.told("WATCHDOG=1") >= 5; }));
    EXPECT_EQ(service.told("WATCHDOG=trigger"), 0);
    int status = -1;
    service.end_ms(SIGTERM, status);
    EXPECT_EQ(status, 0);
}

TEST_F(Daemon, WithoutPairsItSaysBlindAndShowsNoMask) {
    Receiver receiver(lcm_url());
    Service service(start());
    ASSERT_TRUE(receiver.until([&] { return receiver.on("GROUNDLINE_MASK").size() >= 3; })) << service.said();
    const Service::Stopped stopped(service, "gl-capture");
    if (!stopped.stopped()) GTEST_SKIP() << "threads of other programs may not be stopped here";
    ASSERT_TRUE(receiver.until([&] {
        return receiver.last<health_t>("GROUNDLINE_HEALTH").state == health_t::STATE_STALLED;
    })) << service.said();
    receiver.forget();
    ASSERT_TRUE(receiver.until([&] { return receiver.on("GROUNDLINE_HEALTH").size() >= 10; }));
    EXPECT_TRUE(receiver.on("GROUNDLINE_MASK").empty());
    EXPECT_TRUE(receiver.on("GROUNDLINE_GROUND").empty());
    const auto health = receiver.last<health_t>("GROUNDLINE_HEALTH");
    EXPECT_EQ(health.verdict, mask_t::VERDICT_BLIND);
    EXPECT_EQ(health.reasons, mask_t::REASON_NO_FRAMES);
    EXPECT_GT(health.result_age_s, 0.5);
    EXPECT_GE(receiver.on("GROUNDLINE_SECTORS").size(), 5U);
    const auto sectors = receiver.last<sectors_t>("GROUNDLINE_SECTORS");
    EXPECT_EQ(sectors.verdict, mask_t::VERDICT_BLIND);
    EXPECT_EQ(sectors.reasons, mask_t::REASON_NO_FRAMES);
    EXPECT_EQ(sectors.count, 0);
    EXPECT_TRUE(eventually([&] { return service.told("waiting for pairs") > 0; }));
}

// Whatever thread hangs; the pipeline then cannot be waited for.
TEST_F(Daemon, EndsByItselfThoughAThreadHangs) {
    for (const char* thread : {"gl-capture", "gl-sinks", "gl-health"}) {
        Service service(start());
        ASSERT_TRUE(eventually([&] { return service.says("pairs come"); })) << service.said();
        const Service::Stopped stopped(service, thread);
        if (!stopped.stopped()) GTEST_SKIP() << "threads of other programs may not be stopped here";
        int status = -1;
        const double took_ms = service.end_ms(SIGTERM, status);
        EXPECT_EQ(status, 0) << thread << ": " << service.said();
        RecordProperty(std::string("ended_ms_") + thread, std::to_string(took_ms));
    }
}

TEST_F(Daemon, WaitsForAMulticastRoute) {
    if (!own_network()) GTEST_SKIP() << "needs root and ip(8) to make a network of its own";
    ASSERT_TRUE(remove_route());
    Service service(start());
    ASSERT_TRUE(ready(service)) << service.said();
    EXPECT_TRUE(eventually([&] { return service.says("no route for multicast"); })) << service.said();
    EXPECT_TRUE(eventually([&] { return service.told("STATUS=running") > 0; }))
        << "pairs are processed all the same: " << service.said();
    ASSERT_TRUE(add_route());
    Receiver receiver(lcm_url());
    ASSERT_TRUE(receiver.until([&] { return receiver.on("GROUNDLINE_MASK").size() >= 3; })) << service.said();
    ASSERT_TRUE(receiver.until([&] { return !receiver.on("GROUNDLINE_HEALTH").empty(); })) << service.said();
    EXPECT_TRUE(eventually([&] { return service.says("LCM takes messages"); })) << service.said();
    const std::string said = service.said();
    EXPECT_EQ(said.find("no route for multicast"), said.rfind("no route for multicast"))
        << "said once: " << said;
    const auto health = receiver.last<health_t>("GROUNDLINE_HEALTH");
    ASSERT_FALSE(health.counters.empty());
    EXPECT_EQ(health.counters.back().name, "lcm_open_failures");
    EXPECT_GT(health.counters.back().value, 0);
}

TEST_F(Daemon, TheJournalGetsPrioritiesAndNoTime) {
    Start with = start();
    with.journal = true;
    Service service(with);
    ASSERT_TRUE(ready(service));
    service.signal(SIGTERM);
    EXPECT_EQ(service.wait(), 0);
    std::istringstream lines(service.said());
    int count = 0;
    for (std::string line; std::getline(lines, line); ++count)
        EXPECT_TRUE(std::regex_match(line, std::regex("<[3467]>[^0-9<].*"))) << line;
    EXPECT_GT(count, 2);
}

TEST_F(Daemon, ARecordingThatIsNotRepeatedEndsTheProgram) {
    Receiver receiver(lcm_url());
    Service service(start({"--set", "capture.loop=off", "--set",
                           "capture.source=drive?width=160&height=120&focal=125&rate_hz=30&frames=10"}));
    EXPECT_EQ(service.wait(), 0) << service.said();
    EXPECT_EQ(service.told("STOPPING=1"), 1);
}

// Everything the program does on the threads that handle frames, for 1000 frames, LCM's own part apart.
TEST_F(Daemon, ThreadsOfFramesAllocateLockAndWriteNothing) {
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
    GTEST_SKIP() << "a sanitizer stands in the place of the counters";
#endif
    Receiver receiver(lcm_url());
    Start with =
        start({"--set", "capture.source=plane?width=64&height=48&focal=50&rate_hz=200&frames=100000", "--set",
               "process.threads=2", "--set", "publish.preview=on", "--set", "publish.v_disparity=on", "--set",
               "publish.obstacles=on", "--set", "grid.publish=on", "--set", "attitude.input=on"});
    const std::string result = folder_.at("forbidden");
    with.environment = {{"LD_PRELOAD", GROUNDLINE_FORBIDDEN_PRELOAD}, {"GROUNDLINE_FORBIDDEN", result}};
    Service service(with);
    const auto delivered = [&] {
        for (const counter_t& counter : receiver.last<health_t>("GROUNDLINE_HEALTH").counters)
            if (counter.name == "results_delivered") return counter.value;
        return std::int64_t{0};
    };
    ASSERT_TRUE(receiver.until([&] { return delivered() >= 50; })) << service.said();
    service.signal(SIGUSR2);
    service.signal(SIGHUP);
    const std::int64_t begin = delivered();
    ASSERT_TRUE(receiver.until([&] { return delivered() >= begin + 1000; }, 6 * kPatienceMs))
        << delivered() - begin;
    service.signal(SIGUSR2);
    std::map<std::string, std::array<std::int64_t, 6>> threads;
    ASSERT_TRUE(eventually([&] {
        std::ifstream lines(result);
        std::string name;
        std::array<std::int64_t, 6> counts{};
        while (lines >> name >> counts[0] >> counts[1] >> counts[2] >> counts[3] >> counts[4] >> counts[5])
            threads[name] = counts;
        return threads.contains("gl-sinks") && threads.contains("gl-health");
    })) << "nothing was counted";
    for (const auto& [name, counts] : threads) {
        const bool frames =
            name == "gl-capture" || name == "gl-process" || name == "gl-worker1" || name == "gl-sinks";
        if (!frames) continue;
        EXPECT_EQ(counts[0], 0) << "allocations on " << name;
        EXPECT_EQ(counts[1], 0) << "locks on " << name;
        EXPECT_EQ(counts[2], 0) << "output on " << name;
    }
    // The counters themselves: the sinks sent, LCM locked, and the supervisor, which may, read a file.
    EXPECT_GE(threads["gl-sinks"][5], 3000);
    EXPECT_GE(threads["gl-sinks"][4], threads["gl-sinks"][5]);
    EXPECT_GT(threads["groundlined"][0], 0);
    RecordProperty("lcm_allocations", std::to_string(threads["gl-sinks"][3]));
    RecordProperty("lcm_locks", std::to_string(threads["gl-sinks"][4]));
    RecordProperty("messages", std::to_string(threads["gl-sinks"][5]));
}

// What the kernel says of a thread: its policy and priority.
std::pair<int, int> schedule_of(const Service& service, const std::string& thread) {
    const std::filesystem::path tasks = "/proc/" + std::to_string(service.pid()) + "/task";
    for (const auto& task : std::filesystem::directory_iterator(tasks)) {
        std::ifstream comm(task.path() / "comm");
        std::string name;
        if (!std::getline(comm, name) || name != thread) continue;
        const pid_t id = std::stoi(task.path().filename());
        sched_param parameters{};
        sched_getparam(id, &parameters);
        return {sched_getscheduler(id), parameters.sched_priority};
    }
    return {-1, -1};
}

// SCHED_FIFO, and ordinary for what the thread starts.
constexpr int kRealTime = SCHED_FIFO | SCHED_RESET_ON_FORK;
constexpr int kOrdinaryAgain = SCHED_OTHER | SCHED_RESET_ON_FORK;

// Processor time of that thread so far, in seconds.
double busy_s(const Service& service, const std::string& thread) {
    const std::filesystem::path tasks = "/proc/" + std::to_string(service.pid()) + "/task";
    for (const auto& task : std::filesystem::directory_iterator(tasks)) {
        std::ifstream comm(task.path() / "comm");
        std::string name;
        if (!std::getline(comm, name) || name != thread) continue;
        std::ifstream schedstat(task.path() / "schedstat");
        double ns = 0.0;
        schedstat >> ns;
        return ns / 1e9;
    }
    return 0.0;
}

bool may_be_real_time() {
    const sched_param before{};
    sched_param wanted{};
    wanted.sched_priority = 1;
    const bool may = sched_setscheduler(0, SCHED_FIFO, &wanted) == 0;
    sched_setscheduler(0, SCHED_OTHER, &before);
    return may;
}

TEST_F(Daemon, RunsInRealTimeWhereThatIsPermitted) {
    if (!may_be_real_time()) GTEST_SKIP() << "real-time scheduling is not permitted here";
    Receiver receiver(lcm_url());
    // Two pairs from files: a renderer's thread is never real-time.
    const Folder folder;
    ASSERT_EQ(run_groundline(
                  {"synth", "boxes?width=160&height=120&focal=125&frames=2", "--out", folder.at("pairs")})
                  .status,
              0);
    Service service(start({"--set", "capture.driver=files", "--set", "capture.source=" + folder.at("pairs"),
                           "--set", "realtime.scheduling=on", "--set", "process.threads=2", "--set",
                           "realtime.capture_priority=31", "--set", "realtime.sinks_cpus=0"}));
    ASSERT_TRUE(receiver.until([&] { return receiver.on("GROUNDLINE_HEALTH").size() >= 10; }))
        << service.said();
    EXPECT_EQ(schedule_of(service, "gl-capture"), std::make_pair(kRealTime, 31));
    EXPECT_EQ(schedule_of(service, "gl-process"), std::make_pair(kRealTime, 20));
    EXPECT_EQ(schedule_of(service, "gl-worker1"), std::make_pair(kRealTime, 20));
    EXPECT_EQ(schedule_of(service, "gl-sinks"), std::make_pair(kRealTime, 10));
    EXPECT_EQ(schedule_of(service, "groundlined").first, SCHED_OTHER);
    EXPECT_EQ(schedule_of(service, "gl-health").first, SCHED_OTHER);
    const auto health = receiver.last<health_t>("GROUNDLINE_HEALTH");
    EXPECT_EQ(health.realtime_scheduling, 1);
    EXPECT_EQ(health.memory_locked, 1) << service.said();
    EXPECT_FALSE(service.says("refused")) << service.said();
    // A thread that never pauses: the kernel says so, and all of them are made ordinary.
    service.signal(SIGXCPU);
    ASSERT_TRUE(eventually([&] { return schedule_of(service, "gl-worker1").first == kOrdinaryAgain; }));
    EXPECT_EQ(schedule_of(service, "gl-capture").first, kOrdinaryAgain);
    EXPECT_TRUE(receiver.until(
        [&] { return receiver.last<health_t>("GROUNDLINE_HEALTH").realtime_scheduling == 0; }));
}

// Processing that is always late waits for nothing, and is still no thread gone wild.
TEST_F(Daemon, OverloadDoesNotCostRealTime) {
    if (!may_be_real_time()) GTEST_SKIP() << "real-time scheduling is not permitted here";
    const Folder folder;
    ASSERT_EQ(
        run_groundline({"synth", "boxes?width=640&height=480&frames=2", "--out", folder.at("pairs")}).status,
        0);
    for (const char* eye : {"left", "right"}) {  // a name of 19 digits is a time in ns: 2 ms apart
        const std::filesystem::path pictures = folder / "pairs" / eye;
        std::vector<std::filesystem::path> found;
        for (const auto& entry : std::filesystem::directory_iterator(pictures))
            found.push_back(entry.path());
        ASSERT_EQ(found.size(), 2U);
        std::sort(found.begin(), found.end());
        std::filesystem::rename(found[0], pictures / "1700000000000000000.png");
        std::filesystem::rename(found[1], pictures / "1700000000002000000.png");
    }
    Service service(start({"--set", "capture.driver=files", "--set", "capture.source=" + folder.at("pairs"),
                           "--set", "stereo.disparities=64", "--set", "realtime.scheduling=on"}));
    ASSERT_TRUE(ready(service)) << service.said();
    ASSERT_TRUE(eventually([&] { return busy_s(service, "gl-process") > 5.0; }))
        << busy_s(service, "gl-process");
    EXPECT_FALSE(service.says("given up")) << service.said();
    EXPECT_EQ(schedule_of(service, "gl-process"), std::make_pair(kRealTime, 20));
}

TEST_F(Daemon, WhatIsNotPermittedIsSaidOnceAndInHealth) {
    Receiver receiver(lcm_url());
    Start with = start({"--set", "realtime.scheduling=on", "--set", "process.threads=2", "--set",
                        "realtime.sinks_cpus=1023"});
    with.unprivileged = true;
    Service service(with);
    ASSERT_TRUE(receiver.until([&] { return receiver.on("GROUNDLINE_MASK").size() >= 5; })) << service.said();
    const auto health = receiver.last<health_t>("GROUNDLINE_HEALTH");
    EXPECT_EQ(health.realtime_scheduling, 0);
    EXPECT_EQ(health.memory_locked, 0);
    const std::string said = service.said();
    for (const char* sentence : {"real-time scheduling was refused", "a list of processors was refused",
                                 "memory could not be locked"}) {
        EXPECT_NE(said.find(sentence), std::string::npos) << said;
        EXPECT_EQ(said.find(sentence), said.rfind(sentence)) << said;
    }
}

struct Refused {
    const char* what;
    std::vector<std::string> words;
    int status;
    std::vector<std::string> sentence;  // parts of it
};

TEST(DaemonRefuses, WithTheDocumentedStatusAndOneSentence) {
    const Folder folder;
    const std::string typo = folder.at("typo.yaml");
    write_text(typo, "stereo:\n  disparities: 64\n  mathcer: census\n");
    const std::string good = folder.at("good.yaml");
    write_text(good, "capture:\n  driver: synthetic\n  source: drive?width=160&height=120&focal=125\n");
    write_text(folder / "calibration.yaml", "%YAML:1.0\nnonsense: 1\n");
    const std::vector<Refused> cases = {
        {"unknown key", {"--config", typo}, 78, {typo + ":3", "stereo.mathcer", "'stereo.matcher'"}},
        {"bad value", {"--config", good, "--set", "realtime.capture_priority=50"}, 78, {"1 .. 49"}},
        {"no source", {"--config", good, "--set", "capture.source="}, 78, {"capture.source is not set"}},
        {"named file absent", {"--config", folder.at("none.yaml")}, 66, {"none.yaml", "cannot read"}},
        {"source absent",
         {"--config", good, "--set", "capture.driver=files", "--set", "capture.source=" + folder.at("none")},
         66,
         {folder.at("none")}},
        {"calibration malformed",
         {"--config", good, "--set", "capture.calibration=" + folder.at("calibration.yaml")},
         78,
         {"calibration.yaml"}},
        {"half a mount", {"--config", good, "--set", "mount.height_m=1"}, 78, {"mount.pitch_deg"}},
        {"URL", {"--config", good, "--set", "publish.url=nonsense"}, 78, {"udpm://ADDRESS:PORT"}},
        {"log file", {"--config", good, "--set", "publish.url=file://x.lcm?mode=w"}, 78, {"lcm-logger"}},
        {"LCM by TCP", {"--config", good, "--set", "publish.url=tcpq://localhost:7700"}, 78, {"use udpm://"}},
        {"misuse", {"--frames", "3"}, 2, {"--help"}},
    };
    for (const Refused& each : cases)
        for (const bool check_only : {false, true}) {
            Start start{each.words};
            if (check_only) start.words.emplace_back("--check-config");
            Service service(start);
            EXPECT_EQ(service.wait(), each.status) << each.what << ": " << service.said();
            const std::string said = service.said();
            EXPECT_TRUE(said.starts_with("groundlined: ")) << said;
            EXPECT_EQ(std::count(said.begin(), said.end(), '\n'), 1) << said;
            for (const std::string& part : each.sentence)
                EXPECT_NE(said.find(part), std::string::npos) << each.what << ": " << said;
            EXPECT_TRUE(service.told().empty()) << each.what << ": nothing was ready";
        }
    Service service({{"--config", good, "--check-config"}});
    EXPECT_EQ(service.wait(), 0) << service.said();
    EXPECT_TRUE(service.told().empty());
}

}  // namespace
}  // namespace groundline::test
