#pragma once
// Lines of the log. They go to spdlog, whose headers are compiled in common/cli alone: every file that includes them spends some
// three seconds on it.

#include <concepts>
#include <cstdint>
#include <initializer_list>
#include <string>
#include <string_view>
#include <variant>

namespace lightloom {

enum class LogLevel { kDebug, kInfo, kWarn, kError };

/// What stands for a {} of a line. Refers to strings, which live at least as long as the call.
class LogValue {
  public:
    LogValue(const char* text) : value_(std::string_view(text)) {}
    LogValue(const std::string& text) : value_(std::string_view(text)) {}
    LogValue(std::string_view text) : value_(text) {}
    LogValue(double value) : value_(value) {}
    LogValue(std::signed_integral auto value) : value_(int64_t(value)) {}
    LogValue(std::unsigned_integral auto value) : value_(uint64_t(value)) {}

    const auto& value() const { return value_; }

  private:
    std::variant<std::string_view, int64_t, uint64_t, double> value_;
};

/// Prints one line, where the log's level lets it through. In texts, control characters and bytes that are not UTF-8 are replaced
/// as by one_line().
void log_line(LogLevel level, std::string_view format, std::initializer_list<LogValue> values);

/// A format of {fmt} with as many fields ({} or {:.3f}, in order) as there are values, which the compiler checks.
template <size_t kCount>
class LogFormat {
  public:
    consteval LogFormat(const char* text) : text_(text) {
        size_t fields = 0;
        for (const char c : text_) fields += c == '{';
        if (fields != kCount) throw "as many {} as values";
    }
    std::string_view text() const { return text_; }

  private:
    std::string_view text_;
};

template <typename... Values>
void log_debug(LogFormat<sizeof...(Values)> format, const Values&... values) {
    log_line(LogLevel::kDebug, format.text(), {LogValue(values)...});
}
template <typename... Values>
void log_info(LogFormat<sizeof...(Values)> format, const Values&... values) {
    log_line(LogLevel::kInfo, format.text(), {LogValue(values)...});
}
template <typename... Values>
void log_warn(LogFormat<sizeof...(Values)> format, const Values&... values) {
    log_line(LogLevel::kWarn, format.text(), {LogValue(values)...});
}
template <typename... Values>
void log_error(LogFormat<sizeof...(Values)> format, const Values&... values) {
    log_line(LogLevel::kError, format.text(), {LogValue(values)...});
}

}  // namespace lightloom
