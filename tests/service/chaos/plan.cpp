#include "tests/service/chaos/plan.h"

#include <algorithm>
#include <cstdio>
#include <random>

#include "common/core/crash_point.h"

namespace lightloom::chaos {
namespace {

/// The distributions of the standard library differ between libraries; a seed is to mean the same everywhere.
class Dice {
  public:
    Dice(uint64_t seed, uint64_t number) {
        std::seed_seq both{uint32_t(seed), uint32_t(seed >> 32), uint32_t(number), uint32_t(number >> 32)};
        engine_.seed(both);
    }
    uint64_t bits() { return engine_(); }
    int below(int count) { return int(engine_() % uint64_t(count)); }
    double between(double low, double high) { return low + (high - low) * double(engine_() >> 11) * 0x1p-53; }
    bool one_in(int count) { return below(count) == 0; }

  private:
    std::mt19937_64 engine_;
};

constexpr size_t kTableJob = 0;             // in job_kinds()
constexpr size_t kPlainJobs[] = {1, 2, 3};  // those without tables, whose size would depend on the number of samples
constexpr uint64_t kCrashesInARow = 3;

std::vector<std::string> labels_of(const char* program) {
    std::vector<std::string> found;
    for (const std::string_view label : kCrashLabels)
        if (label.starts_with(program) || label.starts_with("asset.") || label.starts_with("file.")) found.emplace_back(label);
    return found;
}

/// Labels of the coordinator that only a job which ends early passes.
constexpr const char* kPartialLabel = "server.partial-written";

/// Where in the life of a job a label is passed; those of the store are passed all the time.
size_t place_of(const std::string& label) {
    if (label.starts_with("asset.")) return 0;
    for (const char* store : {"segment", "payloads", "batch", "checkpoint"})
        if (label.find(store) != std::string::npos) return place_of("server.result-received");
    const auto* const found = std::find(std::begin(kCrashLabels), std::end(kCrashLabels), label);
    return 1 + size_t(found - std::begin(kCrashLabels));
}

/// The label whose turn it is, and a pass. Labels that are passed once or twice in a phase are to be reached.
std::string crash_at(const std::vector<std::string>& labels, uint64_t turn, Dice& dice) {
    const std::string& label = labels[turn % labels.size()];
    const bool often = label.find("unit-") != std::string::npos || label.find("submit") != std::string::npos ||
                       label.find("result-") != std::string::npos || label.find("-merge") != std::string::npos;
    const bool once = label.find("tables-") != std::string::npos || label.find("registered") != std::string::npos ||
                      label.find("released") != std::string::npos;
    return label + ":" + std::to_string(once ? 1 : 1 + dice.below(often ? 8 : label.starts_with("file.") ? 4 : 2));
}

/// `count` different jobs; the first is the one with tables where `tables` says so.
Round submit(Dice& dice, size_t count, bool tables) {
    Round round;
    while (round.jobs.size() < count) {
        const size_t job = tables && round.jobs.empty() ? kTableJob : size_t(dice.below(int(job_kinds().size())));
        if (std::find(round.jobs.begin(), round.jobs.end(), job) != round.jobs.end()) continue;
        round.jobs.push_back(job);
        round.attached.push_back(dice.one_in(2));
        round.endings.push_back(Ending::kComplete);
    }
    return round;
}

/// Kills and stops of workers, more than a second apart for each worker on average.
void disturb_workers(Dice& dice, int workers, int count, double begin, double end, Round& round) {
    for (int i = 0; i < count; ++i) {
        Action action{.at = dice.between(begin, end), .worker = dice.below(workers)};
        action.act = dice.one_in(3) ? Act::kStopWorker : Act::kKillWorker;
        action.seconds = action.act == Act::kStopWorker ? dice.between(0.3, 3) : dice.between(0, 0.6);
        round.actions.push_back(action);
    }
}

/// Kills of the coordinator at about every `interval` seconds.
void kill_server(Dice& dice, int count, double interval, Round& round) {
    double at = 0;
    for (int i = 0; i < count; ++i) {
        at += dice.between(0.3, 2 * interval);
        round.actions.push_back({.act = Act::kKillServer, .at = at, .seconds = dice.between(0, 0.5)});
    }
}

void plan_kills(Dice& dice, uint64_t, Phase& phase) {
    Round round = submit(dice, 2, dice.one_in(2));
    disturb_workers(dice, phase.workers, 8 + dice.below(5), 0.1, 4, round);
    phase.rounds.push_back(std::move(round));
}

void plan_worker_crash(Dice& dice, uint64_t turn, Phase& phase) {
    Round round = submit(dice, 2, true);
    const auto labels = labels_of("worker.");
    const std::string crash = crash_at(labels, turn, dice);
    round.actions.push_back({.act = Act::kCrashWorker, .at = -1, .worker = 0, .crashes = {crash}});
    if (crash.starts_with("worker.unit-released")) {  // which is passed only where something goes wrong
        phase.shared_cache = false;
        round.actions.push_back({.act = Act::kFillDisk, .at = -1, .worker = 0, .seconds = 5});
    }
    const std::string second = crash_at(labels, turn + labels.size() / 2, dice);
    round.actions.push_back({.act = Act::kCrashWorker, .at = dice.between(0.2, 1.5), .worker = 1, .crashes = {second}});
    kill_server(dice, 1, 2, round);
    phase.rounds.push_back(std::move(round));
}

void plan_server_kills(Dice& dice, uint64_t, Phase& phase) {
    Round round = submit(dice, 2, dice.one_in(2));
    double at = 0;
    for (int i = 2 + dice.below(3); i > 0; --i) {
        at += dice.between(0.05, 2);
        const bool stop = dice.one_in(4);
        round.actions.push_back({.act = stop ? Act::kStopServer : Act::kKillServer,
                                 .at = at,
                                 .seconds = stop ? dice.between(0.3, 2.5) : dice.between(0, 0.5)});
    }
    phase.rounds.push_back(std::move(round));
}

void plan_server_crash(Dice& dice, uint64_t turn, Phase& phase) {
    Round round = submit(dice, 2, true);
    auto labels = labels_of("server.");
    std::erase(labels, kPartialLabel);  // see plan_end_early()
    Action action{.act = Act::kCrashServer, .at = -1, .seconds = dice.between(0, 0.3)};
    for (uint64_t i = 0; i < kCrashesInARow; ++i) action.crashes.push_back(crash_at(labels, kCrashesInARow * turn + i, dice));
    std::stable_sort(action.crashes.begin(), action.crashes.end(), [](const std::string& a, const std::string& b) {
        return place_of(a.substr(0, a.find(':'))) < place_of(b.substr(0, b.find(':')));
    });
    round.actions.push_back(std::move(action));
    disturb_workers(dice, phase.workers, 3, 0.5, 5, round);
    phase.rounds.push_back(std::move(round));
}

/// Jobs that a client ends early, while the coordinator dies of it.
void plan_end_early(Dice& dice, uint64_t turn, Phase& phase) {
    Round round;
    for (const Ending ending : {Ending::kCancel, Ending::kFinish}) {
        round.jobs.push_back(kPlainJobs[(turn + round.jobs.size()) % std::size(kPlainJobs)]);
        round.attached.push_back(false);
        round.endings.push_back(ending);
    }
    constexpr const char* kOthers[] = {"server.batch-committed", "server.image-written",
                                       "server.payloads-synced", "server.job-ended",
                                       "server.result-kept",     "server.manifest-written"};  // every other one is passed often
    Action action{.act = Act::kCrashServer, .at = -1, .seconds = dice.between(0, 0.3)};
    action.crashes.push_back(std::string(kPartialLabel) + ":1");
    const std::string other = kOthers[turn % std::size(kOthers)];
    action.crashes.push_back(other + ":" + std::to_string(turn % 2 == 0 ? 1 + dice.below(12) : 1));
    if (turn % 2 == 1) std::swap(action.crashes[0], action.crashes[1]);
    round.actions.push_back(std::move(action));
    disturb_workers(dice, phase.workers, 3, 0.3, 4, round);
    phase.rounds.push_back(std::move(round));
}

/// The same job twice, and what the first left on disk is damaged before the second. Every kind of damage has its turn.
void plan_damage(Dice& dice, uint64_t turn, Phase& phase) {
    phase.rounds.push_back(submit(dice, 1, true));
    Round again = submit(dice, 1, true);
    const auto kind = Damage((turn / 2) % 3);
    if (turn % 2 == 0) {
        again.actions.push_back({.act = Act::kDamageServer, .at = -1, .damage = kind, .place = dice.bits()});
    } else {
        for (int worker = 0; worker < (phase.shared_cache ? 1 : phase.workers); ++worker)
            again.actions.push_back({.act = Act::kDamageWorker, .at = -1, .worker = worker, .damage = kind, .place = dice.bits()});
    }
    phase.rounds.push_back(std::move(again));
}

void plan_disk(Dice& dice, uint64_t, Phase& phase) {
    phase.shared_cache = false;  // else the others would find what they need
    Round round = submit(dice, 2, true);
    round.actions.push_back({.act = Act::kFillDisk, .at = -1, .worker = 0, .seconds = dice.between(2, 20)});
    phase.rounds.push_back(std::move(round));
}

void plan_log(Dice& dice, uint64_t, Phase& phase) {
    Round round = submit(dice, 2, dice.one_in(2));
    round.actions.push_back({.act = Act::kBlockLog, .at = dice.between(0.2, 0.8), .seconds = dice.between(1.5, 3)});
    phase.rounds.push_back(std::move(round));
}

void plan_mixed(Dice& dice, uint64_t turn, Phase& phase) {
    Round round = submit(dice, 2, dice.one_in(2));
    disturb_workers(dice, phase.workers, 6, 0.1, 5, round);
    kill_server(dice, 2, 1.5, round);
    round.actions.push_back({.act = Act::kCrashWorker,
                             .at = dice.between(0.1, 2),
                             .worker = dice.below(phase.workers),
                             .crashes = {crash_at(labels_of("worker."), turn, dice)}});
    round.actions.push_back({.act = Act::kDamageWorker,
                             .at = dice.between(1, 4),
                             .worker = dice.below(phase.workers),
                             .damage = dice.one_in(2) ? Damage::kSceneFile : Damage::kTables,
                             .place = dice.bits()});
    phase.rounds.push_back(std::move(round));
}

/// So many kills that the same unit loses one worker after the other.
void plan_storm(Dice& dice, uint64_t, Phase& phase) {
    Round round = submit(dice, 1, false);
    for (double at = 0.3; at < 12; at += dice.between(0.1, 0.4))
        round.actions.push_back(
            {.act = Act::kKillWorker, .at = at, .worker = dice.below(phase.workers), .seconds = dice.between(0, 0.2)});
    phase.rounds.push_back(std::move(round));
}

struct PhaseKind {
    const char* name;
    void (*plan)(Dice& dice, uint64_t turn, Phase& phase);
};

constexpr PhaseKind kKinds[] = {
    {"kills", plan_kills},
    {"server-crash", plan_server_crash},
    {"worker-crash", plan_worker_crash},
    {"damage", plan_damage},
    {"server-kills", plan_server_kills},
    {"disk", plan_disk},
    {"mixed", plan_mixed},
    {"log", plan_log},
    {"server-crash", plan_server_crash},
    {"worker-crash", plan_worker_crash},
    {"damage", plan_damage},
    {"storm", plan_storm},
    {"end-early", plan_end_early},
};

}  // namespace

const std::vector<JobKind>& job_kinds() {
    static const std::vector<JobKind> kinds{
        {"spcbpt",
         100,
         {"--algorithm", "spcbpt", "--resolution", "64x48", "--max-depth", "5", "--set", "training-paths=60000", "--set",
          "light-subspaces=40", "--set", "eye-subspaces=20", "--set", "cache=500"}},
        {"path", 450, {"--algorithm", "path", "--resolution", "128x96", "--max-depth", "6"}},
        {"bdpt", 300, {"--algorithm", "bdpt", "--resolution", "96x72", "--max-depth", "5"}},
        {"light", 500, {"--algorithm", "light", "--resolution", "96x72", "--max-depth", "6"}},
        {"lvcbpt", 150, {"--algorithm", "lvcbpt", "--resolution", "80x60", "--max-depth", "5"}},
        // A density map is learned, photons are shared by whole frames.
        {"vcm*",
         120,
         {"--algorithm", "vcm", "--resolution", "64x48", "--max-depth", "5", "--set", "heuristic=vcm*", "--set",
          "training-paths=20000"}},
        {"spcbpt merging",
         60,
         {"--algorithm", "spcbpt", "--resolution", "64x48", "--max-depth", "5", "--set", "merging=on", "--set",
          "training-paths=20000", "--set", "light-subspaces=40", "--set", "eye-subspaces=20", "--set", "cache=2000"}},
    };
    return kinds;
}

int job_samples(size_t kind, double work) { return std::max(1, int(work * job_kinds()[kind].samples_per_pixel)); }

std::vector<std::string> job_arguments(size_t kind, int samples) {
    std::vector<std::string> arguments = job_kinds()[kind].settings;
    arguments.insert(arguments.end(), {"--spp", std::to_string(samples)});
    return arguments;
}

std::string job_name(size_t kind, int samples) { return job_kinds()[kind].name + " " + std::to_string(samples) + " spp"; }

const std::vector<std::string>& phase_kinds() {
    static const std::vector<std::string> names = [] {
        std::vector<std::string> found;
        for (const PhaseKind& kind : kKinds)
            if (std::find(found.begin(), found.end(), kind.name) == found.end()) found.emplace_back(kind.name);
        return found;
    }();
    return names;
}

Phase plan_phase(uint64_t seed, uint64_t number) {
    Dice dice(seed, number);
    const size_t count = std::size(kKinds);
    const PhaseKind& kind = kKinds[number % count];
    Phase phase{.seed = seed, .number = number, .kind = kind.name, .workers = 2 + dice.below(2), .shared_cache = dice.one_in(2)};
    phase.threads = 1 + dice.below(2);
    if (dice.one_in(2)) phase.shuffle = uint64_t(dice.below(1000));
    // A kind that comes twice in a cycle has two turns there.
    uint64_t turn = 0;
    for (uint64_t i = 0; i <= number % count; ++i) turn += kKinds[i].plan == kind.plan;
    uint64_t each = 0;
    for (const PhaseKind& other : kKinds) each += other.plan == kind.plan;
    kind.plan(dice, seed + number / count * each + turn - 1, phase);
    for (Round& round : phase.rounds)
        std::stable_sort(round.actions.begin(), round.actions.end(), [](const Action& a, const Action& b) { return a.at < b.at; });
    return phase;
}

std::string farm_name(const Phase& phase) {
    return std::to_string(phase.workers) + " workers x " + std::to_string(phase.threads) +
           (phase.threads == 1 ? " thread, " : " threads, ") + (phase.shuffle ? "shuffled" : "in order");
}

std::string to_text(const Action& action) {
    constexpr const char* kFiles[] = {"file list", "scene file", "tables"};
    const std::string worker = "worker " + std::to_string(action.worker), file = kFiles[int(action.damage)];
    char seconds[32], at[32];
    std::snprintf(seconds, sizeof seconds, "%.2f s", action.seconds);
    std::snprintf(at, sizeof at, "%.2f s", action.at);
    std::string what, crashes;
    for (const std::string& crash : action.crashes) crashes.append(crashes.empty() ? "" : ", then ").append(crash);
    switch (action.act) {
        case Act::kKillWorker: what = "kill " + worker + ", start it after " + seconds; break;
        case Act::kStopWorker: what = "stop " + worker + " for " + seconds; break;
        case Act::kCrashWorker: what = "start " + worker + " anew with " + kCrashVariable + "=" + crashes; break;
        case Act::kFillDisk: what = "disk of " + worker + " full for " + seconds; break;
        case Act::kDamageWorker: what = "kill " + worker + ", damage its " + file + ", start it"; break;
        case Act::kKillServer: what = std::string("kill the coordinator, start it after ") + seconds; break;
        case Act::kStopServer: what = std::string("stop the coordinator for ") + seconds; break;
        case Act::kCrashServer: what = std::string("start the coordinator anew with ") + kCrashVariable + "=" + crashes; break;
        case Act::kBlockLog: what = std::string("nobody reads the coordinator's log for ") + seconds; break;
        case Act::kDamageServer: what = "damage the coordinator's " + file; break;
    }
    return (action.at < 0 ? std::string("before") : std::string(at)) + ": " + what;
}

std::string to_text(const Round& round) {
    std::string text;
    constexpr const char* kEndings[] = {"", " (finish)", " (cancel --keep)"};
    for (size_t i = 0; i < round.jobs.size(); ++i) {
        const char* const detached = round.attached[i] || round.endings[i] != Ending::kComplete ? "" : " (detached)";
        text.append(i ? ", " : "").append(job_kinds()[round.jobs[i]].name).append(detached);
        text += kEndings[int(round.endings[i])];
    }
    return text;
}

}  // namespace lightloom::chaos
