#pragma once
// Settings and random tables of the rows of the catalog that learn, for renders whose means must not depend on them.

#include "common/tables/density_part.h"
#include "common/tables/emission_part.h"
#include "common/tables/gain_part.h"
#include "common/tables/subspace_tables.h"
#include "tests/support/estimates.h"
#include "tests/support/random_density.h"
#include "tests/support/random_emission.h"
#include "tests/support/random_gain.h"
#include "tests/support/random_tables.h"

namespace lightloom::testing {

/// Tables without knowledge, with all parts that the algorithm reads; empty for an algorithm that learns nothing. A
/// part for which there are no random values here yet is learned from a small training set instead, on which no image's
/// mean may depend either.
inline Tables random_tables_for(const AlgorithmInfo& row, const Scene& scene, uint64_t seed,
                                const RandomTableOptions& options = {}) {
    Tables tables;
    if (!row.learning) return tables;
    const std::span<const TablePart* const> parts = row.learning->parts;
    const bool known = std::all_of(parts.begin(), parts.end(), [](const TablePart* p) {
        return p == &SubspaceTables::kPart || p == &EmissionPart::kPart || p == &GainPart::kPart || p == &DensityPart::kPart;
    });
    if (!known) {
        const std::string name(row.name);
        TrainingReport report;
        auto learned = make_tables(scene, settings_of(name, with_small_training(name, {}), seed), {}, &report);
        if (!learned.ok()) throw std::runtime_error(learned.status().message());
        tables = *std::move(learned);
    }
    if (std::find(parts.begin(), parts.end(), &SubspaceTables::kPart) != parts.end())
        tables.set(std::make_shared<const SubspaceTables>(random_tables(scene.emitters(), seed, options)));
    if (std::find(parts.begin(), parts.end(), &EmissionPart::kPart) != parts.end()) {
        EmissionData data = random_emission(scene.emitters(), seed, {0, 1, 0}, 3.5f);
        tables.set(std::make_shared<const EmissionPart>(EmissionPart{std::move(data)}));
    }
    if (std::find(parts.begin(), parts.end(), &GainPart::kPart) != parts.end()) {
        // Every other table leaves roulette to the throughput.
        GainData data = seed % 2 == 0 && parts.size() > 1 ? GainData{} : random_gain(scene.frame().crop, seed);
        tables.set(std::make_shared<const GainPart>(GainPart{std::move(data)}));
    }
    if (std::find(parts.begin(), parts.end(), &DensityPart::kPart) != parts.end())
        tables.set(std::make_shared<const DensityPart>(DensityPart{random_density(scene.emitters(), seed)}));
    tables.belong_to(std::string(row.name));
    return tables;
}

/// Options of a render besides its tables.
struct CacheOptions {
    ByDepth<int> connections = 3;  ///< N
    uint64_t paths = 1000;         ///< M
    double light_paths = 1;        ///< N1 per pixel and iteration.
    bool ris_aware = false, correlation_aware = false;
};

/// The settings for these options of an algorithm with a light-vertex cache; options for which it has no parameter are
/// left out.
inline RenderSettings cache_settings(const std::string& algorithm, const CacheOptions& o, int max_depth) {
    return settings_of(
        algorithm,
        those_of(algorithm, {{"emission", "learned"},
                             {"roulette", "learned"},
                             {"connections", std::to_string(o.connections.at_first) + "," + std::to_string(o.connections.later)},
                             {"cache", std::to_string(o.paths)},
                             {"light-paths", std::to_string(o.light_paths)},
                             {"merge-radius", "0.05"},
                             {"ris-aware", o.ris_aware ? "on" : "off"},
                             {"heuristic", o.correlation_aware ? "correlation-aware" : "balance"}}),
        0, max_depth);
}

}  // namespace lightloom::testing
