#pragma once
// Settings and random tables of the rows of the catalog that learn, for renders that must not depend on either.

#include "common/tables/subspace_tables.h"
#include "tests/support/estimates.h"
#include "tests/support/random_tables.h"

namespace lightloom::testing {

/// Tables that know nothing, with all parts that the algorithm reads; empty for one that learns nothing. A part that has no random
/// values here yet is learned from a small training set instead, which no image may depend on either.
inline Tables random_tables_for(const AlgorithmInfo& row, const Scene& scene, uint64_t seed,
                                const RandomTableOptions& options = {}) {
    Tables tables;
    if (!row.learning) return tables;
    const std::span<const TablePart* const> parts = row.learning->parts;
    const bool known = std::all_of(parts.begin(), parts.end(), [](const TablePart* p) { return p == &SubspaceTables::kPart; });
    if (!known) {
        const std::string name(row.name);
        TrainingReport report;
        auto learned = make_tables(scene, settings_of(name, with_small_training(name, {}), seed), {}, &report);
        if (!learned.ok()) throw std::runtime_error(learned.status().message());
        tables = *std::move(learned);
    }
    if (std::find(parts.begin(), parts.end(), &SubspaceTables::kPart) != parts.end())
        tables.set(std::make_shared<const SubspaceTables>(random_tables(scene.emitters(), seed, options)));
    tables.belong_to(std::string(row.name));
    return tables;
}

/// What a render is made with besides its tables.
struct CacheOptions {
    int connections = 3;     ///< N
    uint64_t paths = 1000;   ///< M
    double light_paths = 1;  ///< N1 per pixel and iteration.
    bool ris_aware = false, correlation_aware = false;
};

/// The same for an algorithm with a light-vertex cache; those that it has no parameter for are left out.
inline RenderSettings cache_settings(const std::string& algorithm, const CacheOptions& o, int max_depth) {
    return settings_of(algorithm,
                       those_of(algorithm, {{"connections", std::to_string(o.connections)},
                                            {"cache", std::to_string(o.paths)},
                                            {"light-paths", std::to_string(o.light_paths)},
                                            {"ris-aware", o.ris_aware ? "on" : "off"},
                                            {"correlation-aware", o.correlation_aware ? "on" : "off"}}),
                       0, max_depth);
}

}  // namespace lightloom::testing
