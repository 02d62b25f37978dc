#include "server/table_ledger.h"

#include <algorithm>

namespace lightloom {

void TableLedger::make(JobNumber job, const Digest& key) {
    stop_making(job);
    makes_.emplace(job, key);
    makers_[key].insert(job);
}

void TableLedger::stop_making(JobNumber job) {
    const auto known = makes_.find(job);
    if (known == makes_.end()) return;
    const auto makers = makers_.find(known->second);
    makers->second.erase(job);
    if (makers->second.empty()) makers_.erase(makers);
    makes_.erase(known);
}

std::optional<TableLedger::JobNumber> TableLedger::maker_of(const Digest& key, JobNumber but) const {
    const auto makers = makers_.find(key);
    if (makers == makers_.end()) return std::nullopt;
    const auto other = std::find_if(makers->second.begin(), makers->second.end(), [&](JobNumber job) { return job != but; });
    return other == makers->second.end() ? std::nullopt : std::optional(*other);
}

void TableLedger::wait(JobNumber job, JobNumber maker) {
    stop_making(job);
    stop_waiting(job);
    waits_[job] = maker;
    crowd_[maker].insert(job);
}

void TableLedger::stop_waiting(JobNumber job) {
    const auto known = waits_.find(job);
    if (known == waits_.end()) return;
    const auto crowd = crowd_.find(known->second);
    crowd->second.erase(job);
    if (crowd->second.empty()) crowd_.erase(crowd);
    waits_.erase(known);
}

std::optional<TableLedger::JobNumber> TableLedger::waits_for(JobNumber job) const {
    const auto known = waits_.find(job);
    return known == waits_.end() ? std::nullopt : std::optional(known->second);
}

std::vector<TableLedger::JobNumber> TableLedger::waiting_for(JobNumber maker) const {
    const auto crowd = crowd_.find(maker);
    return crowd == crowd_.end() ? std::vector<JobNumber>() : std::vector<JobNumber>(crowd->second.begin(), crowd->second.end());
}

TableLedger::JobNumber TableLedger::maker_of_last_resort(JobNumber job) const {
    for (auto next = waits_for(job); next; next = waits_for(job)) job = *next;
    return job;
}

void TableLedger::pin(JobNumber job, const Digest& file) {
    if (file == Digest()) return;
    pins_[file].insert(job);
    files_[job].insert(file);
}

bool TableLedger::unpin(JobNumber job, const Digest& file) {
    const auto pins = pins_.find(file);
    if (pins == pins_.end() || pins->second.erase(job) == 0) return false;
    const auto files = files_.find(job);
    files->second.erase(file);
    if (files->second.empty()) files_.erase(files);
    if (!pins->second.empty()) return false;
    pins_.erase(pins);
    return true;
}

std::set<Digest> TableLedger::pinned_files() const {
    std::set<Digest> files;
    for (const auto& [file, jobs] : pins_) files.insert(file);
    return files;
}

std::vector<Digest> TableLedger::forget(JobNumber job) {
    stop_making(job);
    stop_waiting(job);
    std::vector<Digest> needless;
    const auto files = files_.find(job);
    if (files == files_.end()) return needless;
    const std::set<Digest> pinned = files->second;
    for (const Digest& file : pinned)
        if (unpin(job, file)) needless.push_back(file);
    return needless;
}

}  // namespace lightloom
