// The command line as its users meet it: what is said of mistakes, what the options that all commands share do, and what the
// catalog says of itself.

#include <gtest/gtest.h>

#include <algorithm>
#include <fstream>
#include <nlohmann/json.hpp>
#include <sstream>

#include "common/core/atomic_file.h"
#include "common/film/exr_io.h"
#include "common/transport/settings.h"
#include "common/work/asset.h"
#include "tests/service/fake.h"
#include "tests/service/process.h"

namespace lightloom {
namespace {

using testing::Process;
using testing::TempDirectory;
using Json = nlohmann::json;

const std::string kScene = std::string(LIGHTLOOM_SOURCE_DIR) + "/tests/scenes/furnace-sphere.pbrt";

size_t count(const std::string& text, const std::string& part) {
    size_t n = 0;
    for (size_t at = text.find(part); at != std::string::npos; at = text.find(part, at + 1)) ++n;
    return n;
}

class CommandLine : public ::testing::Test {
  protected:
    struct Run {
        int exit_code;
        std::string output;  ///< Standard output and standard error.
    };
    Run run(const std::vector<std::string>& arguments, const std::string& program = "lightloom") const {
        std::filesystem::remove(path("log"));
        const int exit_code = Process(program, arguments, path("log")).wait();
        const auto output = read_file(path("log"));
        return {exit_code, output.ok() ? *output : std::string()};
    }
    std::string path(const std::string& name) const { return (directory_.path / name).string(); }
    /// A small and quick rendering.
    std::vector<std::string> job(const std::string& command, std::vector<std::string> more) const {
        std::vector<std::string> arguments{command, kScene, "-a", "path", "--resolution", "24x16"};
        arguments.insert(arguments.end(), more.begin(), more.end());
        return arguments;
    }

