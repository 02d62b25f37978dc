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
        for (const Entry& e : open_.front()) done_.push_back({prefix(e.digest), e.worker});
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

std::optional<WorkUnit> UnitTable::lease(uint32_t worker, TimePoint expiry, const AnyoneElse& anyone_else) {
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
    pending_.erase(chosen);
    leased_.insert(e.unit.key);
    e.state = State::kLeased;
    e.worker = worker;
    e.expiry = expiry;
    e.ticket = ++tickets_;
    ++leased_count_;
    return e.unit;
}

bool UnitTable::renew(const UnitKey& key, uint32_t worker, TimePoint expiry) {
    Entry* e = entry(key);
    if (!e || e->state == State::kDone) return false;
    if (e->state == State::kPending) {  // its lease had expired, but the worker is still alive
        pending_.erase(key);
        leased_.insert(key);
        e->state = State::kLeased;
        e->worker = worker;
        e->ticket = ++tickets_;
        ++leased_count_;
    }
    e->lost_with.erase(worker);
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

std::vector<UnitTable::Expired> UnitTable::expire(TimePoint now) {
    std::vector<Expired> expired;
    for (const UnitKey& key : leased_) {
        if (const Entry& e = *entry(key); e.expiry < now) expired.push_back({key, e.worker});
    }
    std::sort(expired.begin(), expired.end(),
              [&](const Expired& a, const Expired& b) { return entry(a.unit)->ticket < entry(b.unit)->ticket; });
    for (const Expired& lease : expired) make_pending(*entry(lease.unit));
    return expired;
}

void UnitTable::open_for(const UnitKey& key) {
    while (restored_ && opened_groups() <= key.group && open_group()) continue;
}

bool UnitTable::is_done(const UnitKey& key) const {
    if (key.group < merged_groups_) return is_ours(key);
    const Entry* const e = entry(key);
    return e && e->state == State::kDone;
}

std::optional<TimePoint> UnitTable::next_expiry() const {
    std::optional<TimePoint> next;
    for (const UnitKey& key : leased_) {
        const TimePoint expiry = entry(key)->expiry;
        if (!next || expiry < *next) next = expiry;
    }
    return next;
}

std::set<uint32_t> UnitTable::lose(const UnitKey& key, uint32_t worker) {
    Entry* e = entry(key);
    if (!e || e->state == State::kDone) return {};
    e->lost_with.insert(worker);
    return e->lost_with;
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

std::vector<UnitTable::Merged> UnitTable::merged() const {
    std::vector<Merged> out;
    out.reserve(done_.size());
    for (size_t i = 0; i < done_.size(); ++i)
        out.push_back({{uint32_t(i / tile_count()), uint32_t(i % tile_count())}, done_[i].worker});
    return out;
}

}  // namespace lightloom
