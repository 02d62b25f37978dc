// Lines of the log: fields, kinds of values, levels.
#include "common/cli/log_line.h"

#include <gtest/gtest.h>

#include <algorithm>

#include "common/cli/log.h"

namespace lightloom {
namespace {

TEST(LogLine, FillsFieldsInOrder) {
    set_up_logging("log_line_test", "info");
    testing::internal::CaptureStderr();
    const std::string name = "b{}r";
    log_info("{}: {} of {} in {:.3f} s, {}", name, -3, uint64_t(1) << 63, 0.12345, std::string_view("view"));
    const std::string line = testing::internal::GetCapturedStderr();
    EXPECT_NE(line.find("info"), line.npos) << line;
    EXPECT_NE(line.find("b{}r: -3 of 9223372036854775808 in 0.123 s, view\n"), line.npos) << line;
}

TEST(LogLine, StaysOneLineWhateverTheTextsHold) {
    set_up_logging("log_line_test", "info");
    testing::internal::CaptureStderr();
    log_info("worker on {}: {}", "evil\n2030-01-01 error \x1b[2J", std::string("\xe2\x80\xae\xff"));
    const std::string line = testing::internal::GetCapturedStderr();
    EXPECT_EQ(std::count(line.begin(), line.end(), '\n'), 1) << line;
    EXPECT_NE(line.find("worker on evil\\x0a2030-01-01 error \\x1b[2J: \\u202e\xef\xbf\xbd\n"), line.npos) << line;
}

TEST(LogLine, KeepsToTheLevel) {
    set_up_logging("log_line_test", "warn");
    testing::internal::CaptureStderr();
    log_debug("debug {}", 1);
    log_info("info");
    log_warn("warn {}", "text");
    log_error("error");
    const std::string lines = testing::internal::GetCapturedStderr();
    EXPECT_EQ(lines.find("debug 1"), lines.npos) << lines;
    EXPECT_EQ(lines.find("info"), lines.npos) << lines;
    EXPECT_NE(lines.find("warn text\n"), lines.npos) << lines;
    EXPECT_NE(lines.find("error\n"), lines.npos) << lines;
}

}  // namespace
}  // namespace lightloom
