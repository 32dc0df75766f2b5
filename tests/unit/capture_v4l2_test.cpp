// The V4L2 driver against a scripted kernel: set-up, stamps, gaps, faults, and that it gives everything back.
#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <deque>
#include <filesystem>
#include <fstream>

#include "capture/camera_source.hpp"
#include "capture/v4l2_driver.hpp"
#include "core/arena.hpp"
#include "support/allocation_count.hpp"
#include "unit/jpeg_support.hpp"
#include "unit/v4l2_fake_kernel.hpp"

namespace groundline::capture {
namespace {

using test::FakeCamera;
using test::FakeFormat;
using test::FakeKernel;
using test::FakePicture;
using test::kMs;
using Waited = CameraDriver::Waited;

constexpr int kWidth = 64;
constexpr int kHeight = 48;

CameraSetup two_cameras() {
    CameraSetup setup;
    setup.left = "/dev/video0";
    setup.right = "/dev/video2";
    setup.width = kWidth;
    setup.height = kHeight;
    return setup;
}

struct Rig {
    explicit Rig(CameraSetup with = two_cameras()) : setup(std::move(with)), driver(setup, kernel) {
        for (const std::string& path : {setup.left, setup.right, setup.device})
            if (!path.empty()) kernel.camera(path);
    }
    FakeCamera& left() { return kernel.camera(setup.left); }
    FakeCamera& right() { return kernel.camera(setup.right); }
    void start() {
        fault = driver.open();
        ASSERT_TRUE(fault.ok()) << fault.sentence.view();
        fault = driver.start();
        ASSERT_TRUE(fault.ok()) << fault.sentence.view();
    }
    Waited wait(std::int64_t ms = 0) { return driver.wait(kernel.now_ns + ms * kMs, frame, fault); }
    // Nothing is left behind, and no rule was broken on the way.
    void expect_all_given_back() {
        driver.close();
        EXPECT_EQ(kernel.opened, kernel.closed);
        EXPECT_EQ(kernel.mappings(), 0);
        for (const std::string& breach : kernel.breaches)
            ADD_FAILURE() << breach;
    }

