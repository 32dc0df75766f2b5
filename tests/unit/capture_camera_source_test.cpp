// The live source over a simulated pair of cameras and a simulated clock: a second of life costs
// microseconds.
#include "capture/camera_source.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <map>
#include <set>
#include <string>
#include <vector>

#include "core/arena.hpp"
#include "support/allocation_count.hpp"

namespace groundline::capture {
namespace {

constexpr std::int64_t kMs = 1'000'000;
constexpr int kWidth = 32;
constexpr int kHeight = 24;
using State = verdict::CameraState;

// Time, and what happens when it has come.
class World final : public SourceClock {
  public:
    std::int64_t mono_ns() override { return now_ns; }
    std::int64_t utime_us() override { return now_ns / 1000 + 1'700'000'000'000'000; }
    void sleep_until(std::int64_t mono_ns) override { pass_to(mono_ns); }

    void at(double seconds, std::function<void()> what) {
        script_.emplace(begin_ns + static_cast<std::int64_t>(seconds * 1e9), std::move(what));
    }
    void pass_to(std::int64_t mono_ns) {
        while (!script_.empty() && script_.begin()->first <= mono_ns) {
            now_ns = std::max(now_ns, script_.begin()->first);
            const auto what = std::move(script_.begin()->second);
            script_.erase(script_.begin());
            what();
        }
        now_ns = std::max(now_ns, mono_ns);
    }
    double seconds() const { return static_cast<double>(now_ns - begin_ns) * 1e-9; }

    static constexpr std::int64_t begin_ns = 1000 * 1000 * kMs;
    std::int64_t now_ns = begin_ns;

  private:
    std::multimap<std::int64_t, std::function<void()>> script_;
};

// One simulated camera.
struct SimulatedEye {
    bool delivers = true;
    double period_ms = 33.0;
    double phase_ms = 0.0;
    double delay_ms = 5.0;  // from exposure to arrival
    std::int64_t next = 0;  // picture to come, counted from the start
    std::int64_t lost = 0;  // since the last delivered
    bool damaged = false;
    bool unusable = false;
    bool by_arrival = false;
    ExposureValues exposure{5000, 10};
};

class SimulatedCameras final : public CameraDriver {
  public:
    SimulatedCameras(World& world, bool side_by_side) : world_(world), side_by_side_(side_by_side) {}

    Fault open() override {
        meet("open");
        if (open_) ADD_FAILURE() << "opened twice";
        ++opened;
        if (!answer_to_open.ok()) return answer_to_open;
        open_ = true;
        return {};
    }
    Fault start() override {
        meet("start");
        world_.pass_to(world_.now_ns + start_takes_ms * kMs);
        started_ns_ = world_.now_ns;
        for (SimulatedEye& eye : eyes)
            eye.next = 0;
        held_.clear();
        return answer_to_start;
    }
    Waited wait(std::int64_t deadline_ns, CameraFrame& frame, Fault& fault) override {
        EXPECT_TRUE(open_) << "waited on what is closed";
        meet("wait");
        for (;;) {
            if (!breaks.ok()) {
                fault = breaks;
                return Waited::kFault;
            }
            // Whichever picture comes next; until then time passes, and the script may change everything.
            int first = -1;
            for (int eye = 0; eye < (side_by_side_ ? 1 : 2); ++eye)
                if (eyes[eye].delivers && (first < 0 || due_ns(eye) < due_ns(first))) first = eye;
            const std::int64_t due = first >= 0 ? due_ns(first) : std::numeric_limits<std::int64_t>::max();
            if (due <= world_.now_ns) {
                if (!take(first, frame)) continue;
                breaks = std::exchange(breaks_after_next, {});
                return Waited::kFrame;
            }
            if (world_.now_ns >= deadline_ns) return Waited::kNothing;
            // In small steps: what the script changes on the way counts.
            world_.pass_to(std::min({due, deadline_ns, world_.now_ns + kMs}));
        }
    }
    Fault copy(const CameraFrame& frame, Eye eye, Luma into) override {
        meet("copy");
        EXPECT_EQ(held_.count({static_cast<int>(frame.eye), frame.buffer}), 1U) << "copied what is not held";
        if (eyes[static_cast<std::size_t>(eye)].unusable)
            return {CameraFault::kFailed, Sentence("a picture is cut short")};
        fill_pixels(into, static_cast<std::uint8_t>((eye == Eye::kLeft ? 0 : 100) + frame.sequence % 100));
        return {};
    }
    void release(const CameraFrame& frame) override {
        EXPECT_TRUE(breaks.ok()) << "a buffer went back to a broken device";
        EXPECT_EQ(held_.erase({static_cast<int>(frame.eye), frame.buffer}), 1U)
            << "released what is not held";
    }
    void close() override {
        meet("close");
        open_ = false;
        held_.clear();
        ++closed;
    }
    int buffers_to_hold() const override { return buffers - 2; }
    std::string_view description() const override { return "two simulated cameras"; }
    std::int64_t left_out() const override { return 3; }
    Fault set_exposure(Eye eye, const ExposureValues& wanted) override {
        meet("set exposure");
        ++exposure_commands;
        if (!answer_to_exposure.ok()) return answer_to_exposure;
        eyes[static_cast<std::size_t>(eye)].exposure = wanted;
        return {};
    }
    ExposureValues read_exposure(Eye eye) override {
        meet("read exposure");
        return eyes[static_cast<std::size_t>(eye)].exposure;
    }

