#include "server/unit_table.h"

#include <algorithm>

#include "common/core/rng.h"

namespace lightloom {

UnitTable::UnitTable(Plan plan, uint64_t iterations, uint32_t window, std::optional<uint64_t> shuffle_seed)
    : plan_(std::move(plan)), iterations_(iterations), window_(std::max(window, 1u)), shuffle_(shuffle_seed) {
    if (iterations_ > 0) {
        group_total_ = uint32_t(plan_.groups_for(iterations_).size());
        unit_total_ = uint64_t(group_total_) * plan_.tile_count();
    }
}

UnitTable::Entry* UnitTable::entry(const UnitKey& key) {
    if (key.group >= groups_.size() || key.tile >= groups_[key.group].size()) return nullptr;
    return &groups_[key.group][key.tile];
}

const WorkUnit* UnitTable::find(const UnitKey& key) const {
    const Entry* e = const_cast<UnitTable*>(this)->entry(key);
    return e ? &e->unit : nullptr;
}

bool UnitTable::open_group() {
    if (closed_ || groups_.size() >= group_limit_ || groups_.size() >= size_t(merged_groups_) + window_) return false;
    if (iterations_ > 0 && opened_iterations_ >= iterations_) return false;
    Group group = plan_.group(uint32_t(groups_.size()));
    if (iterations_ > 0)
        group.iteration_count = uint32_t(std::min<uint64_t>(group.iteration_count, iterations_ - opened_iterations_));
    opened_iterations_ += group.iteration_count;
    std::vector<Entry>& entries = groups_.emplace_back();
    for (const WorkUnit& unit : plan_.units(group)) {
        entries.push_back({.unit = unit});
        pending_.insert(unit.key);
    }
    return true;
}

bool UnitTable::has_more_than(size_t n) {
    if (closed_) return false;
    while (pending_.size() <= n) {
        if (!open_group()) return false;
    }
    return true;
}

std::optional<WorkUnit> UnitTable::lease(uint32_t worker, TimePoint expiry) {
    if (closed_) return std::nullopt;
    // A shuffled table first opens several groups, so that whole groups change places too.
    (void)has_more_than(shuffle_ ? 8 : 0);
    const auto end = pending_.lower_bound({group_limit_, 0});
    const ptrdiff_t count = std::distance(pending_.begin(), end);
    if (count == 0) return std::nullopt;
    auto chosen = pending_.begin();
    if (shuffle_) {
        *shuffle_ = mix64(*shuffle_ + 0x9e3779b97f4a7c15ull);
        std::advance(chosen, ptrdiff_t(*shuffle_ % uint64_t(count)));
    }
    // One broken worker must not take the same unit again and again while others could render it.
    const auto fresh = [&](const UnitKey& key) { return !entry(key)->failed_on.contains(worker); };
    if (!fresh(*chosen)) {
        const auto other = std::find_if(pending_.begin(), end, fresh);
        if (other != end) chosen = other;
    }
    Entry& e = *entry(*chosen);
    pending_.erase(chosen);
    leased_.insert(e.unit.key);
    e.state = State::kLeased;
    e.worker = worker;
    e.expiry = expiry;
    ++leased_count_;
    return e.unit;
}

bool UnitTable::renew(const UnitKey& key, uint32_t worker, TimePoint expiry) {
    Entry* e = entry(key);
    if (!e || e->state == State::kDone) return false;
    if (e->state == State::kPending) {  // its lease had run out, but the worker lives after all
        pending_.erase(key);
        leased_.insert(key);
        e->state = State::kLeased;
        e->worker = worker;
        ++leased_count_;
    }
    if (e->worker == worker) e->expiry = expiry;
    return true;
}

void UnitTable::make_pending(Entry& e) {
    if (e.state == State::kLeased) {
        leased_.erase(e.unit.key);
        --leased_count_;
    }
    e.state = State::kPending;
    pending_.insert(e.unit.key);
}

void UnitTable::release(const UnitKey& key, uint32_t worker) {
    Entry* e = entry(key);
    if (e && e->state == State::kLeased && e->worker == worker) make_pending(*e);
}

void UnitTable::release_all(uint32_t worker) {
    const std::set<UnitKey> leased = leased_;
    for (const UnitKey& key : leased) release(key, worker);
}

size_t UnitTable::expire(TimePoint now) {
    std::vector<UnitKey> expired;
    for (const UnitKey& key : leased_) {
        if (entry(key)->expiry < now) expired.push_back(key);
    }
    for (const UnitKey& key : expired) make_pending(*entry(key));
    return expired.size();
}

UnitTable::Completion UnitTable::complete(const UnitKey& key, uint32_t worker, const Digest& digest) {
    Entry* e = entry(key);
    if (!e) return Completion::kUnknown;
    if (e->state == State::kDone)
        return e->digest == digest ? Completion::kDuplicateSame : Completion::kDuplicateDifferent;
    if (e->state == State::kLeased) {
        leased_.erase(key);
        --leased_count_;
    }
    pending_.erase(key);
    e->state = State::kDone;
    e->worker = worker;
    e->digest = digest;
    ++done_count_;
    return Completion::kFirst;
}

UnitTable::Failures UnitTable::reopen(const UnitKey& key) {
    Entry* e = entry(key);
    if (!e || e->state != State::kDone) return {};
    --done_count_;
    make_pending(*e);
    e->failed_on.insert(e->worker);
    return {++e->failures, int(e->failed_on.size())};
}

UnitTable::Failures UnitTable::fail(const UnitKey& key, uint32_t worker) {
    Entry* e = entry(key);
    if (!e || e->state == State::kDone) return {};
    release(key, worker);
    e->failed_on.insert(worker);
    return {++e->failures, int(e->failed_on.size())};
}

std::vector<UnitTable::Merged> UnitTable::merged(uint32_t groups) const {
    std::vector<Merged> out;
    for (uint32_t g = 0; g < groups && g < groups_.size(); ++g) {
        for (const Entry& e : groups_[g]) out.push_back({e.unit, e.worker});
    }
    return out;
}

}  // namespace lightloom
