#pragma once
// Merging, as the algorithms share it: the disc around a camera vertex and the photons in it. [common/path/README.md, "Merging"]

#include <algorithm>
#include <array>

#include "common/core/math.h"
#include "common/transport/contribution.h"
#include "common/transport/photon_map.h"

namespace lightloom {

/// The radius of merges, m.
struct MergeRadius {
    double per_distance2 = 0;  ///< Squared; for each square metre of PathView::footprint_distance2.
    double fixed2 = 0;         ///< Squared; for every path.
    double most2 = 0;          ///< Squared; no radius is larger.

    double squared(double distance2) const { return std::min(per_distance2 * distance2 + fixed2, most2); }
    MergeRadius scaled(double factor2) const { return {per_distance2 * factor2, fixed2 * factor2, most2 * factor2}; }
};

enum class MergeKernel : uint8_t { kConstant, kEpanechnikov };

/// The kernel at a squared distance below radius2, m^-2.
inline float kernel(MergeKernel kind, float distance2, float radius2) {
    const float constant = kInvPi / radius2;
    return kind == MergeKernel::kConstant ? constant : 2 * constant * (1 - distance2 / radius2);
}

/// What the radius of a path with the camera sub-path z[0 .. t-1], t >= 2, is in proportion to: the squared length along it, from
/// the lens to its first vertex that is not a Dirac vertex, m^2. The same for every path with that camera sub-path.
inline double camera_distance2(const PathVertex* z, int t) {
    float distance = length(z[1].p - z[0].p);
    for (int j = 1; j + 1 < t && z[j].delta; ++j) distance += length(z[j + 1].p - z[j].p);
    return double(distance) * double(distance);
}

/// What merges of an iteration, or of the first one, are.
struct MergeTerms {
    double paths = 1;  ///< n: light sub-paths that are photons.
    MergeRadius radius;
    MergeKernel kernel = MergeKernel::kConstant;
    bool first_hit = false;  ///< Whether merges at x_{k-1} count.

    /// The terms of iteration j where these are those of the first:
    ///     r(j)^2 = r(0)^2 (j + 1)^(alpha - 1)                 [Knaus and Zwicker 2011, eq. 18 in its limit]
    MergeTerms of_iteration(uint64_t j, double alpha) const {
        MergeTerms now = *this;
        now.radius = radius.scaled(math::pow(1 + double(j), alpha - 1));
        return now;
    }
    /// n a, m^2, a = 1 / (integral of the kernel's square): sigma of a merge, without roulette, at this footprint_distance2.
    double density(double distance2) const { return paths * disc(distance2) * (kernel == MergeKernel::kConstant ? 1 : 0.75); }
    /// Area of the disc, m^2.
    double disc(double distance2) const { return kPiD * radius.squared(distance2); }
    /// Last vertex of a path of k edges that may merge.
    int last(int k) const { return first_hit ? k - 1 : k - 2; }
};

/// The disc in which a camera vertex merges.
struct Disc {
    float radius2 = 0;   ///< m^2
    float per_path = 1;  ///< 1 / n
    MergeKernel kernel = MergeKernel::kConstant;
};

/// Least cosine between the geometric normals of two vertices that merge: those of a box's edge do not.
inline constexpr float kSameSurface = 0.7f;

/// Merges z_{t-1}, t >= 2, with the photons around it and calls contribute(contribution, view) for each that gives light. `view`
/// keeps what it has of the camera sub-path.
template <ViewDetail detail, class Contribute>
void merge_near(const Scene& scene, const LightCache& cache, const PhotonMap& photons, const Disc& disc, int max_edges,
                const PathVertex* z, int t, PathView* view, Contribute&& contribute) {
    const PathVertex& v = z[t - 1];
    const uint32_t longest = uint32_t(max_edges + 2 - t);
    struct Near {
        const LightVertex* y;
        int s;
        float distance2;
    };
    // The photons of a disc are far apart in memory, and so they are all asked for before the first is read.
    std::array<Near, 32> near;
    size_t count = 0;
    const auto merge_all = [&] {
        for (size_t i = 0; i < count; ++i) {
            const auto& [y, s, distance2] = near[i];
            if (abs_dot(y[s - 1].ng, v.ng) < kSameSurface) continue;
            const Rgb c = merge<detail>(scene, y, s, z, t, view);
            if (c.is_black()) continue;
            const float scale = disc.per_path * kernel(disc.kernel, distance2, disc.radius2);
            PathContribution found = from_light_path(c * scale, Technique::merge(s - 1), y, z, t);
            found.inverse_density = scale;
            contribute(found, *view);
        }
        count = 0;
    };
    photons.for_each_near(v.p, disc.radius2, [&](const PhotonMap::Photon& photon, float distance2) {
        if (photon.s > longest) return;
        const LightVertex* y = cache.at(photon.first_vertex);
        for (uint32_t i = 0; i < photon.s; ++i) prefetch(&y[i]);
        near[count++] = {y, int(photon.s), distance2};
        if (count == near.size()) merge_all();
    });
    merge_all();
}

}  // namespace lightloom
