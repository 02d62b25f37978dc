#pragma once
// Corrections of the weights for what their densities do not say: how many of a technique's n samples count. A
// correction is a function of the path, so that weights with it still sum to one and no mean changes.

#include "common/path/correction.h"
#include "common/path/correlation.h"
#include "common/path/mis.h"

namespace lightloom {

/// c_s in [1/n, 1] of n samples that split the path after s light vertices and share their camera sub-path.
inline double share_of_samples(Correction correction, const PathView& view, int s, double n) {
    switch (correction) {
        case Correction::kOne: return n > 1 ? 1 / n : 1;
        // Computed one by one, the factors cost the number of possible connections times that of edges per
        // weight. Products that grow along the path would be cheaper, but they round differently, which changes
        // the bytes of every image.
        case Correction::kCorrelation: return correlation_factor(view, s, n);
        case Correction::kUncorrected:
        case Correction::kFootprint:
        case Correction::kPhotons:
        case Correction::kPhotonsBalanced: return 1;
    }
    return 1;
}

/// A selection that counts n c_s samples instead of n. Inner::OnPath gives the number of connections that split the path after s
/// light vertices, connections(s), sigma if only a share of them counts, connect(s, share), and the number of rays of next event
/// estimation, shadow_rays(). Its view must have what view_footprint() writes.
template <class Inner>
struct Corrected {
    Inner inner;
    Correction correction = Correction::kUncorrected;

    struct OnPath : Inner::OnPath {
        static constexpr bool kReadsFootprint = true;
        Correction correction;

        double connect(int s) const {
            return Inner::OnPath::connect(s, share_of_samples(correction, this->view, s, this->connections(s)));
        }
        double next_event() const {
            return share_of_samples(correction, this->view, 1, this->shadow_rays()) * Inner::OnPath::next_event();
        }
    };
    OnPath on(const PathView& view) const { return OnPath{{inner.on(view)}, correction}; }
    auto next_event_rays() const { return inner.next_event_rays(); }
};

/// make(selection) with the correction, or without any where there is none, so that nothing is asked where nothing is corrected.
template <class Inner, class Make>
auto make_corrected(const Inner& inner, Correction correction, Make&& make) {
    return correction == Correction::kUncorrected ? make(inner) : make(Corrected<Inner>{inner, correction});
}

/// Whether a selection reads what view_footprint() writes.
template <class Selection>
inline constexpr bool kReadsFootprint = requires {
    Selection::OnPath::kReadsFootprint;
};

}  // namespace lightloom
