// The libcamera driver as far as it goes without a camera: names, stamps, loading, and a machine that has
// none.
#include <gtest/gtest.h>

#include <sched.h>

#include <array>
#include <filesystem>
#include <string>
#include <thread>
#include <vector>

#include "capture/driver_module.hpp"
#include "capture/libcamera/camera_names.hpp"
#include "capture/libcamera/monotonic_stamp.hpp"
#include "capture/libcamera/processors.hpp"
#include "core/error.hpp"

namespace groundline::capture {
namespace {

TEST(CameraNames, WholePartAndNumberFindOneOfThoseAtHand) {
    const std::vector<std::string> ids = {"/base/soc/i2c@88000/imx708@1a", "/base/soc/i2c@80000/imx708@1a",
                                          "/base/soc/i2c@80000/imx708@1a-wide"};
    struct Row {
        std::string_view name;
        CameraFault kind;
        std::size_t index;
    };
    for (const Row& row :
         {Row{"/base/soc/i2c@80000/imx708@1a", CameraFault::kNone, 1},  // also a part of another
          Row{"i2c@88000", CameraFault::kNone, 0}, Row{"wide", CameraFault::kNone, 2},
          Row{"0", CameraFault::kNone, 1}, Row{"1", CameraFault::kNone, 2}, Row{"2", CameraFault::kNone, 0},
          Row{"3", CameraFault::kAbsent, 0}, Row{"-1", CameraFault::kAbsent, 0},
          Row{"imx708", CameraFault::kRefused, 0}, Row{"ov5647", CameraFault::kAbsent, 0},
          Row{"", CameraFault::kRefused, 0}}) {
        SCOPED_TRACE(row.name);
        std::size_t index = 0;
        const Fault fault = find_camera(row.name, ids, index);
        EXPECT_EQ(fault.kind, row.kind);
        if (fault.ok())
            EXPECT_EQ(index, row.index);
        else
            EXPECT_NE(fault.sentence.view().find("i2c@88000"), std::string_view::npos)
                << fault.sentence.view();
    }
    std::size_t index = 0;
    const Fault none = find_camera("0", {}, index);
    EXPECT_EQ(none.kind, CameraFault::kAbsent);
    EXPECT_NE(none.sentence.view().find("none"), std::string_view::npos);
}

// As the capture thread is bound to one processor after the driver was made.
TEST(ProcessorsOfALibrary, AreTheProgramsAndTheCallersAreItsOwnAgain) {
    const auto here = [] {
        cpu_set_t set{};
        EXPECT_EQ(sched_getaffinity(0, sizeof set, &set), 0);
        return set;
    };
    const auto same = [](const cpu_set_t& a, const cpu_set_t& b) { return CPU_EQUAL(&a, &b) != 0; };
    const cpu_set_t all = here();
    if (CPU_COUNT(&all) < 2) GTEST_SKIP() << "there is one processor";
    const Processors processors;
    std::thread capture([&] {
        cpu_set_t one{};
        for (std::size_t cpu = 0; cpu < CPU_SETSIZE && CPU_COUNT(&one) == 0; ++cpu)
            if (CPU_ISSET(cpu, &all)) CPU_SET(cpu, &one);
        ASSERT_EQ(sched_setaffinity(0, sizeof one, &one), 0);
        {
            const LentProcessors lent(processors);
            std::thread library([&] { EXPECT_TRUE(same(here(), all)); });
            library.join();
        }
        EXPECT_TRUE(same(here(), one));
        std::thread ours([&] { EXPECT_TRUE(same(here(), one)); });
        ours.join();
    });
    capture.join();
}

TEST(MonotonicStamp, IsShiftedOnlyWhereItFitsTheClockThatCountsSleep) {
    constexpr std::int64_t kSecond = 1'000'000'000;
    constexpr std::int64_t kArrival = 1000 * kSecond;
    constexpr std::int64_t kSlept = 500 * kSecond;
    const auto read = [](std::int64_t stamp, std::int64_t slept) {
        return monotonic_stamp(stamp, kArrival, kArrival + slept);
    };
    EXPECT_EQ(read(kArrival - 40, kSlept), kArrival - 40);
    EXPECT_EQ(read(kArrival + kSlept - 40, kSlept), kArrival - 40);
    EXPECT_EQ(read(kArrival + kSlept, kSlept), kArrival);
    EXPECT_EQ(read(kArrival + kSlept - kSecond - 1, kSlept), kArrival + kSlept - kSecond - 1);
    EXPECT_EQ(read(kArrival + kSlept + 1, kSlept),
              kArrival + kSlept + 1);  // ahead of both: left to the caller
    EXPECT_EQ(read(kArrival - 40, 0), kArrival - 40);
    EXPECT_EQ(read(kArrival - 40, 10), kArrival - 40);  // fits both
}

std::string refusal_of(std::string_view name, const std::vector<std::filesystem::path>& folders) {
    std::string sentence;
    try {
        load_driver(name, {}, folders);
    } catch (const Refusal& refusal) {
        EXPECT_EQ(refusal.status(), ExitStatus::kConfig);
        sentence = refusal.what();
    }
    return sentence;
}

TEST(DriverModule, OneThatIsMissingOrOfAnotherBuildIsRefusedByName) {
    const std::string missing = refusal_of("nosuch", {"/nowhere", GROUNDLINE_MODULES});
    EXPECT_NE(missing.find("groundline-nosuch.so"), std::string::npos) << missing;
    EXPECT_NE(missing.find("/nowhere, "), std::string::npos) << missing;
    const std::string other = refusal_of("other", {"/nowhere", GROUNDLINE_MODULES});
    EXPECT_NE(other.find("another version (0.0.0-other)"), std::string::npos) << other;
    const std::string none = refusal_of("none", {GROUNDLINE_MODULES});
    EXPECT_NE(none.find("another version (unknown)"), std::string::npos) << none;
}

TEST(LibcameraDriver, WithoutCamerasSaysSoAndCanBeAskedAgain) {
#ifndef GROUNDLINE_LIBCAMERA_MODULE
    GTEST_SKIP() << "libcamera's development files are not installed, so its driver was not built";
#else
    CameraSetup setup;
    setup.left = "no such camera";
    setup.right = "nor this one";
    const std::array folders = {std::filesystem::path(GROUNDLINE_LIBCAMERA_MODULE).parent_path()};
    const auto driver = load_driver("libcamera", setup, folders);
    driver->close();  // before it was opened
    for (int i = 0; i < 3; ++i) {
        const Fault fault = driver->open();
        EXPECT_EQ(fault.kind, CameraFault::kAbsent) << fault.sentence.view();
        EXPECT_NE(fault.sentence.view().find("'no such camera'"), std::string_view::npos);
    }
    driver->close();
    driver->close();
#endif
}

}  // namespace
}  // namespace groundline::capture