    CameraSetup setup;
    FakeKernel kernel;
    V4l2Driver driver;
    CameraFrame frame;
    Fault fault;
};

bool contains(const Sentence& sentence, const char* part) {
    return sentence.view().find(part) != std::string_view::npos;
}

TEST(V4l2, PicturesOfBothEyesComeWithTheirStampsSequencesAndPixels) {
    Rig rig;
    rig.start();
    std::vector<std::uint8_t> memory(kWidth * kHeight);
    const Luma luma(memory.data(), kWidth, kHeight, kWidth);
    for (int i = 0; i < 50; ++i) {
        rig.kernel.now_ns += 33 * kMs;
        const std::int64_t stamp_ns = rig.kernel.now_ns - 5 * kMs;
        rig.left().expose(stamp_ns, static_cast<std::uint8_t>(i));
        rig.right().expose(stamp_ns + kMs, static_cast<std::uint8_t>(100 + i),
                           V4L2_BUF_FLAG_TIMESTAMP_MONOTONIC | V4L2_BUF_FLAG_TSTAMP_SRC_SOE);
        for (int eye = 0; eye < 2; ++eye) {
            ASSERT_EQ(rig.wait(), Waited::kFrame);
            const bool right = rig.frame.eye == Eye::kRight;
            EXPECT_EQ(rig.frame.sequence, i);
            EXPECT_EQ(rig.frame.lost, 0);
            EXPECT_EQ(rig.frame.exposure_mono_ns, stamp_ns + (right ? kMs : 0));
            EXPECT_EQ(rig.frame.source, right ? StampSource::kStartOfExposure : StampSource::kEndOfFrame);
            EXPECT_EQ(rig.frame.arrival_mono_ns, rig.kernel.now_ns);
            EXPECT_FALSE(rig.frame.damaged);
            ASSERT_TRUE(rig.driver.copy(rig.frame, rig.frame.eye, luma).ok());
            EXPECT_EQ(memory[0], (right ? 100 : 0) + i);
            EXPECT_EQ(memory.back(), memory[0]);
            rig.driver.release(rig.frame);
        }
        ASSERT_EQ(rig.wait(), Waited::kNothing);
    }
    EXPECT_EQ(rig.driver.left_out(), 0);
    EXPECT_EQ(rig.driver.buffers_to_hold(), 4);
    EXPECT_EQ(rig.driver.description(),
              "/dev/video0 (fake) grey 64x48 at 30 Hz, /dev/video2 (fake) grey 64x48 at 30 Hz");
    rig.expect_all_given_back();
}

TEST(V4l2, WaitsUntilTheDeadlineAndWakesForAPicture) {
    Rig rig;
    rig.start();
    const std::int64_t begin_ns = rig.kernel.now_ns;
    EXPECT_EQ(rig.wait(40), Waited::kNothing);
    EXPECT_EQ(rig.kernel.now_ns, begin_ns + 40 * kMs);
    rig.kernel.at(begin_ns + 60 * kMs, [&] { rig.right().expose(begin_ns + 55 * kMs, 1); });
    EXPECT_EQ(rig.wait(100), Waited::kFrame);
    EXPECT_EQ(rig.kernel.now_ns, begin_ns + 60 * kMs);
    EXPECT_EQ(rig.frame.eye, Eye::kRight);
}

TEST(V4l2, InterruptedCallsAreMadeAgain) {
    Rig rig;
    rig.kernel.interruptions = 3;
    rig.start();
    rig.kernel.interruptions = 2;
    rig.left().expose(rig.kernel.now_ns, 1);
    EXPECT_EQ(rig.wait(), Waited::kFrame);
    rig.kernel.interruptions = 2;
    rig.driver.release(rig.frame);
    rig.expect_all_given_back();
}

TEST(V4l2, GapsAreCountedAndOddNumberingIsNot) {
    Rig rig;
    rig.start();
    struct Step {
        std::uint32_t sequence;
        std::int64_t lost;
        std::int64_t expected;
    };
    for (const Step& step : {Step{7, 0, 0},  // the first is the beginning, whatever its number
                             {8, 0, 1},
                             {11, 2, 4},
                             {11, 0, 5},  // not counting
                             {3, 0, 6},   // begins anew
                             {4, 0, 7},
                             {0xFFFFFFFFU, 0, 8},
                             {0, 0, 9},
                             {2, 1, 11}}) {
        rig.left().sequence = step.sequence;
        rig.left().expose(rig.kernel.now_ns, 1);
        ASSERT_EQ(rig.wait(), Waited::kFrame);
        EXPECT_EQ(rig.frame.lost, step.lost) << step.sequence;
        EXPECT_EQ(rig.frame.sequence, step.expected) << step.sequence;
        rig.driver.release(rig.frame);
    }
}

TEST(V4l2, StampsOfWhateverClockBecomeMonotonic) {
    const std::uint32_t unknown = V4L2_BUF_FLAG_TIMESTAMP_UNKNOWN;
    struct Case {
        const char* what;
        std::uint32_t flags;
        std::int64_t ahead_of_mono_ns;  // of the device's clock
        StampSource source;
        bool own;
    };
    Rig probe;
    for (const Case& c :
         {Case{"monotonic and says so", V4L2_BUF_FLAG_TIMESTAMP_MONOTONIC, 0, StampSource::kEndOfFrame, true},
          {"monotonic and says nothing", unknown, 0, StampSource::kArrival, true},
          {"wall clock and says nothing", unknown, probe.kernel.wall_minus_mono_ns, StampSource::kArrival,
           true},
          {"wall clock and says monotonic", V4L2_BUF_FLAG_TIMESTAMP_MONOTONIC,
           probe.kernel.wall_minus_mono_ns, StampSource::kEndOfFrame, true},
          {"no clock", unknown, -500'000 * kMs, StampSource::kArrival, false}}) {
        Rig rig;
        rig.start();
        for (int i = 0; i < 20; ++i) {
            rig.kernel.now_ns += 33 * kMs;
            const std::int64_t exposed_ns = rig.kernel.now_ns - 20 * kMs;
            rig.left().expose(exposed_ns + c.ahead_of_mono_ns, 1, c.flags);
            const Waited waited = rig.wait();
            if (!c.own && i < StampClock::kTries - 1) {
                ASSERT_EQ(waited, Waited::kNothing) << c.what << i;
                continue;
            }
            ASSERT_EQ(waited, Waited::kFrame) << c.what << i;
            EXPECT_EQ(rig.frame.exposure_mono_ns, c.own ? exposed_ns : rig.kernel.now_ns) << c.what;
            EXPECT_EQ(rig.frame.source, c.source) << c.what;
            rig.driver.release(rig.frame);
        }
        if (!c.own) {  // it stays so, even if a stamp happens to fit
            rig.left().expose(rig.kernel.now_ns - kMs, 1, c.flags);
            ASSERT_EQ(rig.wait(), Waited::kFrame);
            EXPECT_EQ(rig.frame.exposure_mono_ns, rig.kernel.now_ns);
        }
        rig.expect_all_given_back();
    }
}

TEST(V4l2, AStampThatWrapsIsReplacedByTheArrival) {
    Rig rig;
    rig.start();
    rig.left().expose(rig.kernel.now_ns, 1);
    ASSERT_EQ(rig.wait(), Waited::kFrame);
    for (const std::int64_t wrong_ns : {std::int64_t{5}, rig.kernel.now_ns + 3000 * kMs}) {
        rig.left().expose(wrong_ns, 1);
        ASSERT_EQ(rig.wait(), Waited::kFrame);
        EXPECT_EQ(rig.frame.exposure_mono_ns, rig.kernel.now_ns);
        EXPECT_EQ(rig.frame.source, StampSource::kArrival);
    }
    // One that is a period early, as the end of a frame that is still to come, is the device's own,
    rig.left().expose(rig.kernel.now_ns + 200 * kMs, 1);
    ASSERT_EQ(rig.wait(), Waited::kFrame);
    EXPECT_EQ(rig.frame.exposure_mono_ns, rig.kernel.now_ns + 200 * kMs);
    EXPECT_EQ(rig.frame.source, StampSource::kEndOfFrame);
    // and so is one that waited because the reader was held up.
    const std::int64_t exposed_ns = rig.kernel.now_ns;
    rig.left().expose(exposed_ns, 1);
    rig.kernel.now_ns += 5000 * kMs;
    ASSERT_EQ(rig.wait(), Waited::kFrame);
    EXPECT_EQ(rig.frame.exposure_mono_ns, exposed_ns);
}

TEST(V4l2, EmptyDamagedAndStaleBuffersAreLeftOutOnlyBeforeTheFirstGoodOne) {
    Rig rig;
    const std::int64_t before_ns = rig.kernel.now_ns - 300 * kMs;
    rig.start();
    rig.left().expose({rig.kernel.now_ns, V4L2_BUF_FLAG_TIMESTAMP_MONOTONIC, {}});
    rig.left().expose(rig.kernel.now_ns, 1, V4L2_BUF_FLAG_TIMESTAMP_MONOTONIC | V4L2_BUF_FLAG_ERROR);
    rig.left().expose(before_ns, 1);
    rig.left().expose(before_ns - 100'000 * kMs, 1);
    rig.kernel.now_ns += 30 * kMs;
    rig.left().expose(rig.kernel.now_ns, 9);
    ASSERT_EQ(rig.wait(), Waited::kFrame);
    EXPECT_EQ(rig.frame.exposure_mono_ns, rig.kernel.now_ns);
    EXPECT_EQ(rig.frame.sequence, 0);
    EXPECT_EQ(rig.driver.left_out(), 4);
    rig.driver.release(rig.frame);

    rig.left().expose({rig.kernel.now_ns, V4L2_BUF_FLAG_TIMESTAMP_MONOTONIC, {}});
    rig.left().expose(rig.kernel.now_ns, 1, V4L2_BUF_FLAG_TIMESTAMP_MONOTONIC | V4L2_BUF_FLAG_ERROR);
    for (int i = 0; i < 2; ++i) {
        ASSERT_EQ(rig.wait(), Waited::kFrame);
        EXPECT_TRUE(rig.frame.damaged);
        rig.driver.release(rig.frame);
    }
    EXPECT_EQ(rig.driver.left_out(), 4);
    rig.expect_all_given_back();
}

TEST(V4l2, APictureCutShortIsAnErrorOfItsOwn) {
    Rig rig;
    rig.start();
    rig.left().expose({rig.kernel.now_ns, V4L2_BUF_FLAG_TIMESTAMP_MONOTONIC,
                       std::vector<std::uint8_t>(kWidth * kHeight - 1, 5)});
    ASSERT_EQ(rig.wait(), Waited::kFrame);
    std::vector<std::uint8_t> memory(kWidth * kHeight);
    const Fault fault = rig.driver.copy(rig.frame, Eye::kLeft, {memory.data(), kWidth, kHeight, kWidth});
    EXPECT_EQ(fault.kind, CameraFault::kFailed);
    EXPECT_TRUE(contains(fault.sentence, "/dev/video0: a picture is cut short"));
    rig.driver.release(rig.frame);
    EXPECT_EQ(rig.wait(), Waited::kNothing) << "the driver goes on";
}

TEST(V4l2, SideBySideHalvesAreTheTwoEyes) {
    CameraSetup setup;
    setup.device = "/dev/video4";
    setup.width = kWidth;
    setup.height = kHeight;
    Rig rig(setup);
    rig.kernel.camera("/dev/video4").formats = {
        {V4L2_PIX_FMT_YUYV, 2 * kWidth, kHeight, 30.0, 4 * kWidth + 16}};
    rig.start();
    FakePicture picture{rig.kernel.now_ns, V4L2_BUF_FLAG_TIMESTAMP_MONOTONIC, {}};
    for (int y = 0; y < kHeight; ++y) {
        for (int x = 0; x < 2 * kWidth + 8; ++x) {
            picture.bytes.push_back(x < kWidth ? 10 : x < 2 * kWidth ? 20 : 30);
            picture.bytes.push_back(128);
        }
    }
    rig.kernel.camera("/dev/video4").expose(picture);
    ASSERT_EQ(rig.wait(), Waited::kFrame);
    EXPECT_EQ(rig.frame.eye, Eye::kBoth);
    for (const Eye eye : {Eye::kLeft, Eye::kRight}) {
        std::vector<std::uint8_t> memory(kWidth * kHeight);
        ASSERT_TRUE(rig.driver.copy(rig.frame, eye, {memory.data(), kWidth, kHeight, kWidth}).ok());
        for (const std::uint8_t luma : memory)
            ASSERT_EQ(luma, eye == Eye::kLeft ? 10 : 20);
    }
    rig.driver.release(rig.frame);
    rig.expect_all_given_back();
}

TEST(V4l2, PackedPixelsSideBySideNeedAWidthInFours) {
    for (const int width : {62, 64}) {
        CameraSetup setup;
        setup.device = "/dev/video4";
        setup.width = width;
        setup.height = kHeight;
        Rig rig(setup);
        rig.kernel.camera("/dev/video4").formats = {
            {V4L2_PIX_FMT_Y10P, static_cast<std::uint32_t>(2 * width), kHeight, 30.0, 192}};
        EXPECT_EQ(rig.driver.open().kind, width % 4 == 0 ? CameraFault::kNone : CameraFault::kRefused);
        rig.expect_all_given_back();
    }
}

TEST(V4l2, JpegsAreDecodedForOneEyeAndForTwoSideBySide) {
    const auto grey_jpeg = [](int width, std::uint8_t left, std::uint8_t right) {
        test::Picture picture(width, kHeight);
        for (int y = 0; y < kHeight; ++y)
            for (int x = 0; x < width; ++x)
                picture.view().at(x, y) = x < kWidth ? left : right;
        return test::compress(picture, test::k422);
    };
    for (const bool side_by_side : {false, true}) {
        CameraSetup setup = two_cameras();
        if (side_by_side) {
            setup.device = setup.left;
            setup.right.clear();
        }
        const int width = side_by_side ? 2 * kWidth : kWidth;
        Rig rig(setup);
        for (FakeCamera* camera : {&rig.left(), &rig.right()})
            camera->formats = {{V4L2_PIX_FMT_MJPEG, static_cast<std::uint32_t>(width), kHeight, 30, 0}};
        rig.start();
        std::vector<std::uint8_t> memory(kWidth * kHeight);
        const Luma luma(memory.data(), kWidth, kHeight, kWidth);
        for (int i = 0; i < 3; ++i) {
            const auto shade = static_cast<std::uint8_t>(60 + 20 * i);
            rig.left().expose(
                {rig.kernel.now_ns, V4L2_BUF_FLAG_TIMESTAMP_MONOTONIC, grey_jpeg(width, shade, 200)});
            ASSERT_EQ(rig.wait(), Waited::kFrame);
            ASSERT_TRUE(rig.driver.copy(rig.frame, Eye::kLeft, luma).ok());
            EXPECT_NEAR(memory[0], shade, 1);
            EXPECT_NEAR(memory[kWidth - 20], shade, 1);
            if (side_by_side) {
                ASSERT_TRUE(rig.driver.copy(rig.frame, Eye::kRight, luma).ok());
                EXPECT_NEAR(memory[20], 200, 1);
                EXPECT_NEAR(memory.back(), 200, 1);
            }
            rig.driver.release(rig.frame);
        }
        FakePicture torn{rig.kernel.now_ns, V4L2_BUF_FLAG_TIMESTAMP_MONOTONIC, grey_jpeg(width, 9, 9)};
        torn.bytes.resize(torn.bytes.size() / 2);
        rig.left().expose(torn);
        ASSERT_EQ(rig.wait(), Waited::kFrame);
        const Fault fault = rig.driver.copy(rig.frame, Eye::kLeft, luma);
        EXPECT_EQ(fault.kind, CameraFault::kFailed);
        EXPECT_TRUE(contains(fault.sentence, "damaged")) << fault.sentence.view();
        rig.driver.release(rig.frame);
        rig.expect_all_given_back();
    }
}

TEST(V4l2, TheFormatIsWhatGivesSizeAndRate) {
    const FakeFormat grey{V4L2_PIX_FMT_GREY, 64, 48, 30, 64};
    const FakeFormat yuyv{V4L2_PIX_FMT_YUYV, 64, 48, 10, 128};
    const FakeFormat slow_yuyv{V4L2_PIX_FMT_YUYV, 64, 48, 5, 128};
    const FakeFormat mjpeg{V4L2_PIX_FMT_MJPEG, 64, 48, 30, 0};
    const FakeFormat small_grey{V4L2_PIX_FMT_GREY, 32, 24, 30, 32};
    const FakeFormat short_lines{V4L2_PIX_FMT_GREY, 64, 48, 30, 60};
    const FakeFormat unknown{V4L2_PIX_FMT_H264, 64, 48, 30, 0};
    struct Case {
        std::vector<FakeFormat> formats;
        std::optional<PixelFormat> wanted;
        std::uint32_t expected;  // 0: refused
    };
    for (const Case& c : {Case{{yuyv, grey}, {}, V4L2_PIX_FMT_GREY},
                          {{yuyv, mjpeg}, {}, V4L2_PIX_FMT_MJPEG},
                          {{yuyv}, {}, V4L2_PIX_FMT_YUYV},
                          {{small_grey, slow_yuyv}, {}, V4L2_PIX_FMT_YUYV},
                          {{grey, mjpeg}, PixelFormat::kMjpeg, V4L2_PIX_FMT_MJPEG},
                          {{grey}, PixelFormat::kYuyv, 0},
                          {{small_grey}, {}, 0},
                          {{short_lines}, {}, 0},
                          {{unknown}, {}, 0}}) {
        CameraSetup setup = two_cameras();
        setup.format = c.wanted;
        Rig rig(setup);
        rig.left().formats = c.formats;
        rig.right().formats = c.formats;
        const Fault fault = rig.driver.open();
        if (c.expected == 0) {
            EXPECT_EQ(fault.kind, CameraFault::kRefused);
            EXPECT_TRUE(contains(fault.sentence, "left camera /dev/video0 does not give 64x48"))
                << fault.sentence.view();
        } else {
            EXPECT_TRUE(fault.ok()) << fault.sentence.view();
            EXPECT_EQ(rig.left().chosen.fourcc, c.expected);
        }
        rig.expect_all_given_back();
    }
}

TEST(V4l2, ControlsAreSetOrTheirLackIsSaid) {
    CameraSetup setup = two_cameras();
    setup.exposure_us = 5000;
    setup.gain = 16;
    setup.flip = Flip::kBoth;
    Rig rig(setup);
    for (FakeCamera* camera : {&rig.left(), &rig.right()})
        camera->controls = {{V4L2_CID_HFLIP, 0},         {V4L2_CID_VFLIP, 0},
                            {V4L2_CID_EXPOSURE_AUTO, 3}, {V4L2_CID_EXPOSURE_ABSOLUTE, 1},
                            {V4L2_CID_AUTOGAIN, 1},      {V4L2_CID_GAIN, 0}};
    ASSERT_TRUE(rig.driver.open().ok());
    for (FakeCamera* camera : {&rig.left(), &rig.right()}) {
        EXPECT_EQ(camera->controls[V4L2_CID_HFLIP], 1);
        EXPECT_EQ(camera->controls[V4L2_CID_VFLIP], 1);
        EXPECT_EQ(camera->controls[V4L2_CID_EXPOSURE_AUTO], V4L2_EXPOSURE_MANUAL);
        EXPECT_EQ(camera->controls[V4L2_CID_EXPOSURE_ABSOLUTE], 50);
        EXPECT_EQ(camera->controls[V4L2_CID_AUTOGAIN], 0);
        EXPECT_EQ(camera->controls[V4L2_CID_GAIN], 16);
    }
    ASSERT_TRUE(rig.driver.set_exposure(Eye::kRight, {12'300, 7}).ok());
    EXPECT_EQ(rig.driver.read_exposure(Eye::kRight).exposure_us, 12'300);
    EXPECT_EQ(rig.driver.read_exposure(Eye::kRight).gain, 7);
    EXPECT_EQ(rig.driver.read_exposure(Eye::kLeft).exposure_us, 5000);

    for (const std::uint32_t missing : {V4L2_CID_HFLIP, V4L2_CID_EXPOSURE_ABSOLUTE, V4L2_CID_GAIN}) {
        Rig poor(setup);
        poor.left().controls = rig.left().controls;
        poor.left().controls.erase(missing);
        const Fault fault = poor.driver.open();
        EXPECT_EQ(fault.kind, CameraFault::kRefused);
        EXPECT_TRUE(contains(fault.sentence, "capture.")) << fault.sentence.view();
        poor.expect_all_given_back();
    }
    // Nothing asked, nothing there: not a fault. What is there goes back to automatic.
    Rig bare;
    bare.left().controls = {{V4L2_CID_EXPOSURE_AUTO, 1}, {V4L2_CID_AUTOGAIN, 0}};
    ASSERT_TRUE(bare.driver.open().ok());
    EXPECT_EQ(bare.left().controls[V4L2_CID_EXPOSURE_AUTO], V4L2_EXPOSURE_APERTURE_PRIORITY);
    EXPECT_EQ(bare.left().controls[V4L2_CID_AUTOGAIN], 1);
    EXPECT_TRUE(std::isnan(bare.driver.read_exposure(Eye::kRight).exposure_us));
}

TEST(V4l2, AControlTellsADeviceThatFailsFromAValueThatIsRefused) {
    struct Case {
        int error;
        CameraFault kind;
        const char* words;
    };
    for (const Case& c : {Case{EINVAL, CameraFault::kRefused, "set capture."},
                          {ERANGE, CameraFault::kRefused, "set capture."},
                          {EACCES, CameraFault::kRefused, "set capture."},
                          {ENODEV, CameraFault::kAbsent, "No such device"},
                          {ENXIO, CameraFault::kAbsent, "No such device"},
                          {EIO, CameraFault::kFailed, "Input/output error"},
                          {EPIPE, CameraFault::kFailed, "Broken pipe"},
                          {ETIMEDOUT, CameraFault::kFailed, "timed out"}}) {
        CameraSetup setup = two_cameras();
        setup.exposure_us = 5000;
        setup.gain = 16;
        setup.flip = Flip::kBoth;
        // The control that fails: horizontal flip, exposure, gain. Those between are not there.
        for (const int at : {0, 4, 6}) {
            Rig rig(setup);
            rig.right().controls = {{V4L2_CID_HFLIP, 0},         {V4L2_CID_VFLIP, 0},
                                    {V4L2_CID_EXPOSURE_AUTO, 3}, {V4L2_CID_EXPOSURE_ABSOLUTE, 1},
                                    {V4L2_CID_AUTOGAIN, 1},      {V4L2_CID_GAIN, 0}};
            rig.left().controls = rig.right().controls;
            std::deque<int>& answers = rig.right().failures[VIDIOC_S_CTRL];
            answers.assign(static_cast<std::size_t>(at), 0);
            answers.push_back(c.error);
            const Fault fault = rig.driver.open();
            EXPECT_EQ(fault.kind, c.kind) << at << strerrordesc_np(c.error);
            EXPECT_TRUE(contains(fault.sentence, c.words)) << at << fault.sentence.view();
            EXPECT_TRUE(contains(fault.sentence, "right camera /dev/video2")) << fault.sentence.view();
            EXPECT_EQ(contains(fault.sentence, "capture."), c.kind == CameraFault::kRefused);
            rig.expect_all_given_back();
        }
    }
    // What need not be taken: a camera that is lost takes seconds for each, one that answers is asked on.
    for (const int error : {ENODEV, ETIMEDOUT, EIO, EPIPE, EINVAL}) {
        Rig rig;
        rig.right().failures[VIDIOC_S_CTRL].assign(4, error);
        const bool lost = error == ENODEV || error == ETIMEDOUT;
        EXPECT_EQ(rig.driver.open().ok(), !lost) << strerrordesc_np(error);
        EXPECT_EQ(rig.right().failures[VIDIOC_S_CTRL].size(), lost ? 3U : 0U);
        rig.expect_all_given_back();
    }
}

TEST(V4l2, ADeviceThatWaitsForItsPartnerIsNotTouched) {
    for (const bool output : {false, true}) {
        Rig rig;
        rig.right().node = output;
        if (output) rig.right().capabilities = V4L2_CAP_VIDEO_OUTPUT | V4L2_CAP_STREAMING;
        rig.left().failures[VIDIOC_S_FMT] = {0};  // is taken away when that is asked
        EXPECT_EQ(rig.driver.open().kind, CameraFault::kAbsent);
        EXPECT_EQ(rig.left().failures[VIDIOC_S_FMT].size(), 1U) << "its format was set";
        EXPECT_TRUE(rig.left().buffers.empty()) << "its buffers were taken";
        EXPECT_EQ(rig.left().fd, -1) << "it is still open";
        rig.expect_all_given_back();
    }
}

TEST(V4l2, EveryStepOfOpeningMayFailAndNothingStaysOpen) {
    struct Case {
        unsigned long request;
        int error;
        CameraFault kind;
        const char* words;
    };
    for (const Case& c : {Case{VIDIOC_QUERYCAP, ENOTTY, CameraFault::kRefused, "is no video device"},
                          {VIDIOC_QUERYCAP, ENODEV, CameraFault::kAbsent, "No such device"},
                          {VIDIOC_S_FMT, EBUSY, CameraFault::kBusy, "another program uses it"},
                          {VIDIOC_S_FMT, ENODEV, CameraFault::kAbsent, "cannot be set up"},
                          {VIDIOC_S_FMT, EIO, CameraFault::kFailed, "cannot be set up"},
                          {VIDIOC_S_FMT, ETIMEDOUT, CameraFault::kFailed, "cannot be set up"},
                          {VIDIOC_S_FMT, EINVAL, CameraFault::kRefused, "set capture.width"},
                          {VIDIOC_REQBUFS, EINVAL, CameraFault::kFailed, "gives no buffers"},
                          {VIDIOC_REQBUFS, EBUSY, CameraFault::kBusy, "gives no buffers"},
                          {VIDIOC_QUERYBUF, EIO, CameraFault::kFailed, "does not show its buffers"},
                          {VIDIOC_QBUF, EIO, CameraFault::kFailed, "does not take a buffer"},
                          {VIDIOC_STREAMON, ENOSPC, CameraFault::kFailed, "USB bus"},
                          {VIDIOC_STREAMON, EINVAL, CameraFault::kFailed, "does not start"}}) {
        Rig rig;
        rig.right().failures[c.request] = {c.error};
        Fault fault = rig.driver.open();
        if (fault.ok()) fault = rig.driver.start();
        EXPECT_EQ(fault.kind, c.kind) << c.words;
        EXPECT_TRUE(contains(fault.sentence, c.words)) << fault.sentence.view();
        EXPECT_TRUE(contains(fault.sentence, "right camera /dev/video2")) << fault.sentence.view();
        rig.driver.close();
        EXPECT_EQ(rig.kernel.mappings(), 0);
        EXPECT_EQ(rig.kernel.opened, rig.kernel.closed);
        // And it can be opened again.
        rig.start();
        rig.expect_all_given_back();
    }
}

TEST(V4l2, ADeviceThatIsNoCameraForUsIsNamed) {
    struct Case {
        std::uint32_t capabilities;
        CameraFault kind;
        const char* words;
    };
    for (const Case& c :
         {Case{V4L2_CAP_VIDEO_OUTPUT | V4L2_CAP_STREAMING, CameraFault::kAbsent, "gives no pictures"},
          {V4L2_CAP_META_CAPTURE, CameraFault::kAbsent, "gives no pictures"},
          {V4L2_CAP_VIDEO_CAPTURE_MPLANE | V4L2_CAP_STREAMING, CameraFault::kRefused, "libcamera"},
          {V4L2_CAP_VIDEO_CAPTURE | V4L2_CAP_READWRITE, CameraFault::kRefused, "cannot stream"}}) {
        Rig rig;
        rig.left().capabilities = c.capabilities;
        const Fault fault = rig.driver.open();
        EXPECT_EQ(fault.kind, c.kind);
        EXPECT_TRUE(contains(fault.sentence, c.words)) << fault.sentence.view();
        rig.expect_all_given_back();
    }
    Rig few;
    few.left().most_buffers = 2;
    EXPECT_EQ(few.driver.open().kind, CameraFault::kFailed);
    Rig four;
    four.left().most_buffers = 4;
    ASSERT_TRUE(four.driver.open().ok());
    EXPECT_EQ(four.driver.buffers_to_hold(), 2);
    Rig absent;
    absent.right().node = false;
    const Fault fault = absent.driver.open();
    EXPECT_EQ(fault.kind, CameraFault::kAbsent);
    EXPECT_TRUE(contains(fault.sentence, "plugged in")) << fault.sentence.view();
    absent.expect_all_given_back();
}

TEST(V4l2, ADeviceThatDiesIsAFaultAndNothingIsQueuedOnItAgain) {
    struct Case {
        const char* what;
        std::function<void(Rig&)> breaks;
        CameraFault kind;
    };
    const std::vector<Case> cases = {
        {"unplugged", [](Rig& rig) { rig.left().answers = false; }, CameraFault::kAbsent},
        {"unbound",
         [](Rig& rig) {
             rig.left().failures[VIDIOC_DQBUF] = {EINVAL};
             rig.left().poll_error = true;
         },
         CameraFault::kFailed},
        {"fatal error",
         [](Rig& rig) {
             rig.left().failures[VIDIOC_DQBUF] = {EIO};
             rig.left().poll_error = true;
         },
         CameraFault::kFailed},
        {"queue dead without a word", [](Rig& rig) { rig.left().poll_error = true; }, CameraFault::kFailed},
        {"takes no buffer", [](Rig& rig) { rig.left().failures[VIDIOC_QBUF] = {EINVAL}; },
         CameraFault::kFailed}};
    for (const Case& c : cases) {
        Rig rig;
        rig.start();
        rig.left().expose(rig.kernel.now_ns, 1);
        rig.right().expose(rig.kernel.now_ns, 1);
        std::array<CameraFrame, 2> held;
        for (CameraFrame& frame : held) {
            ASSERT_EQ(rig.wait(), Waited::kFrame);
            frame = rig.frame;
        }
        c.breaks(rig);
        Waited waited = Waited::kNothing;
        if (std::string(c.what) == "takes no buffer") rig.driver.release(held[0]);
        waited = rig.wait(100);
        EXPECT_EQ(waited, Waited::kFault) << c.what;
        EXPECT_EQ(rig.fault.kind, c.kind) << c.what;
        EXPECT_TRUE(contains(rig.fault.sentence, "left camera /dev/video0")) << rig.fault.sentence.view();
        for (const CameraFrame& frame : held)
            if (std::string(c.what) != "takes no buffer" || frame.eye != Eye::kLeft)
                rig.driver.release(frame);
        rig.driver.close();
        // It comes back, and the same driver object goes on with it.
        rig.left().answers = true;
        rig.left().poll_error = false;
        rig.start();
        rig.left().expose(rig.kernel.now_ns, 1);
        EXPECT_EQ(rig.wait(), Waited::kFrame) << c.what;
        rig.expect_all_given_back();
    }
}

TEST(V4l2, AFastDeviceDoesNotHideTheOther) {
    Rig rig;
    rig.start();
    for (int i = 0; i < 4; ++i)
        rig.left().expose(rig.kernel.now_ns, 1);
    rig.right().expose(rig.kernel.now_ns, 1);
    std::vector<Eye> eyes;
    while (rig.wait() == Waited::kFrame)
        eyes.push_back(rig.frame.eye);
    ASSERT_EQ(eyes.size(), 5U);
    EXPECT_EQ(eyes[1], Eye::kRight);
}

TEST(V4l2, SteadyStreamingAllocatesNothing) {
    Rig rig;
    rig.start();
    std::vector<std::uint8_t> memory(kWidth * kHeight);
    std::uint64_t allocated = 0;
    for (int i = 0; i < 200; ++i) {
        rig.kernel.now_ns += 33 * kMs;
        rig.left().expose(rig.kernel.now_ns, 1);
        const std::uint64_t before = ::groundline::test::allocations();
        ASSERT_EQ(rig.wait(), Waited::kFrame);
        ASSERT_TRUE(rig.driver.copy(rig.frame, Eye::kLeft, {memory.data(), kWidth, kHeight, kWidth}).ok());
        allocated += ::groundline::test::allocations() - before;
        rig.driver.release(rig.frame);  // the fake's own set allocates here
    }
    EXPECT_EQ(allocated, 0U);
}

class KernelClock final : public SourceClock {
  public:
    explicit KernelClock(FakeKernel& kernel) : kernel_(kernel) {}
    std::int64_t mono_ns() override { return kernel_.now_ns; }
    std::int64_t utime_us() override { return kernel_.real_ns() / 1000; }
    void sleep_until(std::int64_t mono_ns) override { kernel_.pass_to(mono_ns); }

  private:
    FakeKernel& kernel_;
};

// Source, driver, device and kernel together: every pair comes in its turn, and after an unplugging again.
TEST(V4l2, TheWholeSourceRunsOnIt) {
    FakeKernel kernel;
    FakeCamera& left = kernel.camera("/dev/video0");
    FakeCamera& right = kernel.camera("/dev/video2");
    const std::int64_t begin_ns = kernel.now_ns;
    for (int i = 0; i < 300; ++i) {
        kernel.at(begin_ns + 33 * i * kMs, [&] {
            if (left.streaming) left.expose(kernel.now_ns, static_cast<std::uint8_t>(left.sequence));
        });
        kernel.at(begin_ns + (33 * i + 4) * kMs, [&] {
            if (right.streaming) right.expose(kernel.now_ns, static_cast<std::uint8_t>(right.sequence));
        });
    }
    kernel.at(begin_ns + 3000 * kMs, [&] { right.answers = right.node = false; });
    kernel.at(begin_ns + 6000 * kMs, [&] { right.answers = right.node = true; });
    CameraSourceConfig config;
    config.width = kWidth;
    config.height = kHeight;
    Counters counters;
    KernelClock clock(kernel);
    Arena arena;
    StereoFrame frame = StereoFrame::make(arena, kWidth, kHeight, false);
    std::vector<std::string> notices;
    std::array<int, 10> pairs_in_second{};
    {
        CameraSource source(config, std::make_unique<V4l2Driver>(two_cameras(), kernel), counters, clock);
        while (kernel.now_ns < begin_ns + 9000 * kMs) {
            const std::int64_t before_ns = kernel.now_ns;
            if (source.next(frame) == Pull::kFrame) {
                ++pairs_in_second[static_cast<std::size_t>((kernel.now_ns - begin_ns) / (1000 * kMs))];
                EXPECT_EQ(frame.stamp.skew_ns, 4 * kMs);
                EXPECT_EQ(kernel.now_ns, frame.stamp.exposure_mono_ns + 4 * kMs) << "as soon as it is there";
                EXPECT_EQ(frame.left.at(0, 0), frame.right.at(0, 0));
            }
            EXPECT_LE(kernel.now_ns - before_ns, 100 * kMs);
            source.take_notices([&](const CameraNotice& it) { notices.emplace_back(it.sentence.view()); });
        }
        EXPECT_EQ(counters.get(Count::kCameraSuperseded), 0U);
    }
    for (const std::size_t second : {1U, 2U, 7U, 8U})
        EXPECT_GE(pairs_in_second[second], 29) << second;
    EXPECT_EQ(pairs_in_second[4] + pairs_in_second[5], 0);
    ASSERT_EQ(notices.size(), 3U);
    EXPECT_EQ(notices[1], "right camera /dev/video2: gave no picture: No such device");
    EXPECT_EQ(kernel.opened, kernel.closed);
    EXPECT_EQ(kernel.mappings(), 0);
    for (const std::string& breach : kernel.breaches)
        ADD_FAILURE() << breach;
}

class V4l2Names : public testing::Test {
  protected:
    void SetUp() override {
        root_ = std::filesystem::path(testing::TempDir()) /
                (std::string("groundline_") + testing::UnitTest::GetInstance()->current_test_info()->name());
        std::filesystem::remove_all(root_);
        places_ = {root_ / "dev", root_ / "class"};
        add("usb1", "A1", "video0", "0");
        add("usb1", "A1", "video1", "1");
        add("usb2", "B2", "video2", "0");
        add("usb3", "B2", "video3", "0");
    }
    void TearDown() override { std::filesystem::remove_all(root_); }
    void add(const std::string& device, const std::string& serial, const std::string& node,
             const std::string& index) {
        const auto interface = root_ / "devices" / device / "interface";
        std::filesystem::create_directories(interface);
        std::filesystem::create_directories(places_.classes / node);
        std::ofstream(root_ / "devices" / device / "serial") << serial << "\n";
        std::ofstream(places_.classes / node / "index") << index << "\n";
        std::filesystem::create_directory_symlink(interface, places_.classes / node / "device");
    }
    std::filesystem::path root_;
    V4l2Places places_;
};

TEST_F(V4l2Names, EachFormFindsItsNode) {
    const auto found = [&](const char* name) {
        std::string path;
        const Fault fault = find_v4l2_device(name, places_, path);
        EXPECT_TRUE(fault.ok()) << fault.sentence.view();
        return path;
    };
    EXPECT_EQ(found("/dev/stereo-left"), "/dev/stereo-left");
    EXPECT_EQ(found("video7"), (places_.devices / "video7").string());
    EXPECT_EQ(found("by-id/usb-X"), (places_.devices / "v4l/by-id/usb-X").string());
    EXPECT_EQ(found("by-path/pci-0"), (places_.devices / "v4l/by-path/pci-0").string());
    EXPECT_EQ(found("serial:A1"), (places_.devices / "video0").string());
}

TEST_F(V4l2Names, WhatCannotBeFoundIsSaid) {
    std::string path;
    EXPECT_EQ(find_v4l2_device("serial:C3", places_, path).kind, CameraFault::kAbsent);
    const Fault two = find_v4l2_device("serial:B2", places_, path);
    EXPECT_EQ(two.kind, CameraFault::kRefused);
    EXPECT_TRUE(contains(two.sentence, "by-path"));
    const Fault none = find_v4l2_device("", places_, path);
    EXPECT_EQ(none.kind, CameraFault::kRefused);
    EXPECT_TRUE(contains(none.sentence, "capture.left"));
    EXPECT_EQ(find_v4l2_device("serial:A1", {root_ / "dev", root_ / "no"}, path).kind, CameraFault::kAbsent);
}

TEST(V4l2, OneDeviceForBothEyesIsRefused) {
    CameraSetup setup = two_cameras();
    setup.right = setup.left;
    Rig rig(setup);
    const Fault fault = rig.driver.open();
    EXPECT_EQ(fault.kind, CameraFault::kRefused);
    EXPECT_TRUE(contains(fault.sentence, "name two cameras")) << fault.sentence.view();
    rig.expect_all_given_back();
}

}  // namespace
}  // namespace groundline::capture