    bool is_open() const { return open_; }
    std::size_t held() const { return held_.size(); }

    std::array<SimulatedEye, 2> eyes;
    Fault answer_to_open;
    Fault answer_to_start;
    Fault answer_to_exposure;
    Fault breaks;
    Fault breaks_after_next;  // picture
    std::int64_t start_takes_ms = 0;
    int buffers = 6;
    int opened = 0;
    int closed = 0;
    int exposure_commands = 0;
    std::function<void(const char*)> on_call;  // sees each call that may take its time, wait() and copy()

  private:
    void meet(const char* call) const {
        if (on_call) on_call(call);
    }
    std::int64_t stamp_ns(int eye) const {
        const SimulatedEye& it = eyes[static_cast<std::size_t>(eye)];
        return started_ns_ +
               static_cast<std::int64_t>((it.phase_ms + it.period_ms * static_cast<double>(it.next)) * 1e6);
    }
    std::int64_t due_ns(int eye) const {
        return stamp_ns(eye) + static_cast<std::int64_t>(eyes[static_cast<std::size_t>(eye)].delay_ms * 1e6);
    }
    bool take(int eye, CameraFrame& frame) {
        SimulatedEye& it = eyes[static_cast<std::size_t>(eye)];
        int buffer = 0;
        while (held_.count({side_by_side_ ? 2 : eye, buffer}) > 0)
            ++buffer;
        const std::int64_t sequence = it.next;
        const std::int64_t stamp = stamp_ns(eye);
        ++it.next;
        if (buffer >= buffers) {  // nowhere to put it
            ++it.lost;
            return false;
        }
        frame.eye = side_by_side_ ? Eye::kBoth : static_cast<Eye>(eye);
        frame.buffer = buffer;
        frame.sequence = sequence;
        frame.exposure_mono_ns = stamp;
        frame.source = it.by_arrival ? StampSource::kArrival : StampSource::kEndOfFrame;
        frame.arrival_mono_ns = world_.now_ns;
        frame.lost = std::exchange(it.lost, 0);
        frame.damaged = it.damaged;
        held_.insert({static_cast<int>(frame.eye), buffer});
        return true;
    }

    World& world_;
    bool side_by_side_;
    bool open_ = false;
    std::int64_t started_ns_ = 0;
    std::set<std::pair<int, int>> held_;
};

struct Robot {
    explicit Robot(bool side_by_side = false, bool follow = false) {
        auto made = std::make_unique<SimulatedCameras>(world, side_by_side);
        cameras = made.get();
        CameraSourceConfig config;
        config.name = "cameras";
        config.width = kWidth;
        config.height = kHeight;
        config.side_by_side = side_by_side;
        config.follow_exposure = follow;
        source = std::make_unique<CameraSource>(config, std::move(made), counters, world);
        frame = StereoFrame::make(arena, kWidth, kHeight, false);
    }
    // Pulls until `seconds` after the beginning. Each turn keeps its time, nothing old or crossed comes out.
    void run_until(double seconds, std::int64_t busy_ms = 0) {
        while (world.seconds() < seconds) {
            const std::int64_t begin_ns = world.now_ns;
            const Pull pull = source->next(frame);
            EXPECT_LE(world.now_ns - begin_ns, 100 * kMs + cameras->start_takes_ms * kMs);
            const double second = world.seconds();
            switch (pull) {
                case Pull::kFrame:
                    ++pairs;
                    pair_seconds.push_back(second);
                    EXPECT_GT(frame.stamp.exposure_mono_ns, last_exposure_ns);
                    EXPECT_LE(std::abs(frame.stamp.skew_ns), 10 * kMs);
                    EXPECT_EQ(frame.stamp.sequence, pairs - 1);
                    last_exposure_ns = frame.stamp.exposure_mono_ns;
                    break;
                case Pull::kIdle:
                    ++idle;
                    break;
                case Pull::kBad:
                    ++bad;
                    break;
                case Pull::kEnd:
                    ADD_FAILURE() << "a live source ended";
                    return;
            }
            EXPECT_LE(cameras->held(), 8U);
            source->take_notices([&](const CameraNotice& notice) {
                notices.push_back((notice.good ? "+ " : "- ") + std::string(notice.sentence.view()));
            });
            if (pull == Pull::kFrame) world.pass_to(world.now_ns + busy_ms * kMs);
        }
    }
    std::uint64_t count(Count which) const { return counters.get(which); }
    // Pairs delivered in [from, to).
    int pairs_in(double from, double to) const {
        int sum = 0;
        for (const double second : pair_seconds)
            sum += second >= from && second < to ? 1 : 0;
        return sum;
    }

