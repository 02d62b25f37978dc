#pragma once
// Corrections of the weights for what their densities do not say: how many of a technique's n samples count. A
// correction is a function of the path, so that weights with it still sum to one and no mean changes.

#include "common/path/correlation.h"
#include "common/path/mis.h"

namespace lightloom {

enum class Correction : uint8_t {
    kUncorrected,
    kCorrelation,  ///< Connections that share a camera sub-path [Grittmann, Georgiev and Slusallek 2021]; correlation.h.
};

/// A selection that counts n c_s connections instead of n. Inner::OnPath gives the number of those that split the path after s
/// light vertices, connections(s), and sigma if only a share of them counts, connect(s, share). Its view must have what
/// view_footprint() writes.
template <class Inner>
struct Corrected {
    Inner inner;
    Correction correction = Correction::kUncorrected;

    struct OnPath : Inner::OnPath {
        Correction correction;

        double connect(int s) const { return Inner::OnPath::connect(s, share(s)); }

      private:
        double share(int s) const {
            switch (correction) {
                case Correction::kUncorrected: return 1;
                // Computed one by one, the factors cost the number of possible connections times that of edges per
                // weight. Products that grow along the path would be cheaper, but they round differently, which changes
                // the bytes of every image.
                case Correction::kCorrelation: return correlation_factor(this->view, s, this->connections(s));
            }
            return 1;
        }
    };
    OnPath on(const PathView& view) const { return OnPath{{inner.on(view)}, correction}; }
    auto next_event_rays() const { return inner.next_event_rays(); }
};

}  // namespace lightloom
