// `replay --paths` and `render --pyramid` as a user runs them, for every algorithm of the catalog.

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <fstream>
#include <map>
#include <nlohmann/json.hpp>
#include <sstream>

#include "common/core/atomic_file.h"
#include "common/film/exr_io.h"
#include "common/transport/settings.h"
#include "common/work/asset.h"
#include "tests/service/process.h"
#include "tests/support/temp_directory.h"

namespace lightloom {
namespace {

namespace fs = std::filesystem;
using testing::Process;
using Json = nlohmann::json;

const std::string kScene = std::string(LIGHTLOOM_SOURCE_DIR) + "/tests/scenes/glass.pbrt";

class Look : public ::testing::Test {
  protected:
    std::string path(const std::string& name) const { return directory_.file(name); }

    struct Run {
        int exit_code;
        std::string output;
    };
    /// Of standard output and standard error together.
    Run run(const std::vector<std::string>& arguments) const {
        const std::string log = path("log" + std::to_string(runs_++));
        const int exit_code = Process("lightloom", arguments, log).wait();
        const auto output = read_file(log);
        return {exit_code, output.ok() ? *output : std::string()};
    }
    std::vector<std::string> job(const std::string& command, const std::string& algorithm,
                                 const std::vector<std::string>& more) const {
        std::vector<std::string> arguments{command,       kScene, "-a",     algorithm, "--resolution",  "20x16",
                                           "--max-depth", "4",    "--seed", "5",       "--table-cache", path("tables")};
        const auto settings = *AlgorithmSettings::parse(algorithm, {});
        for (const char* set : {"training-paths=2000", "cache=300"})
            if (settings.has(std::string(set).substr(0, std::string(set).find('='))))
                arguments.insert(arguments.end(), {"--set", set});
        arguments.insert(arguments.end(), more.begin(), more.end());
        return arguments;
    }
    static bool learns(const std::string& algorithm) { return AlgorithmSettings::parse(algorithm, {})->learning() != nullptr; }
    static bool shares(const std::string& algorithm) { return (*find_algorithm(algorithm))->shares_light_paths; }
    static std::vector<std::string> algorithms() {
        std::vector<std::string> names;
        for (const AlgorithmInfo* row : catalog()) names.emplace_back(row->name);
        return names;
    }

