#include "server/suspicion.h"

#include <algorithm>

namespace lightloom {

Suspicion::Verdict Suspicion::fell_silent(const UnitKey& unit, const Silence& silence, const OthersFellSilent& others) {
    Trial& trial = units_[unit];
    const bool on_trial = trial.suspect() && silence.alone;
    trial.lost.insert(silence.worker);
    trial.contrast = trial.contrast || silence.contrast;
    if (on_trial) {
        if (trial.alone.empty()) trial.first_run = silence.leased;
        trial.alone.insert(silence.worker);
        // A worker that falls silent elsewhere meanwhile shows that hosts go down by themselves; the trial begins anew.
        if (others(trial.alone, trial.first_run)) trial.alone.clear();
        trial.results = silence.results;
    }
    if (trial.alone.size() >= kMaxLostAlone) return Verdict::kGuilty;
    return trial.suspect() ? Verdict::kSuspect : Verdict::kNothing;
}

void Suspicion::returned(const UnitKey& unit, uint32_t worker) {
    const auto known = units_.find(unit);
    if (known == units_.end()) return;
    known->second.lost.erase(worker);
    known->second.alone.erase(worker);
    if (known->second.lost.empty()) units_.erase(known);
}

const Suspicion::Trial* Suspicion::find(const UnitKey& unit) const {
    const auto known = units_.find(unit);
    return known == units_.end() ? nullptr : &known->second;
}

bool Suspicion::suspects(const UnitKey& unit) const {
    const Trial* const trial = find(unit);
    return trial && trial->suspect();
}

bool Suspicion::may_run(const UnitKey& unit, uint64_t results, bool are_others) const {
    const Trial* const trial = find(unit);
    return !trial || trial->alone.empty() || !trial->contrast || !are_others || results > trial->results;
}

bool Suspicion::holds_back_others(uint32_t group_limit) const {
    return std::any_of(units_.begin(), units_.end(), [group_limit](const auto& u) {
        return u.first.group < group_limit && u.second.suspect() && !u.second.contrast;
    });
}

std::set<uint32_t> Suspicion::lost(const UnitKey& unit) const {
    const Trial* const trial = find(unit);
    return trial ? trial->lost : std::set<uint32_t>();
}

std::set<uint32_t> Suspicion::lost_alone(const UnitKey& unit) const {
    const Trial* const trial = find(unit);
    return trial ? trial->alone : std::set<uint32_t>();
}

}  // namespace lightloom
