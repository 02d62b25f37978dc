#include "client/progress.h"

#include <sys/ioctl.h>
#include <unistd.h>

#include <cstdio>

#include "common/core/utf8.h"

namespace lightloom::client {
namespace {

constexpr int kBarWidth = 28;
constexpr auto kPlainInterval = std::chrono::seconds(5);
constexpr auto kRedrawInterval = std::chrono::milliseconds(100);

std::string line_of(const JobInfo& job, int percent) {
    // An algorithm that only splats has no camera samples to count.
    const bool splats_only = !job.spec.algorithm.info().camera_samples;
    const double done = double(splats_only ? job.light_paths : job.camera_samples);
    const double rate = job.render_seconds > 0 ? done / job.render_seconds : 0;
    std::string line;
    char text[160];
    std::snprintf(text, sizeof text, "%3d %%  ", percent);
    line += text;
    if (job.unit_total > 0) {
        std::snprintf(text, sizeof text, "%llu/%u spp", static_cast<unsigned long long>(job.samples_per_pixel_done),
                      job.spec.samples_per_pixel);
    } else {
        std::snprintf(text, sizeof text, "%llu spp", static_cast<unsigned long long>(job.samples_per_pixel_done));
    }
    line += text;
    if (rate > 0) {
        std::snprintf(text, sizeof text, "  %.2f M%s/s  %u worker%s", rate * 1e-6, splats_only ? "paths" : "samples",
                      job.worker_count, job.worker_count == 1 ? "" : "s");
        line += text;
    }
    if (job.noise) line += "  " + noise_text(*job.noise);
    if (job.spec.noise_target > 0 && !is_terminal(job.state)) {
        std::snprintf(text, sizeof text, job.noise && job.noise->light_missing ? " (%.3g, but light is missing)" : " (until %.3g)",
                      job.spec.noise_target);
        line += text;
    }
    if (job.eta_seconds >= 0 && !is_terminal(job.state)) line += "  ETA " + duration_text(job.eta_seconds);
    return line;
}

size_t terminal_columns() {
    winsize size{};
    return ::ioctl(STDERR_FILENO, TIOCGWINSZ, &size) == 0 && size.ws_col > 1 ? size.ws_col : 80;
}

/// "tracing training paths 65536/200000  ETA 12 s", "learning the tables 40 %  ETA 2 s"
std::string phase_line(const JobInfo& job) {
    std::string line = phase_text(job);
    const bool learning = job.phase == PreparePhase::kLearning;
    if (job.phase == PreparePhase::kTracing) {
        line += ' ';
        line += std::to_string(job.phase_done) + "/" + std::to_string(job.phase_total);
    }
    if (learning && job.phase_total > 0) line += ' ' + std::to_string(100 * job.phase_done / job.phase_total) + " %";
    if (!learning && job.phase_done == 0 && job.unit_leased == 0 && job.phase_total > 0) line += "  waiting for a worker";
    if (job.eta_seconds >= 0) line += "  ETA " + duration_text(job.eta_seconds);
    return line;
}

int percent_of(const JobInfo& job) {
    if (job.state == JobState::kPreparing && job.phase_total > 0) return int(100 * job.phase_done / job.phase_total);
    const double share = rendered_share(job);
    // Only an image that is complete is shown as 100 %.
    return job.state == JobState::kSucceeded || job.state == JobState::kFinishing ? 100 : int(100 * std::min(share, 0.995));
}

}  // namespace

std::string duration_text(double seconds) {
    char text[64];
    const auto whole = static_cast<long>(seconds + 0.5);
    if (whole < 60) {
        std::snprintf(text, sizeof text, "%ld s", whole);
    } else if (whole < 3600) {
        std::snprintf(text, sizeof text, "%ld min %02ld s", whole / 60, whole % 60);
    } else {
        std::snprintf(text, sizeof text, "%ld h %02ld min", whole / 3600, whole / 60 % 60);
    }
    return text;
}

std::string age_text(double seconds) {
    const auto hours = static_cast<long>(seconds / 3600);
    if (hours < 48) return duration_text(seconds);
    char text[64];
    std::snprintf(text, sizeof text, "%ld d %02ld h", hours / 24, hours % 24);
    return text;
}

std::string tables_line(const TablesInfo& tables) {
    const double learned = tables.classifier_seconds + tables.energy_seconds + tables.gamma_seconds;
    std::string line = tables.what() + " from " + std::to_string(tables.training_samples) + " training samples";
    if (tables.from_cache) {
        line += ", cached by an earlier job";
    } else {
        char text[64];
        std::snprintf(text, sizeof text, ", %.1f s traced, %.1f s learned", tables.trace_seconds, learned);
        line += text;
    }
    if (tables.capped_by_time_limit) line += " (fewer than asked for: the time limit)";
    return tables.note.empty() ? line : line + "; " + tables.note;
}

std::string noise_text(const NoiseReport& noise) {
    char text[64];
    const double relmse = noise.estimate.relmse;
    std::snprintf(text, sizeof text, "relMSE %.3g +- %.0f %%", relmse, relmse > 0 ? 100 * noise.estimate.error / relmse : 0.0);
    return text;
}

Progress::Progress(bool quiet) : quiet_(quiet), terminal_(::isatty(STDERR_FILENO) == 1) {
    if (!quiet_ && !terminal_) silence_breaker_ = std::jthread([this](std::stop_token stop) { break_silence(stop); });
}

Progress::~Progress() { finish(); }

void Progress::finish() {
    silence_breaker_ = {};
    if (open_) std::fputc('\n', stderr);
    open_ = false;
}

void Progress::break_silence(std::stop_token stop) {
    std::unique_lock lock(mutex_);
    while (!stop.stop_requested()) {
        stopped_.wait_for(lock, stop, std::chrono::seconds(1), [] { return false; });
        if (!line_.empty() && line_ != printed_ && Clock::now() - last_ >= kPlainInterval) print_line();
    }
}

void Progress::print_line() {
    last_ = Clock::now();
    printed_ = line_;
    std::fprintf(stderr, "%s\n", line_.c_str());
}

void Progress::show(const JobInfo& job) {
    if (quiet_) return;
    const std::lock_guard lock(mutex_);
    const bool new_state = !shown_ || job.state != state_;
    const bool new_phase = job.state == JobState::kPreparing && job.phase != phase_;
    phase_ = job.phase;
    const int percent = percent_of(job);
    shown_ = true;
    state_ = job.state;
    const bool preparing = job.state == JobState::kPreparing, running = job.state == JobState::kRunning;
    const bool waiting = running && job.render_seconds == 0;
    line_ = preparing ? phase_line(job) : waiting ? "waiting for a worker" : line_of(job, percent);
    if (!job.message.empty() && !is_terminal(job.state)) line_ = one_line(job.message);  // why it stands still
    if (new_state && running && job.tables.asset.size_bytes > 0)
        std::fprintf(stderr, "%s%s\n", terminal_ ? "\r\033[K" : "", tables_line(job.tables).c_str());
    if (terminal_) {
        if (!new_state && !new_phase && Clock::now() - last_ < kRedrawInterval) return;
        last_ = Clock::now();
        const int filled = percent * kBarWidth / 100;
        const std::string bar = '[' + std::string(size_t(filled), '=') + std::string(size_t(kBarWidth - filled), ' ') + "] ";
        // A line that wraps could not be redrawn.
        const size_t room = terminal_columns() - 1;
        const bool bar_fits = bar.size() + line_.size() <= room;
        std::fprintf(stderr, "\r\033[K%s%s", bar_fits ? bar.c_str() : "", line_.substr(0, room).c_str());
        std::fflush(stderr);
        open_ = true;
    } else if (preparing ? new_phase
               : running ? job.unit_done > 0 && percent >= last_percent_ + 10
                         : new_state && is_terminal(job.state)) {
        if (running) last_percent_ = percent;
        print_line();
    }
}

}  // namespace lightloom::client
