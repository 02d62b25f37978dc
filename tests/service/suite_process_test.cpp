// A suite as a user runs it: killed at any moment and gone on with, within a budget, here and on a service.

#include <gtest/gtest.h>

#include <cmath>
#include <cstdlib>
#include <fstream>
#include <nlohmann/json.hpp>
#include <set>

#include "common/core/atomic_file.h"
#include "tests/service/fake.h"
#include "tests/service/process.h"
#include "tests/service/service_process.h"

namespace lightloom {
namespace {

using testing::Process;
using testing::TempDirectory;
using Json = nlohmann::json;

class SuiteProcess : public ::testing::Test {
  protected:
    std::string path(const std::string& name) const { return (directory_.path / name).string(); }
    int run(const std::vector<std::string>& arguments) {
        std::filesystem::remove(path("log"));
        return Process("lightloom", arguments, path("log")).wait();
    }
    std::string output() const { return *read_file(path("log")); }
    /// Two scenes, two algorithms, three seeds: twelve runs.
    void write_suite(const std::string& budgets, const std::string& more = "") {
        const std::string scenes = std::string(LIGHTLOOM_SOURCE_DIR) + "/tests/scenes/";
        std::ofstream(path("suite.json"))
            << R"({"suite": "kill", "resolution": "24x18", "seeds": 3, "share_iterations": 1, "budgets": )" << budgets
            << R"(, "algorithms": ["path", "spcbpt:training-paths=1000:cache=500:light-subspaces=40:eye-subspaces=40"], "tables": "shared",
                   "reference": {"algorithm": "bdpt", "samples": 64}, "scenes": [{"file": ")"
            << scenes << R"(cornell.pbrt")" << more << R"(}, {"file": ")" << scenes
            << R"(ceiling-lamp.pbrt"}, {"file": "not-there.pbrt", "optional": true}]})";
    }
    std::vector<Json> lines(const std::string& name) const {
        std::vector<Json> result;
        std::ifstream file(path(name));
        for (std::string line; std::getline(file, line);) {
            Json json = Json::parse(line, nullptr, false);
            if (!json.is_discarded()) result.push_back(std::move(json));  // a kill may have torn the last one
        }
        return result;
    }
    size_t count(const std::string& name, const std::string& type) const {
        const std::vector<Json> all = lines(name);
        return size_t(std::count_if(all.begin(), all.end(), [&](const Json& line) { return line["type"] == type; }));
    }

  private:
    TempDirectory directory_;
};

TEST_F(SuiteProcess, SurvivesKillsAtAnyMoment) {
    write_suite(R"({"seconds": 0.2})");
    const std::vector<std::string> arguments{"bench", path("suite.json"), "-o", path("r.jsonl"), "-t", "1", "--resume"};
    for (const size_t runs : {2u, 7u}) {
        const Process process("lightloom", arguments, path("log"));
        ASSERT_TRUE(testing::wait_until(60, [&] { return count("r.jsonl", "run") >= runs; })) << output();
        process.signal(SIGKILL);
        ASSERT_TRUE(testing::wait_until(60, [&] { return process.ended(); }));
    }
    ASSERT_EQ(run(arguments), 0) << output();
    std::set<std::string> runs;
    double before = 0;
    for (const Json& line : lines("r.jsonl")) {
        if (line["type"] == "run") {
            EXPECT_TRUE(runs.insert(line["run"]).second) << "measured twice";
            EXPECT_EQ(line["budget"], Json({{"seconds", 0.2}}));
            EXPECT_FALSE(line.contains("cut"));
        }
        if (!line.contains("suite_seconds")) continue;
        EXPECT_GE(line["suite_seconds"].get<double>(), before) << "time goes on over all processes";
        before = line["suite_seconds"];
    }
    EXPECT_EQ(runs.size(), 12u);
    EXPECT_EQ(count("r.jsonl", "start"), 3u);
    EXPECT_EQ(count("r.jsonl", "techniques"), 4u) << "of each scene and algorithm, once";
    EXPECT_NE(output().find("skipped: not-there"), std::string::npos) << output();
    for (const Json& line : lines("r.jsonl")) {
        if (line["type"] != "run" || line["seed"] != 1) continue;
        EXPECT_TRUE(std::filesystem::exists(path("r.images/" + line["image"].get<std::string>()))) << line;
    }
    // Nothing is left to do, and the file stays as it is.
    const std::string whole = *read_file(path("r.jsonl"));
    ASSERT_EQ(run(arguments), 0) << output();
    EXPECT_EQ(*read_file(path("r.jsonl")), whole);
}

