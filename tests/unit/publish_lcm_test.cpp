// The publisher against LCM itself: in memory, into a log file, over loopback UDP, and when LCM is not there.
#include <gtest/gtest.h>
#include <lcm/lcm.h>
#include <sched.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <cstdlib>
#include <filesystem>
#include <map>
#include <string>
#include <vector>

#include "core/error.hpp"
#include "groundline/health_t.hpp"
#include "groundline/mask_decoder.hpp"
#include "groundline/mask_t.hpp"
#include "groundline/sectors_t.hpp"
#include "publish/health_publisher.hpp"
#include "publish/lcm_link.hpp"
#include "publish/lcm_publisher.hpp"
#include "publish/messages.hpp"
#include "unit/publish_fixture.hpp"

namespace groundline::publish {
namespace {

using test::Frame;
using Bytes = std::vector<std::uint8_t>;

constexpr std::int64_t kMs = 1'000'000;
std::int64_t fake_now_ns = 0;
std::int64_t fake_clock() {
    return fake_now_ns;
}

LcmOptions options_for(const std::string& url, Counters* counters = nullptr) {
    LcmOptions options;
    options.url = url;
    options.counters = counters;
    options.clock = fake_clock;
    return options;
}

// Every message received, by channel, in order.
using Inbox = std::map<std::string, std::vector<Bytes>>;
void receive(const lcm_recv_buf_t* from, const char* channel, void* inbox) {
    const auto* first = static_cast<const std::uint8_t*>(from->data);
    (*static_cast<Inbox*>(inbox))[channel].emplace_back(first, first + from->data_size);
}
void drain(lcm_t* lcm) {
    while (lcm_handle_timeout(lcm, 0) > 0) {
    }
}
std::size_t messages_in(const Inbox& inbox) {
    std::size_t count = 0;
    for (const auto& [channel, messages] : inbox)
        count += messages.size();
    return count;
}

template <typename Message>
Message read(const Bytes& bytes) {
    Message message;
    EXPECT_EQ(message.decode(bytes.data(), 0, static_cast<int>(bytes.size())),
              static_cast<int>(bytes.size()));
    return message;
}

Bytes copy(MessageEncoder::Bytes message) {
    return {message.begin(), message.end()};
}

TEST(Lcm, ThroughMemory) {
    fake_now_ns = 5000 * kMs;
    Counters counters;
    LcmPublisher publisher(options_for("memq://", &counters));
    ASSERT_TRUE(publisher.tick());  // opens
    Inbox inbox;
    ASSERT_NE(publisher.handle(), nullptr);
    lcm_subscribe(publisher.handle(), ".*", receive, &inbox);
    drain(publisher.handle());
    inbox.clear();

    fake_now_ns += 100 * kMs;
    const Frame frame(640, 480);
    ASSERT_TRUE(publisher.consume(frame.result));
    drain(publisher.handle());
    ASSERT_EQ(inbox.size(), 4U);
    EXPECT_EQ(messages_in(inbox), 4U);
    MessageEncoder encoder;
    EXPECT_EQ(inbox["GROUNDLINE_MASK"].at(0), copy(encoder.mask(frame.result)));
    EXPECT_EQ(inbox["GROUNDLINE_SECTORS"].at(0), copy(encoder.sectors(frame.result)));
    EXPECT_EQ(inbox["GROUNDLINE_GROUND"].at(0), copy(encoder.ground(frame.result)));
    const auto mask = read<mask_t>(inbox["GROUNDLINE_MASK"].at(0));
    std::vector<std::uint8_t> classes;
    ASSERT_TRUE(decode_mask(mask, classes));
    for (int y = 0; y < 480; ++y)
        for (int x = 0; x < 640; ++x)
            ASSERT_EQ(classes[static_cast<std::size_t>(y * 640 + x)],
                      static_cast<unsigned>(frame.result.mask.at(x, y)));
    const auto health = read<health_t>(inbox["GROUNDLINE_HEALTH"].at(0));
    EXPECT_EQ(health.state, health_t::STATE_RUNNING);
    EXPECT_EQ(health.sequence, 41);
    EXPECT_GT(health.utime, 1'500'000'000'000'000) << "microseconds since the epoch, of now";
    EXPECT_EQ(publisher.sent(), 6U);  // health and blind sectors of the first tick, four of the frame
    EXPECT_EQ(publisher.lost(), 0U);
    EXPECT_TRUE(publisher.error().empty());
}

TEST(Lcm, ChannelsAndPrefix) {
    fake_now_ns = 0;
    LcmOptions options = options_for("memq://");
    options.prefix = "ROBOT7_EYES";
    options.channels = {.mask = true,
                        .sectors = false,
                        .ground = false,
                        .health = false,
                        .v_disparity = true,
                        .preview = true,
                        .grid = true,
                        .obstacles = true};
    LcmPublisher publisher(options);
    const Frame frame(64, 48);
    ASSERT_TRUE(publisher.consume(frame.result));
    Inbox inbox;
    lcm_subscribe(publisher.handle(), ".*", receive, &inbox);
    fake_now_ns += 1000 * kMs;
    ASSERT_TRUE(publisher.consume(frame.result));
    ASSERT_TRUE(publisher.tick());
    fake_now_ns += 1000 * kMs;
    ASSERT_TRUE(publisher.tick());
    drain(publisher.handle());
    ASSERT_EQ(inbox.size(), 5U);
    for (const char* channel : {"ROBOT7_EYES_MASK", "ROBOT7_EYES_VDISPARITY", "ROBOT7_EYES_PREVIEW",
                                "ROBOT7_EYES_GRID", "ROBOT7_EYES_OBSTACLES"})
        EXPECT_EQ(inbox[channel].size(), 1U) << channel;
}

TEST(Lcm, HealthKeepsItsRateAndSilenceIsSaidWithoutAnyMask) {
    fake_now_ns = 10'000 * kMs;
    LcmPublisher publisher(options_for("memq://"));
    const Frame frame(64, 48);
    ASSERT_TRUE(publisher.consume(frame.result));
    Inbox inbox;
    lcm_subscribe(publisher.handle(), ".*", receive, &inbox);
    // 30 results a second for one second: ten of them bring health along.
    for (int i = 1; i <= 30; ++i) {
        fake_now_ns = 10'000 * kMs + i * 100 * kMs / 3 + 1;
        ASSERT_TRUE(publisher.consume(frame.result));
        ASSERT_TRUE(publisher.tick());
    }
    drain(publisher.handle());
    EXPECT_EQ(inbox["GROUNDLINE_MASK"].size(), 30U);
    EXPECT_EQ(inbox["GROUNDLINE_SECTORS"].size(), 30U);
    EXPECT_NEAR(static_cast<double>(inbox["GROUNDLINE_HEALTH"].size()), 10.0, 1.0);
    inbox.clear();

    // Two seconds without: health goes on; after 0.5 s it says blind, and so do sectors; never a mask again.
    for (int i = 1; i <= 40; ++i) {
        fake_now_ns += 50 * kMs;
        ASSERT_TRUE(publisher.tick());
    }
    drain(publisher.handle());
    EXPECT_EQ(inbox.count("GROUNDLINE_MASK"), 0U);
    EXPECT_EQ(inbox.count("GROUNDLINE_GROUND"), 0U);
    ASSERT_EQ(inbox["GROUNDLINE_HEALTH"].size(), 20U);
    EXPECT_EQ(read<health_t>(inbox["GROUNDLINE_HEALTH"].front()).state, health_t::STATE_RUNNING);
    const auto last = read<health_t>(inbox["GROUNDLINE_HEALTH"].back());
    EXPECT_EQ(last.state, health_t::STATE_STALLED);
    EXPECT_EQ(last.verdict, mask_t::VERDICT_BLIND);
    EXPECT_EQ(last.reasons, mask_t::REASON_NO_FRAMES);
    EXPECT_NEAR(static_cast<double>(inbox["GROUNDLINE_SECTORS"].size()), 15.0, 1.0);
    const auto sectors = read<sectors_t>(inbox["GROUNDLINE_SECTORS"].back());
    EXPECT_EQ(sectors.verdict, mask_t::VERDICT_BLIND);
    EXPECT_EQ(sectors.reasons, mask_t::REASON_NO_FRAMES);
    EXPECT_EQ(sectors.count, 0);

    inbox.clear();
    publisher.stop();
    drain(publisher.handle());
    EXPECT_EQ(read<health_t>(inbox["GROUNDLINE_HEALTH"].at(0)).state, health_t::STATE_STOPPING);
}

// A folder that is gone with the test.
struct Folder {
    std::filesystem::path path;
    Folder() {
        std::string name = (std::filesystem::temp_directory_path() / "groundline_publish_XXXXXX").string();
        path = mkdtemp(name.data());
    }
    ~Folder() { std::filesystem::remove_all(path); }
};

TEST(Lcm, OpensLaterWhenItCannotAtFirst) {
    const Folder folder;
    const std::filesystem::path later = folder.path / "later";
    fake_now_ns = 3000 * kMs;
    Counters counters;
    const Frame frame(64, 48);
    MessageEncoder encoder;
    {
        LcmPublisher publisher(options_for("file://" + (later / "log.lcm").string() + "?mode=w", &counters));
        EXPECT_FALSE(publisher.consume(frame.result));
        EXPECT_EQ(publisher.open_failures(), 1U) << "one attempt for four messages";
        EXPECT_EQ(publisher.lost(), 4U);
        EXPECT_EQ(counters.get(Count::kPublishFailures), 4U);
        EXPECT_NE(publisher.error().find(later.string()), std::string::npos) << publisher.error();
        EXPECT_NE(publisher.error().find("folder exists"), std::string::npos) << publisher.error();

        fake_now_ns += 999 * kMs;
        EXPECT_FALSE(publisher.consume(frame.result));
        EXPECT_EQ(publisher.open_failures(), 1U) << "too early for another attempt";
        fake_now_ns += 1 * kMs;
        EXPECT_FALSE(publisher.consume(frame.result));
        EXPECT_EQ(publisher.open_failures(), 2U);

        std::filesystem::create_directory(later);
        fake_now_ns += 500 * kMs;
        EXPECT_FALSE(publisher.consume(frame.result)) << "still waiting";
        fake_now_ns += 500 * kMs;
        EXPECT_TRUE(publisher.consume(frame.result));
        EXPECT_EQ(publisher.open_failures(), 2U);
        EXPECT_TRUE(publisher.error().empty()) << publisher.error();
        EXPECT_EQ(publisher.sent(), 4U);
    }
    lcm_eventlog_t* log = lcm_eventlog_create((later / "log.lcm").c_str(), "r");
    ASSERT_NE(log, nullptr);
    Inbox inbox;
    while (lcm_eventlog_event_t* event = lcm_eventlog_read_next_event(log)) {
        const auto* first = static_cast<const std::uint8_t*>(event->data);
        inbox[event->channel].emplace_back(first, first + event->datalen);
        lcm_eventlog_free_event(event);
    }
    lcm_eventlog_destroy(log);
    EXPECT_EQ(messages_in(inbox), 4U);
    EXPECT_EQ(inbox["GROUNDLINE_MASK"].at(0), copy(encoder.mask(frame.result)));
    const auto health = read<health_t>(inbox["GROUNDLINE_HEALTH"].at(0));
    EXPECT_EQ(health.counters.back().name, "lcm_open_failures");
    EXPECT_EQ(health.counters.back().value, 2);
}

// A log's messages by channel.
Inbox log_of(const std::filesystem::path& path) {
    Inbox inbox;
    lcm_eventlog_t* log = lcm_eventlog_create(path.c_str(), "r");
    if (log == nullptr) return inbox;
    while (lcm_eventlog_event_t* event = lcm_eventlog_read_next_event(log)) {
        const auto* first = static_cast<const std::uint8_t*>(event->data);
        inbox[event->channel].emplace_back(first, first + event->datalen);
        lcm_eventlog_free_event(event);
    }
    lcm_eventlog_destroy(log);
    return inbox;
}

TEST(Lcm, HealthGoesOutByItselfAndSaysSoWhereNoPairsCome) {
    const Folder folder;
    const std::filesystem::path path = folder.path / "log.lcm";
    fake_now_ns = 7000 * kMs;
    Counters counters;
    {
        HealthPublisher publisher(options_for("file://" + path.string() + "?mode=w", &counters));
        HealthReport report;
        report.utime_us = 99;
        report.verdict = Verdict::kTrusted;
        report.state = LifeState::kRunning;
        EXPECT_TRUE(publisher.publish(report));
        report.reasons.add(Reason::kNoFrames);
        report.verdict = Verdict::kBlind;
        EXPECT_TRUE(publisher.publish(report));
        EXPECT_TRUE(publisher.error().empty());
    }
    Inbox inbox = log_of(path);
    ASSERT_EQ(inbox.size(), 2U);
    ASSERT_EQ(inbox["GROUNDLINE_HEALTH"].size(), 2U);
    ASSERT_EQ(inbox["GROUNDLINE_SECTORS"].size(), 1U) << "only while no pairs come";
    EXPECT_EQ(read<health_t>(inbox["GROUNDLINE_HEALTH"].at(0)).utime, 99);
    const auto sectors = read<sectors_t>(inbox["GROUNDLINE_SECTORS"].at(0));
    EXPECT_EQ(sectors.reasons, mask_t::REASON_NO_FRAMES);
    EXPECT_EQ(sectors.count, 0);

    HealthPublisher nowhere(options_for("file://" + (folder.path / "none" / "log.lcm").string(), &counters));
    EXPECT_FALSE(nowhere.publish(HealthReport()));
    EXPECT_EQ(counters.get(Count::kPublishFailures), 1U);
    EXPECT_NE(nowhere.error().find("folder exists"), std::string::npos) << nowhere.error();
}

TEST(Lcm, ResultsAreNotedWhereOneAsksForThem) {
    fake_now_ns = 9000 * kMs;
    HealthTracker tracker(nullptr, 500 * kMs);
    LcmOptions options = options_for("memq://");
    options.tracker = &tracker;
    options.channels.health = false;
    LcmPublisher publisher(options);
    const Frame frame(64, 48);
    ASSERT_TRUE(publisher.consume(frame.result));
    EXPECT_EQ(tracker.report(0, fake_now_ns).sequence, 41);
    Inbox inbox;
    lcm_subscribe(publisher.handle(), ".*", receive, &inbox);
    publisher.show(true, true);
    ASSERT_TRUE(publisher.consume(frame.result));
    publisher.show(false, true);
    ASSERT_TRUE(publisher.consume(frame.result));
    drain(publisher.handle());
    EXPECT_EQ(inbox.count("GROUNDLINE_HEALTH"), 0U);
    EXPECT_EQ(inbox["GROUNDLINE_VDISPARITY"].size(), 1U);
    EXPECT_EQ(inbox["GROUNDLINE_PREVIEW"].size(), 2U);
}

TEST(Lcm, ReopensAfterASecondOfFailures) {
    // A log opened for reading opens well and then takes nothing.
    const Folder folder;
    const std::string path = (folder.path / "log.lcm").string();
    {
        LcmLink writer("file://" + path + "?mode=w");
        ASSERT_TRUE(writer.send("X", Bytes(8), 0));  // LCM opens no empty log
    }
    fake_now_ns = 0;
    LcmLink link("file://" + path + "?mode=r");
    const Bytes message(8);
    EXPECT_FALSE(link.send("X", message, 0));
    EXPECT_TRUE(link.is_open());
    EXPECT_NE(link.error().find("did not send"), std::string::npos) << link.error();
    EXPECT_FALSE(link.send("X", message, LcmLink::kRetryNs - 1));
    EXPECT_TRUE(link.is_open());
    EXPECT_FALSE(link.send("X", message, LcmLink::kRetryNs));
    EXPECT_FALSE(link.is_open());
    EXPECT_TRUE(link.open(LcmLink::kRetryNs)) << "the last attempt to open is a second ago";
}

TEST(Lcm, RefusesWhatCanNeverWork) {
    for (const char* url : {"nonsense", "://x", "htp://239.255.76.67", "udp://239.255.76.67:7667"}) {
        try {
            const LcmPublisher publisher(options_for(url));
            ADD_FAILURE() << url;
        } catch (const Refusal& refusal) {
            EXPECT_EQ(refusal.status(), ExitStatus::kConfig);
            EXPECT_NE(std::string(refusal.what()).find(url), std::string::npos);
            EXPECT_NE(std::string(refusal.what()).find("udpm://ADDRESS:PORT"), std::string::npos);
        }
    }
    for (const std::string& prefix :
         {std::string(), std::string("A B"), std::string("Ä"), std::string(53, 'P')}) {
        LcmOptions options = options_for("memq://");
        options.prefix = prefix;
        EXPECT_THROW(LcmPublisher{options}, Refusal) << prefix;
    }
    LcmOptions options = options_for("memq://");
    options.prefix = std::string(52, 'P');
    EXPECT_NO_THROW(LcmPublisher{options});
}

TEST(Lcm, ABadAddressIsNamed) {
    fake_now_ns = 0;
    LcmPublisher publisher(options_for("udpm://example:7667"));
    EXPECT_FALSE(publisher.tick());
    EXPECT_NE(publisher.error().find("'example' is not an IPv4 address"), std::string::npos)
        << publisher.error();
    EXPECT_EQ(publisher.open_failures(), 1U);
}

TEST(Lcm, WhereTheUrlComesFrom) {
    ASSERT_EQ(unsetenv("LCM_DEFAULT_URL"), 0);
    EXPECT_EQ(resolve_url(""), "udpm://239.255.76.67:7667?ttl=0");
    ASSERT_EQ(setenv("LCM_DEFAULT_URL", "", 1), 0);
    EXPECT_EQ(resolve_url(""), "udpm://239.255.76.67:7667?ttl=0");
    ASSERT_EQ(setenv("LCM_DEFAULT_URL", "memq://", 1), 0);
    EXPECT_EQ(resolve_url(""), "memq://");
    EXPECT_EQ(LcmPublisher(options_for("")).url(), "memq://");
    EXPECT_EQ(resolve_url("udpm://239.255.76.67:7999?ttl=0"), "udpm://239.255.76.67:7999?ttl=0");
    ASSERT_EQ(unsetenv("LCM_DEFAULT_URL"), 0);
}

TEST(LoopbackGroup, IsTheGroupOfMessagesThatStayOnThisComputer) {
    struct Row {
        const char* url;
        const char* group;
    };
    const std::array rows = {
        Row{"udpm://239.255.76.67:7667?ttl=0", "239.255.76.67"},
        Row{"udpm://239.1.2.3:7000?ttl=0&recv_buf_size=100000", "239.1.2.3"},
        Row{"udpm://239.1.2.3:7000?recv_buf_size=100000&ttl=0", "239.1.2.3"},
        Row{"udpm://239.1.2.3", "239.1.2.3"},
        Row{"udpm://", "239.255.76.67"},
        Row{"udpm://?ttl=0", "239.255.76.67"},
        Row{"udpm://239.255.76.67:7667?ttl=1", ""},
        Row{"udpm://239.255.76.67:7667?ttl=0&ttl=1", ""},
        Row{"udpm://239.255.76.67:7667?ttl=", ""},
        Row{"udpm://:7667?recv_buf_size=9&ttl=1", ""},
        Row{"udpm://10.0.0.7:7667?ttl=0", ""},  // not multicast: its route is none of ours
        Row{"udpm://robot:7667?ttl=0", ""},
        Row{"tcpq://239.255.76.67:7700", ""},
        Row{"memq://", ""},
    };
    for (const Row& row : rows)
        EXPECT_EQ(loopback_group(row.url), row.group) << row.url;
}

// A port of this process, so that test programs that run at once do not hear each other.
std::string udp_url() {
    return "udpm://239.255.76.67:" + std::to_string(20'000 + getpid() % 20'000) + "?ttl=0";
}

constexpr const char* kEnable =
    "no multicast reaches this computer itself; to run this test, as root: "
    "ip link set lo up && ip route add 224.0.0.0/4 dev lo";

TEST(Lcm, OverLoopbackUdp) {
    fake_now_ns = 0;
    const std::string url = udp_url();
    LcmPublisher publisher(options_for(url));
    if (!publisher.tick()) GTEST_SKIP() << kEnable << " (" << publisher.error() << ")";
    lcm_t* receiver = lcm_create(url.c_str());
    if (receiver == nullptr) GTEST_SKIP() << kEnable;
    Inbox inbox;
    lcm_subscribe(receiver, ".*", receive, &inbox);
    // Whether multicast works here is asked with a message that is not ours to get wrong.
    const std::uint8_t probe = 1;
    lcm_publish(receiver, "PROBE", &probe, 1);
    for (int i = 0; i < 20 && inbox.count("PROBE") == 0; ++i)
        lcm_handle_timeout(receiver, 100);
    if (inbox.count("PROBE") == 0) {
        lcm_destroy(receiver);
        GTEST_SKIP() << kEnable;
    }
    // The largest mask there is: noise, in the grid form.
    Frame frame(1280, 720);
    for (int y = 0; y < 720; ++y)
        for (int x = 0; x < 1280; ++x)
            frame.result.mask.at(x, y) = static_cast<TerrainClass>((x * 7 + y * 13) % 4);
    fake_now_ns = 200 * kMs;
    ASSERT_TRUE(publisher.consume(frame.result));
    for (int i = 0; i < 20 && (inbox.count("GROUNDLINE_MASK") == 0 || inbox.count("GROUNDLINE_HEALTH") == 0);
         ++i)
        lcm_handle_timeout(receiver, 100);
    lcm_destroy(receiver);
    MessageEncoder encoder;
    ASSERT_EQ(inbox.count("GROUNDLINE_MASK"), 1U) << "sent, but did not come";
    EXPECT_GT(inbox["GROUNDLINE_MASK"].back().size(), 57'000U);
    EXPECT_EQ(inbox["GROUNDLINE_MASK"].back(), copy(encoder.mask(frame.result)));
    EXPECT_EQ(inbox["GROUNDLINE_SECTORS"].back(), copy(encoder.sectors(frame.result)));
    EXPECT_EQ(inbox["GROUNDLINE_GROUND"].back(), copy(encoder.ground(frame.result)));
    EXPECT_EQ(inbox["GROUNDLINE_HEALTH"].size(), 1U);
}

// In a network of its own, first without any route, then with one. Exit status: 0 good, 77 cannot be tried
// here, else the number of the step that failed.
int without_and_with_a_route() {
    if (unshare(CLONE_NEWNET) != 0) return 77;
    fake_now_ns = 0;
    const Frame frame(64, 48);
    LcmPublisher publisher(options_for("udpm://239.255.76.67:7667?ttl=0"));
    if (publisher.consume(frame.result)) return 1;
    if (publisher.error().find("no route for multicast to 239.255.76.67") == std::string::npos) return 2;
    if (publisher.error().find("ip route add") == std::string::npos) return 3;
    if (publisher.lost() != 4 || publisher.open_failures() != 1) return 4;
    if (std::system("ip link set lo up && ip route add 224.0.0.0/4 dev lo") != 0) return 77;
    fake_now_ns += 1000 * kMs;
    if (!publisher.consume(frame.result)) return 5;
    if (publisher.sent() != 4 || !publisher.error().empty()) return 6;
    // The route goes away again under an open link: reported, and it comes back by itself.
    if (std::system("ip route del 224.0.0.0/4 dev lo") != 0) return 77;
    fake_now_ns += 200 * kMs;
    if (publisher.consume(frame.result) || publisher.error().empty()) return 7;
    if (std::system("ip route add 224.0.0.0/4 dev lo") != 0) return 77;
    fake_now_ns += 200 * kMs;
    if (!publisher.consume(frame.result) || !publisher.error().empty()) return 8;
    return 0;
}

TEST(Lcm, WaitsForAMulticastRoute) {
    const pid_t child = fork();
    ASSERT_GE(child, 0);
    if (child == 0) _exit(without_and_with_a_route());
    int status = 0;
    ASSERT_EQ(waitpid(child, &status, 0), child);
    ASSERT_TRUE(WIFEXITED(status));
    if (WEXITSTATUS(status) == 77) GTEST_SKIP() << "needs root and ip(8) to make a network of its own";
    EXPECT_EQ(WEXITSTATUS(status), 0) << "step that failed";
}

}  // namespace
}  // namespace groundline::publish
