// How a suite file is read, what a budget cuts, and how expectations are judged.

#include <gtest/gtest.h>
#include <unistd.h>

#include <cmath>
#include <filesystem>
#include <limits>

#include "client/bench/reference_image.h"
#include "client/bench/suite.h"
#include "client/bench/suite_clock.h"
#include "client/bench/suite_table.h"
#include "common/core/atomic_file.h"

namespace lightloom::client {
namespace {

constexpr const char* kGood = R"({
  "suite": "two rooms", "resolution": "64x36", "seeds": 4, "first_seed": 7, "tables": "shared", "threshold_percent": 12,
  "budgets": [{"seconds": 20}, {"samples": 64}], "algorithms": ["path", "bdpt:heuristic=power"],
  "reference": {"algorithm": "spcbpt", "seconds": 60},
  "stability": {"seeds": 25, "budget": {"samples": 4}},
  "scenes": [
    {"file": "rooms/a.pbrt", "claim": "a claim", "reference": "refs/a.exr",
     "expect": [{"error": "path", "over": "bdpt:heuristic=power", "at_least": 3}, {"verdict": "path", "is_not": "biased"}]},
    {"name": "b", "file": "/there/b.pbrt", "optional": true, "budgets": {"samples": 8}, "algorithms": "light", "max_depth": 3}
  ]
})";

TEST(Suite, ScenesInheritAndMaySayThemselves) {
    const auto suite = parse_suite(kGood, "dir/s.json", false);
    ASSERT_TRUE(suite.ok()) << suite.status().message();
    EXPECT_EQ(suite->name, "two rooms");
    EXPECT_TRUE(suite->shared_tables);
    EXPECT_EQ(suite->digest.size(), 64u);
    const SuiteScene &a = suite->scenes[0], &b = suite->scenes[1];
    EXPECT_EQ(a.name, "a");
    EXPECT_EQ(a.job.scene, "dir/rooms/a.pbrt");
    EXPECT_EQ(a.reference, "dir/refs/a.exr");
    EXPECT_EQ(a.job.seed, 7u);
    EXPECT_EQ(a.seeds, 4u);
    EXPECT_EQ(a.budgets, (std::vector<RunBudget>{{.seconds = 20}, {.samples = 64}}));
    EXPECT_EQ(a.algorithms[1].label, "bdpt:heuristic=power");
    ASSERT_EQ(a.expectations.size(), 1u) << "verdicts are for --stability";
    EXPECT_EQ(a.expectations[0].text(), "relMSE of path over that of bdpt:heuristic=power is at least 3");
    EXPECT_EQ(b.job.scene, "/there/b.pbrt");
    EXPECT_TRUE(b.optional);
    EXPECT_EQ(b.budgets, (std::vector<RunBudget>{{.samples = 8}}));
    EXPECT_EQ(b.algorithms[0].label, "light");
    EXPECT_EQ(b.job.max_depth, 3);
    EXPECT_EQ(b.recipe->algorithm.label, "spcbpt");
}

TEST(Suite, StabilityHasItsOwnSeedsAndBudget) {
    const auto suite = parse_suite(kGood, "dir/s.json", true);
    ASSERT_TRUE(suite.ok()) << suite.status().message();
    for (const SuiteScene& scene : suite->scenes) {
        EXPECT_EQ(scene.seeds, 25u);
        EXPECT_EQ(scene.budgets, (std::vector<RunBudget>{{.samples = 4}}));
    }
    ASSERT_EQ(suite->scenes[0].expectations.size(), 1u);
    EXPECT_EQ(suite->scenes[0].expectations[0].text(), "verdict of path is not \"biased\"");
}

/// A good suite with one piece replaced.
std::string with(const std::string& piece, const std::string& replacement) {
    std::string text = kGood;
    const size_t at = text.find(piece);
    EXPECT_NE(at, std::string::npos) << piece;
    return text.replace(at, piece.size(), replacement);
}

