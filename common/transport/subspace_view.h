#pragma once
// Labels of full paths: which light subspace every hypothetical light prefix falls into, and which eye subspace every camera
// suffix. A label depends on the end of a sub-path as its own predecessor sees it, so all techniques agree on it.

#include "common/path/correlation.h"
#include "common/path/throughput.h"
#include "common/tables/subspace_tables.h"

namespace lightloom {

struct SubspaceLabeller {
    const SubspaceTables& tables;
    const EmitterSet& emitters;

    /// Labels the sub-path that ends at `v` as traced, and notes where the other tree's labels begin to depend on the
    /// direction.
    static void label(const SubspaceTree& own, const SubspaceTree& other, SubPathVertex* v) {
        const auto settled = own.label_and_settle(sub_path_end(v->p, v->ng, v->wo), other);
        v->label = uint16_t(settled.label);
        v->reverse_branch = settled.other_branch;
    }
    /// The label by `tree`, that of the other kind of sub-path, for one that reaches `v` from the side of
    /// `to_predecessor`.
    static uint16_t reverse_label(const SubspaceTree& tree, const SubPathVertex& v, const Vec3& to_predecessor) {
        const bool same_side = (dot(v.ng, to_predecessor) < 0) == (dot(v.ng, v.wo) < 0);
        return uint16_t(tree.label(sub_path_end(v.p, v.ng, to_predecessor), same_side ? v.reverse_branch : 0));
    }
    /// Label of point x_0 on `emitter`; `travel` is the direction of emission of the environment.
    uint16_t source(uint32_t emitter, const Vec3& position, const Vec3& travel) const {
        return uint16_t(tables.division.label(emitters, emitter, position, travel));
    }

    /// All labels of a complete light sub-path.
    void label_light_path(PathVertex* y, int n) const {
        if (n == 0) return;
        y[0].label = source(uint32_t(y[0].emitter), y[0].p, y[0].ng);
        for (int i = 1; i < n; ++i) {
            if (!y[i].bsdf.has_smooth_lobe()) continue;
            label(tables.light_tree, tables.eye_tree, &y[i]);
            if (i + 1 < n) y[i].reverse_label = reverse_label(tables.eye_tree, y[i], -y[i + 1].wo);
        }
    }
    /// The eye label of a camera vertex, before it is connected.
    void label_camera_vertex(PathVertex* v) const { label(tables.eye_tree, tables.light_tree, v); }

    /// Fills in labels, throughput and footprint of a path made with ViewDetail::kSubspace. `towards` is the unit
    /// vector from z_{t-1} to x_{s-1} (to the emitter of an escaped ray); it is not read for s = 0 on a surface, where
    /// z_{t-1} is x_0. Vertices of z get their reverse labels on demand.
    void complete(const LightSubPath& y, int s, PathVertex* z, int t, const Vec3& towards, PathView* view) const {
        view_throughput(y, s, z, view);
        const int k = view->k;
        const bool hit = s == 0 && k == t - 1;
        const Emitter& e = emitters[uint32_t(s > 0 ? y[0].emitter : hit ? z[t - 1].emitter : emitters.environment_index())];
        view_footprint(e, y, s, z, t, view);
        for (int i = 0; i < s; ++i) view->light_label[i + 1] = y[i].label;
        for (int i = 1; i + 1 < s; ++i) view->eye_label[i] = y[i].reverse_label;
        if (s >= 2) view->eye_label[s - 1] = reverse_label(tables.eye_tree, y[s - 1], -towards);
        for (int j = 1; j < t; ++j) view->eye_label[k - j] = z[j].label;
        if (s == 0 && hit) view->light_label[1] = source(uint32_t(z[t - 1].emitter), z[t - 1].p, z[t - 1].wo);
        if (s == 0 && !hit) view->light_label[1] = source(uint32_t(emitters.environment_index()), {}, -towards);
        // Prefixes that end on the camera side, at z_j; the camera's end vertex z_{t-1} has no successor of its own unless it was
        // the emitter.
        for (int j = 2; j + 1 < t; ++j) label_crossed(z, j, view);
        if (t >= 3 && !hit)
            view->light_label[k - t + 2] =
                z[t - 1].bsdf.has_smooth_lobe() ? reverse_label(tables.light_tree, z[t - 1], towards) : kNoLabel;
        prefetch_gamma(*view);
    }
    /// The same for a path that y[0 .. s-1] and z[0 .. t-1] made by merging at y_{s-1} and z_{t-1}: one vertex, labelled for
    /// prefixes as the light's and for suffixes as the camera's.
    void complete_merge(const LightSubPath& y, int s, PathVertex* z, int t, PathView* view) const {
        view_throughput(y, s, z, view);
        view_footprint(emitters[uint32_t(y[0].emitter)], y, s, z, t, view);
        for (int i = 0; i < s; ++i) view->light_label[i + 1] = y[i].label;
        for (int i = 1; i + 1 < s; ++i) view->eye_label[i] = y[i].reverse_label;
        for (int j = 1; j < t; ++j) view->eye_label[view->k - j] = z[j].label;
        for (int j = 2; j + 1 < t; ++j) label_crossed(z, j, view);
        prefetch_gamma(*view);
    }

  private:
    /// The label of the prefix that ends at z_j, which went on to z_{j+1}.
    void label_crossed(PathVertex* z, int j, PathView* view) const {
        if (z[j].reverse_label == kNoLabel && z[j].bsdf.has_smooth_lobe())
            z[j].reverse_label = reverse_label(tables.light_tree, z[j], -z[j + 1].wo);
        view->light_label[view->k - j + 1] = z[j].reverse_label;
    }
    /// The weight will read Gamma once per technique, each time in another column.
    void prefetch_gamma(const PathView& view) const {
        for (int i = 1; i < view.k; ++i)
            if (view.light_label[i] != kNoLabel && view.eye_label[i] != kNoLabel)
                __builtin_prefetch(tables.column(view.eye_label[i]) + view.light_label[i]);
    }
};

}  // namespace lightloom
