#include "common/transport/catalog.h"

namespace lightloom {

// Each is defined in the algorithm's own file.
extern const AlgorithmInfo kPathRow, kLightRow, kBdptRow, kLvcbptRow, kSpcbptRow;

namespace {

std::vector<const AlgorithmInfo*>& rows() {
    static std::vector<const AlgorithmInfo*> rows{&kPathRow, &kLightRow, &kBdptRow, &kLvcbptRow, &kSpcbptRow};
    return rows;
}

}  // namespace

std::span<const AlgorithmInfo* const> catalog() { return rows(); }

Result<const AlgorithmInfo*> find_algorithm(std::string_view name) {
    std::string known;
    for (const AlgorithmInfo* a : catalog()) {
        if (a->name == name) return a;
        known += (known.empty() ? "" : ", ") + std::string(a->name);
    }
    return not_found("no algorithm named '" + std::string(name) + "'; choose one of: " + known);
}

void add_to_catalog(const AlgorithmInfo& row) { rows().push_back(&row); }

}  // namespace lightloom
