#include "server/unit_table.h"

#include <algorithm>

#include "common/core/rng.h"

namespace lightloom {

UnitTable::UnitTable(Plan plan, uint64_t iterations, uint32_t window, std::optional<uint64_t> shuffle_seed)
    : plan_(std::move(plan)),
      iterations_(iterations),
      window_(std::max(window, 1u)),
      shuffle_(shuffle_seed) {
    if (iterations_ > 0) {
        group_total_ = plan_.group_count(iterations_);
        unit_total_ = uint64_t(group_total_) * plan_.tile_count();
    }
}

uint64_t UnitTable::prefix(const Digest& digest) {
    uint64_t out = 0;
    for (int i = 0; i < 8; ++i) out = out << 8 | digest.bytes[size_t(i)];
    return out;
}

UnitTable::Entry* UnitTable::entry(const UnitKey& key) {
    if (key.group < merged_groups_ || key.group >= opened_groups() || !is_ours(key)) return nullptr;
    return &open_[key.group - merged_groups_][key.tile];
}

Group UnitTable::group(uint32_t index) const {
    Group out = plan_.group(index);
    if (iterations_ > 0) out.iteration_count = uint32_t(std::min<uint64_t>(out.iteration_count, iterations_ - out.first_iteration));
    return out;
}

std::optional<WorkUnit> UnitTable::find(const UnitKey& key) const {
    if (key.group >= opened_groups() || !is_ours(key)) return std::nullopt;
    if (key.group < merged_groups_) return plan_.units(group(key.group))[key.tile];
    return open_[key.group - merged_groups_][key.tile].unit;
}

bool UnitTable::open_group() {
    const uint32_t next = opened_groups();
    if (closed_ || next >= group_limit_ || open_.size() >= window_) return false;
    if (iterations_ > 0 && next >= group_total_) return false;
    open_next();
    return true;
}

void UnitTable::open_next() {
    const uint32_t next = opened_groups();
    std::vector<Entry>& entries = open_.emplace_back();
    for (const WorkUnit& unit : plan_.units(group(next))) {
        entries.push_back({.unit = unit});
        pending_.insert(unit.key);
    }
}

Status UnitTable::restore(uint32_t merged_groups, std::span<const Known> known) {
    const auto wrong = [](const UnitKey& key) {
        return data_loss("the saved result of group " + std::to_string(key.group) + ", tile " + std::to_string(key.tile) +
                         " is of no unit of the job");
    };
    uint32_t opened = merged_groups;
    std::vector<bool> merged(size_t(merged_groups) * tile_count());
    done_.resize(merged.size());
    for (const Known& result : known) {
        const UnitKey& key = result.unit;
        if (!is_ours(key) || (iterations_ > 0 && key.group >= group_total_) ||
            (key.group >= merged_groups && key.group - merged_groups >= kMostOpenGroups))
            return wrong(key);
        opened = std::max(opened, key.group + 1);
        if (key.group >= merged_groups) continue;
        const size_t index = size_t(key.group) * tile_count() + key.tile;
        merged[index] = true;
        done_[index] = {prefix(result.digest), result.worker};
    }
    if (const auto missing = std::find(merged.begin(), merged.end(), false); missing != merged.end())
        return data_loss("the saved results of the merged group " +
                         std::to_string(size_t(missing - merged.begin()) / tile_count()) + " are not complete");
    restored_ = true;
    merged_groups_ = merged_groups;
    done_count_ = merged.size();
    while (opened_groups() < opened) open_next();
    for (const Known& result : known)
        if (result.unit.group >= merged_groups) (void)complete(result.unit, result.worker, result.digest);
    return {};
}

void UnitTable::advance(uint32_t count) {
    for (; merged_groups_ < count && !open_.empty(); ++merged_groups_) {
        for (const Entry& e : open_.front()) done_.push_back({prefix(e.digest), e.lease.worker});
        open_.pop_front();
    }
}

bool UnitTable::has_more_than(size_t n) {
    if (closed_) return false;
    while (pending_.size() <= n) {
        if (!open_group()) return false;
    }
    return true;
}

std::optional<WorkUnit> UnitTable::lease(uint32_t worker, TimePoint now, TimePoint expiry, const AnyoneElse& anyone_else) {
    if (closed_) return std::nullopt;
    // A shuffled table first opens several groups, so that whole groups change their order, too.
    (void)has_more_than(shuffle_ ? 8 : 0);
    const auto end = pending_.lower_bound({group_limit_, 0});
    const ptrdiff_t count = std::distance(pending_.begin(), end);
    if (count == 0) return std::nullopt;
    auto chosen = pending_.begin();
    if (shuffle_) {
        *shuffle_ = mix64(*shuffle_ + 0x9e3779b97f4a7c15ull);
        std::advance(chosen, ptrdiff_t(*shuffle_ % uint64_t(count)));
    }
    // A broken worker must not take the same unit again and again while others could render it.
    const auto fresh = [&](const UnitKey& key) { return !entry(key)->failed_on.contains(worker); };
    if (!fresh(*chosen)) {
        if (const auto other = std::find_if(pending_.begin(), end, fresh); other != end) {
            chosen = other;
        } else if (anyone_else && anyone_else(entry(*chosen)->failed_on)) {
            return std::nullopt;
        }
    }
    Entry& e = *entry(*chosen);
    give(e, {.worker = worker, .leased = now, .expiry = expiry, .begun = {}});
    return e.unit;
}

bool UnitTable::has_suspect() {
    if (closed_ || pending_suspects_.empty()) return false;
    // An empty list of pending units may only mean that no group was opened yet.
    const bool others = pending_.size() + leased_.size() > 0 || has_more_than(0);
    return std::any_of(pending_suspects_.begin(), pending_suspects_.lower_bound({group_limit_, 0}),
                       [&](const UnitKey& key) { return suspicion_.may_run(key, done_count_, others); });
}

std::optional<WorkUnit> UnitTable::lease_suspect(uint32_t worker, TimePoint now, TimePoint expiry, const AnyoneElse& anyone_else) {
    if (!has_suspect()) return std::nullopt;
    const bool others = pending_.size() + leased_.size() > 0;
    for (const UnitKey& key : pending_suspects_) {
        if (key.group >= group_limit_ || !suspicion_.may_run(key, done_count_, others)) continue;
        Entry& e = *entry(key);
        if (e.failed_on.contains(worker) && anyone_else && anyone_else(e.failed_on)) continue;
        give(e, {.worker = worker, .leased = now, .expiry = expiry, .begun = {}, .alone = true});
        return e.unit;
    }
    return std::nullopt;
}

void UnitTable::give(Entry& e, const Lease& lease) {
    const UnitKey& key = e.unit.key;
    if (e.state == State::kPending) {
        pending_.erase(key);
        pending_suspects_.erase(key);
        e.state = State::kLeased;
        leased_.insert(key);
        ++leased_count_;
    }
    e.lease = lease;
    e.lease.ticket = ++tickets_;
    if (!e.done_before) e.done_before = done_count_;
}

bool UnitTable::has_copy(const UnitKey& key, uint32_t worker) const {
    const auto copy = copies_.find(key);
    return copy != copies_.end() && copy->second.worker == worker;
}

bool UnitTable::renew(const UnitKey& key, uint32_t worker, TimePoint now, TimePoint expiry) {
    Entry* e = entry(key);
    if (!e || e->state == State::kDone) return false;
    if (has_copy(key, worker)) {
        copies_.at(key).expiry = expiry;
        return true;
    }
    const bool holds = e->state == State::kLeased && e->lease.worker == worker;
    if (!holds && e->failed_on.contains(worker)) return false;  // it was taken from the worker
    suspicion_.returned(key, worker);
    if (e->state == State::kPending) {  // its lease had expired, but the worker is still alive
        Lease again = e->lease;
        // An earlier coordinator leased it, nobody knows when.
        if (again.ticket == 0) again.leased = now;
        if (again.ticket == 0 || again.worker != worker) again = {.worker = worker, .leased = again.leased, .begun = {}};
        give(*e, again);
    }
    if (e->lease.worker == worker) e->lease.expiry = expiry;
    return true;
}

void UnitTable::make_pending(Entry& e) {
    const UnitKey& key = e.unit.key;
    if (e.state == State::kLeased) {
        leased_.erase(key);
        --leased_count_;
    }
    e.state = State::kPending;
    if (key.group < group_limit_) (suspicion_.suspects(key) ? pending_suspects_ : pending_).insert(key);
}

void UnitTable::end_lease(Entry& e) {
    const auto copy = copies_.extract(e.unit.key);
    if (copy.empty()) {
        make_pending(e);
    } else {
        give(e, copy.mapped());
    }
}

void UnitTable::release(const UnitKey& key, uint32_t worker) {
    Entry* e = entry(key);
    if (!e || e->state != State::kLeased) return;
    if (has_copy(key, worker)) {
        copies_.erase(key);
    } else if (e->lease.worker == worker) {
        end_lease(*e);
    }
}

void UnitTable::release_all(uint32_t worker) {
    const std::set<UnitKey> leased = leased_;
    for (const UnitKey& key : leased) release(key, worker);
}

std::vector<UnitTable::Expired> UnitTable::expire(TimePoint now) {
    std::erase_if(copies_, [&](const auto& copy) { return copy.second.expiry < now; });
    std::vector<const Entry*> ended;
    for (const UnitKey& key : leased_) {
        if (const Entry& e = *entry(key); e.lease.expiry < now) ended.push_back(&e);
    }
    std::sort(ended.begin(), ended.end(), [](const Entry* a, const Entry* b) { return a->lease.ticket < b->lease.ticket; });
    std::vector<Expired> expired;
    for (const Entry* e : ended) expired.push_back({e->unit.key, e->lease.worker, e->lease.leased, e->lease.alone});
    for (const Expired& lease : expired) end_lease(*entry(lease.unit));
    return expired;
}

void UnitTable::open_for(const UnitKey& key) {
    while (restored_ && opened_groups() <= key.group && open_group()) continue;
}

bool UnitTable::is_held(const UnitKey& key, uint32_t worker) const {
    const Entry* const e = entry(key);
    return e && e->state == State::kLeased && (e->lease.worker == worker || has_copy(key, worker));
}

void UnitTable::limit_groups(uint32_t count) {
    group_limit_ = count;
    for (std::set<UnitKey>* const keys : {&pending_, &pending_suspects_}) keys->erase(keys->lower_bound({count, 0}), keys->end());
}

bool UnitTable::is_done(const UnitKey& key) const {
    if (key.group < merged_groups_) return is_ours(key);
    const Entry* const e = entry(key);
    return e && e->state == State::kDone;
}

std::optional<TimePoint> UnitTable::next_expiry() const {
    std::optional<TimePoint> next;
    const auto at_most = [&](TimePoint expiry) {
        if (!next || expiry < *next) next = expiry;
    };
    for (const UnitKey& key : leased_) at_most(entry(key)->lease.expiry);
    for (const auto& [key, copy] : copies_) at_most(copy.expiry);
    return next;
}

Suspicion::Verdict UnitTable::lose(const Expired& lease, const Suspicion::OthersFellSilent& others) {
    Entry* const e = entry(lease.unit);
    if (!e || e->state == State::kDone) return Suspicion::Verdict::kNothing;
    const bool are_others = pending_.size() + pending_suspects_.size() + leased_.size() > 1 || has_more_than(1);
    const bool contrast = done_count_ > e->done_before.value_or(0) || !are_others;
    const auto verdict =
        suspicion_.fell_silent(lease.unit, {lease.worker, lease.leased, lease.alone, contrast, done_count_}, others);
    if (e->state == State::kPending && suspicion_.suspects(lease.unit)) {
        pending_.erase(lease.unit);
        pending_suspects_.insert(lease.unit);
    }
    return verdict;
}

std::optional<TimePoint> UnitTable::rendering(const UnitKey& key, uint32_t worker, TimePoint now) {
    Entry* const e = entry(key);
    if (!e || e->state != State::kLeased) return std::nullopt;
    Lease* const lease = has_copy(key, worker) ? &copies_.at(key) : e->lease.worker == worker ? &e->lease : nullptr;
    if (!lease) return std::nullopt;
    if (!lease->begun) lease->begun = now;
    return lease->begun;
}

std::vector<UnitTable::InWork> UnitTable::in_work() const {
    std::vector<InWork> out;
    for (const UnitKey& key : leased_) {
        const Entry& e = *entry(key);
        out.push_back({e.unit, e.lease.worker, e.lease.leased, e.lease.begun, copies_.contains(key)});
    }
    return out;
}

std::optional<WorkUnit> UnitTable::copy(const UnitKey& key, uint32_t worker, TimePoint now, TimePoint expiry) {
    Entry* const e = entry(key);
    if (closed_ || key.group >= group_limit_ || !e || e->state != State::kLeased || e->lease.worker == worker || e->lease.alone ||
        suspicion_.suspects(key) || copies_.contains(key) || e->failed_on.contains(worker))
        return std::nullopt;
    copies_[key] = {.worker = worker, .leased = now, .expiry = expiry, .begun = {}};
    ++copies_made_;
    return e->unit;
}

UnitTable::Completion UnitTable::complete(const UnitKey& key, uint32_t worker, const Digest& digest) {
    if (key.group < merged_groups_ && is_ours(key)) {
        const Done& done = done_[size_t(key.group) * tile_count() + key.tile];
        return done.digest_prefix == prefix(digest) ? Completion::kDuplicateSame : Completion::kDuplicateDifferent;
    }
    Entry* e = entry(key);
    if (!e) return Completion::kUnknown;
    if (e->state == State::kDone) return e->digest == digest ? Completion::kDuplicateSame : Completion::kDuplicateDifferent;
    if (e->state == State::kLeased) {
        leased_.erase(key);
        --leased_count_;
    }
    pending_.erase(key);
    pending_suspects_.erase(key);
    copies_.erase(key);
    suspicion_.acquit(key);
    e->state = State::kDone;
    e->lease.worker = worker;
    e->digest = digest;
    ++done_count_;
    return Completion::kFirst;
}

UnitTable::Failures UnitTable::reopen(const UnitKey& key) {
    Entry* e = entry(key);
    if (!e || e->state != State::kDone) return {};
    --done_count_;
    make_pending(*e);
    // Its result counted as a success.
    FailedOn& by = e->failed_on[e->lease.worker];
    by.before = ++by.times;
    ++e->failures;
    return failures_of(*e);
}

UnitTable::Failures UnitTable::fail(const UnitKey& key, uint32_t worker, uint64_t successes) {
    Entry* e = entry(key);
    if (!e || e->state == State::kDone) return {};
    release(key, worker);
    FailedOn& by = e->failed_on[worker];
    if (successes > by.successes) by.before = by.times;
    ++by.times;
    by.successes = successes;
    ++e->failures;
    return failures_of(*e);
}

std::vector<UnitTable::Merged> UnitTable::merged() const {
    std::vector<Merged> out;
    out.reserve(done_.size());
    for (size_t i = 0; i < done_.size(); ++i)
        out.push_back({{uint32_t(i / tile_count()), uint32_t(i % tile_count())}, done_[i].worker});
    return out;
}

}  // namespace lightloom
