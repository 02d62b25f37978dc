#pragma once
// PathVertex: one vertex of a camera or light sub-path. s and t count vertices; z_0 is on the lens, y_0 on the emitter.

#include <cmath>

#include "common/scene/scene.h"

namespace lightloom {

/// "Not classified": see PathVertex::label.
inline constexpr uint16_t kNoLabel = 0xffff;

struct PathVertex {
    Vec3 p, ng;  ///< Position; geometric normal (at an infinite light's y_0: the direction of travel).
    Frame shading;
    Vec3 wo;        ///< Unit, towards the predecessor.
    Vec3 wo_local;  ///< The same in the shading frame.
    Bsdf bsdf;
    Rgb alpha;              ///< Throughput of the sub-path up to here, before this vertex scatters.
    double fwd = 0;         ///< Density of this vertex as traced; area, or native measure at y_0.
    double rev = 0;         ///< Density of this vertex as traced from its successor's far side; set when both exist.
    float to_previous = 0;  ///< Turns a solid-angle density at this vertex towards the predecessor into the predecessor's
                            ///< density: |cos| / d^2, 1 for an infinite light, 0 for a light that cannot be hit.
    /// Light sub-paths: |wo.ns| / |wo.ng|, the part of the adjoint correction that belongs to the incoming direction
    /// [Veach 1997, 5.3]. Camera sub-paths: 1.
    float adjoint = 1;
    int32_t emitter = kNone;  ///< Emitter that this vertex lies on.
    float reach = 0;          ///< SurfacePoint::reach.
    bool delta = false;       ///< The sub-path went on through a Dirac lobe.
    /// Light subspace of the prefix, or eye subspace of the suffix, that ends here as traced; and of the other kind, seen from
    /// the successor. kNoLabel until a method with tables asks for them.
    uint16_t label = kNoLabel, reverse_label = kNoLabel;
    /// Where the classifier of reverse_label goes on for this vertex as seen from wo's side (SubspaceTree::label_and_settle()); 0:
    /// the root.
    uint32_t reverse_branch = 0;
    /// Product of the survival probabilities that alpha was divided by: alpha * survival is free of Russian roulette.
    float survival = 1;
    /// Camera sub-paths, once it has scattered: what light tracing would multiply a prefix's F / C by when it crosses this
    /// vertex the other way, from the successor to the predecessor (BSDF, adjoint correction, density; see PathView::step).
    Rgb step;
};

/// What leaves a vertex towards `w` (unit): BSDF value with the cosines of the sub-path's kind, and both densities.
struct Scatter {
    Rgb value;          ///< Camera sub-path: f |w.ns|. Light sub-path: f |w.ng| |wo.ns| / |wo.ng|.
    float pdf_fwd = 0;  ///< Solid angle, towards w.
    float pdf_rev = 0;  ///< Solid angle, towards the predecessor when coming from w.
};

template <TransportMode mode>
Scatter scatter(const PathVertex& v, const Vec3& w) {
    const Vec3 wi = v.shading.to_local(w);
    const BsdfEval e = v.bsdf.eval(v.wo_local, wi, mode);
    const float cosine = mode == TransportMode::kRadiance ? std::fabs(wi.z) : abs_dot(w, v.ng) * v.adjoint;
    return {e.f * cosine, e.pdf_fwd, e.pdf_rev};
}

}  // namespace lightloom
