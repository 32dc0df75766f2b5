// One pair through all stages: what rectification cannot fill is not matched.
#include "pipeline/processor.hpp"

#include <gtest/gtest.h>

#include "support/random_images.hpp"

namespace groundline::pipeline {
namespace {

constexpr int kWidth = 160;
constexpr int kHeight = 120;

// Level cameras whose given rectification zooms out, so that a black frame surrounds the picture.
rig::StereoCalibration zoomed_out() {
    rig::StereoCalibration calibration;
    for (rig::CameraModel* camera : {&calibration.left, &calibration.right}) {
        camera->width = kWidth;
        camera->height = kHeight;
        camera->fx = camera->fy = 120.0;
        camera->cx = 80.0;
        camera->cy = 60.0;
    }
    calibration.translation_m = {-0.1, 0.0, 0.0};
    rig::GivenRectification given;
    given.projection_left = {90.0, 0, 80.0, 0, 0, 90.0, 60.0, 0, 0, 0, 1, 0};
    given.projection_right = {90.0, 0, 80.0, -9.0, 0, 90.0, 60.0, 0, 0, 0, 1, 0};
    calibration.rectification = given;
    return calibration;
}

TEST(Processor, NoWindowReachesBeyondTheSourcePicture) {
    Arena arena;
    const rig::Rectifier rectifier(zoomed_out(), kWidth, kHeight, arena);
    const ConstImageView<std::uint8_t> outside = rectifier.outside_left();
    ASSERT_FALSE(outside.empty()) << "the calibration leaves no black frame";
    Serial serial;
    for (const auto resolution : {verdict::HalfResolution::kNever, verdict::HalfResolution::kAlways}) {
        ProcessorConfig config;
        config.half_resolution = resolution;
        config.matcher.disparities = 16;
        config.matcher.checks = false;
        Processor processor(config, rectifier, serial, arena);
        FrameResult result = processor.make_result(arena);
        StereoFrame frame = StereoFrame::make(arena, kWidth, kHeight, false);
        const auto texture = test::textured_image(kWidth, kHeight, 5);
        copy_pixels<std::uint8_t>(texture.view(), frame.left);
        copy_pixels<std::uint8_t>(texture.view(), frame.right);
        processor.process(frame, result);

        int kept = 0;
        for (int y = 0; y < kHeight; ++y)
            for (int x = 0; x < kWidth; ++x) {
                if (result.disparity.invalid.at(x, y) != Invalid::kNone) continue;
                ++kept;
                for (int v = std::max(y - 5, 0); v <= std::min(y + 5, kHeight - 1); ++v)
                    for (int u = std::max(x - 5, 0); u <= std::min(x + 5, kWidth - 1); ++u)
                        ASSERT_EQ(outside.at(u, v), 0) << x << ", " << y;
            }
        EXPECT_GT(kept, 60 * 40) << "the inside of the picture is matched";
    }
}

}  // namespace
}  // namespace groundline::pipeline
