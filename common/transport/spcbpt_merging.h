#pragma once
// `spcbpt` with merging=on: the light sub-paths of the cache are photons as well. Effective densities, besides those of spcbpt.h,
// at x_i as in vcm.h:
//     merge at x_i   rho = n a S_L(i+1) S_E(k+1-i) C(i+1) A(i)      n: the cache's light sub-paths, S: typical survival of roulette
// With a correction, n c_i stands for n (common/path/merge_shares.h). Each iteration has a cache, and so photons, of its own,
// and n is a constant of the frame. Tables: those of spcbpt, learned by a loss that counts merges among the techniques that Gamma
// does not change. Bias: as vcm's. Missing: nothing that has a vertex to merge at.

#include "common/path/merge_shares.h"
#include "common/transport/renderer.h"
#include "common/transport/spcbpt.h"

namespace lightloom {

/// Merging on one path, beside techniques whose survival of roulette is known.
class MergesOnPath {
  public:
    /// Reads footprint_distance2 and, for corrections, what view_footprint() writes.
    MergesOnPath(const PathView& view, const MergeTerms& terms, Correction correction)
        : density_(terms.density(view.footprint_distance2)),
          k_(view.k),
          last_(terms.last(view.k)),
          shares_(MergeShares::of(correction, view, {terms.paths, terms.disc(view.footprint_distance2), last_})) {}
    /// sigma of merging at x_i, 1 <= i <= k-1.
    double sigma(int i, const PathSurvival& survival) const {
        return i > last_ ? 0 : density_ * shares_(i) * survival.light(i + 1) * survival.camera(k_ + 1 - i);
    }

  private:
    double density_;
    int k_, last_;
    MergeShares shares_;
};

/// A selection of spcbpt.h and merges.
struct MergingSelection {
    SpcbptSelection inner;
    MergeTerms terms;

    struct OnPath : SpcbptSelection::OnPath {
        static constexpr bool kMerges = true;
        MergesOnPath merges;

        double merge(int i) const { return merges.sigma(i, this->survival); }
    };
    OnPath on(const PathView& view) const { return OnPath{{inner.on(view)}, {view, terms, inner.correction}}; }
    NextEventRays next_event_rays() const { return inner.next_event_rays(); }
};

/// `Select` leaves techniques out, see make_unit_renderer().
template <class Select>
struct MergingConnections : SubspaceConnections<decltype(std::declval<const Select&>()(std::declval<MergingSelection>()))> {
    using Base = SubspaceConnections<decltype(std::declval<const Select&>()(std::declval<MergingSelection>()))>;
    using Selection = decltype(Base::densities);
    static constexpr bool kMerges = true;

    Select select;
    MergingSelection first;  ///< Of the first iteration.
    double alpha;

    MergingConnections(Select s, MergingSelection f, double shrinking, std::shared_ptr<const PreparedTables> tables,
                       ByDepth<int> draws)
        : Base{s(f), std::move(tables), draws},
          select(std::move(s)),
          first(std::move(f)),
          alpha(shrinking) {}

    MergeTerms merging(const UnitScope& scope) const { return first.terms.of_iteration(scope.work.group_first_iteration, alpha); }
    Selection selection(const UnitScope& scope) const {
        MergingSelection now = first;
        now.terms = merging(scope);
        return select(std::move(now));
    }
    /// A path whose sub-paths have one vertex more than the path itself was made by a merge.
    void complete(const Scene& scene, const LightSubPath& y, int s, PathVertex* z, int t, const Vec3& towards,
                  PathView* view) const {
        if (s >= 2 && view->k == s + t - 2)
            this->labeller(scene).complete_merge(y, s, z, t, view);
        else
            this->labeller(scene).complete(y, s, z, t, towards, view);
        // With t = 1, x_{k-1} is no Dirac vertex.
        view->footprint_distance2 = t >= 2 ? camera_distance2(z, t) : view->primary_distance2;
    }
};

/// spcbpt's renderer with merging=on; `inner` has what it is without.
Result<std::unique_ptr<Renderer>> make_merging_spcbpt(const RendererRequest& request, const SpcbptSelection& inner,
                                                      std::shared_ptr<const PreparedTables> prepared);
/// The terms of the first iteration with a cache of `windows` windows.
MergeTerms spcbpt_merge_terms(const AlgorithmSettings& settings, const Scene& scene, int windows);

}  // namespace lightloom
