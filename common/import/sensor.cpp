// The sensor of a film: what remains of it in RGB.
//
// pbrt-v4 integrates spectra over the sensor's three curves, maps the triples to XYZ by a matrix that was fitted to the
// colours of a chart, which balances white: a chart under the daylight of `whitebalance` comes out as under the white
// of the output's colour space. Light here is RGB already, so that every sensor sees as the CIE 1931 observer does, and
// only the balance is left: the Bradford transformation from that daylight to D65, which is all that pbrt-v4 does for
// its sensor "cie1931" as well.

#include <algorithm>
#include <array>

#include "common/core/math.h"
#include "common/import/context.h"
#include "common/import/spectra.h"

namespace lightloom::import {
namespace {

using Matrix = FilmResponse::Matrix;
using Triple = FilmResponse::Triple;

Matrix product(const Matrix& a, const Matrix& b) {
    Matrix out{};
    for (size_t i = 0; i < 3; ++i)
        for (size_t j = 0; j < 3; ++j)
            for (size_t k = 0; k < 3; ++k) out[i][j] += a[i][k] * b[k][j];
    return out;
}

Matrix inverse_of(const Matrix& m) {
    const auto minor = [&](size_t i, size_t j) {
        const size_t r0 = i == 0 ? 1 : 0, r1 = i == 2 ? 1 : 2, c0 = j == 0 ? 1 : 0, c1 = j == 2 ? 1 : 2;
        return ((i + j) % 2 == 0 ? 1 : -1) * (m[r0][c0] * m[r1][c1] - m[r0][c1] * m[r1][c0]);
    };
    const double determinant = m[0][0] * minor(0, 0) + m[0][1] * minor(0, 1) + m[0][2] * minor(0, 2);
    Matrix out;
    for (size_t i = 0; i < 3; ++i)
        for (size_t j = 0; j < 3; ++j) out[i][j] = minor(j, i) / determinant;
    return out;
}

/// XYZ of luminance 1 from chromaticity.
Triple xyz_of(double x, double y) { return {x / y, 1, (1 - x - y) / y}; }

/// XYZ of CIE daylight (CIE 015), which is not defined below 4000 K; there it is that of a black body, as in pbrt-v4.
/// Temperatures of daylight are based on an older constant of Planck's law, so that D65 is the daylight of 6504 K;
/// pbrt-v4 corrects them in the same way.
Triple daylight(double kelvin) {
    const double t = kelvin * (1.4388 / 1.4380);
    if (t < 4000) {
        const Xyz c = blackbody_xyz(t);
        return {c.x / c.y, 1, c.z / c.y};
    }
    const double u = 1e3 / t;
    const double x =
        t <= 7000 ? 0.244063 + u * (0.09911 + u * (2.9678 - u * 4.6070)) : 0.237040 + u * (0.24748 + u * (1.9018 - u * 2.0064));
    return xyz_of(x, x * (2.870 - 3 * x) - 0.275);
}

/// The von Kries adaptation in Bradford's primaries [Lam 1985] from the white of `kelvin` to D65, in linear Rec.709 RGB.
Matrix white_balance(double kelvin) {
    constexpr Matrix kBradford{{{0.8951, 0.2664, -0.1614}, {-0.7502, 1.7135, 0.0367}, {0.0389, -0.0685, 1.0296}}};
    constexpr Matrix kRgbOfXyz{
        {{3.2404542, -1.5371385, -0.4985314}, {-0.9692660, 1.8760108, 0.0415560}, {0.0556434, -0.2040259, 1.0572252}}};
    const auto apply = [](const Matrix& m, const Triple& v) { return FilmResponse{1, m}.balanced(v); };
    const Triple from = apply(kBradford, daylight(kelvin)), to = apply(kBradford, xyz_of(0.3127, 0.3290));
    Matrix scale{};
    for (size_t c = 0; c < 3; ++c) scale[c][c] = to[c] / from[c];
    const Matrix adapt = product(inverse_of(kBradford), product(scale, kBradford));
    return product(kRgbOfXyz, product(adapt, inverse_of(kRgbOfXyz)));
}

}  // namespace

FilmResponse::Matrix sensor_colour(Context* context, const ParameterList& p) {
    const std::string sensor = p.one_string("sensor", "cie1931");
    if (sensor != "cie1931") {
        constexpr std::array<std::string_view, 17> kSensors{
            "canon_eos_100d",     "canon_eos_1dx_mkii", "canon_eos_200d",    "canon_eos_200d_mkii", "canon_eos_5d",
            "canon_eos_5d_mkii",  "canon_eos_5d_mkiii", "canon_eos_5d_mkiv", "canon_eos_5ds",       "canon_eos_m",
            "hasselblad_l1d_20c", "nikon_d810",         "nikon_d850",        "sony_ilce_6400",      "sony_ilce_7m3",
            "sony_ilce_7rm3",     "sony_ilce_9"};
        if (std::find(kSensors.begin(), kSensors.end(), sensor) == kSensors.end())
            fail(p.where(), p.what() + ": the sensor " + quoted(sensor) + " is unknown; correct its name or use \"cie1931\"");
        context->diagnostics.warn(p.where(), p.what() + ": of the sensor " + quoted(sensor) +
                                                 " exposure and white balance are taken, its spectral curves are not; "
                                                 "saturated colours differ a little from pbrt's");
    }
    const float kelvin = p.one_float("whitebalance", 0);
    // By default real sensors are balanced for 6500 K, which is the white of the picture.
    if (kelvin == 0) return FilmResponse::kNeutral;
    if (!(kelvin >= 1000) || !(kelvin <= 25000))
        fail(p.where(), p.what() + ": whitebalance must be 0, for none, or lie between 1000 and 25000 kelvin");
    return white_balance(double(kelvin));
}

}  // namespace lightloom::import
