// `groundline evaluate --matchers` on small sets with known answers, and the matchers it compares.
#include <gtest/gtest.h>
#include <stdlib.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <set>
#include <string>
#include <vector>

#include "cli/compared_matchers.hpp"
#include "cli/matcher_table.hpp"
#include "cli/perturbation.hpp"
#include "cli/truth_sets.hpp"
#include "core/error.hpp"
#include "io/png.hpp"
#include "support/random_images.hpp"
#include "unit/evaluate_support.hpp"

namespace groundline::cli {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;
using test::OwnedLuma;
using test::OwnedPair;

std::vector<std::uint16_t> answers_of(const MatcherChoice& choice, const OwnedPair& pair, int min_disparity) {
    const int width = pair.left.width();
    const int height = pair.left.height();
    std::vector<std::uint16_t> answers(static_cast<std::size_t>(width * height));
    Serial serial;
    const auto matcher = choice.make({width, height, min_disparity, 16}, serial);
    matcher->match(pair.left.view(), pair.right.view());
    matcher->answers({answers.data(), width, height, width});
    return answers;
}

TEST(ComparedMatchers, EachSearchesTheSameRange) {
    const struct {
        int shift;
        int first;
        bool inside;
    } cases[] = {{20, 16, true}, {5, 0, true}, {0, 0, true}, {20, 0, false}, {5, 16, false}};
    for (const auto& each : cases) {
        const OwnedPair pair = test::shifted_pair(160, 60, 11, each.shift);
        for (const MatcherChoice& choice : compared_matchers()) {
            int right = 0;
            for (const std::uint16_t answer : answers_of(choice, pair, each.first))
                right += answer != 0 && std::abs(answer - 256 * each.shift) <= 128 ? 1 : 0;
            SCOPED_TRACE(choice.name);
            EXPECT_GE(right, each.inside ? 160 * 60 / 2 : 0) << each.shift;
            EXPECT_LE(right, each.inside ? 160 * 60 : 160) << each.shift;
        }
    }
}

TEST(ComparedMatchers, DenseAnswersMoreThanFiltered) {
    // Noise has no right answer: tests throw most of it out.
    const OwnedPair noise{test::noise_image(160, 60, 1), test::noise_image(160, 60, 2)};
    for (const MatcherChoice& choice : compared_matchers()) {
        const std::vector<std::uint16_t> answers = answers_of(choice, noise, 0);
        const auto absent = std::count(answers.begin(), answers.end(), 0);
        if (!choice.name.ends_with("/dense")) {
            EXPECT_GT(absent, 160 * 60 / 2) << choice.name;
        } else if (choice.ours) {
            EXPECT_EQ(absent, 0) << choice.name;
        } else {
            EXPECT_LT(absent, 160 * 60 * 4 / 10) << choice.name;
        }
    }
}

// On a slope neighbours differ by less than 1 px, so the speckle tests take none of it for speckles.
TEST(ComparedMatchers, SpeckleTestsLetASlopePass) {
    const OwnedPair slope = test::warped_pair(200, 60, 7, [](int, int y) { return y / 5; });
    for (const MatcherChoice& choice : compared_matchers()) {
        const std::vector<std::uint16_t> answers = answers_of(choice, slope, 0);
        const auto absent = std::count(answers.begin(), answers.end(), 0);
        EXPECT_LT(absent, 200 * 60 * 45 / 100) << choice.name;
    }
}

// What the rows with and without local mean are there for.
TEST(ComparedMatchers, OnlyTheLocalMeanLetsThePapersCostBearABrighterCamera) {
    OwnedPair pair = test::shifted_pair(160, 60, 11, 5);
    const OwnedPair plain = pair;
    change_exposure(plain.right.view(), 100, 20, pair.right.view());
    const auto share_right = [&](const char* name) {
        int right = 0;
        for (const std::uint16_t answer : answers_of(choose_matchers({name}).front(), pair, 0))
            right += std::abs(answer - 256 * 5) <= 128 ? 1 : 0;
        return right / (160.0 * 60.0);
    };
    EXPECT_GT(share_right("paper_local_mean/dense"), 0.9);
    EXPECT_LT(share_right("paper/dense"), 0.8);
}

TEST(ComparedMatchers, AreChosenByMethodOrWholeName) {
    const auto names = [](const std::vector<std::string>& wanted) {
        std::vector<std::string> found;
        for (const MatcherChoice& choice : choose_matchers(wanted))
            found.push_back(choice.name);
        return found;
    };
    EXPECT_EQ(names({"bm15", "paper"}),
              (std::vector<std::string>{"paper/dense", "paper/filtered", "bm15/filtered"}));
    EXPECT_EQ(names({"paper/filtered", "paper/filtered"}), std::vector<std::string>{"paper/filtered"});
    EXPECT_EQ(names({}).size(), compared_matchers().size());
    std::set<std::string> different;
    for (const std::string& name : names({}))
        different.insert(name);
    EXPECT_EQ(different.size(), compared_matchers().size());
    for (const char* name : {"pap", "paper/", "", "paper/dens"}) {
        try {
            choose_matchers({"paper", name});
            ADD_FAILURE() << name;
        } catch (const Refusal& refusal) {
            EXPECT_EQ(refusal.status(), ExitStatus::kUsage);
            EXPECT_NE(std::string(refusal.what()).find("sgbm_3way/dense"), std::string::npos);
        }
    }
}

DisparityScore score(std::int64_t scored, std::int64_t answered, std::int64_t bad1, std::int64_t bad3) {
    DisparityScore result;
    result.scored = scored;
    result.answered = answered;
    result.bad1 = bad1;
    result.bad3 = bad3;
    return result;
}

SetScores set_of(const std::string& name, bool sparse, const DisparityScore& figures) {
    SetScores set;
    set.name = name;
    set.sparse = sparse;
    set.frames = 1;
    set.disparities = 64;
    set.scores = {figures};
    return set;
}

TEST(MatcherGroups, SharesOfTheScored) {
    const MatcherFigures figures = figures_of(score(200, 50, 20, 10));
    EXPECT_DOUBLE_EQ(*figures.density, 0.25);
    EXPECT_DOUBLE_EQ(*figures.bad1, 0.4);
    EXPECT_DOUBLE_EQ(*figures.bad3, 0.2);
    EXPECT_DOUBLE_EQ(*figures.bad1_with_absent, 0.85);
    EXPECT_DOUBLE_EQ(*figures.bad3_with_absent, 0.8);
    EXPECT_FALSE(figures_of(score(200, 0, 0, 0)).bad1);
    EXPECT_DOUBLE_EQ(*figures_of(score(200, 0, 0, 0)).bad1_with_absent, 1.0);
    EXPECT_FALSE(figures_of(score(0, 0, 0, 0)).density);
}

TEST(MatcherGroups, SparseTruthIsPooledAndDenseAveraged) {
    const DisparityScore large = score(1000, 1000, 100, 0);
    const DisparityScore small = score(100, 50, 50, 50);
    std::vector<SetScores> sets = {set_of("road_1", true, large),  set_of("room_1", false, large),
                                   set_of("mixed_1", true, large), set_of("alone", false, small),
                                   set_of("road_2", true, small),  set_of("room_2", false, small),
                                   set_of("mixed_2", false, small)};
    sets[4].disparities = 128;
    sets.push_back(set_of("road_3", true, small));
    sets.back().problem = "it could not be read";
    const std::vector<MatcherGroup> groups = grouped(sets);
    ASSERT_EQ(groups.size(), 4U);
    EXPECT_EQ(groups[0].name, "road");
    EXPECT_EQ(groups[0].sets, (std::vector<std::string>{"road_1", "road_2"}));
    EXPECT_TRUE(groups[0].pooled);
    EXPECT_EQ(groups[0].frames, 2);
    EXPECT_EQ(groups[0].scored, 1100);
    EXPECT_EQ(groups[0].fewest_disparities, 64);
    EXPECT_EQ(groups[0].most_disparities, 128);
    EXPECT_DOUBLE_EQ(*groups[0].figures[0].bad1, 150.0 / 1050.0);
    EXPECT_DOUBLE_EQ(*groups[0].figures[0].density, 1050.0 / 1100.0);
    EXPECT_EQ(groups[1].name, "room");
    EXPECT_FALSE(groups[1].pooled);
    EXPECT_DOUBLE_EQ(*groups[1].figures[0].bad1, (0.1 + 1.0) / 2.0);
    EXPECT_DOUBLE_EQ(*groups[1].figures[0].density, 0.75);
    EXPECT_FALSE(groups[2].pooled);  // mixed
    EXPECT_EQ(groups[3].name, "alone");
}

class MatcherTable : public CommandTest {
  protected:
    MatcherTable() {
        std::string pattern = testing::TempDir() + "matchers-XXXXXX";
        suite_ = ::mkdtemp(pattern.data());
        options_.suite = suite_;
        options_.json = true;
    }
    ~MatcherTable() override { fs::remove_all(suite_); }

