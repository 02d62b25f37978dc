#include "server/job_book.h"

#include <algorithm>

namespace lightloom {
namespace {

template <class Key>
JobPtr find_in(const std::map<Key, JobPtr>& jobs, const Key& key) {
    const auto known = jobs.find(key);
    return known == jobs.end() ? nullptr : known->second;
}

}  // namespace

JobPtr JobBook::add(Job job, const std::optional<Digest>& reuse_key) {
    auto file = std::make_shared<JobFile>(std::move(job), next_++, reuse_key);
    jobs_.emplace(file->number, file);
    open_.emplace(file->number, file);
    ids_.emplace(file->job.id(), file);
    requests_.emplace(file->job.submission().request_id, file);
    if (reuse_key) same_.emplace(*reuse_key, file);  // an earlier one stays: it is further
    return file;
}

JobPtr JobBook::find(const std::string& id) const { return find_in(ids_, id); }
JobPtr JobBook::find(uint64_t number) const { return find_in(jobs_, number); }
JobPtr JobBook::find_request(const std::string& request_id) const { return find_in(requests_, request_id); }

JobPtr JobBook::find_same(const Digest& reuse_key) const { return find_in(same_, reuse_key); }

void JobBook::withdraw(const JobFile& file) {
    if (!file.reuse_key) return;
    const auto known = same_.find(*file.reuse_key);
    if (known != same_.end() && known->second.get() == &file) same_.erase(known);
}

void JobBook::job_ended(const JobFile& file) {
    auto node = open_.extract(file.number);
    if (node.empty()) return;
    if (!file.job.gave_all())
        withdraw(file);
    else if (file.reuse_key)
        same_[*file.reuse_key] = node.mapped();
    ended_.insert(std::move(node));
}

std::vector<JobPtr> JobBook::forget_ended(size_t kept) {
    std::vector<JobPtr> forgotten;
    for (auto next = ended_.begin(); next != ended_.end() && ended_.size() > kept;) {
        const JobPtr file = next->second;
        if (file->running_tasks > 0) {
            ++next;
            continue;
        }
        next = ended_.erase(next);
        jobs_.erase(file->number);
        ids_.erase(file->job.id());
        requests_.erase(file->job.submission().request_id);
        withdraw(*file);
        forgotten.push_back(file);
    }
    return forgotten;
}

JobPtr JobBook::in_its_place(const JobPtr& file) const {
    const uint64_t maker = ledger.maker_of_last_resort(file->number);
    return maker == file->number ? file : find(maker);
}

JobInfo JobBook::info(const JobFile& file, TimePoint now) const {
    std::optional<Job::WaitsFor> waits_for;
    if (const auto number = ledger.waits_for(file.number)) {
        const JobPtr maker = find(*number);
        waits_for = {maker->job.id(), info(*maker, now).eta_seconds};
    }
    JobInfo out = file.job.info(now, waits_for);
    if (is_terminal(out.state)) return out;
    if (!paused.empty()) {
        out.message = "paused: " + paused;
    } else if (const std::string why = workers.why_nobody_can(out.job_id, now); !why.empty() && file.job.open_units()) {
        out.message = "waits for its workers: " + why;
    }
    return out;
}

void JobBook::wake_one_waiter(std::list<Waiter*>::iterator from) {
    const auto next = std::find_if(from, waiters.end(), [](const Waiter* waiter) { return !waiter->look; });
    if (next == waiters.end()) return;
    (*next)->look = true;
    (*next)->woken.notify_one();
}

JobBook::Returned JobBook::take_back(const std::string& worker_id, const UnitReference& unit) {
    WorkerRecord* const worker = workers.find(worker_id);
    if (!worker) return {};
    worker->lets_go(unit);
    const JobPtr file = find(unit.job_id);
    return {worker, file, file ? file->job.open_units(unit.key) : nullptr};
}

void JobBook::wake_all_waiters() {
    for (Waiter* waiter : waiters) {
        waiter->look = true;
        waiter->woken.notify_one();
    }
}

}  // namespace lightloom