TEST_F(SuiteProcess, KeepsToItsBudgetAndSaysWhatItCut) {
    write_suite(R"({"seconds": 30})");
    std::vector<std::string> arguments{"bench", path("suite.json"), "-o", path("r.jsonl"), "-t", "1", "--budget", "6s"};
    const auto begin = std::chrono::steady_clock::now();
    ASSERT_EQ(run(arguments), 0) << output();
    // Loading, references and shares of techniques are in it; a loaded machine may take a little longer.
    EXPECT_LT(std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count(), 12);
    EXPECT_EQ(count("r.jsonl", "run"), 12u);
    EXPECT_GE(count("r.jsonl", "cut"), 2u);
    EXPECT_NE(output().find("cut by --budget: cornell: time of each run 30 ->"), std::string::npos) << output();
    for (const Json& line : lines("r.jsonl")) {
        if (line["type"] != "run") continue;
        EXPECT_TRUE(line.contains("cut")) << line;
    }
    // A budget that is used up leaves nothing to measure again, and another suite's results are not mixed in.
    arguments.push_back("--resume");
    ASSERT_EQ(run(arguments), 0) << output();
    EXPECT_EQ(count("r.jsonl", "run"), 12u);
    std::vector<std::string> two_threads = arguments;
    two_threads[5] = "2";
    EXPECT_EQ(run(two_threads), 1) << output();
    EXPECT_NE(output().find("holds path seed 1 with another threads"), std::string::npos) << output();
    std::string other = *read_file(path("suite.json"));
    other.replace(other.find("kill"), 4, "else");
    std::ofstream(path("suite.json"), std::ios::trunc) << other;
    EXPECT_EQ(run(arguments), 1) << output();
    EXPECT_NE(output().find("holds results of the suite kill"), std::string::npos) << output();
}

TEST_F(SuiteProcess, EndsWhereTheBudgetIsGoneBeforeAReferenceIsMade) {
    write_suite(R"({"seconds": 1})");
    std::string suite = *read_file(path("suite.json"));
    suite.replace(suite.find("\"samples\": 64"), 13, "\"seconds\": 900");
    std::ofstream(path("suite.json"), std::ios::trunc) << suite;
    const std::vector<std::string> arguments{"bench", path("suite.json"), "-o", path("r.jsonl"), "-t", "1", "--budget", "1s"};
    ASSERT_EQ(run(arguments), 0) << output();
    EXPECT_GE(count("r.jsonl", "run"), 6u) << "path needs no time to learn";
    EXPECT_NE(output().find("ceiling-lamp: time of the reference 900 -> 0.2"), std::string::npos) << output();
}

TEST_F(SuiteProcess, LearningIsWithinTheBudgetOrTheRunIsLeftOut) {
    write_suite(R"({"seconds": 30})");
    std::string suite = *read_file(path("suite.json"));
    suite.replace(suite.find("training-paths=1000:"), 20, "training-paths=4000000:");
    suite.replace(suite.find("\"tables\": \"shared\""), 18, "\"tables\": \"made\"");
    std::ofstream(path("suite.json"), std::ios::trunc) << suite;
    const auto begin = std::chrono::steady_clock::now();
    ASSERT_EQ(run({"bench", path("suite.json"), "-o", path("r.jsonl"), "-t", "1", "--budget", "4s"}), 0) << output();
    EXPECT_LT(std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count(), 12);
    EXPECT_EQ(count("r.jsonl", "run"), 6u) << "path alone";
    EXPECT_NE(
        output().find("spcbpt:training-paths=4000000:cache=500:light-subspaces=40:eye-subspaces=40 is not measured: it does not "
                      "learn its tables within"),
        std::string::npos)
        << output();
    for (const Json& line : lines("r.jsonl")) {
        if (line["type"] != "run") continue;
        EXPECT_GT(line["iterations"].get<int>(), 5) << "learning took what was path's: " << line;
    }
}

