// `lightloom compare` from its command line to its exit code.

#include <gtest/gtest.h>

#include <CLI/CLI.hpp>
#include <filesystem>
#include <nlohmann/json.hpp>

#include "client/commands.h"
#include "common/core/atomic_file.h"
#include "common/film/exr_io.h"

namespace lightloom::client {
namespace {

class Compare : public testing::Test {
  protected:
    void SetUp() override {
        folder_ = std::filesystem::path(testing::TempDir()) /
                  (std::string("lightloom-compare-") + testing::UnitTest::GetInstance()->current_test_info()->name());
        std::filesystem::remove_all(folder_);
        std::filesystem::create_directories(folder_);
    }
    void TearDown() override { std::filesystem::remove_all(folder_); }

    std::string path(const std::string& name) const { return (folder_ / name).string(); }

    std::string write(const std::string& name, int width, int height, float value, const std::string& algorithm) {
        ExrImage image;
        image.frame = {width, height, {0, 0, width, height}};
        image.color = {width, height, std::vector<float>(size_t(width) * size_t(height) * 3, value)};
        image.attributes = {{exr_attribute::kAlgorithm, algorithm}};
        EXPECT_TRUE(write_exr(path(name), image).ok());
        return path(name);
    }

    struct Outcome {
        int exit_code = -1;
        std::string out, err;
    };
    Outcome run(std::vector<std::string> arguments) {
        CLI::App app;
        Outcome outcome;
        add_compare_command(app, &outcome.exit_code);
        arguments.insert(arguments.begin(), "compare");
        std::reverse(arguments.begin(), arguments.end());  // CLI11 takes vectors from the back.
        testing::internal::CaptureStdout();
        testing::internal::CaptureStderr();
        try {
            app.parse(arguments);
        } catch (const CLI::ParseError& error) {
            outcome.exit_code = kUsage;
        }
        outcome.out = testing::internal::GetCapturedStdout();
        outcome.err = testing::internal::GetCapturedStderr();
        return outcome;
    }

    std::filesystem::path folder_;
};

TEST_F(Compare, PrintsATableAndWritesJsonAndPicture) {
    const std::string a = write("a.exr", 24, 18, 0.6f, "bdpt"), b = write("b.exr", 24, 18, 0.5f, "path");
    const Outcome o = run({a, b, "--heat", path("heat.png"), "--regions", "3x2", "--trim", "1", "--json", path("m.json")});
    EXPECT_EQ(o.exit_code, kSuccess) << o.err;
    EXPECT_EQ(o.err, "");
    for (const char* word : {"MAPE", "relMSE", "SRRMSE", "SSIM", "FLIP", "HDR-FLIP", "mean ratio by region"}) {
        EXPECT_NE(o.out.find(word), std::string::npos) << word;
    }
    EXPECT_EQ(read_file(path("heat.png"))->substr(1, 3), "PNG");
    const auto json = nlohmann::json::parse(*read_file(path("m.json")));
    EXPECT_NEAR(json["mean_ratio"], 1.2, 1e-6);
    EXPECT_NEAR(json["mape_percent"], 100 * 0.1 / 0.51, 1e-4);
    EXPECT_EQ(json["trim_percent"], 1);
    EXPECT_EQ(json["regions"].size(), 6u);
    EXPECT_EQ(json["warnings"].size(), 0u);
}

TEST_F(Compare, JsonAloneGoesToStandardOutput) {
    const std::string a = write("a.exr", 8, 8, 1, "bdpt");
    const Outcome o = run({a, a, "--json"});
    EXPECT_EQ(o.exit_code, kSuccess);
    const auto json = nlohmann::json::parse(o.out);
    EXPECT_EQ(json["rmse"], 0);
    EXPECT_EQ(json["warnings"].size(), 1u);
    EXPECT_NE(o.err.find("made by algorithm \"bdpt\""), std::string::npos) << o.err;
}

TEST_F(Compare, RefusesWithOneLineAndUsageCode) {
    const std::string a = write("a.exr", 8, 8, 1, "bdpt"), other = write("other.exr", 8, 9, 1, "path");
    ASSERT_TRUE(write_file_atomically(path("text.exr"), "no picture").ok());
    const std::vector<std::vector<std::string>> bad{{a, other},
                                                    {a, path("none.exr")},
                                                    {path("text.exr"), a},
                                                    {a, a, "--regions", "3x"},
                                                    {a, a, "--regions", "9x9"},
                                                    {a, a, "--heat", path("no-such-folder/h.png")}};
    for (const auto& arguments : bad) {
        const Outcome o = run(arguments);
        EXPECT_EQ(o.exit_code, kUsage) << arguments.back();
        const std::string last = o.err.substr(o.err.rfind("lightloom: "));
        EXPECT_EQ(std::count(last.begin(), last.end(), '\n'), 1) << o.err;
        EXPECT_EQ(o.out, "");
    }
    EXPECT_EQ(run({a}).exit_code, kUsage);
    EXPECT_EQ(run({a, a, "--trim", "100"}).exit_code, kUsage);
}

}  // namespace
}  // namespace lightloom::client
