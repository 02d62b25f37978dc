#include "tests/service/chaos/phase_run.h"

#include <algorithm>
#include <cstdio>
#include <thread>

#include "common/core/atomic_file.h"
#include "common/work/asset.h"

namespace lightloom::chaos {
namespace {

using Json = nlohmann::json;
using testing::Process;

const std::string kScene = std::string(LIGHTLOOM_SOURCE_DIR) + "/tests/scenes/cornell.pbrt";
constexpr auto kPoll = std::chrono::milliseconds(10);
constexpr double kStatusInterval = 0.05;
constexpr int kMaxAttempts = 12;
/// A job that is to end early is so much larger than one that is not, and is ended when it has so many units.
constexpr int kLarger = 50, kUnitsBeforeEnd = 20;

std::string last_line(std::string text) {
    while (!text.empty() && text.back() == '\n') text.pop_back();
    return text.substr(text.rfind('\n') == std::string::npos ? 0 : text.rfind('\n') + 1);
}

bool has(const std::string& text, const char* part) { return text.find(part) != std::string::npos; }

bool is_terminal(const std::string& state) { return state == "succeeded" || state == "failed" || state == "cancelled"; }

}  // namespace

PhaseRun::PhaseRun(const Phase& phase, std::filesystem::path directory, Ledger& ledger, const RunOptions& options,
                   References references)
    : phase_(phase),
      ledger_(ledger),
      options_(options),
      references_(std::move(references)),
      farm_(phase, std::move(directory), ledger) {}

void PhaseRun::violation(const std::string& what) {
    violations_.push_back(what);
    options_.say("VIOLATION: " + what);
}

std::vector<std::string> PhaseRun::run() {
    if (!farm_.start(options_.patience_seconds)) {
        violation("the coordinator did not start");
        return violations_;
    }
    bool ended = true;
    for (size_t i = 0; ended && i < phase_.rounds.size() && !options_.stopped(); ++i) {
        ended = run_round(i);
        if (ended) audit_idle(i);
    }
    if (options_.stopped()) return violations_;
    farm_.stop_cleanly(options_.patience_seconds);
    ledger_.leftovers += farm_.leftovers();
    const auto [acknowledged, again] = farm_.acknowledged();
    ledger_.acknowledged += acknowledged;
    ledger_.asked_again += again;
    if (again > 0) violation(std::to_string(again) + " result(s) were asked for again that had been acknowledged");
    for (const std::string& what : farm_.take_violations()) violation(what);
    return violations_;
}

bool PhaseRun::run_round(size_t number) {
    const Round& round = phase_.rounds[number];
    options_.say("round " + std::to_string(number) + ": " + to_text(round));
    auto action = round.actions.begin();
    for (; action != round.actions.end() && action->at < 0; ++action) {
        options_.say("  " + to_text(*action));
        farm_.apply(*action);
    }
    testing::wait_until(options_.patience_seconds, [&] {
        farm_.poll();
        return farm_.server_answers() || options_.stopped();
    });
    jobs_.clear();
    for (size_t i = 0; i < round.jobs.size(); ++i) {
        Job& job = jobs_.emplace_back();
        job.kind = round.jobs[i];
        job.attached = round.attached[i];
        job.ending = round.endings[i];
        job.name = std::string("round").append(std::to_string(number)) + "-" + job_kinds()[job.kind].name;
    }
    const auto begin = Clock::now();
    last_progress_ = begin;
    auto last_fault = begin, last_status = begin;
    const auto done = [&] {
        return std::all_of(jobs_.begin(), jobs_.end(), [](const Job& job) { return job.step == Step::kDone; });
    };
    while (!done() && !options_.stopped()) {
        for (; action != round.actions.end() && seconds_since(begin) >= action->at; ++action) {
            options_.say("  " + to_text(*action));
            farm_.apply(*action);
            last_fault = Clock::now();
        }
        const auto blocked_since = farm_.log_blocked_since();
        farm_.poll();
        if (blocked_since && !farm_.log_blocked_since() && last_progress_ < *blocked_since)
            limit_met(Limit::kLog, "no job made progress while nobody read the coordinator's log");
        for (const std::string& what : farm_.take_violations()) violation(what);
        if (!farm_.healed()) last_fault = Clock::now();
        if (seconds_since(last_status) > kStatusInterval) {
            last_status = Clock::now();
            take_status();
        }
        for (Job& job : jobs_) poll(job);
        if (violations_.size() > 8) return false;
        if (seconds_since(last_fault) > options_.patience_seconds) {
            std::string open;
            for (const Job& job : jobs_)
                if (job.step != Step::kDone) open += " " + job.name;
            violation("no end " + std::to_string(int(options_.patience_seconds)) + " s after the last fault:" + open + "; status " +
                      (status_ ? status_->dump() : "unknown"));
            return false;
        }
        std::this_thread::sleep_for(kPoll);
    }
    return !options_.stopped();
}

void PhaseRun::submit(Job& job) {
    std::vector<std::string> arguments{"submit", kScene, "--server", farm_.address(), "--again", "--name", label(job)};
    if (job.attached) arguments.insert(arguments.end(), {"-q", "-o", farm_.path(job.name + ".exr").string()});
    if (!job.attached) arguments.push_back("--detach");
    const auto settings = job_arguments(job.kind, samples(job));
    arguments.insert(arguments.end(), settings.begin(), settings.end());
    job.step = Step::kSubmitting;
    job.id.clear();
    job.end_acknowledged = false;
    job.server_deaths = farm_.server_deaths();
    std::filesystem::remove(farm_.path(job.name + ".log"));
    job.client = std::make_unique<Process>("lightloom", arguments, farm_.path(job.name + ".log"));
}

int PhaseRun::samples(const Job& job) const {
    return (job.ending == Ending::kComplete ? 1 : kLarger) * job_samples(job.kind, options_.work);
}

void PhaseRun::end_early(Job& job) {
    job.step = Step::kEnding;
    std::vector<std::string> arguments{job.ending == Ending::kFinish ? "finish" : "cancel", job.id, "--server", farm_.address()};
    if (job.ending == Ending::kCancel) arguments.emplace_back("--keep");
    job.client = std::make_unique<Process>("lightloom", arguments, farm_.path(job.name + ".log"));
}

void PhaseRun::fetch(Job& job, bool partial) {
    job.step = Step::kFetching;
    std::filesystem::remove(farm_.path(job.name + ".log"));
    std::vector<std::string> arguments{
        "fetch", job.id, "--server", farm_.address(), "-q", "-o", farm_.path(job.name + ".exr").string()};
    if (partial) arguments.emplace_back("--partial");
    job.client = std::make_unique<Process>("lightloom", arguments, farm_.path(job.name + ".log"));
}

std::string PhaseRun::client_log(const Job& job) const {
    const auto text = read_file(farm_.path(job.name + ".log").string());
    return text.ok() ? last_line(*text) : std::string();
}

void PhaseRun::poll(Job& job) {
    if (job.client && job.client->ended()) {
        const int code = job.client->wait();
        job.client.reset();
        client_ended(job, code);
    } else if (job.step == Step::kPending) {
        // A client that finds no coordinator gives up soon; here it is known that one is there.
        if (farm_.server_answers()) submit(job);
    } else if (job.step == Step::kWaiting && status_ && job.status_seen != status_number_) {
        job.status_seen = status_number_;
        look_for(job);
    }
}

void PhaseRun::client_ended(Job& job, int code) {
    const std::string said = client_log(job);
    if (job.step == Step::kEnding) {  // without an answer it is asked again, unless the job has ended by then
        job.end_acknowledged = code == 0;
        job.step = Step::kWaiting;
        job.status_seen = status_number_;
        return;
    }
    if (code != 0) return failed(job, "client's exit code " + std::to_string(code) + ": " + said);
    if (job.step == Step::kSubmitting && !job.attached) {
        job.id = said;
        job.step = Step::kWaiting;
        job.status_seen = status_number_;  // which may be older than the job
        accepted_.insert(label(job));
        return;
    }
    verify(job);
}

void PhaseRun::look_for(Job& job) {
    for (const Json& shown : (*status_)["jobs"]) {
        if (shown["job"] != job.id) continue;
        const std::string state = shown["state"];
        if (state == "succeeded" && job.ending != Ending::kCancel) return fetch(job, false);
        if (state == "cancelled" && job.ending == Ending::kCancel) return fetch(job, true);
        if (job.ending != Ending::kComplete && !job.end_acknowledged && state == "running" &&
            shown["units_done"] >= kUnitsBeforeEnd)
            return end_early(job);
        if (is_terminal(state)) failed(job, job.id + " is " + state + ": " + shown["message"].get<std::string>());
        return;
    }
    failed(job, "the coordinator does not know " + job.id + " any more");
}

void PhaseRun::failed(Job& job, const std::string& why) {
    if (has(why, "fell silent over it")) return limit_met(Limit::kBlame, job.name + ": " + why), again(job);
    if (has(why, "was damaged") || has(why, "is damaged")) {
        // What no message heals is removed by hand, so that the loop goes on.
        const size_t asset = why.find("asset ");
        if (asset != std::string::npos && why.size() >= asset + 70) farm_.remove_asset(why.substr(asset + 6, 64));
        return limit_met(Limit::kHealing, job.name + ": " + why), again(job);
    }
    if (farm_.server_deaths() != job.server_deaths) {
        if (job.step == Step::kFetching) {  // the next status tells whether the job is still known
            job.step = Step::kWaiting;
            job.status_seen = status_number_;
            return;
        }
        if (accepted_.contains(label(job)) || has(why, "no job has the id"))
            return limit_met(Limit::kDurable, job.name + ": " + why), again(job);
        // Without an acknowledgement nothing was promised: the client asks again.
        options_.say("  " + job.name + " was not accepted (" + why + "); submitted again");
        return again(job);
    }
    if (farm_.disk_was_full()) return limit_met(Limit::kBlame, job.name + ": " + why), again(job);
    violation(job.name + ": " + why);
    again(job);
}

void PhaseRun::limit_met(Limit limit, const std::string& why) {
    const char* const name = kLimitNames[size_t(limit)];
    ++ledger_.limits[name];
    if (options_.expected.contains(limit)) {
        violation(std::string(name) + ": " + why);
    } else {
        options_.say("  known limit (" + std::string(name) + "), " + why);
    }
}

void PhaseRun::again(Job& job) {
    ++ledger_.resubmissions;
    if (++job.attempt >= kMaxAttempts) {
        violation(job.name + " has no image after " + std::to_string(kMaxAttempts) + " attempts");
        job.step = Step::kDone;
        return;
    }
    job.step = Step::kPending;
}

void PhaseRun::verify(Job& job) {
    job.step = Step::kDone;
    ++ledger_.images;
    const auto digest = digest_file(farm_.path(job.name + ".exr"));
    if (!digest.ok()) return violation(job.name + ": " + digest.status().message());
    const auto text = read_file(farm_.path(job.name + ".manifest.json").string());
    const Json manifest = text.ok() ? Json::parse(*text, nullptr, false) : Json();
    if (!manifest.is_object()) return violation(job.name + ": there is no manifest that can be read");
    int rendered = samples(job);
    if (job.ending != Ending::kComplete) {
        ++ledger_.ended_early;
        if (manifest["image"]["samples_per_pixel"] >= rendered) violation(job.name + ": it was to end early, and did not");
        rendered = manifest["image"]["samples_per_pixel"];
    }
    ++ledger_.farms[farm_name(phase_)];
    const std::string hex = digest->hex(), reference = references_(job.kind, rendered);
    ++ledger_.digests[job_name(job.kind, rendered)][hex];
    if (hex != reference) violation(job.name + ": the image has SHA-256 " + hex + ", that of `lightloom render` " + reference);
    if (manifest["image"]["sha256"] != hex) violation(job.name + ": the manifest names another image");
    verify_manifest(job, manifest);
}

/// Every unit was merged once: the units of all workers together are all tiles of all groups, without repetition.
void PhaseRun::verify_manifest(const Job& job, const Json& manifest) {
    const Json& work = manifest["work"];
    if (work["duplicates_different"] != 0) violation(job.name + ": duplicates_different " + work["duplicates_different"].dump());
    std::set<std::pair<int, int>> units;
    size_t merged = 0;
    int tiles = 0;
    for (const Json& worker : manifest["workers"]) {
        for (const Json& unit : worker["units"]) {
            units.emplace(unit[0].get<int>(), unit[1].get<int>());
            tiles = std::max(tiles, unit[1].get<int>() + 1);
            ++merged;
        }
    }
    const size_t all = manifest["image"]["groups"].get<size_t>() * size_t(tiles);
    if (units.size() != merged || merged != all || work["units"] != merged)
        violation(job.name + ": " + std::to_string(merged) + " units of workers, " + std::to_string(units.size()) + " different, " +
                  work["units"].dump() + " in all, " + std::to_string(all) + " by groups and tiles");
}

void PhaseRun::take_status() {
    auto status = farm_.status();
    if (!status) return;
    status_ = std::move(status);
    ++status_number_;
    bool progress = false;
    for (const Json& job : (*status_)["jobs"]) {
        accepted_.insert(job["name"].get<std::string>());
        const std::string now = job["units_done"].dump() + " " + job["phase_done"].dump() + " " + job["state"].dump();
        std::string& before = progress_[job["job"].get<std::string>()];
        // Accepting a job is not yet progress with it.
        if (before != now && (!before.empty() || job["units_done"] != 0)) progress = true;
        before = now;
    }
    if (!progress) return;
    farm_.progress_seen();
    if (const double seconds = seconds_since(last_progress_); seconds > ledger_.longest_standstill) {
        ledger_.longest_standstill = seconds;
        ledger_.standstill_phase = "seed " + std::to_string(phase_.seed) + " phase " + std::to_string(phase_.number);
    }
    last_progress_ = Clock::now();
}

void PhaseRun::audit_idle(size_t round) {
    farm_.heal();
    std::string fault = "the farm does not answer";
    const bool idle = testing::wait_until(options_.patience_seconds, [&] {
        farm_.poll();
        if (options_.stopped()) return true;
        const auto status = farm_.healed() ? farm_.status() : std::nullopt;
        if (!status) return false;
        fault.clear();
        for (const Json& job : (*status)["jobs"])
            if (!is_terminal(job["state"]) || job["units_leased"] != 0) fault = "job " + job.dump();
        int alive = 0;
        for (const Json& worker : (*status)["workers"]) {
            if (!farm_.is_alive(worker["process_id"]) || worker["state"] == "gone") continue;
            ++alive;
            if ((worker["state"] != "idle" && worker["state"] != "resting") || worker["units_held"] != 0)
                fault = "worker " + worker.dump();
        }
        if (alive < phase_.workers && fault.empty())
            fault = std::to_string(alive) + " of " + std::to_string(phase_.workers) + " workers";
        // Tables of the jobs that ended are gone.
        if (const auto tables = farm_.tables_in_use(); !tables.empty()) fault = "tables " + tables.string();
        return fault.empty();
    });
    for (const std::string& what : farm_.take_violations()) violation(what);
    if (!idle) violation("round " + std::to_string(round) + ": all jobs have ended, but this is left: " + fault);
}

}  // namespace lightloom::chaos
