#include "client/table_options.h"

#include <cstdio>
#include <cstdlib>

#include "common/cli/command_line.h"
#include "common/cli/numbers.h"
#include "common/transport/training.h"
#include "server/known_identity.h"
#include "server/table_cache.h"

namespace lightloom::client {
namespace {

void add_size_option(cli::App command, TableCacheOptions& options) {
    command.add_option("--table-cache-size", options.megabytes, "MiB that it may hold; the tables used least recently go first")
        ->type_name("MIB")
        ->check(whole_number_between(1, uint64_t(1) << 30))
        ->capture_default_str();
}

}  // namespace

TableCacheOptions::TableCacheOptions() : directory("off") {
    if (const char* home = std::getenv("HOME"); home && *home) directory = std::string(home) + "/.cache/lightloom/tables";
    if (const char* cache = std::getenv("XDG_CACHE_HOME"); cache && *cache) directory = std::string(cache) + "/lightloom/tables";
}

void add_table_cache_options(cli::App command, TableCacheOptions& options) {
    command
        .add_option("--table-cache", options.directory,
                    "Directory in which learned tables, and what golden units render to on this machine, are kept for the next "
                    "render, or off; no scene files and no images (default: lightloom/tables in $XDG_CACHE_HOME or ~/.cache)")
        ->type_name("DIR")
        ->envname("LIGHTLOOM_TABLE_CACHE");
    add_size_option(command, options);
}

void add_measured_table_cache_options(cli::App command, TableCacheOptions& options) {
    options.directory = "off";
    command
        .add_option("--table-cache", options.directory,
                    "Directory of learned tables, as of `lightloom render`, or off: then every run makes its tables anew, and "
                    "its preparation is measured")
        ->type_name("DIR")
        ->capture_default_str();
    add_size_option(command, options);
}

Result<Preparation> cached_preparation(const Scene& scene, const JobSpec& spec, const TableCacheOptions& options, bool quiet,
                                       std::stop_token stop) {
    const LearningInfo* learning = spec.algorithm.learning();
    if (!learning) return Preparation();
    const TableCache cache(options.path(), options.bytes());
    Digest key;
    if (!options.path().empty()) {
        const auto identity = known_identity(options.path());
        if (!identity.ok()) return identity.status();
        key = table_key(*identity, spec);
        if (const auto entry = cache.find(key, learning->parts)) {
            auto tables = parse_tables(entry->bytes, learning->parts);
            const TablesInfo& made = entry->info;
            const double seconds = made.trace_seconds + made.classifier_seconds + made.energy_seconds + made.gamma_seconds;
            if (tables.ok() && tables->validate(scene.emitters()).ok())  // otherwise they are made again
                return Preparation{*std::move(tables), seconds, made.note, true};
        }
    }
    const uint64_t samples = learning_plan(spec.algorithm).samples;
    if (!quiet)
        std::fprintf(stderr, "lightloom: makes the tables of '%s' from %llu training samples; none of this job are in %s\n",
                     spec.algorithm.name().c_str(), static_cast<unsigned long long>(samples),
                     options.path().empty() ? "a cache (--table-cache off)" : options.directory.c_str());
    TrainingReport report;
    auto made = prepare(scene, render_settings(spec), std::move(stop), &report);
    if (!made.ok() || options.path().empty()) return made;
    const double learned = report.classifier_seconds + report.energy_seconds + report.gamma_seconds;
    cache.store(key, serialize(made->tables),
                {.light_subspaces = report.light_subspaces,
                 .eye_subspaces = report.eye_subspaces,
                 .training_samples = samples,
                 .trace_seconds = made->seconds - learned,
                 .classifier_seconds = report.classifier_seconds,
                 .energy_seconds = report.energy_seconds,
                 .gamma_seconds = report.gamma_seconds,
                 .uniform_loss = report.gamma.uniform_loss,
                 .loss = report.gamma.loss,
                 .prior_strength = report.gamma.prior_strength,
                 .note = report.note});
    return made;
}

Result<Tables> cached_tables(const Scene& scene, const JobSpec& spec, const TableCacheOptions& options, bool quiet,
                             std::stop_token stop) {
    auto preparation = cached_preparation(scene, spec, options, quiet, std::move(stop));
    if (!preparation.ok()) return preparation.status();
    return std::move(preparation->tables);
}

}  // namespace lightloom::client