TEST(Suite, MistakesAreNamedInOneLine) {
    const struct {
        std::string text, says;
    } cases[] = {
        {"{\"suite\": \"s\",", "not JSON"},
        {"[]", "has to be an object"},
        {with("\"suite\": \"two rooms\"", "\"suite\": 3"), "\"suite\" has to be a text"},
        {with("\"seeds\": 4", "\"seeds\": 0"), "\"seeds\" has to be a whole number from 1 to 1000"},
        {with("\"seeds\": 4", "\"seds\": 4"), "\"seds\" is not known here (did you mean 'seeds'?)"},
        {with("\"seconds\": 20", "\"seconds\": -1"), "\"seconds\" has to be a number"},
        {with("{\"seconds\": 20}", "{}"), "needs either \"seconds\" or \"samples\""},
        {with("\"path\", \"bdpt:heuristic=power\"", "\"path\", \"bdtp\""), "bdtp"},
        {with("\"path\", \"bdpt:heuristic=power\"", "\"path\", \"path:heuristic=balance\""), "twice"},
        {with("\"file\": \"rooms/a.pbrt\", ", ""), "scene 1 needs \"file\""},
        {with("\"name\": \"b\"", "\"name\": \"a\""), "two of the name a"},
        {with("\"name\": \"b\"", "\"name\": \"../b\""), "part of file names"},
        {with("\"over\": \"bdpt:heuristic=power\"", "\"over\": \"bdpt\""), "speaks of bdpt"},
        {with(", \"at_least\": 3", ""), "needs \"at_least\" or \"at_most\""},
        {with("\"is_not\": \"biased\"", "\"is_not\": \"odd\""), "has to be one of"},
        {with("\"tables\": \"shared\"", "\"tables\": \"none\""), "\"made\" or \"shared\""},
        {with("\"seeds\": 25", "\"seeds\": 5"), "from 20 to 1000"},
        {with("\"seconds\": 60", "\"minutes\": 60"), "\"minutes\" is not known here"},
    };
    for (const auto& wrong : cases) {
        const auto suite = parse_suite(wrong.text, "dir/s.json", false);
        ASSERT_FALSE(suite.ok()) << wrong.says;
        const std::string& message = suite.status().message();
        EXPECT_TRUE(message.starts_with("dir/s.json")) << message;
        EXPECT_NE(message.find(wrong.says), std::string::npos) << message;
        EXPECT_EQ(message.find('\n'), std::string::npos) << message;
    }
    EXPECT_NE(read_suite("/no/such.json", false).status().message().find("/no/such.json"), std::string::npos);
}

TEST(SuiteClock, SeedsAreLeftOutOnlyWhereHalfTheTimeIsNotEnough) {
    // Ten seeds of 8 s each.
    EXPECT_EQ(seeds_within(80, 10, 8, false), 10u);
    EXPECT_EQ(seeds_within(40, 10, 8, false), 10u) << "runs of half the time";
    EXPECT_EQ(seeds_within(20, 10, 8, false), 5u);
    EXPECT_EQ(seeds_within(1, 10, 8, false), 3u) << "below three nothing is known of their scatter";
    EXPECT_EQ(seeds_within(1, 2, 8, false), 2u);
    EXPECT_EQ(seeds_within(1, 20, 8, true), 20u) << "a judgement needs them all";
    EXPECT_EQ(seeds_within(std::numeric_limits<double>::infinity(), 10, 8, false), 10u);
}

TEST(SuiteClock, TimeOfEarlierProcessesCounts) {
    EXPECT_NEAR(SuiteClock(30, 100).left(), 70, 1);
    EXPECT_EQ(SuiteClock(130, 100).left(), 0);
    EXPECT_EQ(SuiteClock(130, 0).left(), std::numeric_limits<double>::infinity());
    EXPECT_EQ(asked_seconds({.seconds = 4}, 10), 4);
    EXPECT_EQ(asked_seconds({.samples = 4}, 10), 10);
}

Json run(const char* scene, const char* label, double relmse, double mean_ratio) {
    return {
        {"type", "run"}, {"scene", scene},           {"label", label},   {"budget", {{"seconds", 20}}}, {"iterations", 10},
        {"seconds", 19}, {"preparation_seconds", 1}, {"relmse", relmse}, {"relmse_own", relmse - 0.01}, {"mean_ratio", mean_ratio}};
}

