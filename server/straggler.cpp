#include "server/straggler.h"

#include <algorithm>
#include <map>

namespace lightloom {
namespace {

/// Seconds from now until the worker is done with a unit that it renders. One that it should be done with, or of which nothing is
/// known, takes as long again as it took beyond that: what has lasted long lasts long.
double seconds_left(double expected, double taken) { return std::max(expected - taken, expected > 0 ? taken - expected : taken); }

}  // namespace

double samples_of(const WorkUnit& unit) {
    if (unit.key.kind != UnitKind::kRender) return double(unit.training.sample_count);
    const double camera = double(unit.render.tile.area()) * unit.render.samples_per_pixel();
    return camera > 0 ? camera : double(unit.render.light_path_count);
}

double longest_seconds(const WorkUnit& unit, double pace, const TimeBounds& bounds) {
    if (!(pace > 0)) return bounds.seconds_without_pace;
    return std::max(bounds.least_seconds, bounds.factor * samples_of(unit) / pace);
}

bool may_copy(const UnitTable& units) {
    const uint64_t known = std::max(units.unit_total(), units.done_count() + units.leased_count());
    return units.copies() == 0 || double(units.copies_made()) < kCopyShare * double(known);
}

std::vector<UnitKey> worth_copying(const UnitTable& units, const std::string& job_id, const WorkerRegistry& workers, double pace,
                                   TimePoint now) {
    if (!(pace > 0)) return {};
    const std::vector<UnitTable::InWork> in_work = units.in_work();
    // A worker renders one unit at a time; another one that it holds waits for this one.
    std::map<uint32_t, double> busy;
    const auto expected = [&](const UnitTable::InWork& item) {
        const double own = workers.at(item.worker).samples_per_second(job_id);
        return own > 0 ? samples_of(item.unit) / own : 0;
    };
    for (const UnitTable::InWork& item : in_work)
        if (item.begun)
            busy[item.worker] = std::max(busy[item.worker], seconds_left(expected(item), seconds_between(*item.begun, now)));
    struct Late {
        UnitKey unit;
        double seconds;
    };
    std::vector<Late> late;
    for (const UnitTable::InWork& item : in_work) {
        if (item.copied) continue;
        const double seconds = item.begun ? seconds_left(expected(item), seconds_between(*item.begun, now))
                                          : busy[item.worker] + std::max(expected(item), seconds_between(item.leased, now));
        if (samples_of(item.unit) / pace < kCopyGain * seconds) late.push_back({item.unit.key, seconds});
    }
    std::stable_sort(late.begin(), late.end(), [](const Late& a, const Late& b) { return a.seconds > b.seconds; });
    std::vector<UnitKey> keys;
    for (const Late& unit : late) keys.push_back(unit.unit);
    return keys;
}

}  // namespace lightloom
