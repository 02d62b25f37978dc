#include "client/report/gnuplot.h"

#include <spawn.h>
#include <sys/mman.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <cstring>
#include <vector>

extern char** environ;

namespace lightloom::client::report {
namespace {

/// A file in memory.
class MemoryFile {
  public:
    explicit MemoryFile(const char* name) : file_(::memfd_create(name, MFD_CLOEXEC)) {}
    MemoryFile(const MemoryFile&) = delete;
    ~MemoryFile() {
        if (file_ >= 0) ::close(file_);
    }
    int number() const { return file_; }
    bool write(std::string_view text) const {
        while (!text.empty()) {
            const ssize_t count = ::write(file_, text.data(), text.size());
            if (count < 0 && errno == EINTR) continue;
            if (count <= 0) return false;
            text.remove_prefix(size_t(count));
        }
        return ::lseek(file_, 0, SEEK_SET) == 0;
    }
    std::string text() const {
        const off_t size = ::lseek(file_, 0, SEEK_END);
        std::string out(size > 0 ? size_t(size) : 0, '\0');
        size_t done = 0;
        while (done < out.size()) {
            const ssize_t count = ::pread(file_, out.data() + done, out.size() - done, off_t(done));
            if (count < 0 && errno == EINTR) continue;
            if (count <= 0) break;
            done += size_t(count);
        }
        out.resize(done);
        return out;
    }

