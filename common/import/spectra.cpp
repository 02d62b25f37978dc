#include "common/import/spectra.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "common/core/math.h"
#include "common/import/file_source.h"
#include "common/import/tokenizer.h"

namespace lightloom::import {
namespace {

constexpr int kFirst = 380, kStep = 10, kCount = 41;

struct Row {
    double x, y, z;  ///< CIE 1931 2 degree colour matching functions.
    double d65;      ///< Relative power of the CIE illuminant D65.
};

// CIE 015, every 10 nm from 380 to 780.
constexpr std::array<Row, kCount> kRows{{
    {0.001368, 0.000039, 0.006450, 49.9755}, {0.004243, 0.000120, 0.020050, 54.6482}, {0.014310, 0.000396, 0.067850, 82.7549},
    {0.043510, 0.001210, 0.207400, 91.4860}, {0.134380, 0.004000, 0.645600, 93.4318}, {0.283900, 0.011600, 1.385600, 86.6823},
    {0.348280, 0.023000, 1.747060, 104.865}, {0.336200, 0.038000, 1.772110, 117.008}, {0.290800, 0.060000, 1.669200, 117.812},
    {0.195360, 0.090980, 1.287640, 114.861}, {0.095640, 0.139020, 0.812950, 115.923}, {0.032010, 0.208020, 0.465180, 108.811},
    {0.004900, 0.323000, 0.272000, 109.354}, {0.009300, 0.503000, 0.158200, 107.802}, {0.063270, 0.710000, 0.078250, 104.790},
    {0.165500, 0.862000, 0.042160, 107.689}, {0.290400, 0.954000, 0.020300, 104.405}, {0.433450, 0.994950, 0.008750, 104.046},
    {0.594500, 0.995000, 0.003900, 100.000}, {0.762100, 0.952000, 0.002100, 96.3342}, {0.916300, 0.870000, 0.001650, 95.7880},
    {1.026300, 0.757000, 0.001100, 88.6856}, {1.062200, 0.631000, 0.000800, 90.0062}, {1.002600, 0.503000, 0.000340, 89.5991},
    {0.854450, 0.381000, 0.000190, 87.6987}, {0.642400, 0.265000, 0.000050, 83.2886}, {0.447900, 0.175000, 0.000020, 83.6992},
    {0.283500, 0.107000, 0.000000, 80.0268}, {0.164900, 0.061000, 0.000000, 80.2146}, {0.087400, 0.032000, 0.000000, 82.2778},
    {0.046770, 0.017000, 0.000000, 78.2842}, {0.022700, 0.008210, 0.000000, 69.7213}, {0.011359, 0.004102, 0.000000, 71.6091},
    {0.005790, 0.002091, 0.000000, 74.3490}, {0.002899, 0.001047, 0.000000, 61.6040}, {0.001440, 0.000520, 0.000000, 69.8856},
    {0.000690, 0.000249, 0.000000, 75.0870}, {0.000332, 0.000120, 0.000000, 63.5927}, {0.000166, 0.000060, 0.000000, 46.4182},
    {0.000083, 0.000030, 0.000000, 66.8054}, {0.000042, 0.000015, 0.000000, 63.3828},
}};

/// The tables at a whole number of nanometres: linear in D65 (as the CIE defines it), cubic in the matching functions.
Row row_at(int nanometres) {
    const int i = std::min((nanometres - kFirst) / kStep, kCount - 2);
    const double t = double(nanometres - kFirst - i * kStep) / kStep;
    const Row &a = kRows[size_t(std::max(i - 1, 0))], &b = kRows[size_t(i)], &c = kRows[size_t(i + 1)],
              &d = kRows[size_t(std::min(i + 2, kCount - 1))];
    const auto cubic = [t](double p, double q, double r, double s) {
        const double v = q + 0.5 * t * (r - p + t * (2 * p - 5 * q + 4 * r - s + t * (3 * (q - r) + s - p)));
        return std::max(v, 0.0);
    };
    return {cubic(a.x, b.x, c.x, d.x), cubic(a.y, b.y, c.y, d.y), cubic(a.z, b.z, c.z, d.z), b.d65 + t * (c.d65 - b.d65)};
}

struct Rgb3 {
    double r, g, b;
};

/// XYZ to linear Rec.709 RGB, IEC 61966-2-1.
Rgb3 to_rgb(double x, double y, double z) {
    return {3.2404542 * x - 1.5371385 * y - 0.4985314 * z, -0.9692660 * x + 1.8760108 * y + 0.0415560 * z,
            0.0556434 * x - 0.2040259 * y + 1.0572252 * z};
}

/// Sums `f(nanometres, row)` over the visible range.
template <typename F>
void for_each_nanometre(F f) {
    for (int nm = kFirst; nm <= kFirst + kStep * (kCount - 1); ++nm) f(double(nm), row_at(nm));
}

/// RGB of `values(nm)` under D65, white being (1, 1, 1).
template <typename F>
Rgb3 colour_under_d65(F values) {
    double sum[3] = {}, white[3] = {};
    for_each_nanometre([&](double nm, const Row& row) {
        const double v = values(nm);
        const double weight[3] = {row.x * row.d65, row.y * row.d65, row.z * row.d65};
        for (int c = 0; c < 3; ++c) sum[c] += weight[c] * v, white[c] += weight[c];
    });
    const Rgb3 a = to_rgb(sum[0], sum[1], sum[2]), w = to_rgb(white[0], white[1], white[2]);
    return {a.r / w.r, a.g / w.g, a.b / w.b};
}

double unit(double v) { return clamp(v, 0.0, 1.0); }

}  // namespace

double evaluate(const Spectrum& spectrum, double nanometres) {
    if (spectrum.empty() || nanometres < spectrum.front().nanometres || nanometres > spectrum.back().nanometres) return 0;
    const auto after = std::upper_bound(spectrum.begin(), spectrum.end(), nanometres,
                                        [](double nm, const SpectrumSample& s) { return nm < s.nanometres; });
    if (after == spectrum.end()) return spectrum.back().value;
    const SpectrumSample &a = *(after - 1), &b = *after;
    return a.value + (b.value - a.value) * (nanometres - a.nanometres) / (b.nanometres - a.nanometres);
}

Rgb unit_luminance_rgb(double x, double y, double z, bool* clipped) {
    Rgb3 c = to_rgb(x / y, 1, z / y);
    if (c.r < 0 || c.g < 0 || c.b < 0) {
        // A white that deviates by the rounding of published chromaticities is not worth a warning.
        if (std::min({c.r, c.g, c.b}) < -1e-3) *clipped = true;
        c = {std::max(c.r, 0.0), std::max(c.g, 0.0), std::max(c.b, 0.0)};
        const double luminance = 0.2126 * c.r + 0.7152 * c.g + 0.0722 * c.b;
        c = {c.r / luminance, c.g / luminance, c.b / luminance};
    }
    return {float(c.r), float(c.g), float(c.b)};
}

std::optional<Rgb> illuminant_rgb(const Spectrum& spectrum, bool* clipped) {
    double x = 0, y = 0, z = 0;
    for_each_nanometre([&](double nm, const Row& row) {
        const double v = evaluate(spectrum, nm);
        x += v * row.x, y += v * row.y, z += v * row.z;
    });
    if (!(y > 0) || !std::isfinite(x + y + z)) return std::nullopt;
    return unit_luminance_rgb(x, y, z, clipped);
}

Xyz blackbody_xyz(double kelvin) {
    // Planck's law relative to its value at 780 nm, so that neither end of the temperatures overflows.
    constexpr double kSecond = 1.4387769e7;  // h c / k_B in nm K
    const double top = kSecond / (780 * kelvin);
    double x = 0, y = 0, z = 0;
    for_each_nanometre([&](double nm, const Row& row) {
        const double arg = kSecond / (nm * kelvin);
        // The ratio (e^top - 1) / (e^arg - 1), written with negative exponents.
        const double ratio = math::exp(top - arg) * (1 - math::exp(-top)) / (1 - math::exp(-arg));
        const double s = 780 / nm;
        const double v = s * s * s * s * s * ratio;
        x += v * row.x, y += v * row.y, z += v * row.z;
    });
    return {x, y, z};
}

Rgb blackbody_rgb(double kelvin, bool* clipped) {
    const Xyz c = blackbody_xyz(kelvin);
    return unit_luminance_rgb(c.x, c.y, c.z, clipped);
}

Spectrum blackbody_spectrum(double kelvin) {
    constexpr double kSecond = 1.4387769e7;  // h c / k_B in nm K
    constexpr double kWien = 2.8977720e6;    // peak wavelength times temperature, nm K
    const double peak = kWien / kelvin, top = kSecond / kWien;
    Spectrum out;
    for (int nm = kFirst; nm <= kFirst + kStep * (kCount - 1); ++nm) {
        const double arg = kSecond / (nm * kelvin), s = peak / nm;
        out.push_back({double(nm), s * s * s * s * s * math::exp(top - arg) * (1 - math::exp(-top)) / (1 - math::exp(-arg))});
    }
    return out;
}

std::optional<Rgb> named_illuminant_rgb(const std::string& name, bool* clipped) {
    struct Named {
        std::string_view name;
        double x, y;
    };
    // CIE 015 chromaticities of the standard illuminants.
    constexpr std::array<Named, 16> kNamed{{{"stdillum-A", 0.44758, 0.40745},
                                            {"stdillum-D50", 0.34567, 0.35851},
                                            {"stdillum-D65", 0.31272, 0.32903},
                                            {"illum-acesD60", 0.32168, 0.33767},
                                            {"stdillum-F1", 0.31310, 0.33727},
                                            {"stdillum-F2", 0.37208, 0.37529},
                                            {"stdillum-F3", 0.40910, 0.39430},
                                            {"stdillum-F4", 0.44018, 0.40329},
                                            {"stdillum-F5", 0.31379, 0.34531},
                                            {"stdillum-F6", 0.37790, 0.38835},
                                            {"stdillum-F7", 0.31292, 0.32933},
                                            {"stdillum-F8", 0.34588, 0.35875},
                                            {"stdillum-F9", 0.37417, 0.37281},
                                            {"stdillum-F10", 0.34609, 0.35986},
                                            {"stdillum-F11", 0.38052, 0.37713},
                                            {"stdillum-F12", 0.43695, 0.40441}}};
    for (const Named& n : kNamed)
        if (n.name == name) return unit_luminance_rgb(n.x, n.y, 1 - n.x - n.y, clipped);
    return std::nullopt;
}

Rgb d65_rgb_at(int nanometres) {
    const Rgb3 c = colour_under_d65([=](double nm) { return nm == nanometres ? 1.0 : 0.0; });
    return {float(c.r), float(c.g), float(c.b)};
}

Rgb reflectance_rgb(const Spectrum& spectrum) {
    const Rgb3 c = colour_under_d65([&](double nm) { return evaluate(spectrum, nm); });
    return {float(unit(c.r)), float(unit(c.g)), float(unit(c.b))};
}

Rgb index_rgb(const Spectrum& spectrum) {
    double sum[3] = {}, total[3] = {};
    for_each_nanometre([&](double nm, const Row& row) {
        const Rgb3 match = to_rgb(row.x * row.d65, row.y * row.d65, row.z * row.d65);
        const double weight[3] = {std::max(match.r, 0.0), std::max(match.g, 0.0), std::max(match.b, 0.0)};
        const double v = evaluate(spectrum, nm);
        for (int c = 0; c < 3; ++c) sum[c] += weight[c] * v, total[c] += weight[c];
    });
    return {float(sum[0] / total[0]), float(sum[1] / total[1]), float(sum[2] / total[2])};
}

ConductorRgb conductor_rgb(const Spectrum& eta, const Spectrum& k) {
    ConductorRgb out{index_rgb(eta), index_rgb(k)};
    const Rgb3 colour = colour_under_d65([&](double nm) {
        const double n = evaluate(eta, nm), a = evaluate(k, nm);
        return ((n - 1) * (n - 1) + a * a) / ((n + 1) * (n + 1) + a * a);
    });
    const double target[3] = {colour.r, colour.g, colour.b};
    float fitted[3];
    for (int c = 0; c < 3; ++c) {
        // Gold's red is 1.02 under D65, which no surface of three independent channels reflects.
        const double n = out.eta[c], f = std::min(target[c], 0.9999);
        const double k2 = (f * (n + 1) * (n + 1) - (n - 1) * (n - 1)) / (1 - f);
        fitted[c] = k2 > 0 ? float(std::sqrt(k2)) : out.k[c];
    }
    out.k = {fitted[0], fitted[1], fitted[2]};
    return out;
}

std::optional<float> named_glass(const std::string& name) {
    struct Named {
        std::string_view name;
        float index;
    };
    // n_d of the manufacturers' catalogues.
    // pbrt-v4's glass-F5, -F10 and -F11 hold the curves of SF5, SF10 and SF11.
    constexpr std::array<Named, 7> kNamed{{{"glass-BK7", 1.5168f},
                                           {"glass-BAF10", 1.6700f},
                                           {"glass-FK51A", 1.4866f},
                                           {"glass-LASF9", 1.8503f},
                                           {"glass-F5", 1.6727f},
                                           {"glass-F10", 1.7283f},
                                           {"glass-F11", 1.7847f}}};
    for (const Named& n : kNamed)
        if (n.name == name) return n.index;
    return std::nullopt;
}

std::optional<Rgb> named_index(const std::string& name) {
    if (const auto glass = named_glass(name)) return Rgb(*glass);
    for (const std::string_view suffix : {"-eta", "-k"}) {
        if (!has_suffix(name, suffix)) continue;
        if (const auto metal = named_metal(name.substr(0, name.size() - suffix.size())))
            return suffix == "-eta" ? metal->eta : metal->k;
    }
    return std::nullopt;
}

bool is_named_spectrum(const std::string& name) {
    bool clipped = false;
    return named_index(name) || named_illuminant_rgb(name, &clipped);
}

std::optional<Spectrum> spectrum_from_pairs(const std::vector<double>& values) {
    if (values.empty() || values.size() % 2 != 0) return std::nullopt;
    Spectrum spectrum;
    for (size_t i = 0; i < values.size(); i += 2) {
        if (i > 0 && !(values[i] > values[i - 2])) return std::nullopt;
        spectrum.push_back({values[i], values[i + 1]});
    }
    return spectrum;
}

std::optional<Spectrum> parse_spectrum_text(const std::string& text) {
    const std::string no_name;
    std::string without_commas = text;
    std::replace(without_commas.begin(), without_commas.end(), ',', ' ');
    Tokenizer tokens(without_commas, &no_name);
    std::vector<double> values;
    while (tokens.peek().kind != TokenKind::kEnd) {
        const Token token = tokens.next();
        double number = 0;
        if (token.kind != TokenKind::kWord || !parse_number(token.text, &number)) return std::nullopt;
        values.push_back(number);
    }
    return spectrum_from_pairs(values);
}

}  // namespace lightloom::import