  private:
    testing::TempDirectory directory_;
    mutable int runs_ = 0;
};

/// The document that a run printed behind the lines of standard error.
Json document(const std::string& output) {
    const size_t begin = output.find('{');
    return begin == std::string::npos ? Json() : Json::parse(output.substr(begin), nullptr, false);
}

TEST_F(Look, PathsSumToTheSample) {
    for (const std::string& algorithm : algorithms()) {
        SCOPED_TRACE(algorithm);
        size_t contributions = 0;
        for (const std::string pixel : {"10,4", "3,12", "15,15"}) {
            const std::vector<std::string> sample{"--iteration", "3", "--pixel", pixel};
            auto arguments = job("replay", algorithm, sample);
            const Run plain = run(arguments);
            arguments.push_back("--paths");
            const Run text = run(arguments);
            arguments.push_back("--json");
            const Run json_run = run(arguments);
            for (const Run& r : {plain, text, json_run}) ASSERT_EQ(r.exit_code, 0) << r.output;
            const Json json = document(json_run.output);
            ASSERT_TRUE(json.is_object()) << json_run.output;
            EXPECT_EQ(json["camera"], json["sum"]);
            float sum[3] = {};
            for (const Json& found : json["paths"]) {
                for (int c = 0; c < 3; ++c) sum[c] += float(found["weighted"][size_t(c)].get<double>());
                EXPECT_NE(found["technique"], "lens");
                EXPECT_EQ(found["vertices"].size(), found["k"].get<size_t>() + 1);
                EXPECT_EQ(found["s"].get<int>() + found["t"].get<int>(),
                          found["k"].get<int>() + (found["technique"] == "hit" && found["k"] == found["t"] ? 0 : 1));
            }
            ASSERT_EQ(json["exposure_scale"].get<double>(), 1.0) << "the next line relies on it";
            for (size_t c = 0; c < 3; ++c) EXPECT_EQ(double(sum[c]), json["camera"][c].get<double>());
            contributions += json["paths"].size();
            // What is printed without --paths is the same sample.
            const size_t line = plain.output.find("camera ");
            ASSERT_NE(line, std::string::npos) << plain.output;
            EXPECT_NE(text.output.find(plain.output.substr(line, plain.output.find('\n', line) - line)), std::string::npos)
                << text.output;
            std::istringstream values(plain.output.substr(line + 7));
            for (size_t c = 0; c < 3; ++c) {
                double value = 0;
                values >> value;
                EXPECT_NEAR(value, json["camera"][c].get<double>(), 1e-8 * std::fabs(value));
            }
            // Splats are the sample's own but where light paths are the unit's.
            EXPECT_EQ(json["splats"].is_null(), shares(algorithm));
            if (shares(algorithm)) {
                arguments.push_back("--splats");
                const Json with_splats = document(run(arguments).output);
                EXPECT_EQ(with_splats["camera"], json["camera"]);
                ASSERT_TRUE(with_splats["splats"].is_array());
                for (const Json& splat : with_splats["splats"]) {
                    EXPECT_EQ(splat["technique"], "lens");
                    EXPECT_EQ(splat["pixel"], with_splats["pixel"]);
                }
            } else {
                std::map<std::pair<int, int>, double> splats;
                for (const Json& splat : json["splats"])
                    splats[{splat["pixel"][0].get<int>(), splat["pixel"][1].get<int>()}] += splat["weighted"][0].get<double>();
                size_t printed = 0;
                for (const auto& [place, red] : splats) {
                    if (red == 0) continue;
                    ++printed;
                    char expected[64];
                    std::snprintf(expected, sizeof expected, "splat at %d,%d  %.9g ", place.first, place.second, red);
                    EXPECT_NE(plain.output.find(expected), std::string::npos) << expected << plain.output;
                }
                EXPECT_EQ(plain.output.find("splat at") == std::string::npos, printed == 0);
            }
        }
        if (algorithm != "light") {
            EXPECT_GT(contributions, 0u);
        }
    }
}

TEST_F(Look, TablesAreSharedWithRender) {
    const std::string made = "makes the tables";
    for (const std::string& algorithm : algorithms()) {
        SCOPED_TRACE(algorithm);
        const Run first = run(job("replay", algorithm, {"--pixel", "2,2"})),
                  second = run(job("replay", algorithm, {"--pixel", "2,2"}));
        ASSERT_EQ(first.exit_code, 0) << first.output;
        EXPECT_EQ(first.output.find(made) != std::string::npos, learns(algorithm)) << first.output;
        EXPECT_EQ(second.output.find(made), std::string::npos) << second.output;
        const Run rendered = run(job("render", algorithm, {"-q", "--spp", "2", "-o", path(algorithm + ".exr")}));
        ASSERT_EQ(rendered.exit_code, 0) << rendered.output;
        if (!learns(algorithm)) continue;
        const Json manifest = Json::parse(*read_file(path(algorithm + ".manifest.json")));
        EXPECT_EQ(manifest["tables"]["from_cache"], true) << "replay has put them there";
        // And the other way round.
        fs::remove_all(path("tables"));
        ASSERT_EQ(run(job("render", algorithm, {"-q", "--spp", "2", "-o", path(algorithm + ".exr")})).exit_code, 0);
        const Run third = run(job("replay", algorithm, {"--pixel", "2,2"}));
        EXPECT_EQ(third.output.find(made), std::string::npos) << third.output;
        EXPECT_EQ(third.output, second.output);
        std::vector<std::string> without = job("replay", algorithm, {"--pixel", "2,2"});
        *std::find(without.begin(), without.end(), path("tables")) = "off";
        const Run off = run(without);
        EXPECT_EQ(off.exit_code, 0);
        EXPECT_NE(off.output.find(made), std::string::npos) << off.output;
        EXPECT_NE(off.output.find(second.output.substr(second.output.find("camera"))), std::string::npos) << "the same tables";
    }
}

TEST_F(Look, PyramidsSumToTheImage) {
    for (const std::string& algorithm : algorithms()) {
        SCOPED_TRACE(algorithm);
        const std::string place = path("pyramid-" + algorithm), image = path(algorithm + ".exr");
        const Run made =
            run(job("render", algorithm, {"--spp", "6", "--pyramid", place, "--pyramid-depth", "3", "--threads", "2"}));
        ASSERT_EQ(made.exit_code, 0) << made.output;
        ASSERT_EQ(run(job("render", algorithm, {"-q", "--spp", "6", "-o", image})).exit_code, 0);
        const auto rendered = read_exr(image), own = read_exr(place + "/image.exr");
        ASSERT_TRUE(rendered.ok() && own.ok());
        EXPECT_EQ(rendered->color.pixels, own->color.pixels);
        const Json json = Json::parse(*read_file(place + "/pyramid.json"));
        EXPECT_EQ(json["algorithm"], algorithm);
        EXPECT_EQ(json["samples_per_pixel"], 6);
        std::vector<double> sum(rendered->color.pixels.size());
        for (const Json& picture : json["pictures"]) {
            const auto exr = read_exr(place + "/weighted-" + picture["name"].get<std::string>() + ".exr");
            ASSERT_TRUE(exr.ok()) << exr.status().message();
            for (size_t i = 0; i < sum.size(); ++i) sum[i] += double(exr->color.pixels[i]);
        }
        for (size_t i = 0; i < sum.size(); ++i) {
            const double value = double(rendered->color.pixels[i]);
            EXPECT_NEAR(sum[i], value, 1e-5 * (0.01 + value));
        }
        EXPECT_NE(made.output.find("index.html"), std::string::npos);
        // The files do not depend on the number of threads, and a second pyramid replaces the first.
        const auto digest = [&](const std::string& name) { return digest_file(place + "/" + name)->hex(); };
        std::map<std::string, std::string> digests;
        for (const auto& entry : fs::directory_iterator(place))
            digests[entry.path().filename().string()] = digest(entry.path().filename().string());
        ASSERT_EQ(run(job("render", algorithm, {"-q", "--spp", "6", "--pyramid", place, "--pyramid-depth", "3", "--threads", "1"}))
                      .exit_code,
                  0);
        for (const auto& [name, before] : digests) EXPECT_EQ(digest(name), before) << name;
    }
}

TEST_F(Look, MistakesAreExplained) {
    const auto replay = [&](std::vector<std::string> more) { return run(job("replay", "bdpt", std::move(more))).exit_code; };
    EXPECT_EQ(replay({"--paths"}), 2);
    EXPECT_EQ(replay({"--unit", "0,0", "--paths"}), 2);
    EXPECT_EQ(replay({"--pixel", "1,1", "--json"}), 2) << "of what?";
    EXPECT_EQ(replay({"--pixel", "1,1", "--splats"}), 2);
    EXPECT_EQ(replay({"--pixel", "100,1", "--paths"}), 2) << "outside of the image";
    EXPECT_EQ(run({"replay", kScene, "-a", "no-such", "--pixel", "1,1", "--paths"}).exit_code, 2);
    EXPECT_EQ(run({"render", kScene, "-a", "no-such", "--pyramid", path("p")}).exit_code, 2);

    const auto render = [&](std::vector<std::string> more) {
        more.insert(more.begin(), {"--spp", "1"});
        return run(job("render", "bdpt", std::move(more)));
    };
    std::ofstream(path("file")) << "x";
    fs::create_directory(path("other"));
    std::ofstream(path("other/notes.txt")) << "mine";
    for (const std::string& place : {path("file"), path("file/below"), path("other"), std::string("/proc/no-such/pyramid")}) {
        const Run refused = render({"--pyramid", place});
        EXPECT_EQ(refused.exit_code, 2) << place;
        EXPECT_NE(refused.output.find(place), std::string::npos) << refused.output;
    }
    EXPECT_EQ(std::distance(fs::directory_iterator(path("other")), fs::directory_iterator()), 1);
    EXPECT_EQ(render({"--pyramid", ""}).exit_code, 2);
    EXPECT_EQ(render({"--pyramid-depth", "3"}).exit_code, 2) << "of what?";
    for (const char* depth : {"0", "-1", "65", "x"})
        EXPECT_EQ(render({"--pyramid", path("p"), "--pyramid-depth", depth}).exit_code, 2);
    for (const std::vector<std::string>& other : {std::vector<std::string>{"-o", path("x.exr")},
                                                  {"--png", path("x.png")},
                                                  {"--half"},
                                                  {"--layers"},
                                                  {"--json", path("x.json")},
                                                  {"--workers", "2"}}) {
        std::vector<std::string> arguments{"--pyramid", path("p")};
        arguments.insert(arguments.end(), other.begin(), other.end());
        EXPECT_EQ(render(arguments).exit_code, 2) << other[0];
    }
    EXPECT_FALSE(fs::exists(path("x.exr")));
}

/// A pool under a small lamp (rare_light_test has the figures): a job that has not found most of its light says so wherever its
/// results are read, in few words, and `-q` has none.
TEST_F(Look, AJobSaysWhatLightItMayHaveMissed) {
    const auto pool = [&](const std::vector<std::string>& more) {
        std::vector<std::string> arguments{"render",       LIGHTLOOM_SOURCE_DIR "/tests/scenes/pool.pbrt",
                                           "-a",           "bdpt",
                                           "--spp",        "2",
                                           "--resolution", "64x36",
                                           "-o",           path("pool.exr"),
                                           "--json",       path("pool.json")};
        arguments.insert(arguments.end(), more.begin(), more.end());
        const Run done = run(arguments);
        EXPECT_EQ(done.exit_code, 0) << done.output;
        return done.output;
    };
    EXPECT_NE(pool({}).find("only a chance hit of a lamp finds it"), std::string::npos);
    for (const char* file : {"pool.manifest.json", "pool.json"}) {
        const Json rare = Json::parse(*read_file(path(file)))["rare_light"];
        EXPECT_NEAR(rare["share"].get<double>(), 0.25, 0.1) << file;
        EXPECT_LT(rare["expected_hits"].get<double>(), 0.1) << file;
        EXPECT_GT(rare["mean_error"].get<double>(), 1) << file;
        EXPECT_EQ(rare["unreachable_share"].get<double>(), 0) << file;
    }
    EXPECT_EQ(pool({"-q"}).find("chance"), std::string::npos);
    // Glass in a room whose lamp is large needs no word.
    EXPECT_EQ(run({"render", kScene, "--spp", "2", "-o", path("glass.exr")}).output.find("chance"), std::string::npos);
}

}  // namespace
}  // namespace lightloom
