#include "common/core/crash_point.h"

#include <signal.h>
#include <unistd.h>

#include <algorithm>
#include <charconv>
#include <cstdio>
#include <cstdlib>

#include "common/core/nearest.h"

namespace lightloom {
namespace {

size_t armed_label = 0;
uint64_t armed_number = 0;
std::atomic<uint64_t> passes{0};

}  // namespace

namespace crash {

std::atomic<bool> armed{false};

void passed(size_t label) {
    if (label != armed_label || passes.fetch_add(1) + 1 != armed_number) return;
    // The one line that is left of it. It is written at once, because nothing is flushed any more.
    dprintf(STDERR_FILENO, "%s: killed at %s, pass %llu\n", kCrashVariable, kCrashLabels[label].data(),
            static_cast<unsigned long long>(armed_number));
    ::kill(::getpid(), SIGKILL);
    for (;;) ::pause();
}

}  // namespace crash

Status arm_crash_point(std::string_view text) {
    crash::armed = false;
    if (text.empty()) return {};
    const std::string prefix = std::string(kCrashVariable) + "=" + std::string(text) + ": ";
    const size_t colon = text.find(':');
    const std::string_view label = text.substr(0, colon);
    const auto* const found = std::find(std::begin(kCrashLabels), std::end(kCrashLabels), label);
    if (found == std::end(kCrashLabels))
        return invalid_argument(prefix + "no crash point has the label \"" + std::string(label) + "\"" +
                                did_you_mean(label, kCrashLabels) + "; common/core/crash_point.h lists them");
    uint64_t number = 1;
    if (colon != std::string_view::npos) {
        const std::string_view digits = text.substr(colon + 1);
        const auto [end, error] = std::from_chars(digits.data(), digits.data() + digits.size(), number);
        if (error != std::errc() || end != digits.data() + digits.size() || number == 0)
            return invalid_argument(prefix + "\"" + std::string(digits) + "\" is no number of times from 1 on");
    }
    armed_label = size_t(found - std::begin(kCrashLabels));
    armed_number = number;
    passes = 0;
    crash::armed = true;
    return {};
}

Status arm_crash_point_of_environment() {
    const char* const text = std::getenv(kCrashVariable);
    return arm_crash_point(text ? text : "");
}

}  // namespace lightloom
