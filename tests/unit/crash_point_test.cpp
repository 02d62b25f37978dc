// Crash points end a process at a chosen pass of a chosen place, and only there.

#include "common/core/crash_point.h"

#include <gtest/gtest.h>
#include <signal.h>

#include <filesystem>
#include <set>

#include "common/core/atomic_file.h"

namespace lightloom {
namespace {

/// Exits with the number of passes.
[[noreturn]] void pass(int times) {
    for (int i = 0; i < times; ++i) {
        crash_point("server.after-merge");
        crash_point("server.before-merge");
    }
    std::exit(times);
}

TEST(CrashPointDeathTest, KillsAtTheChosenPassOfTheChosenLabelOnly) {
    EXPECT_EXIT(pass(5), testing::ExitedWithCode(5), "") << "none is armed";
    const auto armed = [](const char* text, int times) {
        if (!arm_crash_point(text).ok()) std::exit(99);
        pass(times);
    };
    EXPECT_EXIT(armed("server.before-merge", 1), testing::KilledBySignal(SIGKILL),
                "LIGHTLOOM_CRASH_AT: killed at server.before-merge, pass 1");
    EXPECT_EXIT(armed("server.before-merge:3", 2), testing::ExitedWithCode(2), "");
    EXPECT_EXIT(armed("server.before-merge:3", 3), testing::KilledBySignal(SIGKILL), "server.before-merge");
    EXPECT_EXIT(armed("worker.registered", 4), testing::ExitedWithCode(4), "") << "it is never passed";
    EXPECT_EXIT(armed("", 4), testing::ExitedWithCode(4), "");
}

TEST(CrashPoint, AMistakeIsOneClearLine) {
    const auto message = [](const char* text) {
        const Status status = arm_crash_point(text);
        EXPECT_EQ(status.code(), StatusCode::kInvalidArgument) << text;
        EXPECT_FALSE(crash::armed) << text;
        return status.message();
    };
    EXPECT_EQ(message("server.before-merg:3"),
              "LIGHTLOOM_CRASH_AT=server.before-merg:3: no crash point has the label \"server.before-merg\" (did you mean "
              "'server.before-merge'?); common/core/crash_point.h lists them");
    for (const char* text : {":", ":1", "server", " server.before-merge"}) message(text);
    for (const char* number : {"", "0", "-1", "1x", "1:2", "18446744073709551616"})
        EXPECT_NE(message(("server.before-merge:" + std::string(number)).c_str()).find("is no number of times"), std::string::npos)
            << number;
}

TEST(CrashPoint, EveryLabelIsThereOnceAndHasAPlace) {
    const std::set<std::string_view> labels(std::begin(kCrashLabels), std::end(kCrashLabels));
    EXPECT_EQ(labels.size(), std::size(kCrashLabels));
    std::string sources;
    for (const char* folder : {"common", "server", "worker"})
        for (const auto& entry : std::filesystem::recursive_directory_iterator(std::string(LIGHTLOOM_SOURCE_DIR) + "/" + folder))
            if (entry.path().extension() == ".cpp")  // the list itself is in a header
                sources += *read_file(entry.path().string());
    for (const std::string_view label : labels) {
        std::string quoted(1, '"');
        quoted.append(label).push_back('"');
        EXPECT_NE(sources.find(quoted), std::string::npos) << label << " is passed nowhere";
    }
}

}  // namespace
}  // namespace lightloom
