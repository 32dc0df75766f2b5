// Packing of masks: round trips, the conservative grid, the datagram, and a decoder that nothing can upset.
#include <gtest/gtest.h>

#include <algorithm>
#include <random>
#include <string>
#include <vector>

#include "core/arena.hpp"
#include "groundline/mask_decoder.hpp"
#include "groundline/mask_t.hpp"
#include "publish/mask_codec.hpp"

namespace groundline::publish {
namespace {

struct Owned {
    Arena arena;
    Mask view;
    Owned(int width, int height) : view(arena.image<TerrainClass>(width, height)) {}
    void set(int x, int y, unsigned kind) const { view.at(x, y) = static_cast<TerrainClass>(kind & 3U); }
};

std::vector<std::uint8_t> decoded(const PackedMask& packed, const std::vector<std::uint8_t>& buffer,
                                  int width, int height) {
    std::vector<std::uint8_t> out(static_cast<std::size_t>(width) * static_cast<std::size_t>(height), 77);
    EXPECT_TRUE(decode_mask(width, height, packed.scale, static_cast<int>(packed.encoding), buffer.data(),
                            packed.size, out.data(), out.size()));
    return out;
}

// How bad it is to be told less: an independent statement of obstacle > drop > unknown > traversable.
int severity(unsigned kind) {
    const std::array<int, 4> order = {1, 0, 3, 2};
    return order.at(kind);
}

// Masks between a single colour and white noise: blobs of random rows with runs of a random mean length.
void fill_random(const Owned& mask, std::mt19937& random, unsigned mean_run) {
    unsigned kind = random() & 3U;
    for (int y = 0; y < mask.view.height; ++y) {
        for (int x = 0; x < mask.view.width; ++x) {
            if (random() % mean_run == 0) kind = random() & 3U;
            mask.set(x, y, kind);
        }
    }
}

TEST(MaskCodec, RunsComeBackExactly) {
    std::mt19937 random(1);
    std::vector<std::uint8_t> buffer(kMaxMaskBytes);
    for (int round = 0; round < 400; ++round) {
        const int width = 1 + static_cast<int>(random() % 97);
        const int height = 1 + static_cast<int>(random() % 61);
        const Owned mask(width, height);
        fill_random(mask, random, 1 + random() % 200);
        const PackedMask packed = pack_mask(mask.view, buffer);
        ASSERT_EQ(packed.encoding, MaskEncoding::kRuns);
        const std::vector<std::uint8_t> out = decoded(packed, buffer, width, height);
        for (int y = 0; y < height; ++y)
            for (int x = 0; x < width; ++x)
                ASSERT_EQ(out[static_cast<std::size_t>(y * width + x)],
                          static_cast<unsigned>(mask.view.at(x, y)));
    }
}

TEST(MaskCodec, RunsAreThoseOfTheSpecification) {
    const Owned mask(40, 2);
    for (int y = 0; y < 2; ++y)
        for (int x = 0; x < 40; ++x)
            mask.set(x, y, y == 0 && x == 0 ? 3 : y == 0 && x < 33 ? 1 : 2);
    std::vector<std::uint8_t> buffer(kMaxMaskBytes);
    const std::size_t size = pack_runs(mask.view, buffer);
    // 1 drop: 0*4+3. 32 traversable: 31*4+1 = 125. 47 obstacle across the row end: 46*4+2 = 186 = 0xba 0x01.
    const std::vector<std::uint8_t> expected = {0x03, 0x7d, 0xba, 0x01};
    EXPECT_EQ(std::vector<std::uint8_t>(buffer.begin(), buffer.begin() + static_cast<std::ptrdiff_t>(size)),
              expected);
}

TEST(MaskCodec, GridIsThatOfTheSpecification) {
    const Owned mask(5, 3);  // cells of 2: three by two, the last column and row cut off
    const std::array<std::string, 3> rows = {"11013", "11110", "32102"};
    for (int y = 0; y < 3; ++y)
        for (int x = 0; x < 5; ++x)
            mask.set(x, y,
                     static_cast<unsigned>(
                         rows.at(static_cast<std::size_t>(y)).at(static_cast<std::size_t>(x)) - '0'));
    std::vector<std::uint8_t> buffer(kMaxMaskBytes, 0xff);
    ASSERT_EQ(pack_grid(mask.view, 2, buffer), 2U);
    // Cells: 1 0 3 / 2 0 2, the first in the lowest bits.
    EXPECT_EQ(buffer[0], 1U | 0U << 2U | 3U << 4U | 2U << 6U);
    EXPECT_EQ(buffer[1], 0U | 2U << 2U);
}

TEST(MaskCodec, AGridNeverSaysLessThanItsPixels) {
    std::mt19937 random(2);
    std::vector<std::uint8_t> buffer(kMaxMaskBytes);
    for (int round = 0; round < 200; ++round) {
        const int width = 1 + static_cast<int>(random() % 83);
        const int height = 1 + static_cast<int>(random() % 59);
        const int scale = 1 + static_cast<int>(random() % 9);
        const Owned mask(width, height);
        fill_random(mask, random, 1 + random() % 60);
        const PackedMask packed{MaskEncoding::kGrid, scale, pack_grid(mask.view, scale, buffer)};
        const std::vector<std::uint8_t> out = decoded(packed, buffer, width, height);
        for (int y = 0; y < height; ++y) {
            for (int x = 0; x < width; ++x) {
                const unsigned shown = out[static_cast<std::size_t>(y * width + x)];
                ASSERT_GE(severity(shown), severity(static_cast<unsigned>(mask.view.at(x, y))));
                // And no more than that: some pixel of the cell is what the cell shows.
                bool found = false;
                for (int v = y / scale * scale; v < std::min((y / scale + 1) * scale, height); ++v)
                    for (int u = x / scale * scale; u < std::min((x / scale + 1) * scale, width); ++u)
                        found |= static_cast<unsigned>(mask.view.at(u, v)) == shown;
                ASSERT_TRUE(found) << x << ' ' << y << " scale " << scale;
            }
        }
    }
}

struct Size {
    int width, height, scale;
};
constexpr Size kSizes[] = {{320, 240, 1},   {640, 480, 2}, {1280, 720, 2}, {1280, 960, 3},
                           {4096, 3000, 7}, {1, 1, 1},     {7, 500000, 4}};

TEST(MaskCodec, EveryMaskFitsAndTheScaleIsTheSmallest) {
    std::vector<std::uint8_t> buffer(kMaxMaskBytes);
    for (const Size& size : kSizes) {
        SCOPED_TRACE(std::to_string(size.width) + " x " + std::to_string(size.height));
        EXPECT_EQ(grid_scale(size.width, size.height), size.scale);
        const Owned mask(size.width, size.height);
        for (int y = 0; y < size.height; ++y)
            for (int x = 0; x < size.width; ++x)
                mask.set(x, y, static_cast<unsigned>(x + y) & 1U);
        const std::uint64_t pixels =
            static_cast<std::uint64_t>(size.width) * static_cast<std::uint64_t>(size.height);
        const PackedMask packed = pack_mask(mask.view, buffer);
        ASSERT_LE(packed.size, kMaxMaskBytes);
        // A checkerboard needs one byte a pixel as runs.
        EXPECT_EQ(packed.encoding, pixels <= kMaxMaskBytes ? MaskEncoding::kRuns : MaskEncoding::kGrid);
        EXPECT_EQ(packed.scale, packed.encoding == MaskEncoding::kGrid ? size.scale : 1);
        const std::vector<std::uint8_t> out = decoded(packed, buffer, size.width, size.height);
        // Of unknown and traversable the cell shows unknown, except where a cell is one pixel.
        for (std::size_t i = 0; i < out.size(); i += 997)
            ASSERT_EQ(out[i], packed.scale > 1 ? 0U
                                               : (i % static_cast<std::size_t>(size.width) +
                                                  i / static_cast<std::size_t>(size.width)) &
                                                     1U);
    }
}

TEST(MaskCodec, TakesRunsUpToTheLastByteAndTheGridFromTheNext) {
    std::vector<std::uint8_t> buffer(kMaxMaskBytes);
    const int width = 1000;
    const int height = 66;
    for (const int changes : {static_cast<int>(kMaxMaskBytes) - 1, static_cast<int>(kMaxMaskBytes)}) {
        const Owned mask(width, height);
        for (int i = 0; i < width * height; ++i)
            mask.set(i % width, i / width, static_cast<unsigned>(std::min(i, changes)) & 1U);
        const PackedMask packed = pack_mask(mask.view, buffer);
        // `changes` runs of one pixel take a byte each, the rest of 1000 or 1001 pixels takes two.
        const bool fits = static_cast<std::size_t>(changes) + 2 <= kMaxMaskBytes;
        EXPECT_EQ(packed.encoding, fits ? MaskEncoding::kRuns : MaskEncoding::kGrid) << changes;
    }
    const int changes = static_cast<int>(kMaxMaskBytes) - 2;
    const Owned mask(width, height);
    for (int i = 0; i < width * height; ++i)
        mask.set(i % width, i / width, static_cast<unsigned>(std::min(i, changes)) & 1U);
    const PackedMask packed = pack_mask(mask.view, buffer);
    EXPECT_EQ(packed.encoding, MaskEncoding::kRuns);
    EXPECT_EQ(packed.size, kMaxMaskBytes);
}

TEST(MaskCodec, DependsOnTheClassesAlone) {
    std::mt19937 random(3);
    const Owned mask(201, 77);
    fill_random(mask, random, 20);
    Arena other;
    ImageView<TerrainClass> wide = other.image<TerrainClass>(512, 77);
    fill_pixels(wide, TerrainClass::kDrop);  // rubbish where the other view has its padding
    const Mask view(wide.data, 201, 77, wide.stride);
    copy_pixels<TerrainClass>(mask.view, view);
    std::vector<std::uint8_t> a(kMaxMaskBytes, 0x00);
    std::vector<std::uint8_t> b(kMaxMaskBytes, 0xff);
    for (int scale = 0; scale < 4; ++scale) {
        const std::size_t size_a = scale == 0 ? pack_runs(mask.view, a) : pack_grid(mask.view, scale, a);
        const std::size_t size_b = scale == 0 ? pack_runs(view, b) : pack_grid(view, scale, b);
        ASSERT_EQ(size_a, size_b);
        ASSERT_TRUE(std::equal(a.begin(), a.begin() + static_cast<std::ptrdiff_t>(size_a), b.begin()));
    }
}

TEST(MaskCodec, AUniformMaskIsOneRun) {
    std::vector<std::uint8_t> quick(kMaxMaskBytes);
    std::vector<std::uint8_t> packed(kMaxMaskBytes);
    for (const Size& size : kSizes) {
        for (unsigned kind = 0; kind < 4; ++kind) {
            const Owned mask(size.width, size.height);
            fill_pixels(mask.view, static_cast<TerrainClass>(kind));
            const PackedMask a =
                pack_uniform(static_cast<TerrainClass>(kind), size.width, size.height, quick);
            const PackedMask b = pack_mask(mask.view, packed);
            ASSERT_EQ(a.encoding, b.encoding);
            ASSERT_EQ(a.size, b.size);
            ASSERT_LE(a.size, 5U);
            ASSERT_TRUE(std::equal(quick.begin(), quick.begin() + static_cast<std::ptrdiff_t>(a.size),
                                   packed.begin()));
        }
    }
}

// Data in a block of its own size, so that a sanitizer sees any byte read behind it; behind the room for the
// classes lie bytes that must not change.
bool decode_exact(std::int32_t width, std::int32_t height, std::int32_t scale, std::int32_t encoding,
                  const std::vector<std::uint8_t>& data, std::vector<std::uint8_t>& out) {
    constexpr std::size_t kGuard = 16;
    const std::vector<std::uint8_t> tight(data);
    const std::size_t room = out.size();
    out.resize(room + kGuard, 0xa5);
    const bool good =
        decode_mask(width, height, scale, encoding, tight.data(), tight.size(), out.data(), room);
    for (std::size_t i = room; i < out.size(); ++i)
        EXPECT_EQ(out[i], 0xa5) << "wrote behind the room";
    out.resize(room);
    return good;
}

TEST(MaskDecoder, RefusesWhatIsNotExactlyOneMask) {
    std::vector<std::uint8_t> out(12, 9);
    const std::vector<std::uint8_t> good = {11 * 4 + 1};
    EXPECT_TRUE(decode_exact(4, 3, 1, 1, good, out));
    EXPECT_EQ(out, std::vector<std::uint8_t>(12, 1));
    const struct {
        std::int32_t width, height, scale, encoding;
        std::vector<std::uint8_t> data;
        const char* what;
    } bad[] = {
        {4, 3, 1, 1, {}, "no data"},
        {4, 3, 1, 1, {10 * 4 + 1}, "a pixel too few"},
        {4, 3, 1, 1, {10 * 4 + 1, 1 * 4 + 2}, "a pixel too many in the last run"},
        {4, 3, 1, 1, {12 * 4 + 1}, "a pixel too many"},
        {4, 3, 1, 1, {11 * 4 + 1, 0}, "a run too many"},
        {4, 3, 1, 1, {0xad}, "a number that does not end"},
        {4, 3, 1, 1, {0xad, 0x80, 0x80, 0x80, 0x80, 0x00}, "a number of six bytes"},
        {4, 3, 1, 1, {0xff, 0xff, 0xff, 0xff, 0x7f}, "a run of eight thousand million"},
        {4, 3, 2, 1, good, "runs with a scale"},
        {4, 3, 0, 2, {0, 0, 0}, "a grid without scale"},
        {4, 3, -1, 2, {0, 0, 0}, "a grid of negative scale"},
        {4, 3, 1, 2, {0, 0}, "a grid a byte short"},
        {4, 3, 1, 2, {0, 0, 0, 0}, "a grid a byte long"},
        {4, 3, 1, 0, good, "encoding 0"},
        {4, 3, 1, 3, good, "encoding 3"},
        {0, 3, 1, 1, good, "no width"},
        {4, -3, 1, 1, good, "negative height"},
        {4, 4, 1, 1, {15 * 4 + 1}, "more than there is room for"},
        {2147483647, 2147483647, 1, 1, good, "more than may be"},
    };
    for (const auto& each : bad) {
        std::fill(out.begin(), out.end(), std::uint8_t{1});
        EXPECT_FALSE(decode_exact(each.width, each.height, each.scale, each.encoding, each.data, out))
            << each.what;
        EXPECT_EQ(out, std::vector<std::uint8_t>(12, 0)) << each.what << ": must leave everything unknown";
    }
}

TEST(MaskDecoder, RandomBytesNeverReachOutside) {
    std::mt19937 random(4);
    int accepted = 0;
    for (int round = 0; round < 200000; ++round) {
        std::vector<std::uint8_t> data(random() % 24);
        for (std::uint8_t& byte : data)
            byte = static_cast<std::uint8_t>(random());
        const auto width = static_cast<std::int32_t>(random() % 40) - 2;
        const auto height = static_cast<std::int32_t>(random() % 12) - 2;
        const auto scale = static_cast<std::int32_t>(random() % 5) - 1;
        const auto encoding = static_cast<std::int32_t>(random() % 4);
        const int pixels = width > 0 && height > 0 ? width * height : 0;
        const std::size_t room = random() % 2 == 0 ? static_cast<std::size_t>(pixels) : random() % 512;
        std::vector<std::uint8_t> out(room, 0x55);
        const bool good = decode_exact(width, height, scale, encoding, data, out);
        accepted += good ? 1 : 0;
        ASSERT_LE(good ? static_cast<std::size_t>(pixels) : 0, room);
        for (std::size_t i = 0; i < (good ? static_cast<std::size_t>(pixels) : room); ++i)
            ASSERT_LE(out[i], good ? 3 : 0);
    }
    EXPECT_GT(accepted, 100) << "the bytes never got past the first checks";
}

TEST(MaskDecoder, DamagedMasksAreRefusedOrWholeMasks) {
    std::mt19937 random(5);
    const Owned mask(64, 48);
    fill_random(mask, random, 30);
    std::vector<std::uint8_t> buffer(kMaxMaskBytes);
    const PackedMask packed = pack_mask(mask.view, buffer);
    std::vector<std::uint8_t> out(64 * 48);
    for (int round = 0; round < 20000; ++round) {
        std::vector<std::uint8_t> data(buffer.begin(),
                                       buffer.begin() + static_cast<std::ptrdiff_t>(packed.size));
        for (unsigned i = 0; i <= random() % 4; ++i)
            data[random() % data.size()] = static_cast<std::uint8_t>(random());
        data.resize(data.size() - random() % 3);
        if (!decode_exact(64, 48, 1, 1, data, out)) {
            ASSERT_EQ(out, std::vector<std::uint8_t>(64 * 48, 0));
        }
        for (const std::uint8_t kind : out)
            ASSERT_LE(kind, 3);
    }
}

TEST(MaskDecoder, TakesAMessage) {
    std::mt19937 random(6);
    const Owned mask(300, 300);
    fill_random(mask, random, 1);  // noise: the grid
    mask_t message{};
    message.data.resize(kMaxMaskBytes);
    const PackedMask packed = pack_mask(mask.view, message.data);
    ASSERT_EQ(packed.encoding, MaskEncoding::kGrid);
    message.width = message.height = 300;
    message.scale = packed.scale;
    message.encoding = static_cast<std::int8_t>(packed.encoding);
    message.size = static_cast<std::int32_t>(packed.size);
    std::vector<std::uint8_t> out;
    ASSERT_TRUE(decode_mask(message, out));
    EXPECT_EQ(out, decoded(packed, message.data, 300, 300));
    message.size = static_cast<std::int32_t>(message.data.size()) + 1;
    EXPECT_FALSE(decode_mask(message, out));
    EXPECT_TRUE(out.empty());
    message.size = -1;
    EXPECT_FALSE(decode_mask(message, out));
    message.size = static_cast<std::int32_t>(packed.size);
    message.data.resize(packed.size - 1);
    EXPECT_FALSE(decode_mask(message, out)) << "says that it holds more than it does";
    message.data.resize(packed.size);
    EXPECT_TRUE(decode_mask(message, out));
    message.width = 1 << 30;
    EXPECT_FALSE(decode_mask(message, out));
}

}  // namespace
}  // namespace groundline::publish