  private:
    int file_;
};

/// The environment, in which numbers have points and texts are UTF-8.
std::vector<std::string> plain_environment() {
    std::vector<std::string> out;
    for (char** entry = environ; *entry; ++entry)
        if (std::strncmp(*entry, "LC_", 3) != 0 && std::strncmp(*entry, "GNUPLOT", 7) != 0) out.emplace_back(*entry);
    out.emplace_back("LC_ALL=C.UTF-8");
    return out;
}

Status absent(const std::string& program) {
    return failed_precondition("charts need gnuplot, and \"" + program +
                               "\" cannot be started: apt-get install gnuplot-nox (or the gnuplot of your system)");
}

std::string first_line_of_words(const std::string& text) {
    for (size_t begin = 0; begin < text.size();) {
        const size_t end = std::min(text.find('\n', begin), text.size());
        const std::string line = text.substr(begin, end - begin);
        // gnuplot shows the command with a mark below before it says what is wrong with it.
        if (line.find("line ") != std::string::npos && line.find(':') != std::string::npos) return line;
        begin = end + 1;
    }
    return text.substr(0, text.find('\n'));
}

struct Named {
    const char* marker;  ///< In scripts.
    const char* name;    ///< Of the CSS variable.
    const char *light, *dark;
};

// The algorithms' colours differ in lightness too, and stay apart for people who do not see red or green [Okabe and Ito's set, made
// darker on white and lighter on black until thin lines are seen].
constexpr std::array<Named, 19> kColours{{{"#fefefe", "ground", "#ffffff", "#161616"},
                                          {"#010101", "text", "#1d1c1a", "#ececea"},
                                          {"#020202", "axis", "#8a857c", "#77746e"},
                                          {"#030303", "grid", "#e4e0d8", "#2f2e2c"},
                                          {"#040404", "soft", "#5f5b54", "#aaa7a0"},
                                          {"#0a0001", "s0", "#0a63a8", "#62b4f2"},
                                          {"#0a0002", "s1", "#c84e00", "#ff9a52"},
                                          {"#0a0003", "s2", "#00805c", "#41cf9f"},
                                          {"#0a0004", "s3", "#a03c86", "#ee9ad2"},
                                          {"#0a0005", "s4", "#7a6200", "#e2c53a"},
                                          {"#0a0006", "s5", "#3a3a3a", "#d5d5d5"},
                                          {"#0a0007", "s6", "#1d8fa8", "#5fd4e6"},
                                          {"#0a0008", "s7", "#9c2f2f", "#ff8d88"},
                                          {"#140001", "t0", "#2d3a6e", "#4a5ca8"},
                                          {"#140002", "t1", "#2f7d9c", "#3f97b8"},
                                          {"#140003", "t2", "#69b48b", "#6fbf95"},
                                          {"#140004", "t3", "#dfc25a", "#e0c865"},
                                          {"#140005", "t4", "#f3e3cf", "#f6ead9"},
                                          {"#140006", "t5", "#b9b4aa", "#8d8a84"}}};
constexpr size_t kSeries = 8, kTechniques = 6;

const Named* named(int r, int g, int b) {
    char text[8];
    std::snprintf(text, sizeof text, "#%02x%02x%02x", r & 255, g & 255, b & 255);
    for (const Named& colour : kColours)
        if (std::strcmp(colour.marker, text) == 0) return &colour;
    return nullptr;
}

std::string replaced(std::string text, std::string_view from, std::string_view to) {
    for (size_t at = 0; (at = text.find(from, at)) != std::string::npos; at += to.size()) text.replace(at, from.size(), to);
    return text;
}

/// Markers by colours: gnuplot writes "rgb( 10,   0,   1)", "#FEFEFE" and, of the ground, "#fefefe".
template <typename Show>
std::string painted(const std::string& svg, const Show& show) {
    std::string out;
    for (size_t at = 0; at < svg.size();) {
        const size_t found = svg.find("rgb(", at);
        out += svg.substr(at, found - at);
        if (found == std::string::npos) break;
        int r = 0, g = 0, b = 0, used = 0;
        const bool read = std::sscanf(svg.c_str() + found, "rgb(%d ,%d ,%d )%n", &r, &g, &b, &used) == 3 && used > 0;
        const Named* colour = read ? named(r, g, b) : nullptr;
        out += colour ? show(*colour) : svg.substr(found, 4);
        at = found + (colour ? size_t(used) : 4);
    }
    return replaced(replaced(std::move(out), "#FEFEFE", show(kColours[0])), "#fefefe", show(kColours[0]));
}

std::vector<std::string> lines_of(std::string_view text) {
    std::vector<std::string> lines;
    for (size_t begin = 0; begin < text.size();) {
        const size_t end = std::min(text.find('\n', begin), text.size());
        std::string line(text.substr(begin, end - begin));
        line.erase(0, line.find_first_not_of(" \t"));
        line.erase(line.find_last_not_of(" \t\r") + 1);
        if (!line.empty()) lines.push_back(std::move(line));
        begin = end + 1;
    }
    return lines;
}

/// What stands between the root's tags, without groups that hold nothing, shapes that nothing shows and names that only gnuplot
/// knows. `size` becomes the root's viewBox.
std::string content(std::string_view svg, std::string* size) {
    const std::string whole(svg);
    if (const size_t at = whole.find("viewBox=\""); at != std::string::npos)
        *size = whole.substr(at, whole.find('"', at + 9) - at + 1);
    const size_t begin = whole.find("<g id=\"gnuplot_canvas\">"), end = whole.rfind("</svg>");
    if (begin == std::string::npos || end == std::string::npos) return "";
    std::vector<std::string> kept;
    bool filter = false;
    const auto shows = [&](const std::string& shape) { return whole.find("href='#" + shape + "'") != std::string::npos; };
    for (std::string& line : lines_of(std::string_view(whole).substr(begin, end - begin))) {
        filter |= line.starts_with("<filter");
        const bool skip = filter;
        filter &= !line.starts_with("</filter");
        if (skip) continue;
        if (const size_t id = line.find("id='gp");
            id != std::string::npos && !shows(line.substr(id + 4, line.find('\'', id + 4) - id - 4)))
            continue;
        if (line == "</g>" && !kept.empty() && kept.back().starts_with("<g fill=") && kept.back().ends_with(">") &&
            kept.back().find("><") == std::string::npos) {
            kept.pop_back();
            continue;
        }
        if (const size_t title = line.find("<title>gnuplot_plot_"); title != std::string::npos) line.erase(title);
        kept.push_back(std::move(line));
    }
    std::string out;
    for (const std::string& line : kept) out += line + "\n";
    return replaced(replaced(std::move(out), "xlink:href", "href"), "font-family=\"sans\"", "font-family=\"system-ui,sans-serif\"");
}

std::string wrapped_up(std::string_view svg, const std::string& prefix, const std::string& root, const std::string& description) {
    std::string size;
    std::string inner = content(svg, &size);
    inner = replaced(replaced(std::move(inner), "id='gp", "id='" + prefix + "gp"), "href='#gp", "href='#" + prefix + "gp");
    inner = replaced(std::move(inner), "id=\"gnuplot_", "id=\"" + prefix);
    return "<svg " + root + size + " role=\"img\">\n<title>" + description + "</title>\n" + inner + "</svg>\n";
}

}  // namespace

Status find_gnuplot(const std::string& program) {
    const Result<std::string> answer = run_gnuplot("", program);
    return answer.ok() ? Status::ok_status() : answer.status();
}

Result<std::string> run_gnuplot(std::string_view script, const std::string& program) {
    const MemoryFile input("script"), output("chart"), complaint("complaint");
    if (input.number() < 0 || output.number() < 0 || complaint.number() < 0 || !input.write(script)) {
        return internal_error("no memory for a chart: " + std::string(std::strerror(errno)));
    }
    posix_spawn_file_actions_t actions;
    posix_spawn_file_actions_init(&actions);
    posix_spawn_file_actions_adddup2(&actions, input.number(), STDIN_FILENO);
    posix_spawn_file_actions_adddup2(&actions, output.number(), STDOUT_FILENO);
    posix_spawn_file_actions_adddup2(&actions, complaint.number(), STDERR_FILENO);
    std::string name = program, plain = "--default-settings";
    std::array<char*, 3> arguments{name.data(), plain.data(), nullptr};
    std::vector<std::string> environment = plain_environment();
    std::vector<char*> entries;
    for (std::string& entry : environment) entries.push_back(entry.data());
    entries.push_back(nullptr);
    pid_t child = -1;
    const int failed = ::posix_spawnp(&child, name.c_str(), &actions, nullptr, arguments.data(), entries.data());
    posix_spawn_file_actions_destroy(&actions);
    if (failed != 0) return absent(program);
    int status = 0;
    while (::waitpid(child, &status, 0) < 0)
        if (errno != EINTR) return internal_error("gnuplot was lost: " + std::string(std::strerror(errno)));
    if (!WIFEXITED(status)) return internal_error("gnuplot was killed by signal " + std::to_string(WTERMSIG(status)));
    if (WEXITSTATUS(status) == 127) return absent(program);
    if (WEXITSTATUS(status) != 0) return internal_error("gnuplot refuses a chart: " + first_line_of_words(complaint.text()));
    return output.text();
}

namespace colour {
std::string series(size_t style) { return kColours[5 + style % kSeries].marker; }
std::string technique(size_t position) { return kColours[5 + kSeries + position % kTechniques].marker; }
}  // namespace colour

std::string colour_variables(bool dark) {
    std::string out;
    for (const Named& colour : kColours) out += "--" + std::string(colour.name) + ":" + (dark ? colour.dark : colour.light) + ";";
    return out;
}

std::string svg_of_page(std::string_view svg, const std::string& prefix, const std::string& description) {
    return painted(wrapped_up(svg, prefix, "", description),
                   [](const Named& colour) { return "var(--" + std::string(colour.name) + ")"; });
}

std::string svg_alone(std::string_view svg, const std::string& description) {
    return "<?xml version=\"1.0\" encoding=\"utf-8\"?>\n" +
           painted(wrapped_up(svg, "", "xmlns=\"http://www.w3.org/2000/svg\" ", description),
                   [](const Named& colour) { return std::string(colour.light); });
}

}  // namespace lightloom::client::report
