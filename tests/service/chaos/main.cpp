// The kill loop: renders jobs with a coordinator and workers that are killed, stopped, damaged and made to crash at chosen places,
// and checks that nothing of that shows in the images. deploy/chaos.sh runs it.

#include <signal.h>
#include <stdlib.h>

#include <chrono>
#include <cstdio>
#include <filesystem>
#include <map>

#include "common/cli/command_line.h"
#include "common/cli/log.h"
#include "common/cli/numbers.h"
#include "common/cli/start.h"
#include "common/work/asset.h"
#include "tests/service/chaos/phase_run.h"

namespace lightloom::chaos {
namespace {

namespace fs = std::filesystem;

constexpr const char* kFooter =
    R"(Phase N of seed S does the same whenever it runs: --seed S --phase N --phases 1 runs one alone again.
Exit codes: 0 every promise held, 1 a violation, 2 bad command line.)";

volatile sig_atomic_t interrupted = 0;

void interrupt(int) { interrupted = 1; }

/// The image that the job has without any disturbance, in a directory of its own.
Result<std::string> render_reference(size_t job, int samples, const fs::path& directory) {
    const JobKind& kind = job_kinds()[job];
    const fs::path image = directory / (kind.name + ".exr"), log = directory / (kind.name + ".log");
    std::vector<std::string> arguments{"render", std::string(LIGHTLOOM_SOURCE_DIR) + "/tests/scenes/cornell.pbrt",
                                       "-q",     "--workers",
                                       "1",      "--threads",
                                       "2",      "--table-cache",
                                       "off",    "-o",
                                       image};
    const auto settings = job_arguments(job, samples);
    arguments.insert(arguments.end(), settings.begin(), settings.end());
    if (testing::Process("lightloom", arguments, log).wait() != 0)
        return internal_error("the reference of " + kind.name + " could not be rendered, see " + log.string());
    const auto digest = digest_file(image);
    if (!digest.ok()) return digest.status();
    return digest->hex();
}

}  // namespace
}  // namespace lightloom::chaos

