#pragma once
// The tables of SPCBPT, complete before a unit that reads them starts: kappa (two classifiers and the division of the
// lights), Q, Gamma, and the windows of rarely hit subspaces. [Su, Li and Wang 2022; common/path/README.md, "Subspaces"]
//
// Light subspaces: 0 .. division.cell_count() - 1 belong to prefixes of one vertex, the rest to longer ones.

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "common/core/digest.h"
#include "common/core/result.h"
#include "common/tables/classifier.h"
#include "common/tables/light_division.h"
#include "common/tables/tables.h"

namespace lightloom {

struct SubspaceTables {
    uint32_t light_count = 1, eye_count = 1;  ///< N_L and N_E, each at most kMaxSubspaces.
    LightDivision division;
    SubspaceTree light_tree;  ///< Labels from division.cell_count() on.
    SubspaceTree eye_tree;
    /// Q, light_count entries, all positive: expected scalar throughput of a light path's prefixes in the subspace (W-like
    /// units of the scene), floor included.
    std::vector<float> energy;
    /// Gamma, eye_count columns of light_count entries each, all positive, every column sums to one:
    /// gamma[j * light_count + i] is the probability that eye subspace j connects to light subspace i. The conservative
    /// share (TrainingOptions::mix) is included.
    std::vector<float> gamma;
    /// J, light_count entries, 1 .. kMaxWindow: from how many windows of light paths a subspace takes its prefixes;
    /// only paths of the first window are splatted. [common/path/README.md, "Windows"]
    std::vector<uint16_t> window;
    /// Mean number of connectible light vertices (y_0 included) per light path; lvcbpt, which selects uniformly, needs
    /// it.
    double vertices_per_path = 1;

    static const TablePart kPart;  ///< "subspaces"

    static constexpr uint32_t kMaxSubspaces = 16384;  ///< Labels are 16 bit and one value is reserved.

    static constexpr uint16_t kMaxWindow = 32;  ///< A unit traces at most this many windows.

    const float* column(uint32_t eye) const { return &gamma[size_t(eye) * light_count]; }
    uint32_t light_label(const SubPathEnd& end) const { return light_tree.label(end); }
    uint32_t eye_label(const SubPathEnd& end) const { return eye_tree.label(end); }

    /// Checks everything that the renderer relies on; kDataLoss names the table that is wrong.
    Status validate(const EmitterSet& emitters) const;
};

/// Tables with one subspace on both sides, which are valid for every scene.
SubspaceTables trivial_tables(const EmitterSet& emitters);

/// Writes named sections, each with its own SHA-256. The same tables have the same bytes on every host.
std::string serialize(const SubspaceTables& tables);
/// kDataLoss when a section is missing, cut short, of an unknown version, or does not match its digest.
Result<SubspaceTables> parse_subspace_tables(std::string_view bytes);

}  // namespace lightloom
