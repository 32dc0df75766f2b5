// Polygons of the robot's own parts: the words, and which pixels lie inside.
#include "rig/body_mask.hpp"

#include <gtest/gtest.h>

#include <random>

#include "support/random_images.hpp"

namespace groundline::rig {
namespace {

using groundline::test::OwnedLuma;

OwnedLuma drawn(const Polygon& polygon, int width = 32, int height = 24) {
    OwnedLuma mask(width, height, 5);
    mask.fill([](int, int) { return 0; });
    fill_polygon(polygon, mask.view());
    return mask;
}

TEST(BodyPolygons, WordsBecomeCorners) {
    const auto polygons = parse_polygons(" 0,0 10,0.5  -3.25,1e1 ;\n5,5 6,6 7,5");
    ASSERT_TRUE(polygons.has_value());
    ASSERT_EQ(polygons->size(), 2U);
    ASSERT_EQ((*polygons)[0].size(), 3U);
    EXPECT_EQ((*polygons)[0][1].x, 10.0);
    EXPECT_EQ((*polygons)[0][1].y, 0.5);
    EXPECT_EQ((*polygons)[0][2].x, -3.25);
    EXPECT_EQ((*polygons)[0][2].y, 10.0);
    EXPECT_EQ((*polygons)[1][2].x, 7.0);
}

TEST(BodyPolygons, OtherWordsAreNone) {
    for (const char* text : {"", " ", ";", "mask.png", "0,0 1,1", "0,0 1,1 2", "0,0 1,1 2,x", "0,0 1,1 2,2,2",
                             "0,0 1,1 2,2; 3,3", "0,0 1,1 2,2 ; ; 0,0 1,1 2,2", "nan,0 1,1 2,2",
                             "0,0 1,1 inf,2", "0, 0 1,1 2,2", "0,0 1,1 2,2;/etc"})
        EXPECT_FALSE(parse_polygons(text).has_value()) << text;
    EXPECT_TRUE(parse_polygons("0,0 1,1 2,2;").has_value()) << "a last semicolon is no further polygon";
}

TEST(BodyPolygons, MiddlesOnLeftAndUpperEdgesAreInside) {
    const OwnedLuma mask = drawn({{3, 2}, {9, 2}, {9, 7}, {3, 7}});
    for (int y = 0; y < mask.height(); ++y)
        for (int x = 0; x < mask.width(); ++x)
            EXPECT_EQ(mask.at(x, y), x >= 3 && x < 9 && y >= 2 && y < 7 ? 1 : 0) << x << ' ' << y;
}

// Two polygons with a common edge share no pixel and leave none out.
TEST(BodyPolygons, NeighboursMeetWithoutGapOrOverlap) {
    const OwnedLuma left = drawn({{0, 0}, {11, 0}, {17, 24}, {0, 24}});
    const OwnedLuma right = drawn({{11, 0}, {32, 0}, {32, 24}, {17, 24}});
    for (int y = 0; y < 24; ++y)
        for (int x = 0; x < 32; ++x)
            EXPECT_EQ(left.at(x, y) + right.at(x, y), 1) << x << ' ' << y;
}

TEST(BodyPolygons, TheMiddleOfAStarIsOutside) {
    const OwnedLuma mask = drawn({{16, 0}, {24, 23}, {2, 9}, {30, 9}, {8, 23}});
    EXPECT_EQ(mask.at(16, 3), 1);
    EXPECT_EQ(mask.at(16, 12), 0) << "even-odd: crossed twice";
}

// Against the definition: a ray to the right crosses the outline an odd number of times.
TEST(BodyPolygons, AgreesWithCountingCrossings) {
    std::mt19937 random(3);
    const auto anywhere = [&](int span) {
        return static_cast<double>(random() % (4U * span)) / 2.0 - span / 2.0;
    };
    for (int round = 0; round < 300; ++round) {
        Polygon polygon;
        for (unsigned corner = 0; corner < 3 + random() % 5; ++corner)
            polygon.push_back({anywhere(32), anywhere(24)});
        const OwnedLuma mask = drawn(polygon);
        for (int y = 0; y < 24; ++y)
            for (int x = 0; x < 32; ++x) {
                bool inside = false;
                bool close = false;
                for (std::size_t i = 0; i < polygon.size(); ++i) {
                    const Corner& a = polygon[i];
                    const Corner& b = polygon[(i + 1) % polygon.size()];
                    if ((a.y > y) == (b.y > y)) continue;
                    const double crossing = a.x + (y - a.y) * (b.x - a.x) / (b.y - a.y);
                    close = close || std::abs(crossing - x) < 1e-9;
                    if (crossing > x) inside = !inside;
                }
                if (!close) {
                    ASSERT_EQ(mask.at(x, y), inside ? 1 : 0) << round << ": " << x << ' ' << y;
                }
            }
    }
}

}  // namespace
}  // namespace groundline::rig