int main(int argc, char** argv) {
    using namespace lightloom;
    using namespace lightloom::chaos;
    cli::Program app{"Kills workers and coordinator of a farm of this build, again and again, and checks what it renders.",
                     "chaos"};
    app.footer(kFooter);
    double minutes = 0;
    uint64_t seed = 1, phases = 0;
    std::optional<uint64_t> first;
    std::vector<std::string> allow = {"healing"}, kinds;
    std::string ledger_file, level = "info";
    RunOptions options;
    const auto minutes_option =
        app.add_option("--minutes", minutes, "How long; the phase in work is finished")->check(number_between(0, 1e6));
    app.add_option("--seed", seed, "Of all phases")->type_name("SEED")->check(whole_number())->capture_default_str();
    app.add_option("--phase", first, "The first phase (default: 0, or where the ledger's last run ended)")
        ->type_name("N")
        ->check(whole_number());
    app.add_option("--phases", phases, "At most so many")->type_name("N")->check(whole_number());
    app.add_option("--kinds", kinds,
                   "Only phases of these kinds: kills, server-crash, worker-crash, damage, server-kills, disk, mixed, log, storm, "
                   "end-early")
        ->type_name("KIND,...")
        ->delimiter(',');
    app.add_option(
           "--allow", allow,
           "What is counted, but is no violation: durable (an accepted job is lost with the coordinator), blame (a job fails "
           "because "
           "of its workers' deaths), healing (a damaged file of the coordinator fails a job whose client is gone), log (a log that "
           "nobody reads stops the farm), none")
        ->type_name("LIMIT,...")
        ->delimiter(',')
        ->capture_default_str();
    app.add_option("--ledger", ledger_file, "Adds to this file after each phase, and goes on where it ended")->type_name("FILE");
    const auto work_option =
        app.add_option("--work", options.work, "Multiplies the samples of each job, which take some seconds on two fast processors")
            ->type_name("FACTOR")
            ->check(number_between(0.01, 1000))
            ->capture_default_str();
    app.add_option("--patience", options.patience_seconds, "Seconds without an end after which a round counts as stuck")
        ->type_name("SECONDS")
        ->check(number_between(1, 3600))
        ->capture_default_str();
    if (const auto ended = parse_and_log(app, argc, argv, level)) return *ended;
    if (minutes_option.count() == 0 && phases == 0) {
        print_error("--minutes or --phases: without either the loop would not end");
        return kBadCommandLine;
    }
    options.expected = {Limit::kDurable, Limit::kBlame, Limit::kHealing, Limit::kLog};
    for (const std::string& name : allow) {
        if (name == "none") continue;
        const auto* const limit = std::find(std::begin(kLimitNames), std::end(kLimitNames), name);
        if (limit == std::end(kLimitNames)) {
            print_error("--allow " + name + ": no such limit; there are durable, blame, healing, log and none");
            return kBadCommandLine;
        }
        options.expected.erase(Limit(limit - std::begin(kLimitNames)));
    }
    for (const std::string& kind : kinds) {
        if (std::find(phase_kinds().begin(), phase_kinds().end(), kind) != phase_kinds().end()) continue;
        print_error("--kinds " + kind + ": no such kind of phase");
        return kBadCommandLine;
    }
    Ledger ledger;
    if (!ledger_file.empty()) {
        auto loaded = Ledger::load(ledger_file);
        if (!loaded.ok()) return report_failure(loaded.status());
        ledger = *std::move(loaded);
    }
    const size_t old_violations = ledger.violations.size();

    // A file that has grown to a process's limit is an error that it sees, as on a full disk, instead of a signal; children inherit
    // it.
    ::signal(SIGXFSZ, SIG_IGN);
    struct sigaction action {};
    action.sa_handler = interrupt;
    ::sigaction(SIGINT, &action, nullptr);
    ::sigaction(SIGTERM, &action, nullptr);
    ::setvbuf(stdout, nullptr, _IOLBF, 0);
    const auto begin = Clock::now();
    options.stopped = [] { return interrupted != 0; };
    options.say = [&](const std::string& line) { std::printf("%8.2f %s\n", seconds_since(begin), line.c_str()); };

    std::string base = (fs::temp_directory_path() / "lightloom-chaos-XXXXXX").string();
    if (!::mkdtemp(base.data())) return report_failure(internal_error(base + ": no directory can be made there"));
    fs::create_directories(fs::path(base) / "references");
    std::map<std::pair<size_t, int>, std::string> references;
    Status no_reference;
    const auto reference = [&](size_t job, int samples) {
        std::string& known = references[{job, samples}];
        if (known.empty()) {
            auto made = render_reference(job, samples, fs::path(base) / "references");
            if (made.ok()) known = *made;
            if (!made.ok()) no_reference = made.status();
        }
        return known;
    };

    const std::string program = "deploy/chaos.sh";
    const uint64_t from = first ? *first : ledger.next_phase;
    uint64_t done = 0;
    for (uint64_t number = from; !options.stopped(); ++number) {
        if ((phases > 0 && done >= phases) || (minutes_option.count() > 0 && seconds_since(begin) >= 60 * minutes)) break;
        const Phase phase = plan_phase(seed, number);
        if (!kinds.empty() && std::find(kinds.begin(), kinds.end(), phase.kind) == kinds.end()) continue;
        options.say("phase " + std::to_string(number) + " of seed " + std::to_string(seed) + ", " + phase.kind + ": " +
                    farm_name(phase) + ", " + (phase.shared_cache ? "one cache" : "a cache each"));
        for (const Round& round : phase.rounds)
            for (size_t i = 0; i < round.jobs.size(); ++i)
                if (round.endings[i] == Ending::kComplete) reference(round.jobs[i], job_samples(round.jobs[i], options.work));
        if (!no_reference.ok()) return report_failure(no_reference);
        const fs::path directory = fs::path(base) / ("phase-" + std::to_string(number));
        std::vector<std::string> violations;
        try {
            violations = PhaseRun(phase, directory, ledger, options, reference).run();
        } catch (const std::exception& error) {  // an answer that has not the form that it must have
            violations.emplace_back(error.what());
        }
        if (options.stopped() && violations.empty()) break;
        ++done, ++ledger.phases;
        ledger.next_phase = number + 1;
        std::string replay = program + " --seed " + std::to_string(seed) + " --phase " + std::to_string(number) + " --phases 1";
        for (const std::string& name : allow) replay += " --allow " + name;
        if (work_option.count() > 0) replay += " --work " + std::to_string(options.work);
        for (const std::string& what : violations)
            ledger.violations.push_back("seed " + std::to_string(seed) + " phase " + std::to_string(number) + ": " + what);
        if (violations.empty()) {
            fs::remove_all(directory);
        } else {
            options.say("again: " + replay + "   (files: " + directory.string() + ")");
            ledger.violations.push_back("  again: " + replay);
        }
        if (!ledger_file.empty())
            if (const Status saved = ledger.save(ledger_file); !saved.ok()) return report_failure(saved);
    }
    std::printf("%s", ledger.text().c_str());
    const bool clean = ledger.violations.size() == old_violations;
    if (clean) fs::remove_all(base);
    return clean ? 0 : 1;
}
