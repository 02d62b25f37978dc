#pragma once
// FilmResponse: how a film turns the light that reaches it into pixel values. It is linear, so that it can be applied
// to sums and means, after rendering.

#include <array>

#include "common/core/vec.h"

namespace lightloom {

struct FilmResponse {
    using Triple = std::array<double, 3>;
    using Matrix = std::array<Triple, 3>;
    static constexpr Matrix kNeutral{{{1, 0, 0}, {0, 1, 0}, {0, 0, 1}}};

    double exposure = 1;       ///< Multiplies every channel: exposure time * iso / 100. Not negative.
    Matrix colour = kNeutral;  ///< White balance, from linear Rec.709 RGB to the same; applied before the exposure.

    bool is_neutral() const { return colour == kNeutral; }
    /// Applies the white balance alone. With the neutral matrix the value does not change by a single bit.
    Triple balanced(const Triple& rgb) const {
        Triple out;
        for (size_t c = 0; c < 3; ++c) out[c] = colour[c][0] * rgb[0] + colour[c][1] * rgb[1] + colour[c][2] * rgb[2];
        return out;
    }
    /// The pixel value of light `rgb`.
    Triple operator()(const Triple& rgb) const {
        Triple out = balanced(rgb);
        for (double& v : out) v *= exposure;
        return out;
    }
    Triple of(const Rgb& rgb) const { return (*this)(triple(rgb)); }
    static Triple triple(const Rgb& rgb) { return {double(rgb.r), double(rgb.g), double(rgb.b)}; }
};

}  // namespace lightloom
