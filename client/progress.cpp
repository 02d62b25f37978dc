#include "client/progress.h"

#include <unistd.h>

#include <cstdio>

namespace lightloom::client {
namespace {

constexpr int kBarWidth = 28;
constexpr double kPlainInterval = 5;  // seconds between plain lines

std::string line_of(const JobInfo& job, int percent) {
    const double rate = job.render_seconds > 0 ? double(job.camera_samples) / job.render_seconds : 0;
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
        std::snprintf(text, sizeof text, "  %.2f Msamples/s  %u worker%s", rate * 1e-6, job.worker_count,
                      job.worker_count == 1 ? "" : "s");
        line += text;
    }
    if (job.eta_seconds >= 0 && !is_terminal(job.state)) line += "  ETA " + duration_text(job.eta_seconds);
    return line;
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
    if (job.state == JobState::kSucceeded || job.state == JobState::kFinishing) return 100;
    double done = 0;
    if (job.unit_total > 0) done = double(job.unit_done) / double(job.unit_total);
    if (job.spec.time_limit_seconds > 0) done = job.render_seconds / job.spec.time_limit_seconds;
    return int(100 * std::min(done, 0.995));
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

std::string tables_line(const TablesInfo& tables) {
    const double learned = tables.classifier_seconds + tables.energy_seconds + tables.gamma_seconds;
    std::string line = "tables of " + std::to_string(tables.light_subspaces) + " x " + std::to_string(tables.eye_subspaces) +
                       " subspaces from " + std::to_string(tables.training_samples) + " training samples";
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

Progress::Progress(bool quiet) : quiet_(quiet), terminal_(::isatty(STDERR_FILENO) == 1) {}

Progress::~Progress() { finish(); }

void Progress::finish() {
    if (open_) std::fputc('\n', stderr);
    open_ = false;
}

void Progress::show(const JobInfo& job) {
    if (quiet_) return;
    const auto now = std::chrono::steady_clock::now();
    const double waited = std::chrono::duration<double>(now - last_).count();
    const bool new_state = !shown_ || job.state != state_;
    const bool new_phase = job.state == JobState::kPreparing && job.phase != phase_;
    phase_ = job.phase;
    const int percent = percent_of(job);
    shown_ = true;
    state_ = job.state;
    if (terminal_) {
        if (!new_state && !new_phase && waited < 0.1) return;
        last_ = now;
        if (new_state && job.state == JobState::kRunning && job.tables.asset.size_bytes > 0)
            std::fprintf(stderr, "\r\033[K%s\n", tables_line(job.tables).c_str());
        const int filled = percent * kBarWidth / 100;
        const std::string bar = std::string(size_t(filled), '=') + std::string(size_t(kBarWidth - filled), ' ');
        const bool waiting = job.state == JobState::kRunning && job.render_seconds == 0;
        const std::string text = job.state == JobState::kPreparing ? phase_line(job)
                                 : waiting                         ? "waiting for a worker"
                                                                   : line_of(job, percent);
        std::fprintf(stderr, "\r\033[K[%s] %s", bar.c_str(), text.c_str());
        std::fflush(stderr);
        open_ = true;
    } else if (job.state == JobState::kPreparing &&
               (new_phase || (waited >= kPlainInterval && (job.phase_total > 0 || job.eta_seconds >= 0)))) {
        last_ = now;
        std::fprintf(stderr, "%s\n", phase_line(job).c_str());
    } else if (new_state && job.state == JobState::kRunning && job.tables.asset.size_bytes > 0) {
        std::fprintf(stderr, "%s\n", tables_line(job.tables).c_str());
    } else if (job.state == JobState::kRunning && job.unit_done > 0 &&
               (percent >= last_percent_ + 10 || waited >= kPlainInterval)) {
        last_ = now;
        last_percent_ = percent;
        std::fprintf(stderr, "%s\n", line_of(job, percent).c_str());
    } else if (new_state && is_terminal(job.state)) {
        std::fprintf(stderr, "%s\n", line_of(job, percent).c_str());
    }
}

}  // namespace lightloom::client
