#include <gtest/gtest.h>

#include <opencv2/core.hpp>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/videoio.hpp>
#include <optional>

#include "core/arena.hpp"
#include "io/natural_order.hpp"
#include "io/pair_list.hpp"
#include "io/pair_reader.hpp"
#include "io_test_support.hpp"

namespace groundline::io {
namespace {

namespace fs = std::filesystem;
using testing::refusal;
using testing::TempFolder;
using testing::write_ramp;
using testing::write_text;

// An open source with memory for its pairs.
struct Opened {
    explicit Opened(const std::vector<std::string>& words) : pairs(open_pairs(words)) {
        const SourceInfo& info = pairs.reader->info();
        frame = StereoFrame::make(arena, info.width, info.height, info.colour);
    }
    explicit Opened(const fs::path& path) : Opened(std::vector<std::string>{path.string()}) {}

    PairReader& reader() { return *pairs.reader; }
    Pull next() { return pairs.reader->next(frame); }

    OpenedPairs pairs;
    Arena arena;
    StereoFrame frame;
};

// The next pair must be ramps of these values.
void expect_pair(Opened& source, int left_value, int right_value) {
    ASSERT_EQ(source.next(), Pull::kFrame) << source.reader().error();
    const Luma left = source.frame.left, right = source.frame.right;
    for (int y = 0; y < left.height; ++y)
        for (int x = 0; x < left.width; ++x) {
            ASSERT_EQ(left.at(x, y), static_cast<std::uint8_t>(left_value + x + 3 * y));
            ASSERT_EQ(right.at(x, y), static_cast<std::uint8_t>(right_value + x + 3 * y));
        }
}

void write_pairs(const fs::path& left, const fs::path& right, const std::vector<std::string>& names) {
    for (std::size_t i = 0; i < names.size(); ++i) {
        write_ramp(left / names[i], 21, 13, static_cast<int>(i));
        write_ramp(right / names[i], 21, 13, static_cast<int>(100 + i));
    }
}

TEST(NaturalOrder, NumbersCountAndOtherBytesCompare) {
    EXPECT_TRUE(natural_less("2.png", "10.png"));
    EXPECT_FALSE(natural_less("10.png", "2.png"));
    EXPECT_TRUE(natural_less("a9b2", "a10b1"));
    EXPECT_TRUE(natural_less("000002.png", "000010.png"));
    EXPECT_TRUE(natural_less("a", "ab"));
    EXPECT_TRUE(natural_less("02", "2"));
    EXPECT_FALSE(natural_less("2", "02"));
    EXPECT_FALSE(natural_less("7", "7"));
    EXPECT_TRUE(natural_less("02a", "2b"));
    EXPECT_TRUE(natural_less("1403636579763555584", "1403636579813555456"));
}

TEST(Pairs, FoldersWithTheSameNamesInOrder) {
    const TempFolder folder;
    write_pairs(folder / "left", folder / "right", {"1.png", "2.png", "10.png"});
    write_text(folder / "left/notes.txt", "no image");
    write_text(folder / "left/.hidden.png", "no image");
    Opened source(folder.path());
    EXPECT_EQ(source.reader().info().name, folder.path().string());
    EXPECT_EQ(source.reader().info().width, 21);
    EXPECT_EQ(source.reader().info().height, 13);
    EXPECT_EQ(source.reader().info().length, 3);
    EXPECT_FALSE(source.reader().info().colour);
    EXPECT_EQ(source.reader().info().rate_hz, 0.0);
    EXPECT_EQ(source.pairs.folder, folder.path());
    for (int i = 0; i < 3; ++i) {
        expect_pair(source, i, 100 + i);
        EXPECT_EQ(source.frame.stamp.position, i);
        EXPECT_EQ(source.frame.stamp.utime_us, i * 100'000);
        EXPECT_EQ(source.frame.stamp.exposure_mono_ns, i * 100'000'000LL);
        EXPECT_EQ(source.frame.stamp.source, StampSource::kUnknown);
    }
    EXPECT_EQ(source.frame.stamp.name_view(), "10.png");
    EXPECT_EQ(source.next(), Pull::kEnd);
    EXPECT_EQ(source.reader().error(), "");
    ASSERT_TRUE(source.reader().rewind());
    expect_pair(source, 0, 100);
    EXPECT_EQ(source.frame.stamp.position, 0);
}

TEST(Pairs, NamesOfNineteenDigitsAreStamps) {
    const TempFolder folder;
    write_pairs(folder / "left", folder / "right", {"1403636579763555584.png", "1403636579813555456.png"});
    Opened source(folder.path());
    EXPECT_NEAR(source.reader().info().rate_hz, 20.0, 0.001);
    expect_pair(source, 0, 100);
    EXPECT_EQ(source.frame.stamp.exposure_mono_ns, 1403636579763555584);
    EXPECT_EQ(source.frame.stamp.utime_us, 1403636579763555);
    EXPECT_EQ(source.frame.stamp.source, StampSource::kFile);
}

TEST(Pairs, TwoImagesAndTheFolderThatHoldsThem) {
    const TempFolder folder;
    write_ramp(folder / "set/left.png", 8, 6, 1);
    write_ramp(folder / "set/right.png", 8, 6, 2);
    Opened two({(folder / "set/left.png").string(), (folder / "set/right.png").string()});
    expect_pair(two, 1, 2);
    EXPECT_EQ(two.next(), Pull::kEnd);
    EXPECT_EQ(two.pairs.folder, folder / "set");
    Opened one(folder / "set");
    expect_pair(one, 1, 2);
    EXPECT_EQ(one.frame.stamp.name_view(), "left.png");
    // In unrelated folders no calibration is looked for.
    write_ramp(folder / "other/right.png", 8, 6, 3);
    Opened apart({(folder / "set/left.png").string(), (folder / "other/right.png").string()});
    expect_pair(apart, 1, 3);
    EXPECT_TRUE(apart.pairs.folder.empty()) << apart.pairs.folder;
}

TEST(Pairs, TwoImagesOfOneSetShareItsCalibration) {
    const auto folder_of = [](const char* left, const char* right) {
        return list_two_images(left, right).folder;
    };
    const fs::path here = fs::current_path();
    EXPECT_EQ(folder_of("/set/a.png", "/set/b.png"), "/set");
    EXPECT_EQ(folder_of("/set/left/1.png", "/set/right/1.png"), "/set");
    EXPECT_EQ(folder_of("/set/x/../left/1.png", "/set/right/./1.png"), "/set");
    EXPECT_EQ(folder_of("l.png", "./r.png"), ".");
    EXPECT_EQ(folder_of("left/1.png", "right/1.png"), here);
    EXPECT_EQ(folder_of("/left/1.png", "/right/1.png"), "/") << "siblings, if at the top";
    EXPECT_EQ(folder_of("/set/left/1.png", "/other/right/1.png"), "");
    EXPECT_EQ(folder_of("/set/right/1.png", "/set/left/1.png"), "") << "exchanged";
    EXPECT_EQ(folder_of("/set/a/1.png", "/set/b/1.png"), "");
    EXPECT_EQ(folder_of("/set/left/1.png", "/set/2.png"), "");
    EXPECT_EQ(folder_of("/set/left/1.png", "/set/deeper/right/1.png"), "");
    EXPECT_EQ(folder_of("/a/1.png", "/b/1.png"), "");
}

TEST(Pairs, Middlebury) {
    const TempFolder folder;
    write_ramp(folder / "im0.png", 8, 6, 1);
    write_ramp(folder / "im1.png", 8, 6, 2);
    write_ramp(folder / "im1E.png", 8, 6, 3);
    Opened source(folder.path());
    expect_pair(source, 1, 2);
    EXPECT_EQ(source.reader().info().length, 1);
}

TEST(Pairs, KittiStereoGreyBeforeColour) {
    const TempFolder folder;
    write_pairs(folder / "image_2", folder / "image_3", {"000000_10.png", "000000_11.png"});
    {
        Opened source(folder.path());
        EXPECT_TRUE(source.pairs.colour_pair);
        EXPECT_EQ(source.reader().info().length, 2);
        expect_pair(source, 0, 100);
    }
    write_pairs(folder / "image_0", folder / "image_1", {"000000_10.png"});
    Opened source(folder.path());
    EXPECT_FALSE(source.pairs.colour_pair);
    EXPECT_EQ(source.reader().info().length, 1);
}

TEST(Pairs, KittiOdometryTimes) {
    const TempFolder folder;
    write_pairs(folder / "image_0", folder / "image_1", {"000001.png", "000002.png"});
    write_text(folder / "times.txt", "0.000000e+00\n1.036224e-01\n2.072346e-01\n");
    Opened source(folder.path());
    expect_pair(source, 0, 100);
    EXPECT_EQ(source.frame.stamp.exposure_mono_ns, 103'622'400);
    expect_pair(source, 1, 101);
    EXPECT_EQ(source.frame.stamp.utime_us, 207'234);
    EXPECT_EQ(source.frame.stamp.source, StampSource::kFile);
}

TEST(Pairs, KittiRawWithStampsOfBothCameras) {
    const TempFolder folder;
    write_pairs(folder / "image_02/data", folder / "image_03/data", {"0000000000.png", "0000000002.png"});
    write_text(folder / "image_02/timestamps.txt",
               "2011-09-26 13:02:25.594360375\r\n2011-09-26 13:02:25.7\r\n2011-09-26 13:02:25.801\r\n");
    write_text(folder / "image_03/timestamps.txt",
               "2011-09-26 13:02:25.594360500\n2011-09-26 13:02:25.7\n2011-09-26 13:02:25.800\n");
    Opened source(folder.path());
    EXPECT_TRUE(source.pairs.colour_pair);
    expect_pair(source, 0, 100);
    EXPECT_EQ(source.frame.stamp.exposure_mono_ns, 1317042145594360375);
    EXPECT_EQ(source.frame.stamp.utime_us, 1317042145594360);
    EXPECT_EQ(source.frame.stamp.skew_ns, 125);
    expect_pair(source, 1, 101);
    EXPECT_EQ(source.frame.stamp.exposure_mono_ns, 1317042145801000000);
    EXPECT_EQ(source.frame.stamp.skew_ns, -1'000'000);
}

TEST(Pairs, EurocIsPairedByStampAndSinglesAreTold) {
    const TempFolder folder;
    const fs::path cam0 = folder / "mav0/cam0", cam1 = folder / "mav0/cam1";
    for (int n = 1; n <= 3; ++n) {
        const std::string name = std::to_string(n) + ".png";
        write_ramp(cam0 / "data" / name, 8, 6, n);
        write_ramp(cam1 / "data" / std::string("r").append(name), 8, 6, 100 + n);
    }
    write_text(cam0 / "data.csv",
               "#timestamp [ns],filename\r\n1403636579763555584,1.png\r\n1403636579813555456,2.png\r\n"
               "1403636579863555584,3.png\r\n");
    write_text(cam1 / "data.csv",
               "#timestamp [ns],filename\n1403636579763555584,r1.png\n1403636579863556000, r3.png\n");
    Opened source(folder.path());
    EXPECT_EQ(source.reader().info().length, 2);
    EXPECT_HAS(source.reader().note(), "1 left and 0 right images");
    expect_pair(source, 1, 101);
    EXPECT_EQ(source.frame.stamp.exposure_mono_ns, 1403636579763555584);
    EXPECT_EQ(source.frame.stamp.utime_us, 1403636579763555);
    expect_pair(source, 3, 103);
    EXPECT_EQ(source.frame.stamp.skew_ns, 416);
    EXPECT_EQ(source.frame.stamp.position, 1);
    EXPECT_EQ(source.next(), Pull::kEnd);
    EXPECT_EQ(Opened(folder / "mav0").reader().info().length, 2);
}

TEST(Pairs, ColourFillsBothImages) {
    const TempFolder folder;
    fs::create_directories(folder / "left");
    fs::create_directories(folder / "right");
    cv::imwrite((folder / "left/a.ppm").string(), cv::Mat(6, 8, CV_8UC3, cv::Scalar(10, 200, 90)));
    cv::imwrite((folder / "right/a.ppm").string(), cv::Mat(6, 8, CV_8UC3, cv::Scalar(0, 0, 255)));
    Opened source(folder.path());
    ASSERT_TRUE(source.reader().info().colour);
    ASSERT_EQ(source.next(), Pull::kFrame);
    EXPECT_EQ(source.frame.left.at(7, 5), luma_of(90, 200, 10));
    EXPECT_EQ(source.frame.right.at(7, 5), 77);
    const std::uint8_t* pixel = source.frame.left_bgr.row(5) + 3 * 7;
    EXPECT_EQ(std::vector<int>(pixel, pixel + 3), (std::vector<int>{10, 200, 90}));
}

// A video of vertical halves: left half `left`, right half `right`, brighter by 10 a frame.
void write_video(const fs::path& path, int width, int height, int frames, int fourcc, int backend) {
    cv::VideoWriter writer(path.string(), backend, fourcc, 25.0, {width, height});
    ASSERT_TRUE(writer.isOpened());
    for (int i = 0; i < frames; ++i) {
        cv::Mat image(height, width, CV_8UC3, cv::Scalar(40 + 10 * i, 40 + 10 * i, 40 + 10 * i));
        image.colRange(width / 2, width).setTo(cv::Scalar(140 + 10 * i, 140 + 10 * i, 140 + 10 * i));
        writer.write(image);
    }
}

TEST(Pairs, SideBySideVideo) {
    const TempFolder folder;
    const int mjpg = cv::VideoWriter::fourcc('M', 'J', 'P', 'G');
    write_video(folder / "drive.avi", 64, 32, 5, mjpg, cv::CAP_OPENCV_MJPEG);
    Opened source(folder / "drive.avi");
    EXPECT_EQ(source.reader().info().width, 32);
    EXPECT_EQ(source.reader().info().height, 32);
    EXPECT_EQ(source.reader().info().length, 5);
    EXPECT_EQ(source.reader().info().rate_hz, 25.0);
    EXPECT_TRUE(source.reader().info().colour);
    EXPECT_EQ(source.pairs.folder, folder.path());
    for (int pass = 0; pass < 2; ++pass) {
        for (int i = 0; i < 5; ++i) {
            ASSERT_EQ(source.next(), Pull::kFrame);
            // JPEG of flat halves: within a few grey levels.
            EXPECT_NEAR(source.frame.left.at(5, 5), 40 + 10 * i, 4);
            EXPECT_NEAR(source.frame.left_bgr.row(5)[16], 40 + 10 * i, 4);
            EXPECT_NEAR(source.frame.right.at(5, 5), 140 + 10 * i, 4);
            EXPECT_EQ(source.frame.stamp.exposure_mono_ns, i * 40'000'000LL);
            EXPECT_EQ(source.frame.stamp.source, StampSource::kFile);
            EXPECT_EQ(source.frame.stamp.position, i);
            EXPECT_EQ(source.frame.stamp.name_view(), "drive.avi#" + std::to_string(i));
        }
        EXPECT_EQ(source.next(), Pull::kEnd);
        EXPECT_EQ(source.reader().error(), "");
        ASSERT_TRUE(source.reader().rewind());
    }
}

TEST(Pairs, VideoOfOddWidthIsRefused) {
    const TempFolder folder;
    const fs::path path = folder / "odd.avi";
    write_video(path, 63, 32, 2, cv::VideoWriter::fourcc('M', 'J', 'P', 'G'), cv::CAP_OPENCV_MJPEG);
    const std::string sentence = refusal(ExitStatus::kInput, [&] { open_pairs({path.string()}); });
    EXPECT_HAS(sentence, path.string());
    EXPECT_HAS(sentence, "63 pixels wide; expected an even width");
}

// The real sets, where they are at hand.
TEST(Pairs, RecordedSets) {
    const fs::path data = GROUNDLINE_SOURCE_DIR "/../shared/data";
    if (!fs::exists(data)) GTEST_SKIP() << "the recorded sets are not at hand";
    Opened sequence(data / "kitti_seq1");
    EXPECT_EQ(sequence.reader().info().length, 26);
    EXPECT_EQ(sequence.reader().info().width, 1226);
    ASSERT_EQ(sequence.next(), Pull::kFrame);
    EXPECT_EQ(sequence.frame.stamp.name_view(), "000000.png");
    Opened boards(data / "calib_opencv");
    EXPECT_EQ(boards.reader().info().length, 13);
    Opened motorcycle(data / "mb_motorcycle");
    EXPECT_TRUE(motorcycle.reader().info().colour);
    EXPECT_EQ(motorcycle.reader().info().height, 500);
}

}  // namespace
}  // namespace groundline::io
