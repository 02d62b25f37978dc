// The name that was meant where another was written.

#include "common/core/nearest.h"

#include <gtest/gtest.h>

#include <vector>

namespace lightloom {
namespace {

TEST(SpellingMistakes, CountsEditsAndExchanges) {
    EXPECT_EQ(spelling_mistakes("", ""), 0u);
    EXPECT_EQ(spelling_mistakes("render", "render"), 0u);
    EXPECT_EQ(spelling_mistakes("Render", "rENDER"), 0u) << "capitals are no mistake";
    EXPECT_EQ(spelling_mistakes("", "abc"), 3u);
    EXPECT_EQ(spelling_mistakes("rendr", "render"), 1u) << "one is missing";
    EXPECT_EQ(spelling_mistakes("rennder", "render"), 1u) << "one is too many";
    EXPECT_EQ(spelling_mistakes("rander", "render"), 1u) << "one is wrong";
    EXPECT_EQ(spelling_mistakes("redner", "render"), 1u) << "two are exchanged";
    EXPECT_EQ(spelling_mistakes("ca", "abc"), 3u) << "an exchange whose letters are parted is two mistakes and more";
    EXPECT_EQ(spelling_mistakes("kitten", "sitting"), 3u);
}

TEST(Nearest, IsTheOneWithFewestMistakesIfTheyAreFew) {
    const std::vector<std::string_view> known{"path", "light", "bdpt", "lvcbpt", "spcbpt"};
    EXPECT_EQ(nearest("pth", known), "path");
    EXPECT_EQ(nearest("PATH", known), "path");
    EXPECT_EQ(nearest("bpdt", known), "bdpt");
    EXPECT_EQ(nearest("spcbt", known), "spcbpt");
    EXPECT_EQ(nearest("lvcbpd", known), "lvcbpt");
    for (const char* far : {"", "x", "no-such", "photons", "p"}) EXPECT_EQ(nearest(far, known), "") << far;
    EXPECT_EQ(nearest(std::string(100000, 'p'), known), "");
    EXPECT_EQ(nearest("path", {}), "");
}

TEST(Nearest, TakesTheBeginningOfAName) {
    const std::vector<std::string_view> known{"correlation-aware", "connections", "cache"};
    EXPECT_EQ(nearest("corr", known), "correlation-aware");
    EXPECT_EQ(nearest("co", known), "") << "too short to tell";
    EXPECT_EQ(did_you_mean("conections", known), " (did you mean 'connections'?)");
    EXPECT_EQ(did_you_mean("zzz", known), "");
}

}  // namespace
}  // namespace lightloom