  private:
    TempDirectory directory_;
};

TEST_F(CommandLine, MistakesAreOneLineThatSuggestsWhatIsNear) {
    const std::string no_command = "lightloom: there is no command ", no_option = "lightloom: there is no option ";
    const std::vector<std::pair<std::vector<std::string>, std::string>> mistakes{
        {{"rendr"}, no_command + "'rendr' (did you mean 'render'?); `lightloom --help` lists them"},
        {{"rendr", "room.pbrt", "--spp", "4"}, no_command + "'rendr' (did you mean 'render'?); `lightloom --help` lists them"},
        {{"rendr", "--help"}, no_command + "'rendr' (did you mean 'render'?); `lightloom --help` lists them"},
        {{"Compare"}, no_command + "'Compare' (did you mean 'compare'?); `lightloom --help` lists them"},
        {{"frobnicate"}, no_command + "'frobnicate'; `lightloom --help` lists them"},
        {{}, "lightloom: a command is missing; `lightloom --help` lists them"},
        {{"--lgo", "info", "algorithms"}, no_option + "'--lgo' (did you mean '--log'?)"},
        {{"--lgo", "info"}, no_option + "'--lgo' (did you mean '--log'?); `lightloom --help` lists them"},
        {{"render", kScene, "--ssp", "4"}, no_option + "'--ssp' (did you mean '--spp'?); `lightloom render --help` lists them"},
        {{"render", "--resolutoin=8x8"}, no_option + "'--resolutoin' (did you mean '--resolution'?); `lightloom render --help`"},
        {{"list", "--sever", "host:1"}, no_option + "'--sever' (did you mean '--server'?); `lightloom list --help` lists them"},
        {{"list", "more"}, "lightloom: 'more' was not expected; see `lightloom list --help`"},
        {{"render"}, "lightloom: SCENE is required; see `lightloom render --help`"},
        {{"render", kScene, "--spp", "x"}, "lightloom: --spp: \"x\" is no whole number from 1 to 16777216; see"},
        {{"render", kScene, "-a", "bpdt"}, "lightloom: no algorithm named 'bpdt' (did you mean 'bdpt'?); choose one of: path, "},
        {{"render", kScene, "-a", "bdpt", "--set", "heuristics=power"},
         "lightloom: algorithm 'bdpt' has no parameter 'heuristics' (did you mean 'heuristic'?)"},
        {{"render", kScene, "-a", "bdpt", "--set", "heuristic=powr"},
         "lightloom: parameter heuristic=powr of 'bdpt' must be balance, power, maximum, popov or correlation-aware (did you mean "
         "'power'?)"},
        {{"algorithms", "spcbt"}, "lightloom: no algorithm named 'spcbt' (did you mean 'spcbpt'?); choose one of: path, "},
        {{"inspect", path("none.pbrt")}, "lightloom: "},
        {{"compare", path("none.exr"), path("none.exr")}, "lightloom: "},
    };
    for (const auto& [arguments, message] : mistakes) {
        const Run r = run(arguments);
        EXPECT_EQ(r.exit_code, 2) << message;
        EXPECT_TRUE(r.output.starts_with(message)) << r.output;
        EXPECT_EQ(std::count(r.output.begin(), r.output.end(), '\n'), 1) << r.output;
    }
}

TEST_F(CommandLine, EveryProgramNamesItselfAndItsVersion) {
    std::string build;
    for (const std::string program : {"lightloom", "lightloom-server", "lightloom-worker"}) {
        const Run version = run({"--version"}, program);
        EXPECT_EQ(version.exit_code, 0);
        ASSERT_TRUE(version.output.starts_with(program + " ")) << version.output;
        const std::string own = version.output.substr(program.size() + 1);
        EXPECT_EQ(std::count(own.begin(), own.end(), '\n'), 1) << own;
        if (build.empty()) build = own;
        EXPECT_EQ(own, build) << "one build has one id";
        for (const std::vector<std::string>& mistake : {std::vector<std::string>{"--no-such"}, {"--log", "loud"}}) {
            const Run r = run(mistake, program);
            EXPECT_EQ(r.exit_code, 2);
            EXPECT_TRUE(r.output.starts_with(program + ": ")) << r.output;
            EXPECT_EQ(std::count(r.output.begin(), r.output.end(), '\n'), 1) << r.output;
        }
    }
    // What ends a program that has begun to log.
    std::ofstream(path("file")) << "x";
    const Run server = run({"--data", path("file/below"), "--listen", "127.0.0.1:0", "--status", "off"}, "lightloom-server");
    EXPECT_EQ(server.exit_code, 1);
    EXPECT_TRUE(server.output.starts_with("lightloom-server: " + path("file/below"))) << server.output;
    const Run open = run({"--listen", "0.0.0.0:0"}, "lightloom-server");
    EXPECT_EQ(open.exit_code, 2);
    EXPECT_TRUE(open.output.starts_with("lightloom-server: refusing to listen")) << open.output;
    const Run worker = run({"--cache", path("file/below")}, "lightloom-worker");
    EXPECT_EQ(worker.exit_code, 1);
    EXPECT_TRUE(worker.output.starts_with("lightloom-worker: --cache ")) << worker.output;
}

TEST_F(CommandLine, TheLogLevelStandsBeforeOrBehindTheCommand) {
    EXPECT_EQ(run({"--log", "info", "algorithms"}).exit_code, 0);
    EXPECT_EQ(run({"algorithms", "--log", "info"}).exit_code, 0);
    // The coordinator of `render` says at this level what it does.
    const auto render = job("render", {"--spp", "1", "-q", "-o", path("a.exr")});
    const auto with = [&](bool before, const std::string& level) {
        std::vector<std::string> arguments = render;
        arguments.insert(before ? arguments.begin() : arguments.end(), {"--log", level});
        return run(arguments);
    };
    EXPECT_EQ(with(true, "info").output.find("tile(s)") == std::string::npos, false);
    EXPECT_EQ(with(false, "info").output.find("tile(s)") == std::string::npos, false);
    EXPECT_EQ(with(false, "error").output.find("tile(s)"), std::string::npos);
    for (const bool before : {true, false}) {
        const Run loud = with(before, "inof");
        EXPECT_EQ(loud.exit_code, 2);
        EXPECT_TRUE(
            loud.output.starts_with("lightloom: --log: \"inof\" is not trace, debug, info, warn, error or off (did you mean "
                                    "'info'?)"))
            << loud.output;
    }
}

TEST_F(CommandLine, AlgorithmsAreListedWithEachParameterOnce) {
    const std::string all = run({"algorithms"}).output;
    for (const AlgorithmInfo* row : catalog()) {
        EXPECT_NE(all.find(std::string("\n").append(row->name).append("\n")), std::string::npos) << all;
        const Run one = run({"algorithms", std::string(row->name)});
        EXPECT_EQ(one.exit_code, 0);
        for (const ParameterInfo& p : row->parameters) {
            const std::string line = std::string("\n").append(p.name).append("=").append(p.text_of(p.default_value)).append("\n");
            EXPECT_EQ(count(one.output, line), 1u) << one.output;
            EXPECT_NE(all.find(line), std::string::npos) << all;
            for (const std::string_view choice : p.choices) EXPECT_NE(one.output.find(choice), std::string::npos) << choice;
        }
    }
    for (const char* shared : {"\nrr-start=4\n", "\nrr-min=0.5\n", "\nconnections=5,2\n"})
        EXPECT_EQ(count(all, shared), 1u) << shared << all;
    EXPECT_EQ(count(all, "\nheuristic=balance\n"), 2u) << "one has the values that need shared sub-paths\n" << all;
    std::istringstream lines(all);
    for (std::string line; std::getline(lines, line);) EXPECT_LE(line.size(), 100u) << line;
}

TEST_F(CommandLine, AlgorithmsAreThereForProgramsToo) {
    const Json all = Json::parse(run({"algorithms", "--json"}).output)["algorithms"];
    ASSERT_EQ(all.size(), catalog().size());
    for (size_t i = 0; i < all.size(); ++i) {
        const AlgorithmInfo& row = *catalog()[i];
        EXPECT_EQ(all[i]["name"], std::string(row.name));
        EXPECT_EQ(all[i]["tables"], row.learning != nullptr);
        const Json& parameters = all[i]["parameters"];
        ASSERT_EQ(parameters.size(), row.parameters.size()) << row.name;
        // What it says of a parameter can be set.
        for (const Json& p : parameters) {
            const auto text = [](const Json& value) { return value.is_string() ? value.get<std::string>() : value.dump(); };
            std::vector<std::string> values{text(p["default"])};
            if (p["type"] == "choice")
                for (const Json& choice : p["choices"]) values.push_back(text(choice));
            else
                values.insert(values.end(), {text(p["min"]), text(p["max"])});
            for (const std::string& value : values) {
                const auto settings = AlgorithmSettings::parse(row.name, {{text(p["name"]), value}});
                EXPECT_TRUE(settings.ok()) << settings.status().message();
            }
        }
    }
    const Json one = Json::parse(run({"algorithms", "bdpt", "--json"}).output)["algorithms"];
    ASSERT_EQ(one.size(), 1u);
    EXPECT_EQ(one[0]["name"], "bdpt");
}

/// -o names what a command writes, in every command that writes something.
TEST_F(CommandLine, OutputsAreNamedByO) {
    ASSERT_EQ(run(job("render", {"--spp", "2", "-t", "1", "-q", "-o", path("a.exr")})).exit_code, 0);
    ASSERT_EQ(run(job("reference", {"--spp", "2", "-t", "1", "-q", "-o", path("ref.exr")})).exit_code, 0);
    EXPECT_EQ(run({"compare", path("a.exr"), path("ref.exr"), "-o", path("heat.png")}).exit_code, 0);
    EXPECT_EQ(read_file(path("heat.png"))->substr(1, 3), "PNG");
    EXPECT_EQ(run({"inspect", kScene, "-q", "-o", path("scene.json")}).exit_code, 0);
    EXPECT_EQ(Json::parse(*read_file(path("scene.json")))["spheres"], 1);
    EXPECT_EQ(run({"bench", kScene, "--reference", path("ref.exr"), "--algorithms", "light", "--spp", "1", "--seeds", "1", "-t",
                   "1", "-q", "-o", path("runs.jsonl")})
                  .exit_code,
              0);
    EXPECT_TRUE(std::filesystem::exists(path("runs.jsonl")));
    // replay writes what it prints otherwise.
    const Run printed = run(job("replay", {"--pixel", "3,4", "-t", "1"}));
    const Run written = run(job("replay", {"--pixel", "3,4", "-t", "1", "-o", path("sample.txt")}));
    EXPECT_EQ(printed.exit_code, 0);
    EXPECT_EQ(written.exit_code, 0);
    EXPECT_EQ(written.output, "");
    EXPECT_EQ(*read_file(path("sample.txt")), printed.output);
    EXPECT_EQ(run(job("replay", {"--pixel", "3,4", "--paths", "--json", "-o", path("sample.json")})).exit_code, 0);
    EXPECT_EQ(Json::parse(*read_file(path("sample.json")))["pixel"], (Json{3, 4}));
    EXPECT_EQ(run(job("replay", {"--pixel", "3,4", "-o", path("none/sample.txt")})).exit_code, 2);
    // A pyramid's folder.
    EXPECT_EQ(run(job("render", {"--spp", "1", "-q", "--pyramid", "-o", path("pyramid")})).exit_code, 0);
    EXPECT_TRUE(std::filesystem::exists(path("pyramid/index.html")));
    const Run twice = run(job("render", {"--spp", "1", "--pyramid", path("one"), "-o", path("two")}));
    EXPECT_EQ(twice.exit_code, 2);
    EXPECT_NE(twice.output.find("name two folders"), std::string::npos) << twice.output;
    const Run nowhere = run(job("render", {"--spp", "1", "--pyramid"}));
    EXPECT_EQ(nowhere.exit_code, 2);
    EXPECT_NE(nowhere.output.find("name the folder"), std::string::npos) << nowhere.output;
}

/// --crop renders the window that the scene's own pixelbounds would.
TEST_F(CommandLine, CropTakesTheScenesPlace) {
    const std::string film = "\"integer xresolution\" [ 64 ]";
    std::string text = *read_file(kScene);
    ASSERT_NE(text.find(film), std::string::npos);
    text.replace(text.find(film), film.size(), film + " \"integer pixelbounds\" [ 20 44 10 26 ]");
    std::ofstream(path("cropped.pbrt")) << text;
    const auto render = [&](const std::string& scene, const std::string& name, std::vector<std::string> more) {
        more.insert(more.begin(), {"render", scene, "-a", "bdpt", "--spp", "3", "-q", "-t", "1", "-o", path(name)});
        return run(more);
    };
    ASSERT_EQ(render(path("cropped.pbrt"), "own.exr", {}).exit_code, 0);
    ASSERT_EQ(render(kScene, "crop.exr", {"--crop", "20,44,10,26"}).exit_code, 0);
    ASSERT_EQ(render(path("cropped.pbrt"), "other.exr", {"--crop", "0,8,0,4"}).exit_code, 0);
    const auto own = read_exr(path("own.exr")), crop = read_exr(path("crop.exr")), other = read_exr(path("other.exr"));
    ASSERT_TRUE(own.ok() && crop.ok() && other.ok());
    const FrameLayout window{64, 64, {20, 10, 44, 26}};
    EXPECT_EQ(own->frame, window);
    EXPECT_EQ(crop->frame, window);
    EXPECT_EQ(crop->color.pixels, own->color.pixels);
    EXPECT_EQ(other->frame, (FrameLayout{64, 64, {0, 0, 8, 4}}));
    // A sample of it, rendered again.
    const Run sample = run({"replay", kScene, "-a", "bdpt", "--crop", "20,44,10,26", "--pixel", "21,11", "-t", "1"});
    EXPECT_EQ(sample.exit_code, 0) << sample.output;
    const Run outside = run({"replay", kScene, "-a", "bdpt", "--crop", "20,44,10,26", "--pixel", "1,1", "-t", "1"});
    EXPECT_EQ(outside.exit_code, 2) << outside.output;
    // A benchmark's runs have the reference's window.
    ASSERT_EQ(
        run({"reference", kScene, "-a", "bdpt", "--spp", "3", "-q", "--crop", "20,44,10,26", "-o", path("ref.exr")}).exit_code, 0);
    const Run bench = run({"bench", kScene, "--reference", path("ref.exr"), "--algorithms", "light", "--spp", "1", "--seeds", "1",
                           "-q", "-o", path("runs.jsonl")});
    EXPECT_EQ(bench.exit_code, 0) << bench.output;

    const std::string size = "the frame has 64 x 64 pixels, so 0 <= X0 < X1 <= 64 and 0 <= Y0 < Y1 <= 64";
    for (const char* bad : {"0,65,0,4", "0,4,0,65", "4,4,0,4", "8,4,0,4", "0,4,9,9", "-1,4,0,4", "0,0,0,0"}) {
        const Run refused = render(kScene, "none.exr", {"--crop", bad});
        EXPECT_EQ(refused.exit_code, 2) << bad;
        EXPECT_TRUE(refused.output.starts_with(std::string("lightloom: the crop window ") + bad)) << refused.output;
        EXPECT_NE(refused.output.find(size), std::string::npos) << refused.output;
    }
    const Run scaled = render(kScene, "none.exr", {"--resolution", "32x16", "--crop", "0,33,0,16"});
    EXPECT_NE(scaled.output.find("the frame has 32 x 16 pixels"), std::string::npos) << scaled.output;
    for (const char* bad : {"", "1,2,3", "1,2,3,4,5", "a,b,c,d", "0,4,0,4x", "0.5,4,0,4", "0 4 0 4"}) {
        const Run refused = render(kScene, "none.exr", {std::string("--crop=") + bad});
        EXPECT_EQ(refused.exit_code, 2) << bad << refused.output;
    }
    EXPECT_FALSE(std::filesystem::exists(path("none.exr")));
}

/// Manifests show choices by name; the image of earlier versions, whose header has numbers, keeps its bytes.
TEST_F(CommandLine, ChoicesHaveNamesInManifestsAndNumbersInImages) {
    const auto render = [&](const std::string& heuristic, const std::string& name) {
        return run(job("render", {"--spp", "2", "-q", "--set", "heuristic=" + heuristic, "-o", path(name + ".exr")})).exit_code;
    };
    ASSERT_EQ(render("power", "name"), 0);
    ASSERT_EQ(render("1", "number"), 0);
    EXPECT_EQ(*digest_file(path("name.exr")), *digest_file(path("number.exr")));
    for (const char* name : {"name", "number"})
        EXPECT_EQ(Json::parse(*read_file(path(std::string(name) + ".manifest.json")))["spec"]["parameters"]["heuristic"], "power");
    EXPECT_EQ(read_exr(path("name.exr"))->attribute(exr_attribute::kParameters),
              "heuristic=1 next-event=1 roulette=0 rr-min=0.7 rr-start=4 shadow-rays=1 training-paths=50000");
}

/// Help of every command names what it takes, its units and its defaults.
TEST_F(CommandLine, HelpIsThereForEveryCommand) {
    const std::string all = run({"--help"}).output;
    for (const char* command : {"render", "submit", "watch", "fetch", "preview", "finish", "cancel", "list", "inspect", "compare",
                                "algorithms", "replay", "bench", "report", "reference"}) {
        EXPECT_NE(all.find(std::string("\n  ").append(command)), std::string::npos) << all;
        const Run help = run({command, "--help"});
        EXPECT_EQ(help.exit_code, 0);
        EXPECT_NE(help.output.find("--log"), std::string::npos) << help.output;
        EXPECT_EQ(help.output.find(" MB"), std::string::npos) << help.output;
    }
}

}  // namespace
}  // namespace lightloom