    static constexpr int kShift = 8;
    static OwnedPair pair(int width = 128, int height = 48) {
        return test::shifted_pair(width, height, 5, kShift);
    }
    // Truth says kShift + off px on every `every`th pixel.
    void write_set(const std::string& name, const OwnedPair& pair, int off = 0, int every = 1) const {
        fs::create_directories(suite_ / name);
        io::write_png(suite_ / name / "left.png", pair.left.view());
        io::write_png(suite_ / name / "right.png", pair.right.view());
        const int width = pair.left.width();
        std::vector<std::uint16_t> truth(static_cast<std::size_t>(width * pair.left.height()));
        for (std::size_t i = 0; i < truth.size(); i += static_cast<std::size_t>(every))
            truth[i] = static_cast<std::uint16_t>(256 * (kShift + off));
        io::write_png(suite_ / name / "disp.png",
                      ConstImageView<std::uint16_t>(truth.data(), width, pair.left.height(), width));
    }
    int run() {
        return kept([&] { return run_matcher_table(options_); });
    }
    // The results of a set under one condition, without its name.
    static json results(const json& table, const std::string& set, const std::string& condition) {
        json found = json::array();
        for (const json& each : table["sets"]) {
            if (each["name"] != set) continue;
            for (json result : each["results"]) {
                if (result["condition"] != condition) continue;
                result.erase("condition");
                found.push_back(result);
            }
        }
        return found;
    }

