#include "client/job_label.h"

#include <pwd.h>
#include <unistd.h>

#include <array>
#include <filesystem>

#include "common/core/utf8.h"

namespace lightloom::client {
namespace {

std::string user_name() {
    std::array<char, 4096> buffer;
    passwd entry{}, *found = nullptr;
    const uid_t user = ::geteuid();
    // A container may know its users by number only.
    if (::getpwuid_r(user, &entry, buffer.data(), buffer.size(), &found) != 0 || !found) return std::to_string(user);
    return found->pw_name;
}

std::string host_name() {
    char name[256] = {};
    return ::gethostname(name, sizeof name - 1) == 0 ? name : "unknown";
}

/// Names of files and hosts may be any bytes.
std::string fit_for_a_label(const std::string& text) { return clipped_utf8(one_line(text), JobLabel::kMaxBytes); }

}  // namespace

JobLabel make_label(const std::string& name, const std::string& scene) {
    return {name.empty() ? fit_for_a_label(std::filesystem::path(scene).stem().string()) : name,
            fit_for_a_label(user_name() + "@" + host_name())};
}

}  // namespace lightloom::client