    World world;
    SimulatedCameras* cameras = nullptr;
    Counters counters;
    Arena arena;
    std::unique_ptr<CameraSource> source;
    StereoFrame frame;
    std::int64_t pairs = 0;
    std::int64_t idle = 0;
    std::int64_t bad = 0;
    std::int64_t last_exposure_ns = 0;
    std::vector<double> pair_seconds;
    std::vector<std::string> notices;
};

using Notices = std::vector<std::string>;
const Fault kGone{CameraFault::kAbsent, Sentence("left camera: No such device")};

TEST(CameraSource, SaysWhatItIsBeforeAnyCameraIsThere) {
    Robot robot;
    EXPECT_TRUE(robot.source->info().live);
    EXPECT_EQ(robot.source->info().width, kWidth);
    EXPECT_EQ(robot.source->info().length, -1);
    EXPECT_EQ(robot.cameras->opened, 0);
    EXPECT_EQ(robot.source->status().state, State::kAbsent);
}

TEST(CameraSource, PairsComeWithStampsPixelsAndFigures) {
    Robot robot;
    robot.cameras->eyes[1].phase_ms = 1.5;
    robot.cameras->eyes[1].exposure.exposure_us = 7000;
    robot.run_until(2.96);
    EXPECT_EQ(robot.pairs, 91);
    EXPECT_EQ(robot.notices, Notices{"+ two simulated cameras"});
    const FrameStamp& stamp = robot.frame.stamp;
    EXPECT_EQ(stamp.skew_ns, 1'500'000);
    EXPECT_EQ(stamp.source, StampSource::kEndOfFrame);
    EXPECT_EQ(stamp.exposure_mono_ns, World::begin_ns + 90 * 33 * kMs);
    EXPECT_EQ(stamp.utime_us, 1'700'000'000'000'000 + stamp.exposure_mono_ns / 1000);
    EXPECT_EQ(stamp.name_view(), "camera 90 90");
    EXPECT_EQ(robot.frame.left.at(5, 5), 90);
    EXPECT_EQ(robot.frame.right.at(5, 5), 190);
    const CameraStatus status = robot.source->status();
    EXPECT_EQ(status.state, State::kRunning);
    EXPECT_DOUBLE_EQ(status.skew_ms, 1.5);
    EXPECT_DOUBLE_EQ(status.exposure_difference_ms, 2.0);
    EXPECT_DOUBLE_EQ(status.mean[0], 90.0);
    EXPECT_DOUBLE_EQ(status.mean[1], 190.0);
    EXPECT_DOUBLE_EQ(status.saturated_share[1], 0.0);
    EXPECT_EQ(robot.count(Count::kCameraLeftOut), 3U);
    EXPECT_EQ(robot.count(Count::kCameraSingles), 0U);
    EXPECT_EQ(robot.count(Count::kCameraGaps), 0U);
}

TEST(CameraSource, ADateByArrivalOnEitherSideIsSaid) {
    for (const std::size_t eye : {0U, 1U}) {
        Robot robot;
        robot.cameras->eyes[eye].by_arrival = true;
        robot.run_until(0.2);
        EXPECT_EQ(robot.frame.stamp.source, StampSource::kArrival);
    }
}

TEST(CameraSource, WaitsForCamerasThatComeLate) {
    Robot robot;
    robot.cameras->answer_to_open = kGone;
    robot.world.at(20.0, [&] { robot.cameras->answer_to_open = {}; });
    robot.run_until(19.9);
    EXPECT_EQ(robot.pairs, 0);
    EXPECT_GT(robot.idle, 200) << "stop is looked for all the while";
    EXPECT_LT(robot.cameras->opened, 25) << "once a second";
    EXPECT_EQ(robot.notices, Notices{"- left camera: No such device"});
    robot.run_until(25.0);
    EXPECT_GT(robot.pairs_in(20.0, 21.2), 0) << "within a second and a bit";
    EXPECT_EQ(robot.notices.size(), 2U);
    EXPECT_EQ(robot.count(Count::kCameraRestarts), 0U);
}

TEST(CameraSource, ComesBackAfterEachOfTenReplugs) {
    Robot robot;
    for (int i = 0; i < 10; ++i) {
        robot.world.at(5.0 + 10 * i, [&] {
            robot.cameras->breaks = kGone;
            robot.cameras->answer_to_open = kGone;
        });
        robot.world.at(9.0 + 10 * i, [&] { robot.cameras->answer_to_open = robot.cameras->breaks = {}; });
    }
    robot.run_until(104.0);
    for (int i = 0; i < 10; ++i) {
        EXPECT_EQ(robot.pairs_in(5.01 + 10 * i, 9.0 + 10 * i), 0) << "nothing old is delivered";
        EXPECT_GT(robot.pairs_in(9.0 + 10 * i, 11.0 + 10 * i), 20) << i;
    }
    EXPECT_EQ(robot.notices.size(), 21U) << "one line for each change";
    EXPECT_EQ(robot.count(Count::kCameraRestarts), 10U);
    // Opened, found absent a few times, closed as often.
    EXPECT_EQ(robot.cameras->closed, robot.cameras->opened - 1);
}

TEST(CameraSource, AWriterThatDiesIsAStallAndIsTriedAgain) {
    Robot robot;
    robot.world.at(5.0, [&] { robot.cameras->eyes[0].delivers = robot.cameras->eyes[1].delivers = false; });
    robot.run_until(6.9);
    EXPECT_EQ(robot.source->status().state, State::kRunning);
    robot.run_until(7.2);
    EXPECT_EQ(robot.source->status().state, State::kStalled);
    EXPECT_EQ(robot.source->status().fault, CameraFault::kNone);
    EXPECT_FALSE(robot.cameras->is_open());
    ASSERT_EQ(robot.notices.size(), 2U);
    EXPECT_EQ(robot.notices[1], "- both cameras gave no picture for too long; closed, to be opened again");
    robot.run_until(7.5);
    EXPECT_EQ(robot.source->status().state, State::kStarting) << "opened again, with the longer limit now";
    robot.run_until(17.0);
    EXPECT_EQ(robot.source->status().state, State::kStarting);
    EXPECT_EQ(robot.cameras->opened, 2);
    robot.world.at(17.1, [&] {
        for (SimulatedEye& eye : robot.cameras->eyes) {
            eye.delivers = true;
            eye.next = 300;
        }
    });
    robot.run_until(20.0);
    EXPECT_GT(robot.pairs_in(17.1, 18.0), 10);
    EXPECT_EQ(robot.notices.size(), 3U);
}

TEST(CameraSource, OneDeadEyeIsNamedAndPairsNothing) {
    Robot robot;
    robot.world.at(3.0, [&] { robot.cameras->eyes[1].delivers = false; });
    robot.run_until(5.2);
    EXPECT_EQ(robot.pairs_in(3.1, 5.2), 0);
    EXPECT_EQ(robot.source->status().state, State::kStalled);
    ASSERT_EQ(robot.notices.size(), 2U);
    EXPECT_NE(robot.notices[1].find("the right camera gave no picture"), std::string::npos)
        << robot.notices[1];
    EXPECT_GT(robot.count(Count::kCameraSingles), 50U);
}

TEST(CameraSource, ASlowStarterIsGivenItsTime) {
    Robot robot;
    robot.cameras->eyes[1].delivers = false;
    robot.world.at(8.0, [&] {
        robot.cameras->eyes[1].delivers = true;
        robot.cameras->eyes[1].next = 243;
    });
    robot.run_until(12.0);
    EXPECT_EQ(robot.cameras->opened, 1);
    EXPECT_GT(robot.pairs_in(8.0, 12.0), 100);
    EXPECT_EQ(robot.notices, Notices{"+ two simulated cameras"});
}

TEST(CameraSource, OneCameraAtHalfTheRatePairsEverySecondPicture) {
    Robot robot;
    robot.cameras->eyes[1].period_ms = 66.0;
    robot.run_until(10.0);
    EXPECT_NEAR(static_cast<double>(robot.pairs), 151.0, 2.0);
    EXPECT_NEAR(static_cast<double>(robot.count(Count::kCameraSingles)), 151.0, 4.0);
    EXPECT_FALSE(robot.source->status().out_of_step);
}

TEST(CameraSource, OutOfStepIsToldOnceAndPairsNothing) {
    Robot robot;
    robot.cameras->eyes[1].phase_ms = 16.0;
    robot.run_until(3.0);
    EXPECT_EQ(robot.pairs, 0);
    EXPECT_EQ(robot.source->status().state, State::kRunning);
    EXPECT_TRUE(robot.source->status().out_of_step);
    EXPECT_NEAR(std::abs(robot.source->status().skew_ms), 16.5, 0.6);
    ASSERT_EQ(robot.notices.size(), 2U);
    EXPECT_NE(robot.notices[1].find("out of step"), std::string::npos);
    robot.world.at(3.0, [&] { robot.cameras->eyes[1].phase_ms = 2.0; });
    robot.run_until(5.0);
    EXPECT_GT(robot.pairs, 50);
    EXPECT_FALSE(robot.source->status().out_of_step);
    robot.run_until(6.0);
    ASSERT_EQ(robot.notices.size(), 3U);
    EXPECT_EQ(robot.notices[2], "+ the cameras are in step again");
}

TEST(CameraSource, CamerasAtTheEdgeOfTheToleranceDoNotFillTheLog) {
    Robot robot;
    for (int i = 0; i < 60; ++i)
        robot.world.at(i, [&, i] { robot.cameras->eyes[1].phase_ms = i % 2 == 0 ? 9.0 : 12.0; });
    robot.run_until(60.0);
    EXPECT_LE(robot.notices.size(), 13U);
    EXPECT_GE(robot.notices.size(), 3U);
}

TEST(CameraSource, CamerasThatDriftApartAreFoundOutBeforeAndAfter) {
    Robot robot;
    robot.cameras->eyes[1].period_ms = 33.0 * (1 + 200e-6);
    robot.run_until(45.0);
    EXPECT_NEAR(robot.source->status().drift_ppm, 200.0, 2.0);
    EXPECT_NEAR(robot.source->status().skew_ms, 9.0, 0.1);
    EXPECT_FALSE(robot.source->status().out_of_step);
    robot.run_until(55.0);
    EXPECT_TRUE(robot.source->status().out_of_step);
    EXPECT_EQ(robot.pairs_in(51.0, 55.0), 0);
    EXPECT_EQ(robot.notices.size(), 2U);
}

TEST(CameraSource, DamagedPicturesAreCountedAndNotUsed) {
    Robot robot;
    robot.world.at(2.0, [&] { robot.cameras->eyes[0].damaged = true; });
    robot.world.at(3.0, [&] { robot.cameras->eyes[0].damaged = false; });
    robot.run_until(4.0);
    EXPECT_NEAR(static_cast<double>(robot.count(Count::kCameraDamaged)), 30.0, 1.0);
    EXPECT_EQ(robot.pairs_in(2.05, 3.0), 0);
    EXPECT_GT(robot.pairs_in(3.0, 4.0), 25);
    EXPECT_EQ(robot.count(Count::kCameraRestarts), 0U);
    // A camera that gives nothing else is as good as dead.
    robot.world.at(4.0, [&] { robot.cameras->eyes[0].damaged = true; });
    robot.run_until(6.5);
    EXPECT_EQ(robot.count(Count::kCameraRestarts), 1U);
}

TEST(CameraSource, APictureThatCannotBeUnpackedIsABadPairWithASentence) {
    Robot robot;
    robot.cameras->eyes[1].unusable = true;
    robot.run_until(1.0);
    EXPECT_EQ(robot.pairs, 0);
    EXPECT_GT(robot.bad, 25);
    EXPECT_EQ(robot.source->error(), "a picture is cut short");
    EXPECT_EQ(robot.source->status().last_fault.view(), "a picture is cut short");
    robot.cameras->eyes[1].unusable = false;
    robot.run_until(2.0);
    EXPECT_GT(robot.pairs, 25);
}

TEST(CameraSource, WhichEyeLosesPicturesIsToldAtMostOnceAMinute) {
    Robot robot;
    for (int i = 0; i < 100; ++i)
        robot.world.at(2.0 + i, [&] { robot.cameras->eyes[1].lost = 3; });
    robot.world.at(10.0, [&] { robot.cameras->eyes[0].damaged = true; });
    robot.world.at(10.99, [&] { robot.cameras->eyes[0].damaged = false; });
    robot.run_until(130.0);
    ASSERT_EQ(robot.notices.size(), 5U);
    const std::string advice = "; look at its cable, its bus and the load";
    EXPECT_EQ(robot.notices[1], "- the right camera lost 3 pictures and gave 0 damaged ones" + advice);
    EXPECT_EQ(robot.notices[2], "- the left camera lost 0 pictures and gave 30 damaged ones" + advice);
    EXPECT_EQ(robot.notices[3], "- the right camera lost 180 pictures and gave 0 damaged ones" + advice);
    EXPECT_EQ(robot.notices[4], "- the right camera lost 117 pictures and gave 0 damaged ones" + advice);
}

TEST(CameraSource, ACameraThatGivesNothingUsableIsOpenedAgain) {
    for (const bool side_by_side : {false, true}) {
        Robot robot(side_by_side);
        robot.world.at(2.0, [&] { robot.cameras->eyes[1].unusable = true; });
        robot.run_until(3.9);
        EXPECT_EQ(robot.count(Count::kCameraRestarts), 0U);
        robot.run_until(4.2);
        EXPECT_EQ(robot.count(Count::kCameraRestarts), 1U);
        ASSERT_EQ(robot.notices.size(), 2U);
        EXPECT_EQ(robot.notices[1],
                  std::string("- ") + (side_by_side ? "the stereo camera" : "the right camera") +
                      " gave no picture that can be used for too long; closed, to be opened again; the last "
                      "was: a picture is cut short");
        // It is given its time to start, as one that gives nothing is, and told once.
        robot.run_until(60.0);
        EXPECT_GE(robot.count(Count::kCameraRestarts), 4U);
        EXPECT_LE(robot.count(Count::kCameraRestarts), 8U);
        EXPECT_EQ(robot.notices.size(), 2U);
        EXPECT_NE(robot.source->status().state, State::kRunning);
        robot.cameras->eyes[1].unusable = false;
        robot.run_until(66.0);
        EXPECT_GT(robot.pairs_in(64.5, 66.0), 40);
        EXPECT_EQ(robot.source->status().state, State::kRunning);
        EXPECT_EQ(robot.notices.size(), 3U);
    }
}

TEST(CameraSource, BadPicturesHereAndThereAreNoStall) {
    Robot robot;
    for (int i = 0; i < 40; ++i) {
        robot.world.at(1.0 + 0.5 * i, [&, i] { robot.cameras->eyes[i % 2].unusable = true; });
        robot.world.at(1.4 + 0.5 * i, [&, i] { robot.cameras->eyes[i % 2].unusable = false; });
    }
    robot.run_until(22.0);
    EXPECT_GT(robot.bad, 400);
    EXPECT_EQ(robot.count(Count::kCameraRestarts), 0U);
}

TEST(CameraSource, UnusableAndThenOutOfStepIsNotSilent) {
    Robot robot;
    robot.world.at(2.0, [&] { robot.cameras->eyes[1].unusable = true; });
    robot.world.at(3.0, [&] { robot.cameras->eyes[1].phase_ms = 16.0; });
    robot.run_until(10.0);
    EXPECT_EQ(robot.count(Count::kCameraRestarts), 0U);
    EXPECT_TRUE(robot.source->status().out_of_step);
}

TEST(CameraSource, ASlowReaderGetsTheNewestPairAndTheRestIsCounted) {
    Robot robot;
    robot.run_until(10.0, 200);  // 5 pairs a second of 30
    EXPECT_NEAR(static_cast<double>(robot.pairs), 50.0, 5.0);
    EXPECT_LT(robot.world.now_ns - robot.last_exposure_ns, 300 * kMs);
    const auto superseded = static_cast<std::int64_t>(robot.count(Count::kCameraSuperseded));
    const auto gaps = static_cast<std::int64_t>(robot.count(Count::kCameraGaps));
    EXPECT_EQ(robot.pairs + superseded + gaps / 2, robot.cameras->eyes[0].next - robot.cameras->eyes[0].lost)
        << "each picture is somewhere";
    EXPECT_EQ(robot.count(Count::kCameraRestarts), 0U);
}

TEST(CameraSource, AReaderThatWasStoppedFindsNoStall) {
    Robot robot;
    robot.run_until(3.0);
    robot.world.pass_to(robot.world.now_ns + 8000 * kMs);
    robot.run_until(14.0);
    EXPECT_EQ(robot.count(Count::kCameraRestarts), 0U);
    EXPECT_GT(robot.pairs_in(11.0, 14.0), 80);
}

TEST(CameraSource, FewBuffersAreEnough) {
    for (const int buffers : {3, 4}) {
        Robot robot;
        robot.cameras->buffers = buffers;
        robot.cameras->eyes[1].phase_ms = 4.0;
        robot.run_until(5.0);
        EXPECT_GE(robot.pairs, 149) << buffers;
        EXPECT_EQ(robot.count(Count::kCameraGaps), 0U) << buffers;
        // One eye waits for the other in vain; two buffers are the device's all the same.
        robot.cameras->eyes[1].delivers = false;
        robot.run_until(6.0);
        EXPECT_LE(robot.cameras->held(), static_cast<std::size_t>(buffers - 2));
        EXPECT_EQ(robot.count(Count::kCameraGaps), 0U) << buffers;
    }
}

TEST(CameraSource, SideBySideEachPictureIsAPair) {
    Robot robot(true);
    robot.run_until(2.96);
    EXPECT_EQ(robot.pairs, 91);
    EXPECT_EQ(robot.frame.stamp.skew_ns, 0);
    EXPECT_EQ(robot.frame.left.at(0, 0), 90);
    EXPECT_EQ(robot.frame.right.at(0, 0), 190);
    EXPECT_TRUE(std::isnan(robot.source->status().exposure_difference_ms));
    robot.run_until(6.0, 150);
    EXPECT_GT(robot.count(Count::kCameraSuperseded), 50U);
    robot.cameras->eyes[0].delivers = false;
    robot.run_until(9.0);
    EXPECT_EQ(robot.count(Count::kCameraRestarts), 1U);
    ASSERT_EQ(robot.notices.size(), 2U);
    EXPECT_EQ(robot.notices[1],
              "- the stereo camera gave no picture for too long; closed, to be opened again");
}

TEST(CameraSource, APictureSideBySideThatAFaultOvertakesIsCounted) {
    Robot robot(true);
    robot.run_until(2.0);
    const auto accounted = [&] {
        return robot.pairs + static_cast<std::int64_t>(robot.count(Count::kCameraSuperseded));
    };
    EXPECT_EQ(accounted(), robot.cameras->eyes[0].next);
    robot.cameras->breaks_after_next = kGone;
    robot.run_until(2.1);
    EXPECT_EQ(robot.count(Count::kCameraRestarts), 1U);
    EXPECT_EQ(accounted(), robot.cameras->eyes[0].next);
}

TEST(CameraSource, TheRightCameraFollowsTheLeftOnesExposure) {
    Robot robot(false, true);
    robot.world.at(2.0, [&] { robot.cameras->eyes[0].exposure = {9000, 20}; });
    robot.run_until(5.0);
    EXPECT_EQ(robot.cameras->eyes[1].exposure.exposure_us, 9000);
    EXPECT_EQ(robot.cameras->eyes[1].exposure.gain, 20);
    EXPECT_EQ(robot.cameras->exposure_commands, 1);
    EXPECT_DOUBLE_EQ(robot.source->status().exposure_difference_ms, 0.0);
    EXPECT_EQ(robot.notices.size(), 1U);

    Robot apart(false, false);
    apart.cameras->eyes[0].exposure = {9000, 20};
    apart.run_until(3.0);
    EXPECT_EQ(apart.cameras->exposure_commands, 0);

    Robot unwilling(false, true);
    unwilling.cameras->answer_to_exposure = {CameraFault::kRefused, Sentence("takes no exposure")};
    unwilling.cameras->eyes[0].exposure = {9000, 20};
    unwilling.run_until(20.0);
    EXPECT_EQ(unwilling.cameras->exposure_commands, 1) << "asked once for each opening";
    EXPECT_EQ(unwilling.notices, (Notices{"+ two simulated cameras", "- takes no exposure"}));
    EXPECT_GT(unwilling.pairs, 500);

    Robot hindered(false, true);
    hindered.cameras->answer_to_exposure = {CameraFault::kFailed, Sentence("does not answer")};
    hindered.cameras->eyes[0].exposure = {9000, 20};
    hindered.world.at(3.0, [&] { hindered.cameras->answer_to_exposure = {}; });
    hindered.run_until(2.0);
    EXPECT_EQ(hindered.source->status().last_fault.view(), "does not answer");
    hindered.run_until(10.0);
    EXPECT_EQ(hindered.cameras->eyes[1].exposure.exposure_us, 9000) << "asked again";
    EXPECT_EQ(hindered.notices, Notices{"+ two simulated cameras"});
}

TEST(CameraSource, SaysWhileADeviceMayTakeItsTime) {
    Robot robot(false, true);
    std::map<std::string, std::set<bool>> seen;
    robot.cameras->on_call = [&](const char* call) { seen[call].insert(robot.source->in_device_call()); };
    robot.world.at(2.0, [&] { robot.cameras->eyes[0].exposure = {9000, 20}; });
    robot.world.at(5.0, [&] { robot.cameras->breaks = kGone; });
    robot.world.at(5.1, [&] { robot.cameras->breaks = {}; });
    EXPECT_FALSE(robot.source->in_device_call());
    robot.run_until(7.0);
    EXPECT_FALSE(robot.source->in_device_call());
    robot.cameras->on_call = nullptr;
    const std::set<bool> always = {true};
    const std::map<std::string, std::set<bool>> wanted = {
        {"open", always},          {"start", always}, {"close", always}, {"set exposure", always},
        {"read exposure", always}, {"wait", {false}}, {"copy", {false}}};
    EXPECT_EQ(seen, wanted);
}

TEST(CameraSource, NoPairWaitsForALookAtTheExposure) {
    for (const bool follow : {false, true}) {
        Robot robot(false, follow);
        robot.run_until(2.0);
        int looks = 0;
        bool copied = false;
        robot.cameras->on_call = [&](const char* call) {
            const std::string_view name = call;
            copied = copied || name == "copy";
            if (name != "read exposure") return;
            ++looks;
            EXPECT_FALSE(copied) << "a pair was kept back";
        };
        while (robot.world.seconds() < 12.0) {
            copied = false;
            robot.source->next(robot.frame);
        }
        EXPECT_NEAR(looks, follow ? 40 : 20, 3);
        robot.cameras->on_call = nullptr;
    }
}

TEST(CameraSource, AFailedStartIsClosedAndBackedOff) {
    Robot robot;
    robot.cameras->answer_to_start = {CameraFault::kFailed, Sentence("no room on the bus")};
    robot.run_until(20.0);
    EXPECT_EQ(robot.cameras->opened, robot.cameras->closed);
    EXPECT_LE(robot.cameras->opened, 9) << "0, 0.25, 0.75, 1.75, 3.75, 7.75, ... s";
    EXPECT_EQ(robot.notices, Notices{"- no room on the bus"});
    EXPECT_EQ(robot.source->status().state, State::kBackingOff);
    EXPECT_EQ(robot.source->status().fault, CameraFault::kFailed);
}

TEST(CameraSource, NoticesNobodyTakesDoNotPileUp) {
    Robot robot;
    for (int i = 0; i < 60; ++i) {
        robot.world.at(5.0 * i + 4.0, [&] { robot.cameras->breaks = kGone; });
        robot.world.at(5.0 * i + 4.1, [&] { robot.cameras->breaks = {}; });
    }
    StereoFrame frame = robot.frame;
    while (robot.world.seconds() < 300.0)
        robot.source->next(frame);
    int told = 0;
    robot.source->take_notices([&](const CameraNotice&) { ++told; });
    EXPECT_EQ(told, 32);
}

TEST(CameraSource, SteadyStateAllocatesAndLocksNothingOver1000Pairs) {
    // The simulated driver's set of buffers allocates a node for each picture it holds, and nothing else
    // does.
    Robot robot;
    robot.cameras->eyes[1].phase_ms = 1.0;
    for (int i = 0; i < 100; ++i)
        robot.source->next(robot.frame);
    const std::uint64_t allocations = test::allocations();
    const std::uint64_t locks = test::mutex_locks();
    const std::int64_t pictures = robot.cameras->eyes[0].next + robot.cameras->eyes[1].next;
    std::int64_t pairs = 0;
    while (pairs < 1000)
        pairs += robot.source->next(robot.frame) == Pull::kFrame ? 1 : 0;
    const std::int64_t taken = robot.cameras->eyes[0].next + robot.cameras->eyes[1].next - pictures;
#if !defined(__SANITIZE_ADDRESS__) && !defined(__SANITIZE_THREAD__)
    EXPECT_EQ(test::allocations() - allocations, static_cast<std::uint64_t>(taken));
#endif
    EXPECT_EQ(test::mutex_locks(), locks);
}

}  // namespace
}  // namespace groundline::capture
