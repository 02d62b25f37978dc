#include "server/worker_registry.h"

#include <algorithm>
#include <cmath>

namespace lightloom {
namespace {

constexpr size_t kMaxRefused = 32;
/// What is left of the weight of a unit in a worker's pace with every later one.
constexpr double kPaceDecay = 0.8;

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

bool WorkerRegistry::anyone_else(const std::set<uint32_t>& workers, TimePoint now) const {
    return std::any_of(workers_.begin(), workers_.end(), [&](const auto& w) {
        return !lost(*w.second, now) && now >= w.second->rests_until && !workers.contains(w.first);
    });
}

void WorkerRegistry::unit_failed(WorkerRecord& worker, TimePoint now) {
    const int repeated = worker.failures_in_a_row++;
    if (repeated > 0) worker.rests_until = seconds_after(now, std::min(60.0, std::ldexp(1.0, std::min(repeated - 1, 6))));
}

bool WorkerRegistry::rests(const WorkerRecord& worker, TimePoint now) const {
    return now < worker.rests_until && anyone_else({worker.index}, now);
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
    return rests(worker, now) ? WorkerState::kResting : WorkerState::kIdle;
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
        if (status.state == WorkerState::kResting)
            status.note = "failed " + std::to_string(w->failures_in_a_row) + " units in a row";
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
