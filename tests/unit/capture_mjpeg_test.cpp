// JPEG pictures made by the same library: the luma comes back, and what is damaged is refused.
#include "capture/mjpeg.hpp"

#include <gtest/gtest.h>

#include <cstdio>

#include <cmath>
#include <cstdlib>
#include <vector>

#include "support/allocation_count.hpp"
#include "unit/jpeg_support.hpp"

namespace groundline::capture {
namespace {

using namespace test;

Picture slope(int width, int height) {
    Picture picture(width, height);
    for (int y = 0; y < height; ++y)
        for (int x = 0; x < width; ++x)
            picture.view().at(x, y) =
                static_cast<std::uint8_t>(60 + 100 * x / width + 80 * y / height + (x / 8 + y / 8) % 2 * 10);
    return picture;
}

double mean_difference(const Picture& a, const Picture& b) {
    double sum = 0.0;
    for (std::size_t i = 0; i < a.memory.size(); ++i)
        sum += std::abs(int{a.memory[i]} - int{b.memory[i]});
    return sum / static_cast<double>(a.memory.size());
}

// The picture without its Huffman tables, as most USB cameras send it.
Jpeg without_tables(const Jpeg& jpeg) {
    Jpeg bare(jpeg.begin(), jpeg.begin() + 2);
    for (std::size_t at = 2; at + 4 <= jpeg.size();) {
        const std::size_t length = 2 + jpeg[at + 2] * 256U + jpeg[at + 3];
        const bool scan = jpeg[at + 1] == 0xDA;
        const auto first = jpeg.begin() + static_cast<std::ptrdiff_t>(at);
        if (scan) {
            bare.insert(bare.end(), first, jpeg.end());
            break;
        }
        if (jpeg[at + 1] != 0xC4) bare.insert(bare.end(), first, first + static_cast<std::ptrdiff_t>(length));
        at += length;
    }
    return bare;
}

TEST(Mjpeg, LumaComesBackFromGreyAndEveryColourForm) {
    MjpegDecoder decoder;
    for (const Sampling sampling : {kGrey, Sampling{3, 1, 1}, k422, k420}) {
        Picture original = slope(64, 48);
        const Jpeg jpeg = compress(original, sampling);
        Picture decoded(64, 48);
        ASSERT_TRUE(decoder.decode(jpeg, decoded.view())) << decoder.problem();
        EXPECT_LT(mean_difference(original, decoded), 1.0) << sampling.components << sampling.horizontal;
        Picture bare(64, 48);
        const Jpeg stripped = without_tables(jpeg);
        ASSERT_LT(stripped.size(), jpeg.size());
        ASSERT_TRUE(decoder.decode(stripped, bare.view())) << decoder.problem();
        EXPECT_EQ(bare.memory, decoded.memory);
        Jpeg padded = jpeg;
        padded.resize(jpeg.size() + 100, 0);
        ASSERT_TRUE(decoder.decode(padded, bare.view())) << decoder.problem();
        EXPECT_EQ(bare.memory, decoded.memory);
    }
}

TEST(Mjpeg, OddSizesAndAPaddedTarget) {
    MjpegDecoder decoder;
    Picture original = slope(37, 21);
    const Jpeg jpeg = compress(original, k422);
    Picture packed(37, 21);
    ASSERT_TRUE(decoder.decode(jpeg, packed.view()));
    std::vector<std::uint8_t> wide(static_cast<std::size_t>(50 * 21), 9);
    ASSERT_TRUE(decoder.decode(jpeg, {wide.data(), 37, 21, 50}));
    for (std::size_t y = 0; y < 21; ++y)
        for (std::size_t x = 0; x < 50; ++x)
            ASSERT_EQ(wide[y * 50 + x], x < 37 ? packed.memory[y * 37 + x] : 9);
}

TEST(Mjpeg, DamageIsRefusedAndTheNextPictureIsDecodedAllTheSame) {
    MjpegDecoder decoder;
    Picture original = slope(64, 48);
    const Jpeg good = compress(original, k422);
    std::vector<std::pair<const char*, Jpeg>> damaged;
    damaged.emplace_back("empty", Jpeg{});
    damaged.emplace_back("zeros", Jpeg(1000, 0));
    damaged.emplace_back("only a beginning", Jpeg(good.begin(), good.begin() + 20));
    damaged.emplace_back("half",
                         Jpeg(good.begin(), good.begin() + static_cast<std::ptrdiff_t>(good.size() / 2)));
    damaged.emplace_back("no end", Jpeg(good.begin(), good.end() - 10));
    Jpeg torn = good;  // as when a packet of the bus is lost
    torn.erase(torn.end() - 300, torn.end() - 100);
    damaged.emplace_back("torn", torn);
    for (const auto& [what, jpeg] : damaged) {
        Picture decoded(64, 48);
        EXPECT_FALSE(decoder.decode(jpeg, decoded.view())) << what;
        EXPECT_STRNE(decoder.problem(), "") << what;
        ASSERT_TRUE(decoder.decode(good, decoded.view())) << "after " << what << ": " << decoder.problem();
        EXPECT_LT(mean_difference(original, decoded), 1.0) << "after " << what;
    }
    // Extraneous bytes before a restart marker: a few are an encoder's habit, many are lost data.
    const Jpeg restarts = compress(original, k422, 2);
    for (const auto& [stray, taken] : {std::pair{12, true}, {200, false}}) {
        Jpeg jpeg = restarts;
        for (std::size_t at = 0; at + 1 < jpeg.size(); ++at) {
            if (jpeg[at] != 0xFF || jpeg[at + 1] != 0xD3) continue;
            jpeg.insert(jpeg.begin() + static_cast<std::ptrdiff_t>(at), static_cast<std::size_t>(stray),
                        0x55);
            break;
        }
        ASSERT_GT(jpeg.size(), restarts.size());
        Picture decoded(64, 48);
        EXPECT_EQ(decoder.decode(jpeg, decoded.view()), taken) << stray << decoder.problem();
        if (taken) {
            EXPECT_LT(mean_difference(original, decoded), 1.0);
        }
    }
    Picture other_size(32, 48);
    EXPECT_FALSE(decoder.decode(good, other_size.view()));
}

TEST(Mjpeg, NoCutReadsBeyondOrIsTakenForWhole) {
    MjpegDecoder decoder;
    Picture original = slope(24, 16);
    const Jpeg good = compress(original, k420);
    for (std::size_t kept = 0; kept + 2 < good.size(); ++kept) {
        const Jpeg cut(good.begin(), good.begin() + static_cast<std::ptrdiff_t>(kept));
        Picture decoded(24, 16);
        EXPECT_FALSE(decoder.decode(cut, decoded.view())) << kept << " of " << good.size() << " bytes";
    }
}

// What the library does with the heap for one picture: it is bounded, and all of it comes back.
TEST(Mjpeg, TheLibraryTakesTheSameFewBlocksForEveryPicture) {
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
    GTEST_SKIP() << "a sanitizer stands in the place of the counters";
#endif
    MjpegDecoder decoder;
    Picture original = slope(640, 480);
    const Jpeg good = compress(original, k422);
    Picture decoded(640, 480);
    std::vector<std::uint64_t> blocks;
    blocks.reserve(20);
    for (int i = 0; i < 20; ++i) {
        const std::uint64_t before = ::groundline::test::allocations();
        ASSERT_TRUE(decoder.decode(good, decoded.view()));
        blocks.push_back(::groundline::test::allocations() - before);
    }
    for (std::size_t i = 1; i < blocks.size(); ++i)
        EXPECT_EQ(blocks[i], blocks[1]);
    EXPECT_LE(blocks[1], 16U);
    RecordProperty("blocks", static_cast<int>(blocks[1]));
    std::printf("%d heap blocks a picture\n", static_cast<int>(blocks[1]));
}

}  // namespace
}  // namespace groundline::capture
