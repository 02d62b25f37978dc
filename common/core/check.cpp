#include "common/core/check.h"

#include <cstdio>
#include <cstdlib>

namespace lightloom::check {

void fail(const char* file, int line, const char* expression, const std::string& details) {
    std::fprintf(stderr, "%s:%d: check failed: %s%s%s\n", file, line, expression, details.empty() ? "" : ": ", details.c_str());
    std::fflush(stderr);
    std::abort();
}

std::string text_of(bool value) { return value ? "true" : "false"; }

std::string text_of(double value) {
    char text[40];
    std::snprintf(text, sizeof text, "%.17g", value);
    return text;
}

std::string text_of(long long value) { return std::to_string(value); }

std::string text_of(unsigned long long value) { return std::to_string(value); }

std::string text_of(const void* value) {
    char text[40];
    std::snprintf(text, sizeof text, "%p", value);
    return text;
}

std::string text_of(std::string_view value) { return '"' + std::string(value) + '"'; }

}  // namespace lightloom::check
