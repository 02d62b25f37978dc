// bench, reference and compare as a user runs them.

#include <gtest/gtest.h>

#include <algorithm>
#include <fstream>
#include <nlohmann/json.hpp>
#include <set>

#include "common/core/atomic_file.h"
#include "tests/service/fake.h"
#include "tests/service/process.h"

namespace lightloom {
namespace {

using testing::Process;
using testing::TempDirectory;
using Json = nlohmann::json;

const std::string kScene = std::string(LIGHTLOOM_SOURCE_DIR) + "/tests/scenes/cornell.pbrt";

class Bench : public ::testing::Test {
  protected:
    std::string path(const std::string& name) const { return (directory_.path / name).string(); }
    /// Runs the client; what it printed is left in output().
    int run(const std::vector<std::string>& arguments) {
        std::filesystem::remove(path("log"));
        return Process("lightloom", arguments, path("log")).wait();
    }
    std::string output() const { return *read_file(path("log")); }
    void make_reference() {
        ASSERT_EQ(run({"reference", kScene, "-o", path("ref.exr"), "--algorithm", "bdpt", "--spp", "48", "--resolution", "32x32",
                       "--threads", "2", "-q"}),
                  0)
            << output();
    }
    std::vector<Json> lines(const std::string& name) const {
        std::vector<Json> result;
        std::ifstream file(path(name));
        for (std::string line; std::getline(file, line);) result.push_back(Json::parse(line));
        return result;
    }