TEST(Expectations, AreJudgedByMediansOverSeeds) {
    Suite suite;
    suite.scenes.resize(2);
    suite.scenes[0].name = "a";
    suite.scenes[1].name = "b";
    const double inf = HUGE_VAL;
    using Kind = Expectation::Kind;
    suite.scenes[0].expectations = {{Kind::kErrorRatio, "path", "bdpt", "", 3, inf},
                                    {Kind::kErrorRatio, "path", "bdpt", "", 5, inf},
                                    {Kind::kError, "bdpt", "", "", -inf, 0.11},
                                    {Kind::kMeanRatio, "path", "", "", 0.9, 1.1}};
    suite.scenes[1].expectations = {{Kind::kError, "bdpt", "", "", -inf, 1}};
    // The medians without the reference's noise are 0.4 and 0.1.
    const std::vector<Json> lines{run("a", "path", 0.41, 0.8), run("a", "path", 9, 1.2), run("a", "path", 0.01, 1.0),
                                  run("a", "bdpt", 0.11, 1)};
    const auto outcomes = judge_expectations(suite, lines);
    ASSERT_TRUE(outcomes.ok());
    ASSERT_EQ(outcomes->size(), 5u);
    EXPECT_EQ((*outcomes)[0].kind, Outcome::Kind::kHolds);
    EXPECT_EQ((*outcomes)[0].found, "4");
    EXPECT_EQ((*outcomes)[1].kind, Outcome::Kind::kFails);
    EXPECT_EQ((*outcomes)[2].kind, Outcome::Kind::kHolds);
    EXPECT_EQ((*outcomes)[3].kind, Outcome::Kind::kHolds);
    EXPECT_EQ((*outcomes)[4].kind, Outcome::Kind::kNotJudged) << "no run of it has ended";
    const std::string table = suite_table(lines);
    EXPECT_NE(table.find("a      path       20 s    3     10   19.00     1.00       0.4"), std::string::npos) << table;
}

TEST(Expectations, AreNotJudgedNearTheReferencesOwnError) {
    Suite suite;
    suite.scenes.resize(1);
    suite.scenes[0].name = "a";
    using Kind = Expectation::Kind;
    suite.scenes[0].expectations = {{Kind::kErrorRatio, "path", "bdpt", "", 1.05, HUGE_VAL},
                                    {Kind::kErrorRatio, "bdpt", "path", "", 1.05, HUGE_VAL}};
    std::vector<Json> lines{run("a", "path", 0.0097, 1), run("a", "bdpt", 0.0091, 1)};  // own errors below zero
    for (Json& line : lines) line["near_floor"] = true;
    const auto outcomes = judge_expectations(suite, lines);
    ASSERT_TRUE(outcomes.ok());
    for (const Outcome& outcome : *outcomes) {
        EXPECT_EQ(outcome.kind, Outcome::Kind::kNotJudged);
        EXPECT_NE(outcome.found.find("too near the reference's own error"), std::string::npos) << outcome.found;
    }
    EXPECT_NE(suite_table(lines).find("< 0.0097"), std::string::npos) << suite_table(lines);
}

TEST(Reference, IsFoundBesideItsScene) {
    const std::filesystem::path directory = std::filesystem::temp_directory_path() / ("references-" + std::to_string(::getpid()));
    std::filesystem::create_directories(directory / "references");
    const auto put = [&](const char* name) { ASSERT_TRUE(write_file_atomically((directory / name).string(), "x").ok()); };
    EXPECT_TRUE(find_reference(directory / "room.pbrt", 64, 36).empty());
    put("room-ref.exr");
    EXPECT_EQ(find_reference(directory / "room.pbrt", 64, 36), directory / "room-ref.exr");
    put("references/room-64x36.exr");
    EXPECT_EQ(find_reference(directory / "room.pbrt", 64, 36), directory / "references/room-64x36.exr");
    EXPECT_EQ(find_reference(directory / "room.pbrt", 64, 37), directory / "room-ref.exr");
    std::filesystem::remove_all(directory);
}

}  // namespace
}  // namespace lightloom::client
