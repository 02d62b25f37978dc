#pragma once
// What the kill loop does to a farm: phases, each a pure function of the seed and its number, so that one that shows a fault can be
// run again without those before it.

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

namespace lightloom::chaos {

/// A job that the loop renders again and again. Its image has one SHA-256, whatever happens meanwhile.
struct JobKind {
    std::string name;
    int samples_per_pixel = 1;
    std::vector<std::string> settings;
};

const std::vector<JobKind>& job_kinds();
/// Samples per pixel: `work` times as many as the kind has.
int job_samples(size_t kind, double work);
/// What `lightloom render` and `lightloom submit` are told.
std::vector<std::string> job_arguments(size_t kind, int samples);
/// "path 150 spp"
std::string job_name(size_t kind, int samples);

enum class Act {
    kKillWorker,    ///< SIGKILL; it is started again after `seconds`.
    kStopWorker,    ///< SIGSTOP; SIGCONT after `seconds`.
    kCrashWorker,   ///< The worker is started anew so that it dies at the crash point `crash`.
    kFillDisk,      ///< For `seconds`, no file of the worker can grow beyond a size that lists have and tables have not.
    kDamageWorker,  ///< SIGKILL, a byte of a file in the worker's cache is flipped, and it is started again.
    kKillServer,    ///< SIGKILL; the coordinator is started again after `seconds`.
    kStopServer,    ///< SIGSTOP; SIGCONT after `seconds`.
    kCrashServer,   ///< The coordinator is started anew so that it dies at the crash point `crash`.
    kDamageServer,  ///< A byte of a file of the coordinator is flipped.
    kBlockLog,      ///< For `seconds` nobody reads what the coordinator writes to standard error, and the pipe is full.
};

/// Which file is damaged.
enum class Damage { kFileList, kSceneFile, kTables };

struct Action {
    Act act = Act::kKillWorker;
    double at = 0;  ///< Seconds after the round's jobs were submitted; below 0: before they are.
    int worker = 0;
    double seconds = 0;
    std::vector<std::string> crashes;  ///< LABEL:N; when the process has died at one, it is started anew with the next.
    Damage damage = Damage::kFileList;
    uint64_t place = 0;  ///< Chooses the byte.
};

/// How the client lets a job end. What is left of one that ends early has the bytes of a job with as many samples.
enum class Ending {
    kComplete,
    kFinish,  ///< `finish`, once some groups are merged; the job has far more samples than it will render.
    kCancel,  ///< `cancel --keep`, the same, and `fetch --partial`.
};

/// Jobs that are submitted together, and what happens to them. The next round begins when all have ended and the audit is done.
struct Round {
    std::vector<size_t> jobs;     ///< Indices into job_kinds().
    std::vector<bool> attached;   ///< Whether `submit` waits; else it is detached, and `fetch` follows.
    std::vector<Ending> endings;  ///< A job that ends early is detached.
    std::vector<Action> actions;  ///< In the order of their times.
};

/// A farm that begins with empty directories.
struct Phase {
    uint64_t seed = 0, number = 0;
    std::string kind;
    int workers = 0, threads = 1;     ///< Of each worker.
    std::optional<uint64_t> shuffle;  ///< The coordinator leases units in the random order of this seed.
    bool shared_cache = false;        ///< One cache directory for all workers, or one for each.
    std::vector<Round> rounds;
};

/// Kinds of phases take turns, so that as many phases as there are kinds contain each; so do crash points.
const std::vector<std::string>& phase_kinds();
Phase plan_phase(uint64_t seed, uint64_t number);
/// "2 workers x 1 thread, shuffled"
std::string farm_name(const Phase& phase);

/// One line.
std::string to_text(const Action& action);
std::string to_text(const Round& round);

}  // namespace lightloom::chaos
