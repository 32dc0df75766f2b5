#include "lint/layering.hpp"

#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <iterator>
#include <string>

namespace groundline::lint {
namespace {

TEST(Layering, SourcesKeepTheRules) {
    const std::filesystem::path root = GROUNDLINE_SOURCE_DIR "/src";
    int files = 0;
    for (const auto& entry : std::filesystem::recursive_directory_iterator(root)) {
        const std::string extension = entry.path().extension().string();
        if (extension != ".cpp" && extension != ".hpp") continue;
        std::ifstream file(entry.path(), std::ios::binary);
        const std::string text{std::istreambuf_iterator<char>(file), {}};
        for (const std::string& breach :
             breaches(entry.path().lexically_relative(root).generic_string(), text))
            ADD_FAILURE() << "src/" << breach;
        ++files;
    }
    EXPECT_GT(files, 20) << "the sources were not found under " << root;
}

// A rule is worth something only if breaking it is seen: each line here must be named, alone.
TEST(Layering, EveryBreachIsSeen) {
    const struct {
        const char* path;
        const char* line;
        const char* sentence;
    } cases[] = {
        {"rig/a.cpp", "#include \"stereo/b.hpp\"", "rig must not include stereo"},
        {"core/a.hpp", "#include \"rig/b.hpp\"", "core must not include rig"},
        {"terrain/a.hpp", "#include \"verdict/b.hpp\"", "terrain must not include verdict"},
        {"io/a.hpp", "#include \"publish/b.hpp\"", "io must not include publish"},
        {"publish/a.hpp", "#include \"capture/b.hpp\"", "publish must not include capture"},
        {"io/a.hpp", "#include \"b.hpp\"", "name of a room"},
        {"stereo/a.cpp", "#include <opencv2/core.hpp>", "must not include opencv2/core.hpp"},
        {"synth/a.cpp", "#  include <fstream>", "must not include fstream"},
        {"verdict/a.cpp", "#include <thread>", "must not include thread"},
        {"rig/a.cpp", "const double a = std::sin(b);", "calls sin"},
        {"rig/a.cpp", "auto r = x*hypot (a, b);", "calls hypot"},
        {"core/a.cpp", "f(::expf(x));", "calls exp"},
        {"cli/a.cpp", "open(\"/home/me/x\");", "place on one machine"},
        {"garage/a.cpp", "int a;", "no known room"},
    };
    for (const auto& each : cases) {
        const std::string text = "// first\n" + std::string(each.line) + "\n";
        const auto found = breaches(each.path, text);
        ASSERT_EQ(found.size(), 1U) << each.path << ": " << each.line;
        EXPECT_NE(found[0].find(each.sentence), std::string::npos) << found[0];
    }
}

TEST(Layering, WhatIsAllowedPasses) {
    const struct {
        const char* path;
        const char* text;
    } cases[] = {
        {"rig/a.cpp", "#include \"core/image.hpp\"\n#include \"rig/b.hpp\"\n#include <cmath>\n"},
        {"cli/a.cpp",
         "#include \"io/b.hpp\"\n#include <opencv2/core.hpp>\n#include <thread>\nstd::sin(x);\n"},
        {"rig/a.cpp", "det::sin(x); row.exp(y); p->log(z); arcsin(q); std::sqrt(s); // like std::sin(x)\n"},
        {"rig/a.cpp",
         "say(\"sin(x) \\\" cos(y)\"); /* pow(\n tan( */ char c = '\"'; int n = 1'000; // exp(\n"},
        {"core/deterministic_math.cpp", "double sin(double x) { return std::sin(x); }\n"},
    };
    for (const auto& each : cases)
        for (const std::string& breach : breaches(each.path, each.text))
            ADD_FAILURE() << breach;
}

}  // namespace
}  // namespace groundline::lint
