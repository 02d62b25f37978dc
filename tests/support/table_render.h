#pragma once
// Settings and random tables of the rows of the catalog that learn, for renders that must not depend on either.

#include "common/tables/subspace_tables.h"
#include "tests/support/estimates.h"
#include "tests/support/random_tables.h"

namespace lightloom::testing {

/// Random tables with all parts that the algorithm reads, empty for one that learns nothing. A new part needs a line here.
inline Tables random_tables_for(const AlgorithmInfo& row, const EmitterSet& emitters, uint64_t seed,
                                const RandomTableOptions& options = {}) {
    Tables tables;
    if (!row.learning) return tables;
    for (const TablePart* part : row.learning->parts) {
        if (part == &SubspaceTables::kPart)
            tables.set(std::make_shared<const SubspaceTables>(random_tables(emitters, seed, options)));
        else
            ADD_FAILURE() << "no random tables of part '" << part->name << "' yet: make them in table_render.h";
    }
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
    const RenderSettings defaults = settings_of(algorithm);
    std::map<std::string, std::string> parameters;
    for (const auto& [name, value] : std::map<std::string, std::string>{{"connections", std::to_string(o.connections)},
                                                                        {"cache", std::to_string(o.paths)},
                                                                        {"light-paths", std::to_string(o.light_paths)},
                                                                        {"ris-aware", o.ris_aware ? "on" : "off"},
                                                                        {"correlation-aware", o.correlation_aware ? "on" : "off"}})
        if (defaults.algorithm.has(name)) parameters[name] = value;
    return settings_of(algorithm, parameters, 0, max_depth);
}

}  // namespace lightloom::testing
