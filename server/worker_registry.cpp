#include "server/worker_registry.h"

#include <algorithm>
#include <cmath>

namespace lightloom {
namespace {

constexpr size_t kMaxRefused = 32;
/// What is left of the weight of a unit in a worker's pace with every later one.
constexpr double kPaceDecay = 0.8;
/// What a worker lacked for a job is forgotten so many seconds after its rest.
constexpr double kLackForgotten = 600;
/// Most hosts that a message names.
constexpr size_t kNamedHosts = 3;

/// 1, 2, 4, ... and at most 60 s.
double rest_seconds(int times) { return std::min(60.0, std::ldexp(1.0, std::min(times - 1, 6))); }

}  // namespace

void WorkerRecord::delivered(const std::string& job_id, double samples, double seconds) {
    if (!(seconds > 0 && std::isfinite(seconds))) return;  // it comes from the worker
    if (pace.job != job_id) pace = {job_id, 0, 0};         // samples of another algorithm or scene cost something else
    pace.samples = kPaceDecay * pace.samples + samples;
    pace.seconds = kPaceDecay * pace.seconds + seconds;
}

void WorkerRegistry::refuse(const WorkerHello& hello, const std::string& why, TimePoint now) {
    // Whoever starts a worker again and again sees it once.
    std::erase_if(refused_, [&](const Refused& r) { return r.hello.host == hello.host && r.why == why; });
    if (refused_.size() == kMaxRefused) refused_.pop_front();
    refused_.push_back({hello, why, now});
}

WorkerRecord& WorkerRegistry::insert(uint32_t index, const WorkerHello& hello) {
    auto worker = std::make_unique<WorkerRecord>();
    worker->index = index;
    worker->id = "worker-" + std::to_string(index + 1) + "-" + hello.host + "-" + std::to_string(hello.process_id);
    worker->hello = hello;
    indices_.emplace(worker->id, index);
    return *(workers_[index] = std::move(worker));
}

WorkerRecord& WorkerRegistry::add(const WorkerHello& hello, TimePoint now) {
    WorkerRecord& worker = insert(workers_.empty() ? 0 : workers_.rbegin()->first + 1, hello);
    worker.last_heard = now;
    std::erase_if(refused_, [&](const Refused& r) { return r.hello.host == hello.host; });
    return worker;
}

void WorkerRegistry::restore(uint32_t index, const WorkerHello& hello) {
    if (!workers_.contains(index)) insert(index, hello).left = true;
}

WorkerRecord* WorkerRegistry::find(const std::string& id) const {
    const auto known = indices_.find(id);
    if (known == indices_.end()) return nullptr;
    WorkerRecord* const worker = workers_.at(known->second).get();
    return worker->left ? nullptr : worker;
}

size_t WorkerRegistry::idle() const {
    return size_t(std::count_if(workers_.begin(), workers_.end(),
                                [](const auto& w) { return w.second->held.empty() && w.second->waiting > 0; }));
}

WorkerRegistry::Crew WorkerRegistry::crew(TimePoint now) const {
    Crew crew;
    for (const auto& [index, worker] : workers_) {
        if (lost(*worker, now)) continue;
        ++crew.workers;
        crew.most_threads = std::max(crew.most_threads, worker->hello.thread_count);
    }
    return crew;
}

bool WorkerRegistry::anyone_there(const std::function<bool(const WorkerRecord&)>& but, TimePoint now) const {
    return std::any_of(workers_.begin(), workers_.end(), [&](const auto& w) { return !lost(*w.second, now) && !but(*w.second); });
}

bool WorkerRegistry::anyone_else(const std::function<bool(const WorkerRecord&)>& but, TimePoint now) const {
    return anyone_there([&](const WorkerRecord& w) { return now < w.rests_until || but(w); }, now);
}

void WorkerRegistry::unit_failed(WorkerRecord& worker, const std::string& why, TimePoint now) {
    const int repeated = worker.failures_in_a_row++;
    if (repeated > 0) worker.rests_until = seconds_after(now, rest_seconds(repeated));
    worker.trouble = why;
}

void WorkerRegistry::lacks(WorkerRecord& worker, const std::string& job_id, const std::string& what, TimePoint now) {
    // Those of jobs that have ended meanwhile.
    std::erase_if(worker.lacks, [&](const auto& lack) { return seconds_between(lack.second.until, now) > kLackForgotten; });
    WorkerRecord::Lack& lack = worker.lacks[job_id];
    lack.what = what;
    lack.until = seconds_after(now, rest_seconds(++lack.times));
}

void WorkerRegistry::unit_succeeded(WorkerRecord& worker, const std::string& job_id) {
    ++worker.successes;
    worker.failures_in_a_row = 0;
    worker.doubted = false;
    worker.lacks.erase(job_id);
}

bool WorkerRegistry::rests(const WorkerRecord& worker, TimePoint now) const {
    return now < worker.rests_until &&
           (worker.doubted || anyone_else([&](const WorkerRecord& w) { return w.index == worker.index; }, now));
}

bool WorkerRegistry::rests_from(const WorkerRecord& worker, const std::string& job_id, TimePoint now) {
    const auto lack = worker.lacks.find(job_id);
    return lack != worker.lacks.end() && now < lack->second.until;
}

std::string WorkerRegistry::why_nobody_can(const std::string& job_id, TimePoint now) const {
    size_t there = 0;
    std::string why;
    for (const auto& [index, worker] : workers_) {
        if (lost(*worker, now)) continue;
        const auto lack = worker->lacks.find(job_id);
        const bool lacks = lack != worker->lacks.end();
        if (!lacks && !worker->doubted) return {};
        if (++there > kNamedHosts) continue;
        why += (there > 1 ? "; " : "") + worker->hello.host + " (" + worker->id +
               "): " + (lacks ? lack->second.what : worker->trouble);
    }
    if (there > kNamedHosts) why += "; and " + std::to_string(there - kNamedHosts) + " more";
    return why;
}

bool WorkerRegistry::others_fell_silent(const std::set<uint32_t>& but, TimePoint since, TimePoint now) const {
    return std::any_of(workers_.begin(), workers_.end(), [&](const auto& w) {
        // A worker is last heard of up to a heartbeat, a quarter of a lease at most, before it dies.
        return !w.second->left && !but.contains(w.first) &&
               seconds_between(since, w.second->last_heard) >= -0.25 * lease_seconds_ &&
               seconds_between(w.second->last_heard, now) >= 0.5 * lease_seconds_;
    });
}

bool WorkerRegistry::fell_silent(uint32_t index, TimePoint now) {
    WorkerRecord& worker = at(index);
    if (worker.left || worker.blamed == worker.last_heard || seconds_between(worker.last_heard, now) < 0.5 * lease_seconds_)
        return false;
    worker.blamed = worker.last_heard;
    return true;
}

WorkerState WorkerRegistry::state(const WorkerRecord& worker, TimePoint now) const {
    if (lost(worker, now)) return WorkerState::kGone;
    if (!worker.held.empty()) return WorkerState::kBusy;
    const bool lacks = std::any_of(worker.lacks.begin(), worker.lacks.end(), [&](const auto& l) { return now < l.second.until; });
    return lacks || rests(worker, now) ? WorkerState::kResting : WorkerState::kIdle;
}

std::vector<WorkerStatus> WorkerRegistry::statuses(TimePoint now, double gone_within_seconds) const {
    std::vector<WorkerStatus> out;
    for (const auto& [index, w] : workers_) {
        if (w->left && w->last_heard == TimePoint()) continue;  // it left before this coordinator began
        WorkerStatus status{.worker_id = w->id,
                            .host = w->hello.host,
                            .process_id = w->hello.process_id,
                            .thread_count = w->hello.thread_count,
                            .state = state(*w, now),
                            .note = {},
                            .in_work = {},
                            .units_merged = w->merged,
                            .units_held = w->held.size(),
                            .samples_per_second = w->pace.seconds > 0 ? w->pace.samples / w->pace.seconds : 0,
                            .seconds_since_heard = seconds_between(w->last_heard, now)};
        if (status.state == WorkerState::kGone) {
            if (status.seconds_since_heard > gone_within_seconds) continue;
            status.note = w->left ? "left" : "fell silent";
        } else if (w->in_work && w->held.contains(*w->in_work)) {
            status.in_work = w->in_work;
        }
        if (status.state == WorkerState::kResting) {
            const auto lack = std::find_if(w->lacks.begin(), w->lacks.end(), [&](const auto& l) { return now < l.second.until; });
            status.note =
                lack != w->lacks.end() ? lack->second.what : "failed " + std::to_string(w->failures_in_a_row) + " units in a row";
        }
        out.push_back(std::move(status));
    }
    for (const Refused& r : refused_) {
        const double seconds = seconds_between(r.when, now);
        if (seconds > gone_within_seconds) continue;
        out.push_back({.worker_id = {},
                       .host = r.hello.host,
                       .process_id = r.hello.process_id,
                       .thread_count = r.hello.thread_count,
                       .state = WorkerState::kRefused,
                       .note = r.why,
                       .in_work = {},
                       .seconds_since_heard = seconds});
    }
    return out;
}

}  // namespace lightloom
