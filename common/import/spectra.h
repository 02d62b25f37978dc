#pragma once
// How pbrt's spectra become linear RGB (Rec.709 primaries, white D65). The renderer is RGB; these are the rules:
//
// * `rgb` is taken as it is. As a light it is that radiance (intensity, irradiance) in the picture; pbrt's spectral film
//   reproduces exactly these numbers too.
// * Lights (`spectrum` values, files, names, `blackbody`): pbrt-v4 scales a spectrum so that its luminance is 1 and then
//   applies the light's `scale` or `power`. So only the chromaticity counts: XYZ with the CIE 1931 2 degree observer,
//   divided by Y, to RGB. A component below zero (a colour outside the gamut) becomes 0 and the others are scaled so
//   that the luminance stays 1; the import says so.
// * Reflectances and transmittances: the colour under the white D65, RGB(R * D65) / RGB(D65): a constant r is
//   (r, r, r). Components are clamped to [0, 1].
// * Indices of refraction eta and k of conductors: a weighted mean per channel, the weights being the positive part
//   of the channel's matching function times D65. If both eta and k are spectra, k is then adjusted so that the reflectance at
//   normal incidence is exactly the RGB colour of the spectral reflectance there, which is what one sees (but at most
//   0.9999 in each channel: the red of gold would be 1.02)
// * The index of a dielectric: its value at the sodium line (587.6 nm, the n_d of a glass catalogue); dispersion is
//   ignored, which the import says.
//
// A black body is a light of its colour, and anywhere else the spectrum that is 1 at its peak, as in pbrt. A named index of
// refraction is known by its reduction only; as a reflectance it is that, clamped to [0, 1] per channel, which the import says.
//
// A spectrum is linear between its samples and zero outside of them, as in pbrt.

#include <optional>
#include <string>
#include <vector>

#include "common/core/vec.h"

namespace lightloom::import {

struct SpectrumSample {
    double nanometres, value;
};
/// Samples with increasing wavelengths.
using Spectrum = std::vector<SpectrumSample>;

double evaluate(const Spectrum& spectrum, double nanometres);

/// RGB of luminance 1 with the chromaticity of the XYZ colour; `*clipped` is set when it lies outside the gamut.
Rgb unit_luminance_rgb(double x, double y, double z, bool* clipped);
/// RGB of luminance 1; nothing if the spectrum has no luminance.
std::optional<Rgb> illuminant_rgb(const Spectrum& spectrum, bool* clipped);
/// CIE 1931 2 degree tristimulus values.
struct Xyz {
    double x, y, z;
};
/// XYZ of a black body, on an arbitrary scale. `kelvin` is positive.
Xyz blackbody_xyz(double kelvin);
/// A black body's colour, luminance 1. `kelvin` is positive.
Rgb blackbody_rgb(double kelvin, bool* clipped);
/// A black body from 380 to 780 nm, relative to its peak (which may lie outside), as pbrt uses it for anything but a
/// light.
Spectrum blackbody_spectrum(double kelvin);
/// The colour of a named light spectrum (stdillum-..., illum-acesD60); nothing for an unknown name.
std::optional<Rgb> named_illuminant_rgb(const std::string& name, bool* clipped);

Rgb reflectance_rgb(const Spectrum& spectrum);
/// Contribution of D65's light at one wavelength (380 to 780 nm, otherwise zero) to linear RGB, per nanometre; together
/// they are (1, 1, 1).
Rgb d65_rgb_at(int nanometres);

struct ConductorRgb {
    Rgb eta, k;
};
/// Per-channel weighted mean of an index spectrum.
Rgb index_rgb(const Spectrum& spectrum);
ConductorRgb conductor_rgb(const Spectrum& eta, const Spectrum& k);
/// Reduced indices of "metal-Ag", "metal-Al", ...: the name without "-eta" or "-k".
std::optional<ConductorRgb> named_metal(const std::string& name);
/// n_d of a glass such as "glass-BK7"; nothing for an unknown name.
std::optional<float> named_glass(const std::string& name);
/// The reduced index "metal-Ag-eta", "metal-Ag-k", or a glass's n_d in every channel; nothing for any other name.
std::optional<Rgb> named_index(const std::string& name);
/// Whether a parameter of some kind may have this name as its spectrum: any of the above, a metal's with "-eta" or "-k".
bool is_named_spectrum(const std::string& name);

/// Parses a spectrum file: pairs of wavelength and value, blanks or commas between the numbers, '#' comments. Nothing
/// if the text is anything else.
std::optional<Spectrum> parse_spectrum_text(const std::string& text);
/// Makes a spectrum of the pairs in a parameter; nothing if their number is odd or the wavelengths do not increase.
std::optional<Spectrum> spectrum_from_pairs(const std::vector<double>& values);

}  // namespace lightloom::import
