#include "common/cli/log.h"

#include <spdlog/details/os.h>
#include <spdlog/sinks/base_sink.h>
#include <spdlog/sinks/stdout_color_sinks.h>
#include <spdlog/spdlog.h>
#include <unistd.h>

#include <cstdio>
#include <cstdlib>
#include <exception>
#include <mutex>

#include "common/cli/log_queue.h"
#include "common/core/utf8.h"

namespace lightloom {
namespace {

/// Lines of about 100 bytes: a few MiB at most, and hours of a farm's log at level info.
constexpr size_t kMaxLines = 20000;
/// How long an end waits for the reader of the log.
constexpr double kFlushSeconds = 1;

/// Set once, and never destroyed: whatever logs while the process exits must find it.
LogQueue* background = nullptr;

/// A sink that formats a line and hands it over. The queue is safe for threads, the formatter is not: hence the mutex of base_sink.
class QueueSink final : public spdlog::sinks::base_sink<std::mutex> {
  private:
    void sink_it_(const spdlog::details::log_msg& message) override {
        spdlog::memory_buf_t text;
        formatter_->format(message, text);
        std::string line(text.data(), text.size());
        if (coloured_ && message.color_range_end > message.color_range_start) {
            line.insert(message.color_range_end, "\033[m");
            line.insert(message.color_range_start, colour_of(message.level));
        }
        background->push(std::move(line));
    }
    void flush_() override {}

    static const char* colour_of(spdlog::level::level_enum level) {
        switch (level) {
            case spdlog::level::err: return "\033[31m\033[1m";
            case spdlog::level::warn: return "\033[33m\033[1m";
            case spdlog::level::info: return "\033[32m";
            default: return "\033[36m";
        }
    }

    const bool coloured_ = spdlog::details::os::in_terminal(stderr) && spdlog::details::os::is_color_terminal();
};

void set_up(const std::string& program, const std::string& level, spdlog::sink_ptr sink) {
    auto logger = std::make_shared<spdlog::logger>(program, std::move(sink));
    logger->set_pattern("%Y-%m-%dT%H:%M:%S.%e %n %^%l%$ %v");
    logger->set_level(spdlog::level::from_str(level));
    spdlog::set_default_logger(logger);
}

}  // namespace

void set_up_logging(const std::string& program, const std::string& level) {
    set_up(program, level, std::make_shared<spdlog::sinks::stderr_color_sink_mt>());
}

void set_up_background_logging(const std::string& program, const std::string& level) {
    background = new LogQueue(program, kMaxLines, [](std::string_view bytes) { write_log_bytes(STDERR_FILENO, bytes); });
    set_up(program, level, std::make_shared<QueueSink>());
    std::atexit([] { flush_log(kFlushSeconds); });
    static const std::terminate_handler before = std::get_terminate();
    std::set_terminate([] {
        flush_log(kFlushSeconds);
        before();
    });
}

void flush_log(double seconds) {
    if (background) background->flush(seconds);
}

void print_error(const std::string& message) {
    // What a coordinator or a worker says of itself may be part of it.
    const std::string line = spdlog::default_logger()->name() + ": " + one_line(message) + "\n";
    if (background)
        background->push(line);
    else
        std::fputs(line.c_str(), stderr);
}

}  // namespace lightloom
