#pragma once
// Whether two algorithms agree on a scene: ratios of mean luminance for the whole image, its regions, and each path length,
// with simultaneous confidence intervals. A bias of a few percent in one kind of path shows here and not in a picture.

#include <functional>
#include <memory>
#include <nlohmann/json_fwd.hpp>
#include <stop_token>
#include <string>
#include <vector>

#include "client/progressive_render.h"
#include "common/metrics/region_means.h"

namespace lightloom::client {

enum class Verdict {
    kAgree,     ///< The 95 % interval contains 1.
    kNoisy,     ///< It does, but it is so wide (more than +-20 %) that it says little; or the reference found no light at all.
    kDoubtful,  ///< It does not, but the 99.9 % interval does: by chance in one cross-check of twenty.
    kDiffer,    ///< Not even that one does.
};

/// One comparison.
struct CrossCheckRow {
    std::string what;  ///< "image", "region 2,1" (column and row from 1), "length 3", "length 7 and more".
    Estimate reference, check;
    RatioInterval interval;  ///< Of check / reference, 95 % over all rows together.
    Verdict verdict = Verdict::kAgree;
};

struct CrossCheck {
    std::vector<CrossCheckRow> rows;
    uint64_t iterations = 0;  ///< Of the checking algorithm's image.
    double seconds = 0;       ///< Of rendering, path lengths included.
    Verdict verdict() const;  ///< The worst.
    std::string table() const;
    nlohmann::ordered_json json() const;
};

/// Mean luminance by path length in edges, as the difference of two renderings with the same random numbers whose longest
/// paths differ by one edge: what the two share cancels. Element i holds, for group i, lengths 1 to max_depth + 1.
struct LengthMeans {
    std::vector<std::vector<double>> groups;
    std::vector<double> weights;  ///< Iterations of each group.
    double seconds = 0;

    /// Of lengths `first` to `last` together.
    Estimate estimate(size_t first, size_t last) const;
};
/// The tables of a rendering on the scene: made by prepare(), or found.
using PreparationSource = std::function<Result<Preparation>(const RenderSettings& settings)>;
/// Renders whole groups for at least `seconds`, and at least kLeastGroups of them.
Result<LengthMeans> measure_lengths(const std::shared_ptr<const Scene>& scene, const RenderSettings& settings, double seconds,
                                    const PreparationSource& tables, std::stop_token stop);

/// Grid of regions, and the groups that a variance needs at least.
inline constexpr int kCheckColumns = 3, kCheckRows = 3;
inline constexpr uint32_t kLeastGroups = 16;

/// Renders with `checker` for `seconds` and compares with `made`, the means of the reference that `producer` made; then, for
/// `seconds` more, half for each, compares the path lengths. The two must not share random numbers: other seeds.
Result<CrossCheck> cross_check(const std::shared_ptr<const Scene>& scene, const RenderSettings& producer,
                               const std::vector<Estimate>& made, const RenderSettings& checker, double seconds,
                               const PreparationSource& tables, std::stop_token stop);

/// The rows of `what`, compared at simultaneous levels. References and checks in the same order.
CrossCheck compare_estimates(const std::vector<std::string>& what, const std::vector<Estimate>& references,
                             const std::vector<Estimate>& checks);

}  // namespace lightloom::client
