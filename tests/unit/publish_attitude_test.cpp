// Attitudes as they come over LCM: what is handed on, and what is refused and counted.
#include <gtest/gtest.h>
#include <lcm/lcm.h>

#include <cstdint>
#include <limits>
#include <vector>

#include "core/clock.hpp"
#include "core/error.hpp"
#include "groundline/attitude_t.hpp"
#include "publish/attitude_receiver.hpp"

namespace groundline::publish {
namespace {

constexpr std::int64_t kMs = 1'000'000;
std::int64_t fake_now_ns = 0;

struct Receiver {
    static LcmOptions options_for(Counters& counters) {
        fake_now_ns = 50'000 * kMs;
        LcmOptions options;
        options.url = "memq://";
        options.counters = &counters;
        options.clock = [] { return fake_now_ns; };
        return options;
    }
    std::uint64_t refused() const { return counters.get(Count::kAttitudesRefused); }

    Counters counters;
    LcmOptions options = options_for(counters);
    pipeline::AttitudeHandOver out{{}};
    AttitudeReceiver receiver{options, out};
};

attitude_t attitude(std::int64_t age_us) {
    attitude_t message{};
    message.utime = now_utime_us() - age_us;
    message.pitch_rad = 0.25;
    message.roll_rad = -0.125;
    message.sigma_rad = 0.5;
    return message;
}

std::vector<std::uint8_t> bytes_of(const attitude_t& message) {
    std::vector<std::uint8_t> bytes(static_cast<std::size_t>(message.getEncodedSize()));
    EXPECT_EQ(message.encode(bytes.data(), 0, static_cast<int>(bytes.size())),
              static_cast<int>(bytes.size()));
    return bytes;
}

void give(AttitudeReceiver& receiver, const std::vector<std::uint8_t>& bytes) {
    receiver.take(bytes.data(), static_cast<std::uint32_t>(bytes.size()));
}

TEST(AttitudeReceiver, HandsOnWhatComesOverLcm) {
    Receiver robot;
    robot.receiver.receive(1);  // opens and subscribes
    ASSERT_NE(robot.receiver.handle(), nullptr);
    EXPECT_EQ(robot.out.newest(), nullptr);
    const std::vector<std::uint8_t> bytes = bytes_of(attitude(0));
    ASSERT_EQ(lcm_publish(robot.receiver.handle(), "GROUNDLINE_ATTITUDE", bytes.data(),
                          static_cast<unsigned>(bytes.size())),
              0);
    robot.receiver.receive(1000);
    const pipeline::AttitudeHistory* history = robot.out.newest();
    ASSERT_NE(history, nullptr);
    const AttitudeInput taken = history->at(fake_now_ns, 1000 * kMs);
    ASSERT_TRUE(taken.valid);
    EXPECT_EQ(taken.pitch_rad, 0.25);
    EXPECT_EQ(taken.roll_rad, -0.125);
    EXPECT_EQ(taken.sigma_rad, 0.5);
    EXPECT_EQ(robot.refused(), 0U);
    EXPECT_EQ(robot.counters.get(Count::kAttitudesTaken), 1U);
}

// The sender's wall clock is compared with ours at arrival, and only the age goes to the pictures' clock.
TEST(AttitudeReceiver, DatesByAge) {
    Receiver robot;
    give(robot.receiver, bytes_of(attitude(400'000)));
    const pipeline::AttitudeHistory* history = robot.out.newest();
    ASSERT_NE(history, nullptr);
    // Within what a busy machine may take between the two readings of the clock, on the early side only.
    EXPECT_FALSE(history->at(fake_now_ns, 399 * kMs).valid);
    EXPECT_TRUE(history->at(fake_now_ns - 500 * kMs, 300 * kMs).valid);
}

TEST(AttitudeReceiver, RefusesAndCountsWhatIsOfNoUse) {
    Receiver robot;
    std::uint64_t refused = 0;
    const auto expect_refused = [&](const std::vector<std::uint8_t>& bytes, const char* what) {
        give(robot.receiver, bytes);
        EXPECT_EQ(robot.refused(), ++refused) << what;
        EXPECT_EQ(robot.out.newest(), nullptr) << what;
    };
    expect_refused(bytes_of(attitude(3'600'000'000)), "an hour old");
    expect_refused(bytes_of(attitude(-3'600'000'000)), "an hour ahead");
    attitude_t extreme = attitude(0);
    extreme.utime = std::numeric_limits<std::int64_t>::min();
    expect_refused(bytes_of(extreme), "at the beginning of time");
    extreme.utime = std::numeric_limits<std::int64_t>::max();
    expect_refused(bytes_of(extreme), "at its end");
    attitude_t bad = attitude(0);
    bad.roll_rad = std::numeric_limits<double>::quiet_NaN();
    expect_refused(bytes_of(bad), "no number");
    std::vector<std::uint8_t> bytes = bytes_of(attitude(0));
    bytes.pop_back();
    expect_refused(bytes, "a byte short");
    bytes = bytes_of(attitude(0));
    bytes.push_back(0);
    expect_refused(bytes, "a byte long");
    bytes = bytes_of(attitude(0));
    bytes[0] ^= 1U;
    expect_refused(bytes, "of another type");
    expect_refused({}, "empty");

    give(robot.receiver, bytes_of(attitude(0)));
    EXPECT_EQ(robot.refused(), refused);
    EXPECT_NE(robot.out.newest(), nullptr);
}

TEST(AttitudeReceiver, ADotInThePrefixIsADot) {
    Receiver robot;
    robot.options.prefix = "robot.1";
    AttitudeReceiver receiver(robot.options, robot.out);
    receiver.receive(1);
    const std::vector<std::uint8_t> bytes = bytes_of(attitude(0));
    for (const char* channel : {"robotX1_ATTITUDE", "robot.1_ATTITUDE"}) {
        lcm_publish(receiver.handle(), channel, bytes.data(), static_cast<unsigned>(bytes.size()));
        receiver.receive(50);
        EXPECT_EQ(robot.out.newest() != nullptr, channel[5] == '.') << channel;
    }
}

TEST(AttitudeReceiver, OpensAfreshWhereNothingComes) {
    Receiver robot;
    robot.options.url = "memq://a-name-longer-than-a-string-holds-in-itself";
    AttitudeReceiver receiver(robot.options, robot.out);
    receiver.receive(1);
    ASSERT_NE(receiver.handle(), nullptr);
    fake_now_ns += AttitudeReceiver::kSilentNs - kMs;
    receiver.receive(1);
    ASSERT_NE(receiver.handle(), nullptr);
    give(receiver, bytes_of(attitude(0)));
    fake_now_ns += AttitudeReceiver::kSilentNs - kMs;
    receiver.receive(1);
    ASSERT_NE(receiver.handle(), nullptr) << "something came in between";
    fake_now_ns += kMs;
    receiver.receive(1);
    EXPECT_EQ(receiver.handle(), nullptr);
    receiver.receive(1);
    EXPECT_NE(receiver.handle(), nullptr);
}

TEST(AttitudeReceiver, WaitsWhereLcmDoesNotOpen) {
    Receiver robot;
    robot.options.url = "file:///nowhere/at/all?mode=r";
    AttitudeReceiver receiver(robot.options, robot.out);
    receiver.receive(1);
    EXPECT_EQ(receiver.handle(), nullptr);
    robot.options.url = "nonsense";
    EXPECT_THROW(AttitudeReceiver(robot.options, robot.out), Refusal);
}

}  // namespace
}  // namespace groundline::publish
