// From lines of a results file to judged rows, their table and their JSON.

#include "client/bench/verdicts.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <random>

namespace lightloom::client {
namespace {

Json scene_line(const std::string& scene) {
    Json line{{"type", "scene"}, {"scene", scene}, {"reference_relmse", 1e-6}, {"reference_regions", Json::array()}};
    for (int r = 0; r < 10; ++r) line["reference_regions"].push_back({{"mean", 0.5}, {"variance", 1e-9}});
    return line;
}

/// Lines of a run whose error falls as n^-1/2 and whose image has `light` times the reference's.
std::vector<Json> run_lines(const std::string& scene, const std::string& label, uint64_t seed, double light = 1) {
    std::mt19937_64 generator(seed * 1000 + uint64_t(label.front()));
    std::normal_distribution<double> noise(0, 0.01);
    const Json common{{"run", scene + label + std::to_string(seed)},
                      {"scene", scene},
                      {"label", label},
                      {"seed", seed},
                      {"budget", {{"samples", 64}}}};
    std::vector<Json> lines;
    for (int n = 1; n <= 64; n *= 2) {
        Json line{{"type", "checkpoint"}};
        line.update(common);
        line["iterations"] = n;
        line["relmse"] = (1 + noise(generator)) / n;
        line["relmse_trimmed"] = 0.9 / n;
        line["mean_ratio"] = light;
        lines.push_back(line);
    }
    Json end = lines.back();
    end["type"] = "run";
    end["region_means"] = Json::array();
    for (int r = 0; r < 10; ++r) end["region_means"].push_back(0.5 * light * (1 + noise(generator)));
    end["fireflies"] = {{"count", 0}, {"energy", 0.0}};
    lines.push_back(end);
    return lines;
}

std::vector<Json> results() {
    std::vector<Json> lines{{{"type", "start"}, {"format", "lightloom-bench 2"}}, scene_line("slit"), scene_line("pool")};
    const auto add = [&](const std::vector<Json>& more) { lines.insert(lines.end(), more.begin(), more.end()); };
    for (uint64_t seed = 1; seed <= 20; ++seed) {
        add(run_lines("slit", "path", seed));
        add(run_lines("slit", "bdpt:heuristic=power", seed, 1.07));
        add(run_lines("pool", "path", seed, 0.3));
    }
    return lines;
}

TEST(Verdicts, RunsThatABudgetCutToLessThanHalfAreNotJudgedWithTheOthers) {
    std::vector<Json> lines{scene_line("slit")};
    for (uint64_t seed = 1; seed <= 20; ++seed) {
        std::vector<Json> run = run_lines("slit", "path", seed);
        if (seed > 15) {
            Json end = run.back();
            run.resize(3);  // 1, 2, 4 samples
            end["iterations"] = 4, end["relmse"] = 0.25, end["cut"] = {{"given_seconds", 0.1}};
            run.push_back(end);
        }
        lines.insert(lines.end(), run.begin(), run.end());
    }
    const auto judged = judge_results(lines);
    ASSERT_TRUE(judged.ok()) << judged.status().message();
    const Judged& row = judged->front();
    EXPECT_EQ(row.cut, 5);
    EXPECT_EQ(row.left_out, 5);
    EXPECT_EQ(row.stability.seeds, 15);
    EXPECT_NEAR(row.stability.error.mean, 1.0 / 64, 1e-3);
    EXPECT_NE(verdict_table(*judged).find("64 samples, 5 cut"), std::string::npos);
    EXPECT_NE(verdict_table(*judged).find("without 5 run(s) that a budget cut"), std::string::npos);
}

TEST(Verdicts, OneRowForEachSceneAndAlgorithm) {
    const std::vector<Json> lines = results();
    const auto judged = judge_results(lines);
    ASSERT_TRUE(judged.ok()) << judged.status().message();
    ASSERT_EQ(judged->size(), 3u);
    const Judged &sound = (*judged)[0], &bright = (*judged)[1], &dark = (*judged)[2];
    EXPECT_EQ(sound.scene + sound.label, "slitpath");
    EXPECT_EQ(sound.budget, Json({{"samples", 64}}));
    EXPECT_EQ(sound.stability.seeds, 20);
    EXPECT_TRUE(sound.stability.sound()) << sound.stability.verdict;
    EXPECT_NEAR(sound.stability.slope->mean, -0.5, 0.01);
    EXPECT_EQ(bright.label, "bdpt:heuristic=power");
    EXPECT_TRUE(bright.stability.biased) << bright.stability.verdict;
    EXPECT_EQ(dark.scene, "pool");
    EXPECT_TRUE(dark.stability.finds_nothing) << dark.stability.verdict;

    const std::string table = verdict_table(*judged);
    EXPECT_EQ(std::count(table.begin(), table.end(), '\n'), 4);
    for (const char* words : {"SCENE", "VERDICT\n", "64 samples", "sound: error falls as n^-0.50, no bias seen (within ",
                              "% too bright in ", "finds almost nothing: 30 % of the light ["})
        EXPECT_NE(table.find(words), std::string::npos) << words << "\n" << table;

    const Json json = verdict_json(*judged);
    ASSERT_EQ(json.size(), 3u);
    EXPECT_EQ(json[0]["flags"], Json::array());
    EXPECT_EQ(json[1]["flags"], Json::array({"biased"}));
    EXPECT_EQ(json[2]["flags"], Json::array({"finds-nothing", "biased"}));
    EXPECT_EQ(json[0]["regions"].size(), 10u);
    EXPECT_EQ(json[0]["regions"][1]["name"], "the upper left");
    EXPECT_EQ(json[0]["tiny"]["iterations"], 1);
    EXPECT_EQ(json.dump().find("null"), std::string::npos) << json.dump();
    EXPECT_EQ(json[2]["verdict"], dark.stability.verdict);
}

/// Budgets are rows of their own; killed runs do not count, nor do the checkpoints that they left before they began again.
TEST(Verdicts, KilledRunsAreIgnored) {
    std::vector<Json> lines{scene_line("slit")};
    for (uint64_t seed = 1; seed <= 3; ++seed) {
        auto run = run_lines("slit", "path", seed);
        if (seed == 1) lines.insert(lines.end(), run.begin(), run.begin() + 3);
        if (seed == 2) run.pop_back();
        if (seed == 3) run.back()["budget"] = {{"seconds", 20}};
        lines.insert(lines.end(), run.begin(), run.end());
    }
    const auto judged = judge_results(lines);
    ASSERT_TRUE(judged.ok()) << judged.status().message();
    ASSERT_EQ(judged->size(), 2u);
    EXPECT_EQ((*judged)[0].stability.seeds, 1);
    EXPECT_EQ((*judged)[0].stability.rising, 0);
    EXPECT_EQ((*judged)[1].budget, Json({{"seconds", 20}}));
    EXPECT_TRUE(judge_results({})->empty());
}

TEST(Verdicts, LightOfChanceAndAReferenceWithoutVariance) {
    std::vector<Json> lines = results();
    for (Json& line : lines) {
        if (line["type"] == "scene") {
            line.erase("reference_relmse");
            if (line["scene"] == "slit")
                for (Json& region : line["reference_regions"]) region.erase("variance");
        }
        if (line.contains("mean_ratio")) line["mean_ratio"] = Json(HUGE_VAL);
        if (line["type"] == "run") line["mean_ratio"] = nullptr;
        if (line["type"] == "run") line["rare_light"] = {{"share", 0.8}, {"unreachable_share", 0.0}, {"expected_hits", 1e-3}};
    }
    const auto judged = judge_results(lines);
    ASSERT_TRUE(judged.ok()) << judged.status().message();
    EXPECT_EQ((*judged)[1].stability.flags(), std::vector<std::string>{"not-judged"});
    EXPECT_EQ((*judged)[1].stability.tiny.mean_ratio.count, 0);
    EXPECT_TRUE((*judged)[2].stability.misses_light);
    EXPECT_FALSE((*judged)[2].stability.biased);
}

TEST(Verdicts, NameTheLineAndTheFieldThatIsWrong) {
    const std::vector<Json> good = results();
    const auto refused = [&](size_t line, const std::function<void(Json&)>& damage, const std::string& words) {
        std::vector<Json> lines = good;
        damage(lines[line]);
        const auto judged = judge_results(lines);
        ASSERT_FALSE(judged.ok()) << words;
        EXPECT_EQ(judged.status().code(), StatusCode::kInvalidArgument);
        EXPECT_NE(judged.status().message().find(words), std::string::npos) << judged.status().message();
        EXPECT_EQ(judged.status().message().find('\n'), std::string::npos);
    };
    refused(
        0, [](Json& l) { l.erase("type"); }, "line 1 of the results: \"type\" is missing");
    refused(
        0, [](Json& l) { l = 3; }, "line 1 of the results: not an object");
    refused(
        1, [](Json& l) { l.erase("reference_regions"); }, "line 2 of the results: \"reference_regions\" is missing");
    refused(
        1, [](Json& l) { l["reference_regions"][4] = 1; }, "not a list of objects");
    refused(
        1, [](Json& l) { l["reference_regions"].erase(9); }, "scene \"slit\", path: stability: seed 1: has 10 region means");
    refused(
        1, [](Json& l) { l["scene"] = "other"; }, "scene \"slit\", path: there is no line of type \"scene\"");
    for (const char* name : {"run", "iterations", "relmse", "relmse_trimmed"})
        refused(
            3, [&](Json& l) { l.erase(name); }, "line 4 of the results: \"" + std::string(name) + "\" is missing");
    for (const char* name : {"seed", "scene", "label", "budget", "region_means", "fireflies"})
        refused(
            10, [&](Json& l) { l.erase(name); }, "line 11 of the results: \"" + std::string(name) + "\" is missing");
    refused(
        10, [](Json& l) { l["seed"] = -1; }, "\"seed\" is not a count");
    refused(
        10, [](Json& l) { l["relmse"] = "small"; }, "\"relmse\" is not a number");
    refused(
        10, [](Json& l) { l["budget"] = 64; }, "\"budget\" is not an object");
    refused(
        10, [](Json& l) { l["fireflies"].erase("energy"); }, "\"energy\" is missing");
    refused(
        10, [](Json& l) { l["rare_light"] = Json::object(); }, "\"share\" is missing");
    refused(
        10, [](Json& l) { l["seed"] = 2; }, "seed 2: occurs twice");
}

}  // namespace
}  // namespace lightloom::client
