#pragma once
// PathVertex: one vertex of a camera or light sub-path. s and t count vertices; z_0 is on the lens, y_0 on the emitter.

#include <cmath>

#include "common/scene/scene.h"

namespace lightloom {

/// "Not classified": see SubPathVertex::label.
inline constexpr uint16_t kNoLabel = 0xffff;

/// What full paths, weights and labels read of a vertex, whether it was traced just now or is kept in a cache. What they read of
/// every vertex of a sub-path comes first and fills one cache line.
struct SubPathVertex {
    double fwd = 0;      ///< Density of this vertex as traced; area, or native measure at y_0.
    double rev = 0;      ///< Density of this vertex as traced from its successor; set when the successor has scattered.
    Vec3 p;              ///< Position.
    Rgb alpha;           ///< Throughput of the sub-path up to here, before this vertex scatters.
    float survival = 1;  ///< What roulette divided alpha by: alpha * survival is free of it. A product of probabilities, or of
                         ///< expected numbers of branches.
    /// Light subspace of the prefix, or eye subspace of the suffix, that ends here as traced; reverse_label is of the
    /// other kind, as seen from the successor. kNoLabel until a method with tables asks for them.
    uint16_t label = kNoLabel, reverse_label = kNoLabel;
    /// Node from which the classifier of reverse_label goes on if this vertex is seen from wo's side
    /// (SubspaceTree::label_and_settle()); 0 is the root.
    uint32_t reverse_branch = 0;
    int32_t emitter = kNone;  ///< Emitter that this vertex lies on.
    float to_previous = 0;    ///< Turns a solid-angle density at this vertex towards the predecessor into the predecessor's
                              ///< density: |cos| / d^2, 1 for an infinite light, 0 for a light that cannot be hit.
    bool delta = false;       ///< The sub-path went on through a Dirac lobe.
    bool lossless = false;    ///< Bsdf::is_lossless(): no light is lost here.
    Vec3 ng;                  ///< Geometric normal (at an infinite light's y_0: the direction of travel).
    Vec3 wo;                  ///< Unit, towards the predecessor.
    float reach = 0;          ///< SurfacePoint::reach.
    /// Light sub-paths: |wo.ns| / |wo.ng|, the part of the adjoint correction that belongs to the incoming direction
    /// [Veach 1997, 5.3]. Camera sub-paths: 1.
    float adjoint = 1;
};

struct PathVertex : SubPathVertex {
    Frame shading;
    Vec3 wo_local;  ///< `wo` in the shading frame.
    Bsdf bsdf;
    /// For camera sub-paths, once the vertex has scattered: what light tracing would multiply a prefix's F / C by when
    /// it crosses this vertex the other way, from the successor to the predecessor (BSDF, adjoint correction, density;
    /// see PathView::step).
    Rgb step;

    void set_bsdf(const Bsdf& b) {
        bsdf = b;
        lossless = b.is_lossless();
    }
    const Vec3& shading_normal() const { return shading.n; }
    BsdfEval eval(const Vec3& w, TransportMode mode) const { return bsdf.eval(wo_local, shading.to_local(w), mode); }
};

/// What leaves a vertex towards `w` (unit): BSDF value with the cosines of the sub-path's kind, and both densities.
struct Scatter {
    Rgb value;          ///< Camera sub-path: f |w.ns|. Light sub-path: f |w.ng| |wo.ns| / |wo.ng|.
    float pdf_fwd = 0;  ///< Solid angle, towards w.
    float pdf_rev = 0;  ///< Solid angle, towards the predecessor when coming from w.
};

/// `Vertex`: PathVertex, or LightVertex (light_vertex.h).
template <TransportMode mode, class Vertex>
Scatter scatter(const Vertex& v, const Vec3& w) {
    const float shading_cosine = dot(w, v.shading_normal());
    const BsdfEval e = v.eval(w, mode);
    const float cosine = mode == TransportMode::kRadiance ? std::fabs(shading_cosine) : abs_dot(w, v.ng) * v.adjoint;
    return {e.f * cosine, e.pdf_fwd, e.pdf_rev};
}

}  // namespace lightloom