  private:
    TempDirectory directory_;
};

TEST_F(Bench, AReferenceIsTheRenderWithAsManySamples) {
    make_reference();
    ASSERT_EQ(
        run({"render", kScene, "-o", path("render.exr"), "--algorithm", "bdpt", "--spp", "48", "--resolution", "32x32", "-q"}), 0)
        << output();
    EXPECT_EQ(*digest_file(path("ref.exr")), *digest_file(path("render.exr")));
    const Json json = Json::parse(*read_file(path("ref.json")));
    EXPECT_EQ(json["sha256"], digest_file(path("ref.exr"))->hex());
    EXPECT_EQ(json["algorithm"], "bdpt");
    EXPECT_EQ(json["samples_per_pixel"], 48);
    EXPECT_GT(json["mean_y_se"].get<double>(), 0);

    EXPECT_EQ(run({"compare", path("render.exr"), path("ref.exr"), "--json", path("compare.json")}), 0);
    EXPECT_NE(output().find("warning: both images were made by algorithm \"bdpt\""), std::string::npos) << output();
    EXPECT_EQ(Json::parse(*read_file(path("compare.json")))["warnings"].size(), 1u);
}

TEST_F(Bench, ACrossCheckIsStoredBesideTheReference) {
    const std::vector<std::string> arguments{"reference",    kScene, "-o",           path("ref.exr"), "--algorithm", "bdpt",
                                             "--spp",        "32",   "--resolution", "24x24",         "--max-depth", "3",
                                             "--cross-time", "0.3"};
    std::vector<std::string> agree = arguments, same = arguments;
    agree.insert(agree.end(), {"--cross-check", "path:rr-start=6"});
    ASSERT_EQ(run(agree), 0) << output();
    const Json check = Json::parse(*read_file(path("ref.json")))["cross_check"];
    EXPECT_EQ(check["algorithm"], "path");
    EXPECT_GE(check["rows"].size(), 12u);
    EXPECT_NE(output().find("length 2"), std::string::npos) << output();
    same.insert(same.end(), {"--cross-check", "bdpt:heuristic=power"});
    EXPECT_EQ(run(same), 2) << output();
}

TEST_F(Bench, RunsAreLoggedAndResumed) {
    make_reference();
    const std::vector<std::string> arguments{"bench",        kScene,
                                             "--reference",  path("ref.exr"),
                                             "--algorithms", "path,bdpt:heuristic=power",
                                             "--seeds",      "2",
                                             "--time",       "0.15",
                                             "--slice",      "0.05",
                                             "--threads",    "2",
                                             "--threshold",  "20",
                                             "--out",        path("runs.jsonl")};
    ASSERT_EQ(run(arguments), 0) << output();
    EXPECT_NE(output().find("bdpt:heuristic=power"), std::string::npos) << output();
    EXPECT_NE(output().find("warning"), std::string::npos) << "the reference is bdpt's: " << output();
    const std::vector<Json> first = lines("runs.jsonl");
    std::map<std::string, std::vector<Json>> runs;
    for (const Json& line : first) {
        if (line.contains("run")) runs[line["run"]].push_back(line);
    }
    EXPECT_EQ(first[0]["type"], "start");
    EXPECT_EQ(first[0]["format"], "lightloom-bench 2");
    EXPECT_EQ(first[1]["type"], "scene");
    EXPECT_EQ(first[1]["reference_regions"].size(), 10u);
    EXPECT_GT(first[1]["reference_regions"][0]["variance"].get<double>(), 0);
    ASSERT_EQ(runs.size(), 4u);
    for (const auto& [key, run] : runs) {
        ASSERT_GE(run.size(), 3u);
        for (size_t i = 0; i + 1 < run.size(); ++i) {
            EXPECT_EQ(run[i]["type"], "checkpoint");
            EXPECT_EQ(run[i]["width"], 32);
            EXPECT_EQ(run[i]["scene_digest"].get<std::string>().size(), 64u);
            EXPECT_GT(run[i]["rays"].get<uint64_t>(), 0u);
            if (i == 0) continue;
            EXPECT_GT(run[i]["seconds"].get<double>(), run[i - 1]["seconds"].get<double>());
        }
        EXPECT_EQ(run.back()["type"], "run");
        EXPECT_EQ(run.back()["region_means"].size(), 10u);
        EXPECT_TRUE(run.back().contains("reached") || run.back()["capped"].get<bool>());
        EXPECT_EQ(run.back()["iterations"], run[run.size() - 2]["iterations"]);
    }
    // Interleaved: the first run had not ended when the last one of the same seed began.
    std::set<std::string> begun;
    for (size_t i = 0; first[i]["type"] != "run"; ++i) {
        if (first[i]["type"] == "checkpoint") begun.insert(first[i]["run"]);
    }
    EXPECT_EQ(begun.size(), 2u);

    EXPECT_EQ(run(arguments), 2) << "an existing file is not overwritten";
    std::vector<std::string> resume = arguments;
    resume.push_back("--resume");
    const std::string whole = *read_file(path("runs.jsonl"));
    ASSERT_EQ(run(resume), 0) << output();
    EXPECT_EQ(*read_file(path("runs.jsonl")), whole) << "nothing was left to do";
    EXPECT_TRUE(std::filesystem::exists(path("runs.images/cornell-reference.exr")));

    // Killed while it wrote the last line: that run starts again, the others stay.
    const std::string last_run = first.back()["run"];
    std::ofstream(path("runs.jsonl"), std::ios::trunc) << whole.substr(0, whole.size() - 20);
    ASSERT_EQ(run(resume), 0) << output();
    EXPECT_NE(output().find("3 run(s) are in"), std::string::npos) << output();
    size_t done = 0, checkpoints_of_one = 0;
    for (const Json& line : lines("runs.jsonl")) {
        done += line["type"] == "run";
        checkpoints_of_one += line["type"] == "checkpoint" && line["run"] == last_run && line["iterations"] == 1;
    }
    EXPECT_EQ(done, 4u);
    EXPECT_EQ(checkpoints_of_one, 1u) << "lines of the torn run are gone";
}

TEST_F(Bench, TablesOfTheCacheCostWhatMakingThemTook) {
    const std::string tables = path("tables");
    const std::vector<std::string> job{kScene, "--resolution", "24x18", "--max-depth", "4", "--threads", "2", "-q"};
    const auto reference = [&](const std::string& name) {
        std::vector<std::string> arguments{"reference", "-o",    path(name + ".exr"),   "--spp",         "2",    "--algorithm",
                                           "spcbpt",    "--set", "training-paths=2000", "--table-cache", tables, "--seed",
                                           "1"};
        arguments.insert(arguments.end(), job.begin(), job.end());
        EXPECT_EQ(run(arguments), 0) << output();
        return Json::parse(*read_file(path(name + ".json")));
    };
    const Json first = reference("ref"), second = reference("again");
    EXPECT_EQ(first["tables"], "made");
    EXPECT_EQ(second["tables"], "cached");
    EXPECT_EQ(first["sha256"], second["sha256"]) << "they are the same tables";
    ASSERT_EQ(run({"reference", kScene, "-o", path("other.exr"), "-a", "path", "--spp", "8", "--resolution", "24x18", "--max-depth",
                   "4", "-q"}),
              0)
        << output();

    const auto bench = [&](const std::string& name, std::vector<std::string> more) {
        std::vector<std::string> arguments{
            "bench",   "--reference", path("other.exr"), "--algorithms", "path,spcbpt:training-paths=2000", "--spp", "2",
            "--seeds", "2",           "--out",           path(name)};
        arguments.insert(arguments.end(), job.begin(), job.end());
        arguments.insert(arguments.end(), more.begin(), more.end());
        EXPECT_EQ(run(arguments), 0) << output();
        std::map<std::string, Json> ends;
        for (const Json& line : lines(name))
            if (line["type"] == "run") ends[line["algorithm"].get<std::string>() + std::to_string(line["seed"].get<int>())] = line;
        return ends;
    };
    const auto count = [&] {
        return std::count_if(std::filesystem::directory_iterator(tables), {},
                             [](const auto& entry) { return entry.path().extension() == ".tables"; });
    };
    auto measured = bench("measured.jsonl", {});
    EXPECT_EQ(count(), 1) << "what bench measures it does not keep";
    EXPECT_EQ(output().find('*'), std::string::npos) << output();
    auto some = bench("some.jsonl", {"--table-cache", tables});
    EXPECT_EQ(count(), 2);
    EXPECT_NE(output().find("* as recorded"), std::string::npos) << output();
    EXPECT_FALSE(some["path1"].contains("tables"));
    for (const char* run : {"spcbpt1", "spcbpt2"}) {
        EXPECT_EQ(measured[run]["tables"], "made");
        EXPECT_GT(measured[run]["preparation_seconds"].get<double>(), 0);
        EXPECT_EQ(measured[run]["mape_percent"], some[run]["mape_percent"]);
    }
    EXPECT_EQ(some["spcbpt1"]["tables"], "cached") << "a rendering has made those of seed 1";
    EXPECT_EQ(some["spcbpt2"]["tables"], "made");
    const double made = first["preparation_seconds"].get<double>(), found = some["spcbpt1"]["preparation_seconds"].get<double>();
    EXPECT_GT(found, 0.5 * made) << "finding them is not free";
}

TEST_F(Bench, TwoDoNotWriteToOneFile) {
    make_reference();
    const std::vector<std::string> arguments{
        "bench", kScene,   "--reference", path("ref.exr"), "--algorithms", "path",  "--threads",        "1",       "--seeds",
        "1",     "--time", "60",          "--threshold",   "20",           "--out", path("runs.jsonl"), "--resume"};
    const Process first("lightloom", arguments, path("first.log"));
    const auto size = [&] {
        std::error_code none;
        const auto bytes = std::filesystem::file_size(path("runs.jsonl"), none);
        return none ? 0 : bytes;
    };
    ASSERT_TRUE(testing::wait_until(60, [&] { return size() > 0; })) << *read_file(path("first.log"));
    EXPECT_EQ(run(arguments), 1) << output();
    EXPECT_NE(output().find("runs.jsonl: another bench is writing to it"), std::string::npos) << output();
    const auto before = size();
    EXPECT_TRUE(testing::wait_until(60, [&] { return size() > before; })) << "the first goes on in the same file";
    first.signal(SIGKILL);
    ASSERT_TRUE(testing::wait_until(60, [&] { return first.ended(); }));
    std::vector<std::string> shorter = arguments;
    shorter[11] = "0.1";
    EXPECT_EQ(run(shorter), 0) << "a dead one holds nothing: " << output();
}

TEST_F(Bench, MistakesAreRefusedBeforeAnythingIsRendered) {
    make_reference();
    const auto bench = [&](std::vector<std::string> more) {
        std::vector<std::string> arguments{"bench", kScene, "--reference", path("ref.exr"), "--out", path("runs.jsonl")};
        arguments.insert(arguments.end(), more.begin(), more.end());
        return run(arguments);
    };
    EXPECT_EQ(bench({"--algorithms", "path"}), 2) << "neither --time nor --spp";
    EXPECT_EQ(bench({"--algorithms", "no-such", "--spp", "1"}), 2);
    EXPECT_EQ(bench({"--algorithms", "path,path:heuristic=balance", "--spp", "1"}), 2);
    EXPECT_EQ(bench({"--algorithms", "path", "--spp", "1", "--resolution", "16x16"}), 2);
    EXPECT_EQ(bench({"--algorithms", "path", "--spp", "1", "--max-depth", "1"}), 2);
    EXPECT_NE(output().find("--max-depth 8"), std::string::npos) << output();
    EXPECT_EQ(bench({"--algorithms", "path", "--spp", "1", "--seed", "0"}), 2) << "the reference's random numbers";
    EXPECT_NE(output().find("was rendered with seed 0"), std::string::npos) << output();
    EXPECT_FALSE(std::filesystem::exists(path("runs.jsonl")));
    EXPECT_EQ(bench({"--algorithms", "path", "--spp", "5", "--seeds", "1"}), 0) << output();
    EXPECT_EQ(lines("runs.jsonl").back()["iterations"], 5);
}

}  // namespace
}  // namespace lightloom
