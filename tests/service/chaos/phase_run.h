#pragma once
// One phase of the kill loop: submits its jobs, disturbs the farm, submits again what may be lost, and audits what came of it.

#include <functional>
#include <map>
#include <memory>
#include <set>
#include <string>
#include <vector>

#include "tests/service/chaos/farm.h"

namespace lightloom::chaos {

struct RunOptions {
    double work = 1;                ///< Multiplies the samples of each job.
    double patience_seconds = 90;   ///< In which a round ends after its last fault, or the audit finds what it waits for.
    std::set<Limit> expected;       ///< Limits that count as violations.
    std::function<bool()> stopped;  ///< Somebody wants the loop to end.
    std::function<void(const std::string&)> say;
};

/// The SHA-256 of a job's image, as `lightloom render` makes it alone, by index into job_kinds() and samples per pixel.
using References = std::function<std::string(size_t job, int samples)>;

class PhaseRun {
  public:
    PhaseRun(const Phase& phase, std::filesystem::path directory, Ledger& ledger, const RunOptions& options, References references);

    /// The violations; none if all promises held.
    std::vector<std::string> run();

  private:
    enum class Step { kPending, kSubmitting, kWaiting, kEnding, kFetching, kDone };
    /// A job and the client that waits for it.
    struct Job {
        size_t kind = 0;
        bool attached = false;
        Ending ending = Ending::kComplete;
        bool end_acknowledged = false;  ///< That it is to end early.
        std::string name;               ///< Of its files; with the attempt, it is what `list` calls the job.
        int attempt = 0;
        Step step = Step::kPending;
        std::string id;  ///< Of a detached job that was accepted.
        std::unique_ptr<testing::Process> client;
        uint64_t server_deaths = 0;  ///< When this attempt began.
        uint64_t status_seen = 0;    ///< Number of the last status that was looked at.
    };

    bool run_round(size_t number);
    void submit(Job& job);
    int samples(const Job& job) const;
    void end_early(Job& job);
    void fetch(Job& job, bool partial);
    void poll(Job& job);
    void client_ended(Job& job, int code);
    void look_for(Job& job);
    /// The job ended without an image: a violation, unless the reason is a known limit. It is submitted again.
    void failed(Job& job, const std::string& why);
    void limit_met(Limit limit, const std::string& why);
    void again(Job& job);
    void verify(Job& job);
    void verify_manifest(const Job& job, const nlohmann::json& manifest);
    void take_status();
    void audit_idle(size_t round);
    void violation(const std::string& what);
    std::string client_log(const Job& job) const;
    static std::string label(const Job& job) { return job.name + "." + std::to_string(job.attempt); }

    const Phase& phase_;
    Ledger& ledger_;
    const RunOptions& options_;
    const References references_;
    Farm farm_;
    std::vector<Job> jobs_;
    std::optional<nlohmann::json> status_;  ///< The latest.
    uint64_t status_number_ = 0;
    std::map<std::string, std::string> progress_;  ///< Of each job that was ever seen, by id.
    std::set<std::string> accepted_;               ///< Labels of jobs that the status page has shown.
    Clock::time_point last_progress_{};
    std::vector<std::string> violations_;
};

}  // namespace lightloom::chaos
