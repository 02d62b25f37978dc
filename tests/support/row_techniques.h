#pragma once
// Finds out which techniques a row of the catalog has, by asking it about paths.

#include "tests/support/path_generator.h"
#include "tests/support/table_render.h"

namespace lightloom::testing {

/// Techniques of paths of two edges and more.
struct RowTechniques {
    bool hit = false, next_event = false, connect = false, lens = false;
    bool connect_to_light = false;  ///< `connect` has points on lights (s = 1) as well.
    bool next_event_later = false;  ///< `next_event` is not for the camera's first hit alone.

    /// Every technique of paths of k edges.
    std::vector<Technique> of_length(int k) const {
        std::vector<Technique> all;
        if (hit) all.push_back(Technique::hit());
        if (k == 2 ? next_event : next_event_later) all.push_back(Technique::next_event());
        for (int s = connect_to_light ? 1 : 2; connect && s < k; ++s) all.push_back(Technique::connect(s));
        if (lens) all.push_back(Technique::lens(k));
        return all;
    }
    /// Bits: hit, next event, connect, lens.
    int bits() const { return int(hit) | int(next_event) << 1 | int(connect) << 2 | int(lens) << 3; }
    /// Whether techniques with these bits make paths of every length from two edges on, where nothing is a Dirac vertex and lights
    /// can be hit: connections of light sub-paths need three.
    bool suffices(int bits) const {
        if (bits & 0b1001 || (bits & 0b10 && next_event_later)) return true;
        return bits & 0b100 && (connect_to_light || bits & 0b10);
    }
};

inline TechniqueMask mask_of_bits(int bits) {
    TechniqueMask mask;
    for (const auto& [bit, kind] : {std::pair{1, TechniqueKind::kHit},
                                    {2, TechniqueKind::kNextEvent},
                                    {4, TechniqueKind::kConnect},
                                    {8, TechniqueKind::kLens}})
        mask.on[int(kind)] = bits & bit;
    return mask;
}

/// One technique alone, for one length.
inline TechniqueMask mask_of(Technique t, int k) {
    TechniqueMask mask = TechniqueMask::length(k);
    for (int kind = 0; kind < kTechniqueKinds; ++kind) mask.on[kind] = kind == int(t.kind);
    mask.only_s = t.s;
    return mask;
}

/// Returns no techniques for a row that cannot be asked about single paths. `scene` has lights that can be hit.
inline RowTechniques techniques_of(const AlgorithmInfo& row, const std::shared_ptr<const Scene>& scene) {
    RowTechniques found;
    const std::string name(row.name);
    const auto renderer = Renderer::create(scene, settings_of(name, with_all_learned(name, {})), random_tables_for(row, *scene, 1));
    if (!renderer.ok()) throw std::runtime_error(renderer.status().message());
    const auto weights = (*renderer)->weights();
    if (!weights) return found;
    for_each_path(
        *scene, 1000, 4, 5,
        [&](const FullPath& path, Technique own, const PathView& view, const Rgb&) {
            if (path.k() < 2 || !(weights->sigma(view, own) > 0)) return;
            switch (own.kind) {
                case TechniqueKind::kHit: found.hit = true; break;
                case TechniqueKind::kNextEvent:
                    found.next_event = true;
                    found.next_event_later |= path.k() > 2;
                    break;
                case TechniqueKind::kConnect:
                    found.connect = true;
                    found.connect_to_light |= own.s == 1;
                    break;
                case TechniqueKind::kLens: found.lens = true; break;
                case TechniqueKind::kMerge: break;  // no path here is made this way
            }
        },
        weights.get());
    return found;
}

}  // namespace lightloom::testing
