#pragma once
// TechniqueMask leaves techniques out: the weights of those that remain sum to one again, so that the image has the
// same mean wherever they can make the same paths. It is for measurements and tests; what a user renders has no mask.

#include <algorithm>

#include "common/path/mis.h"

namespace lightloom {

struct TechniqueMask {
    bool on[kTechniqueKinds] = {true, true, true, true, true};  ///< By TechniqueKind: whether it remains.
    int only_s = -1;                                            ///< Only this split remains; -1: all do.
    int min_k = 1, max_k = kMaxEdges;                           ///< Lengths of paths, in edges, that remain.
    int max_light_vertices = kMaxEdges;                         ///< Light sub-paths have at most this many.
    bool visible_stays = false;                                 ///< Directly visible emitters remain, hits or not.

    static TechniqueMask without(TechniqueKind kind) {
        TechniqueMask mask;
        mask.on[int(kind)] = false;
        return mask;
    }
    static TechniqueMask length(int k) { return {.min_k = k, .max_k = k}; }

    /// What both leave; `only_s` is that of either.
    TechniqueMask both(const TechniqueMask& other) const {
        TechniqueMask out = *this;
        for (int kind = 0; kind < kTechniqueKinds; ++kind) out.on[kind] &= other.on[kind];
        out.min_k = std::max(min_k, other.min_k);
        out.max_k = std::min(max_k, other.max_k);
        out.max_light_vertices = std::min(max_light_vertices, other.max_light_vertices);
        if (only_s < 0) out.only_s = other.only_s;
        constexpr int kHit = int(TechniqueKind::kHit);
        out.visible_stays = (on[kHit] || visible_stays) && (other.on[kHit] || other.visible_stays);
        return out;
    }
    bool allows(int k, Technique t) const {
        const bool visible = k == 1 && visible_stays && t.kind == TechniqueKind::kHit;
        return (on[int(t.kind)] || visible) && k >= min_k && k <= max_k && t.light_vertices() <= max_light_vertices &&
               (only_s < 0 || t.s == only_s);
    }
};

template <class Selection>
struct Masked {
    Selection inner;
    TechniqueMask mask;

    struct OnPath : Selection::OnPath {
        using Inner = typename Selection::OnPath;
        TechniqueMask mask;
        int k;

        double hit() const {
            return allow(Technique::hit(), [&] { return Inner::hit(); });
        }
        double next_event() const {
            return allow(Technique::next_event(), [&] { return Inner::next_event(); });
        }
        double connect(int s) const {
            return allow(Technique::connect(s), [&] { return Inner::connect(s); });
        }
        double lens() const {
            return allow(Technique::lens(k), [&] { return Inner::lens(); });
        }
        double merge(int i) const {
            return allow(Technique::merge(i), [&] { return Inner::merge(i); });
        }

      private:
        template <class Value>
        double allow(Technique t, Value&& value) const {
            return mask.allows(k, t) ? value() : 0;
        }
    };
    OnPath on(const PathView& view) const { return OnPath{{inner.on(view)}, mask, view.k}; }
    auto next_event_rays() const { return inner.next_event_rays(); }
};

}  // namespace lightloom
