#pragma once
// What the kill loop has done and seen, over all phases and, through a file, over several runs.

#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "common/core/result.h"

namespace lightloom::chaos {

/// What a coordinator did not always promise. kBlame is expected to hold; the others are met and counted until the loop is told to
/// expect better.
enum class Limit {
    kDurable,  ///< A coordinator that died has lost an accepted job.
    kBlame,    ///< A job failed because of workers that died or had no room, although its units are sound.
    kHealing,  ///< A damaged file of the coordinator failed a job, or had to be removed by hand.
    kLog,      ///< No job made progress while nobody read the coordinator's log.
};
inline constexpr const char* kLimitNames[] = {"durable", "blame", "healing", "log"};
inline constexpr size_t kLimits = std::size(kLimitNames);

struct Ledger {
    uint64_t phases = 0, images = 0;
    uint64_t worker_kills = 0, worker_stops = 0, server_kills = 0, server_stops = 0, full_disks = 0, damaged_files = 0;
    uint64_t worker_crashes = 0, server_crashes = 0;  ///< Deaths at crash points.
    uint64_t resubmissions = 0;
    uint64_t ended_early = 0;  ///< Of the images: those of jobs that `finish` or `cancel --keep` ended.
    uint64_t acknowledged = 0,
             asked_again = 0;  ///< Results that workers were thanked for, and those of them that were asked for again.
    uint64_t leftovers = 0;    ///< Scratch directories that killed processes left and nobody removed.
    uint64_t next_phase = 0;   ///< Where a run that goes on with this ledger begins.
    std::map<std::string, uint64_t> crashes;  ///< By label.
    std::map<std::string, uint64_t> limits;   ///< By name.
    std::map<std::string, uint64_t> farms;    ///< Images by number of workers, their threads, and the order of units.
    std::map<std::string, std::map<std::string, uint64_t>> digests;  ///< Of images, by job.
    std::vector<double> server_starts;                               ///< Seconds from a start to its open port, after a death.
    std::vector<double> recoveries;                                  ///< From that port to the next progress of a job.
    double longest_standstill = 0;                                   ///< Seconds without progress while there was work.
    std::string standstill_phase;                                    ///< "seed S phase N" of it.
    std::vector<std::string> violations;

    /// Crash points that were passed fatally at least `times` times.
    size_t labels_hit(uint64_t times) const;
    std::string text() const;

    /// A file that does not exist is an empty ledger.
    static Result<Ledger> load(const std::string& path);
    Status save(const std::string& path) const;
};

}  // namespace lightloom::chaos
