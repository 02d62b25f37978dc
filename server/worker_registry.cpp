#include "server/worker_registry.h"

#include <algorithm>
#include <cmath>

namespace lightloom {

WorkerRecord& WorkerRegistry::add(const WorkerHello& hello, TimePoint now) {
    auto worker = std::make_unique<WorkerRecord>();
    worker->index = uint32_t(workers_.size());
    worker->id = "worker-" + std::to_string(worker->index + 1) + "-" + hello.host + "-" + std::to_string(hello.process_id);
    worker->hello = hello;
    worker->last_heard = now;
    indices_.emplace(worker->id, worker->index);
    workers_.push_back(std::move(worker));
    return *workers_.back();
}

WorkerRecord* WorkerRegistry::find(const std::string& id) const {
    const auto known = indices_.find(id);
    if (known == indices_.end()) return nullptr;
    WorkerRecord* const worker = workers_[known->second].get();
    return worker->left ? nullptr : worker;
}

size_t WorkerRegistry::idle() const {
    return size_t(std::count_if(workers_.begin(), workers_.end(), [](const auto& w) { return w->held.empty() && w->waiting > 0; }));
}

WorkerRegistry::Crew WorkerRegistry::crew(TimePoint now) const {
    Crew crew;
    for (const auto& worker : workers_) {
        if (lost(*worker, now)) continue;
        ++crew.workers;
        crew.most_threads = std::max(crew.most_threads, worker->hello.thread_count);
    }
    return crew;
}

bool WorkerRegistry::anyone_else(const std::set<uint32_t>& workers, TimePoint now) const {
    return std::any_of(workers_.begin(), workers_.end(),
                       [&](const auto& w) { return !lost(*w, now) && now >= w->rests_until && !workers.contains(w->index); });
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

std::vector<WorkerStatus> WorkerRegistry::statuses(TimePoint now) const {
    std::vector<WorkerStatus> out;
    for (const auto& w : workers_)
        out.push_back({w->id, w->hello.host, w->hello.process_id, w->hello.thread_count, w->merged, w->held.size(),
                       seconds_between(w->last_heard, now), lost(*w, now)});
    return out;
}

}  // namespace lightloom
