#pragma once
// What a file of learned tables holds, in numbers and pictures.

#include <array>
#include <memory>
#include <nlohmann/json_fwd.hpp>
#include <string>

#include "common/scene/scene.h"
#include "common/tables/density_part.h"
#include "common/tables/emission_part.h"
#include "common/tables/gain_part.h"
#include "common/tables/subspace_tables.h"

namespace lightloom::client {

struct TableFile {
    std::shared_ptr<const SubspaceTables> subspaces;  ///< Null where an algorithm learns emission alone.
    std::shared_ptr<const EmissionPart> emission;     ///< Null in bare tables of subspaces.
    std::shared_ptr<const GainPart> gain;             ///< Null without roulette=learned.
    std::shared_ptr<const DensityPart> density;       ///< Null where an algorithm does not merge.
    Digest digest;
    uint64_t size_bytes = 0;
};

/// Reads an entry of a table cache, or bare tables, and checks that they fit the scene.
Result<TableFile> read_tables(const std::string& path, const Scene& scene);
/// Sizes, labels that occur, quantiles of Q, entropy of Gamma's columns in bits, windows, digest; what is known of emission,
/// gains and photons.
nlohmann::ordered_json describe(const TableFile& file, const Scene& scene);
void print(const TableFile& file, const Scene& scene);
/// What follows PREFIX in the names of the pictures.
inline constexpr std::array kTablePictures{"-kappa-eye.png", "-kappa-light.png", "-gamma.png", "-q.png"};
/// PREFIX-kappa-eye.png and PREFIX-kappa-light.png: the subspaces of what the camera sees first, in false colours (a light
/// sub-path that ends there is taken to come along the normal). PREFIX-gamma.png: a column per eye subspace, a row per
/// light subspace, brightness by the logarithm of Gamma over uniform. PREFIX-q.png: a bar per light subspace, height by the
/// logarithm of Q; cells of emitters in another colour. kInvalidArgument if there are no subspaces.
Status draw(const TableFile& file, const Scene& scene, const std::string& prefix);

}  // namespace lightloom::client