TEST_F(SuiteProcess, WhatABudgetCutIsMeasuredInFullAndKeptUntilThen) {
    write_suite(R"({"samples": 2000})");
    std::string suite = *read_file(path("suite.json"));
    suite.replace(suite.find("\"samples\": 64"), 13, "\"seconds\": 1.5");
    std::ofstream(path("suite.json"), std::ios::trunc) << suite;
    std::vector<std::string> arguments{"bench", path("suite.json"), "-o", path("r.jsonl"), "-t", "1", "--budget", "5s"};
    ASSERT_EQ(run(arguments), 0) << output();
    const size_t measured = count("r.jsonl", "run");
    ASSERT_GE(measured, 6u) << "a slow machine may not learn in time";
    EXPECT_NE(output().find("cut by --budget: cornell: samples of each run 2000 ->"), std::string::npos) << output();
    EXPECT_NE(output().find("time of the reference 1.5 ->"), std::string::npos) << output();

    // Interrupted before anything is measured again: nothing is lost.
    arguments = {"bench", path("suite.json"), "-o", path("r.jsonl"), "-t", "1", "--resume"};
    {
        const Process process("lightloom", arguments, path("log"));
        std::this_thread::sleep_for(std::chrono::milliseconds(500));
        process.signal(SIGKILL);
        ASSERT_TRUE(testing::wait_until(60, [&] { return process.ended(); }));
    }
    EXPECT_EQ(count("r.jsonl", "run"), measured);
    // The samples that were asked for are many: fewer do for the rest of the test, as other runs.
    std::string fewer = *read_file(path("suite.json"));
    fewer.replace(fewer.find("2000"), 4, "20");
    std::ofstream(path("suite.json"), std::ios::trunc) << fewer;
    arguments = {"bench", path("suite.json"), "-o", path("s.jsonl"), "-t",
                 "1",     "--budget",         "1s", "--references",  path("r.references")};
    ASSERT_EQ(run(arguments), 0) << output();
    arguments = {"bench", path("suite.json"), "-o", path("s.jsonl"), "-t", "1", "--resume", "--references", path("r.references")};
    ASSERT_EQ(run(arguments), 0) << output();
    std::set<std::string> runs;
    for (const Json& line : lines("s.jsonl")) {
        EXPECT_NE(line["type"], "cut") << "nothing is cut any more";
        if (line["type"] != "run") continue;
        EXPECT_TRUE(runs.insert(line["scene"].get<std::string>() + line["label"].get<std::string>() + line["seed"].dump()).second);
        EXPECT_EQ(line["iterations"], 20);
        EXPECT_FALSE(line.contains("cut"));
    }
    EXPECT_EQ(runs.size(), 12u);
    EXPECT_EQ(output().find("-cut.exr"), std::string::npos) << output();
}

TEST_F(SuiteProcess, ExpectationsDecideTheExitCode) {
    write_suite(R"({"samples": 8})", R"(, "expect": [{"error": "path", "at_most": 100}])");
    ASSERT_EQ(run({"bench", path("suite.json"), "-o", path("a.jsonl"), "-q"}), 0) << output();
    EXPECT_NE(output().find("holds: cornell: relMSE of path is at most 100"), std::string::npos) << output();
    write_suite(R"({"samples": 8})", R"(, "expect": [{"error": "path", "at_least": 100}])");
    EXPECT_EQ(run({"bench", path("suite.json"), "-o", path("b.jsonl"), "-q"}), 1) << output();
    EXPECT_NE(output().find("FAILS: cornell"), std::string::npos) << output();
    // Equal samples give equal errors, whoever renders them.
    const testing::Service service;
    const auto worker = service.worker("worker", 1);
    ASSERT_EQ(run({"bench", path("suite.json"), "-o", path("s.jsonl"), "--server", service.address(), "--references",
                   path("b.references")}),
              1)
        << output();
    std::map<std::string, double> here, there;
    for (const Json& line : lines("b.jsonl"))
        if (line["type"] == "run" && line["algorithm"] == "path")
            here[line["scene"].get<std::string>() + line["seed"].dump()] = line["relmse"];
    for (const Json& line : lines("s.jsonl"))
        if (line["type"] == "run" && line["algorithm"] == "path")
            there[line["scene"].get<std::string>() + line["seed"].dump()] = line["relmse"];
    EXPECT_EQ(here, there);
    EXPECT_EQ(here.size(), 6u);
}

