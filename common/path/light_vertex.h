#pragma once
// LightVertex: a vertex of a light sub-path in a cache. It holds only what connections, merges, labels and weights
// read, in two cache lines instead of five: a cache may have a million paths, and drawing from it mostly waits for
// memory.

#include <cstddef>
#include <type_traits>

#include "common/path/vertex.h"

namespace lightloom {

/// The surface at a vertex that is not Lambertian. It is stored apart from the vertex, because few scenes have many of
/// these.
struct LightSurface {
    Bsdf bsdf;
    Vec3 s, t;  ///< Tangents of the shading frame.

    explicit LightSurface(const PathVertex& v) : bsdf(v.bsdf), s(v.shading.s), t(v.shading.t) {}
};

struct alignas(64) LightVertex : SubPathVertex {
    Vec3 ns;  ///< Shading normal.
    BsdfKind kind;
    bool smooth;  ///< Bsdf::has_smooth_lobe(): the vertex can be connected to.
    union {
        Rgb reflectance;              ///< kDiffuse.
        const LightSurface* surface;  ///< All others; null where nothing but Dirac lobes scatters. It belongs to the cache.
    };

    /// `s` must not be null if needs_surface(v), and must outlive the vertex.
    LightVertex(const PathVertex& v, const LightSurface* s)
        : SubPathVertex(v),
          ns(v.shading.n),
          kind(v.bsdf.kind),
          smooth(v.bsdf.has_smooth_lobe()),
          surface(s) {
        if (kind == BsdfKind::kDiffuse) reflectance = v.bsdf.reflectance;
    }
    static bool needs_surface(const PathVertex& v) { return v.bsdf.kind != BsdfKind::kDiffuse && v.bsdf.has_smooth_lobe(); }

    const Vec3& shading_normal() const { return ns; }
    /// Equal to the PathVertex's bit for bit where the vertex can be connected to, and zero elsewhere.
    BsdfEval eval(const Vec3& w, TransportMode mode) const {
        if (kind == BsdfKind::kDiffuse) return eval_diffuse(reflectance, dot(wo, ns), dot(w, ns));
        if (!surface) return {};
        const Frame shading(surface->s, surface->t, ns);
        return surface->bsdf.eval(shading.to_local(wo), shading.to_local(w), mode);
    }
    /// Prefetches what eval() reads besides the vertex itself, which must have been fetched already.
    void prefetch_surface() const {
        if (kind == BsdfKind::kDiffuse || !surface) return;
        for (size_t offset = 0; offset < sizeof(LightSurface); offset += 64)
            __builtin_prefetch(reinterpret_cast<const char*>(surface) + offset);
    }
};
static_assert(std::is_trivially_copyable_v<LightVertex> && sizeof(LightVertex) == 128 && offsetof(SubPathVertex, ng) == 64);

/// A light sub-path y_0 ... whose vertices are as they were traced or in a cache. It is for code that is not worth
/// being compiled for both.
class LightSubPath {
  public:
    LightSubPath() = default;
    LightSubPath(const PathVertex* y) : first_(y) {}                   // NOLINT: both convert
    LightSubPath(const LightVertex* y) : first_(y), compact_(true) {}  // NOLINT

    explicit operator bool() const { return first_ != nullptr; }
    const SubPathVertex& operator[](int i) const {
        if (compact_) return compact(i);
        return traced(i);
    }
    BsdfKind bsdf_kind(int i) const { return compact_ ? compact(i).kind : traced(i).bsdf.kind; }
    bool has_smooth_lobe(int i) const { return compact_ ? compact(i).smooth : traced(i).bsdf.has_smooth_lobe(); }

  private:
    const PathVertex& traced(int i) const { return static_cast<const PathVertex*>(first_)[i]; }
    const LightVertex& compact(int i) const { return static_cast<const LightVertex*>(first_)[i]; }

    const SubPathVertex* first_ = nullptr;
    bool compact_ = false;
};

}  // namespace lightloom