    fs::path suite_;
    MatcherTableOptions options_;
};

TEST_F(MatcherTable, RightAnswersAreRightForEveryMatcher) {
    write_set("a_right", pair());
    write_set("a_off2", pair(), 2);
    write_set("b_sparse", pair(), 0, 3);
    options_.conditions = {"clean"};
    ASSERT_EQ(run(), 0) << sentence_ << err_;
    EXPECT_TRUE(err_.empty()) << err_;
    const json table = json::parse(out_);
    ASSERT_EQ(table["matchers"].size(), compared_matchers().size());
    const json right = results(table, "a_right", "clean");
    ASSERT_EQ(right.size(), compared_matchers().size());
    for (const json& result : right) {
        EXPECT_EQ(result["scored"], (128 - kShift) * 48) << result;  // beyond is not in the right picture
        EXPECT_GT(result["density"], 0.45) << result;
        EXPECT_LT(result["bad1"], 0.03) << result;
    }
    for (const json& result : results(table, "a_off2", "clean")) {
        EXPECT_GT(result["bad1"], 0.97) << result;
        EXPECT_LT(result["bad3"], 0.03) << result;
    }
    for (const json& result : results(table, "b_sparse", "clean"))
        EXPECT_EQ(result["scored"], 128 * 48 / 3) << result;
    EXPECT_EQ(table["sets"][0]["disparities"], 32);
    EXPECT_EQ(table["sets"][0]["truth"], "dense");
    EXPECT_EQ(table["sets"][2]["truth"], "sparse");
    EXPECT_EQ(table["groups"][0]["weighed"], "sets");
    EXPECT_EQ(table["groups"][1]["weighed"], "pixels");
    EXPECT_NEAR(table["groups"][0]["results"][0]["bad1"].get<double>(), 0.5, 0.02);

    const std::string first = out_;
    ASSERT_EQ(run(), 0);
    EXPECT_EQ(out_, first);
    options_.disparities = 16;
    ASSERT_EQ(run(), 0);
    EXPECT_EQ(json::parse(out_)["sets"][0]["disparities"], 16);
}

// Matching under a condition is matching pictures that were disturbed before.
TEST_F(MatcherTable, ConditionsDisturbTheRightPicture) {
    const OwnedPair given = pair();
    write_set("given", given);
    const auto write_disturbed = [&](const std::string& name, auto disturb) {
        OwnedPair disturbed = given;
        disturb(given.right.view(), disturbed.right.view());
        write_set(name, disturbed);
    };
    write_disturbed("gain", [](ConstLuma from, Luma to) { change_exposure(from, 110, 5, to); });
    write_disturbed("shift", [](ConstLuma from, Luma to) { shift_down(from, 1, to); });
    write_disturbed("blur", [](ConstLuma from, Luma to) { blur_binomial_5x5(from, to); });
    ASSERT_EQ(run(), 0) << sentence_ << err_;
    const json table = json::parse(out_);
    for (const char* condition : {"gain", "shift", "blur"}) {
        EXPECT_EQ(results(table, "given", condition), results(table, condition, "clean")) << condition;
        EXPECT_NE(results(table, "given", condition), results(table, "given", "clean")) << condition;
    }
}

TEST_F(MatcherTable, NoiseDisturbsBothPicturesFiveTimes) {
    const OwnedPair given = pair();
    write_set("given", given);
    for (std::uint64_t repetition = 0; repetition < 5; ++repetition) {
        OwnedPair noisy = given;
        const std::uint64_t number = pair_number("given", 0);
        add_noise(given.left.view(), 5, noise_seed(repetition, number, 0), noisy.left.view());
        add_noise(given.right.view(), 5, noise_seed(repetition, number, 1), noisy.right.view());
        write_set("noisy" + std::to_string(repetition), noisy);
    }
    ASSERT_EQ(run(), 0) << sentence_ << err_;
    const json table = json::parse(out_);
    const json found = results(table, "given", "noise");
    for (std::size_t i = 0; i < compared_matchers().size(); ++i) {
        int scored = 0;
        int answered = 0;
        double bad1 = 0.0;
        for (int repetition = 0; repetition < 5; ++repetition) {
            const json each = results(table, "noisy" + std::to_string(repetition), "clean")[i];
            scored += each["scored"].get<int>();
            answered += each["answered"].get<int>();
            bad1 += each["bad1"].get<double>() * each["answered"].get<int>();
        }
        SCOPED_TRACE(found[i]["matcher"]);
        EXPECT_EQ(found[i]["scored"], scored);
        EXPECT_EQ(found[i]["answered"], answered);
        EXPECT_NEAR(found[i]["bad1"].get<double>() * answered, bad1, 0.1);
    }
}

TEST_F(MatcherTable, NoiseIsTheSameInEverySuite) {
    write_set("b", pair());
    options_.conditions = {"noise"};
    options_.matchers = {"paper/filtered"};
    ASSERT_EQ(run(), 0) << sentence_;
    const json alone = results(json::parse(out_), "b", "noise");
    write_set("a", pair());
    ASSERT_EQ(run(), 0) << sentence_;
    EXPECT_EQ(results(json::parse(out_), "b", "noise"), alone);
    EXPECT_NE(results(json::parse(out_), "a", "noise"), alone);  // but another pair has other noise
}

TEST_F(MatcherTable, TableNamesEverything) {
    write_set("road_a", pair(), 0, 3);
    write_set("road_b", pair(96, 40), 0, 3);
    options_.json = false;
    ASSERT_EQ(run(), 0) << sentence_;
    for (const char* part :
         {"road: 2 sets, 2 frames, pixels of all taken together; 32 disparities\n",
          "clean                        density      bad-1      bad-3  bad-1+abs  bad-3+abs\n",
          "  paper/dense                   100.00 ", "right picture 1.1 x + 5 grey levels",
          "5 seeds together", "5x5 binomial", "uniqueness 10 %, left-right 1 px, speckle 100 px within 1 px",
          "MODE_HH 5x5, P1 200"})
        EXPECT_NE(out_.find(part), std::string::npos) << part << " is not in:\n" << out_;
}

TEST_F(MatcherTable, WhatCannotBeMatchedIsSaidAndLeftOut) {
    write_set("good", pair());
    write_set("narrow", pair(24, 40));
    options_.conditions = {"clean"};
    options_.matchers = {"paper"};
    EXPECT_EQ(run(), 78);
    json table = json::parse(out_);
    EXPECT_EQ(table["groups"].size(), 1U);
    EXPECT_EQ(table["sets"][1]["status"], 78);
    EXPECT_NE(err_.find("narrow: disparities 0 to 31"), std::string::npos) << err_;

    fs::remove_all(suite_ / "narrow");
    fs::remove(suite_ / "good" / "right.png");
    write_set("other", pair());
    EXPECT_EQ(run(), 66);
    table = json::parse(out_);
    EXPECT_FALSE(table["sets"][0]["problem"].get<std::string>().empty());
    EXPECT_EQ(table["sets"][1]["status"], 0);
    EXPECT_EQ(table["groups"].size(), 1U);

    fs::remove_all(suite_ / "good");
    const std::vector<std::uint16_t> small(100, 2048);
    io::write_png(suite_ / "other" / "disp.png", ConstImageView<std::uint16_t>(small.data(), 10, 10, 10));
    EXPECT_EQ(run(), 66);
    EXPECT_NE(err_.find("has 10x10 pixels; expected 128x48"), std::string::npos) << err_;
}

// Three pairs of which one has broken truth: the others count.
TEST_F(MatcherTable, LaterFramesThatCannotBeReadAreStatus66) {
    const OwnedPair given = pair();
    const fs::path set = suite_ / "many";
    for (const char* folder : {"left", "right", "disp"})
        fs::create_directories(set / folder);
    const std::vector<std::uint16_t> truth(128 * 48, 256 * kShift);
    for (const char* name : {"000000.png", "000001.png", "000002.png"}) {
        io::write_png(set / "left" / name, given.left.view());
        io::write_png(set / "right" / name, given.right.view());
        io::write_png(set / "disp" / name, ConstImageView<std::uint16_t>(truth.data(), 128, 48, 128));
    }
    fs::resize_file(set / "disp/000001.png", 40);
    options_.conditions = {"clean"};
    options_.matchers = {"paper/dense"};
    EXPECT_EQ(run(), 66);
    const json table = json::parse(out_);
    EXPECT_EQ(table["sets"][0]["frames"], 2);
    EXPECT_EQ(table["sets"][0]["results"][0]["scored"], 2 * (128 - kShift) * 48);
    EXPECT_NE(err_.find("000001.png"), std::string::npos) << err_;
}

TEST_F(MatcherTable, RefusesUnknownNames) {
    write_set("a", pair());
    options_.matchers = {"papper"};
    EXPECT_EQ(run(), 2);
    EXPECT_NE(sentence_.find("papper"), std::string::npos);
    options_.matchers = {};
    options_.conditions = {"rain"};
    EXPECT_EQ(run(), 2);
    EXPECT_NE(sentence_.find("clean, gain, noise, shift, blur"), std::string::npos) << sentence_;
    options_.conditions = {};
    options_.sets = {"nowhere"};
    EXPECT_EQ(run(), 66);
    EXPECT_NE(sentence_.find("nowhere"), std::string::npos);
    EXPECT_TRUE(out_.empty());
}

TEST_F(MatcherTable, SetsAreChosenByBeginningOrPattern) {
    for (const char* name : {"road_1", "road_2", "room_1", "broad_1"})
        write_set(name, pair(32, 16));
    fs::create_directories(suite_ / "without_truth");
    const auto chosen = [&](const std::vector<std::string>& words) {
        std::string names;
        for (const fs::path& set : truth_sets(suite_, words))
            names += set.filename().string() + " ";
        return names;
    };
    EXPECT_EQ(chosen({}), "broad_1 road_1 road_2 room_1 ");
    EXPECT_EQ(chosen({"ro"}), "road_1 road_2 room_1 ");
    EXPECT_EQ(chosen({"*_1"}), "broad_1 road_1 room_1 ");
    EXPECT_EQ(chosen({"room", "road_[2-9]"}), "road_2 room_1 ");
    EXPECT_THROW(chosen({"road", "oad"}), Refusal);
}

}  // namespace
}  // namespace groundline::cli