TEST_F(SuiteProcess, StabilityGivesVerdicts) {
    write_suite(R"({"samples": 8})", R"(, "expect": [{"verdict": "path", "is_not": "biased"}])");
    ASSERT_EQ(run({"bench", "--stability", path("suite.json"), "-o", path("r.jsonl"), "-q"}), 0) << output();
    EXPECT_EQ(count("r.jsonl", "run"), 80u) << "20 seeds";
    EXPECT_NE(output().find("VERDICT"), std::string::npos) << output();
    EXPECT_NE(output().find("holds: cornell: verdict of path is not \"biased\""), std::string::npos) << output();
}

TEST_F(SuiteProcess, ResultsBecomeOnePage) {
    write_suite(R"({"samples": 4})");
    ASSERT_EQ(run({"bench", path("suite.json"), "-o", path("r.jsonl"), "-q"}), 0) << output();
    const std::string old_path = std::getenv("PATH");
    ::setenv("PATH", "/no/such/folder", 1);
    EXPECT_EQ(run({"report", path("r.jsonl"), "-o", path("r.html")}), 2) << output();
    ::setenv("PATH", old_path.c_str(), 1);
    EXPECT_NE(output().find("gnuplot"), std::string::npos) << output();
    EXPECT_EQ(std::ranges::count(output(), '\n'), 1) << output();
    EXPECT_FALSE(std::filesystem::exists(path("r.html")));
    if (run({"report", path("r.jsonl"), "-o", path("r.html"), "--svg", path("charts")}) != 0) {
        ASSERT_NE(output().find("gnuplot"), std::string::npos) << output();
        GTEST_SKIP() << output();
    }
    EXPECT_NE(read_file(path("r.html"))->find("<svg"), std::string::npos);
    EXPECT_TRUE(std::filesystem::exists(path("charts/cornell-error-time.svg")));
    // Half a line in the middle is an error, at the end it is what a kill left.
    std::ofstream(path("r.jsonl"), std::ios::app) << "{\"type\":\"che";
    EXPECT_EQ(run({"report", path("r.jsonl"), "-o", path("torn.html")}), 0) << output();
    std::ofstream(path("r.jsonl"), std::ios::app) << "\n{\"type\":\"start\"}\n";
    EXPECT_EQ(run({"report", path("r.jsonl"), "-o", path("bad.html")}), 2) << output();
    EXPECT_NE(output().find("r.jsonl:"), std::string::npos) << output();
    EXPECT_FALSE(std::filesystem::exists(path("bad.html")));
}

TEST_F(SuiteProcess, BadInputIsOneClearLine) {
    const auto refused = [&](const std::string& says, const std::vector<std::string>& more = {}) {
        std::vector<std::string> arguments{"bench", path("suite.json"), "-o", path("r.jsonl")};
        arguments.insert(arguments.end(), more.begin(), more.end());
        EXPECT_NE(run(arguments), 0) << says;
        EXPECT_NE(output().find(says), std::string::npos) << output();
        EXPECT_EQ(std::ranges::count(output(), '\n'), 1) << output();
        EXPECT_FALSE(std::filesystem::exists(path("r.jsonl"))) << says;
    };
    refused("suite.json");
    write_suite(R"({"seconds": 1})", R"(, "reference": "none.exr")");
    refused("none.exr: no such file");
    write_suite(R"({"seconds": 1})", R"(, "reference": "small.exr")");
    ASSERT_EQ(run({"reference", std::string(LIGHTLOOM_SOURCE_DIR) + "/tests/scenes/cornell.pbrt", "--resolution", "16x12", "--spp",
                   "4", "-o", path("small.exr"), "-q"}),
              0);
    refused("small.exr");  // the suite asks for 24 x 18
    write_suite(R"({"seconds": 1})");
    refused("--algorithms is for a single scene", {"--algorithms", "path"});
    refused("is no time such as 90s", {"--budget", "soon"});
    std::string missing = *read_file(path("suite.json"));
    missing.replace(missing.find(", \"optional\": true"), 18, "");
    std::ofstream(path("suite.json"), std::ios::trunc) << missing;
    refused("not-there.pbrt: no such file");
}

}  // namespace
}  // namespace lightloom
