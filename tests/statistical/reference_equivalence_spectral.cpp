// How far rendering in RGB is from rendering in spectra, as the references are made: the scene is rendered again and again, its
// three channels standing for three wavelengths each time, and the wavelengths are added up to RGB. Colours become the
// smooth spectra that pbrt-v4 gives them: a sigmoid of a quadratic polynomial for reflectances [Jakob and Hanika 2019], and
// for lights such a spectrum of half the largest component times D65. Greys stay what they are.

#include <algorithm>
#include <array>
#include <cstdio>
#include <fstream>
#include <map>
#include <set>

#include "common/import/import.h"
#include "common/import/spectra.h"
#include "tests/statistical/reference_equivalence.h"

namespace lightloom::equivalence {
namespace {

constexpr int kFirst = 385, kBin = 10, kBins = 36;  ///< Nanometres; bins from 380 to 740.
using Bins = std::array<double, kBins>;
using Triple = std::array<double, 3>;

struct Weights {
    std::array<Triple, kBins> rgb{};  ///< What one bin adds to RGB; over all bins (1, 1, 1).
    Weights() {
        Triple sum{};
        for (int i = 0; i < kBins; ++i)
            for (int nm = kFirst + i * kBin - 5; nm < kFirst + i * kBin + 5; ++nm)
                for (int c = 0; c < 3; ++c) rgb[size_t(i)][size_t(c)] += import::d65_rgb_at(nm)[c];
        for (const Triple& w : rgb)
            for (size_t c = 0; c < 3; ++c) sum[c] += w[c];
        for (Triple& w : rgb)
            for (size_t c = 0; c < 3; ++c) w[c] /= sum[c];
    }
};
const Weights& weights() {
    static const Weights w;
    return w;
}

Triple to_rgb(const Bins& spectrum) {
    Triple rgb{};
    for (size_t i = 0; i < kBins; ++i)
        for (size_t c = 0; c < 3; ++c) rgb[c] += spectrum[i] * weights().rgb[i][c];
    return rgb;
}

Bins sigmoid_spectrum(const Triple& polynomial) {
    Bins spectrum;
    for (int i = 0; i < kBins; ++i) {
        const double t = double(i) / kBins, x = (polynomial[0] * t + polynomial[1]) * t + polynomial[2];
        spectrum[size_t(i)] = 0.5 + x / (2 * std::sqrt(1 + x * x));
    }
    return spectrum;
}

/// x with m x = b, by Cramer's rule.
Triple solve(const std::array<Triple, 3>& m, const Triple& b) {
    const auto determinant = [](const Triple& p, const Triple& q, const Triple& r) {
        return p[0] * (q[1] * r[2] - q[2] * r[1]) - p[1] * (q[0] * r[2] - q[2] * r[0]) + p[2] * (q[0] * r[1] - q[1] * r[0]);
    };
    std::array<Triple, 3> columns;
    for (size_t i = 0; i < 3; ++i)
        for (size_t j = 0; j < 3; ++j) columns[i][j] = m[j][i];
    const double whole = determinant(columns[0], columns[1], columns[2]);
    return {determinant(b, columns[1], columns[2]) / whole, determinant(columns[0], b, columns[2]) / whole,
            determinant(columns[0], columns[1], b) / whole};
}

/// The spectrum of a reflectance: Newton's method, led from grey to the colour in small steps.
Bins fit(Triple rgb) {
    Bins spectrum;
    if (rgb[0] == rgb[1] && rgb[1] == rgb[2]) {
        spectrum.fill(rgb[0]);
        return spectrum;
    }
    for (double& v : rgb) v = std::clamp(v, 2e-3, 0.998);  // beyond, coefficients run away
    const double grey = (rgb[0] + rgb[1] + rgb[2]) / 3;
    Triple p{0, 0, (grey - 0.5) / std::sqrt(grey * (1 - grey))};
    const auto error = [](const Triple& polynomial, const Triple& target) {
        Triple e = to_rgb(sigmoid_spectrum(polynomial));
        for (size_t c = 0; c < 3; ++c) e[c] -= target[c];
        return e;
    };
    const auto size = [](const Triple& e) { return e[0] * e[0] + e[1] * e[1] + e[2] * e[2]; };
    constexpr int kSteps = 12;
    for (int step = 1; step <= kSteps; ++step) {
        Triple target;
        for (size_t c = 0; c < 3; ++c) target[c] = grey + (rgb[c] - grey) * step / kSteps;
        Triple e = error(p, target);
        for (int round = 0; round < 25 && size(e) > 1e-16; ++round) {
            std::array<Triple, 3> jacobian;
            for (size_t k = 0; k < 3; ++k) {
                Triple moved = p;
                const double h = 1e-5 * std::max(1.0, std::fabs(p[k]));
                moved[k] += h;
                const Triple there = error(moved, target);
                for (size_t c = 0; c < 3; ++c) jacobian[c][k] = (there[c] - e[c]) / h;
            }
            const Triple change = solve(jacobian, e);
            Triple best = p;
            for (double part = 1; part > 1e-3; part /= 2) {
                Triple next;
                for (size_t k = 0; k < 3; ++k) next[k] = p[k] - part * change[k];
                if (const Triple there = error(next, target); size(there) < size(e)) {
                    best = next, e = there;
                    break;
                }
            }
            if (best == p) break;
            p = best;
        }
    }
    return sigmoid_spectrum(p);
}

/// Spectra of reflectances; those of image texels are interpolated between colours of a grid, which keeps their RGB exactly.
class Spectra {
  public:
    const Bins& exact(const Rgb& c) {
        const auto [it, inserted] = exact_.try_emplace({c.r, c.g, c.b});
        if (inserted) it->second = fit({c.r, c.g, c.b});
        return it->second;
    }
    Rgb at(const Rgb& c, const std::array<int, 3>& bins) { return pick(exact(c), bins); }
    Rgb interpolated(const Rgb& c, const std::array<int, 3>& bins) {
        if (c.r == c.g && c.g == c.b) return c;
        Rgb sum;
        int cell[3];
        float t[3];
        for (int k = 0; k < 3; ++k) {
            const float x = clamp(c[k], 0.0f, 1.0f) * (kGrid - 1);
            cell[k] = std::min(int(x), kGrid - 2), t[k] = x - float(cell[k]);
        }
        for (int corner = 0; corner < 8; ++corner) {
            float weight = 1;
            int node[3];
            for (int k = 0; k < 3; ++k) {
                const int up = (corner >> k) & 1;
                weight *= up ? t[k] : 1 - t[k];
                node[k] = cell[k] + up;
            }
            const auto value = [](int i) { return float(i) / (kGrid - 1); };
            if (weight > 0) sum += at({value(node[0]), value(node[1]), value(node[2])}, bins) * weight;
        }
        return sum;
    }
    /// Of a light: half the largest component is the reflectance scale.
    template <typename Reflectance>
    static Rgb illuminant(const Rgb& c, Reflectance reflectance) {
        const float scale = 2 * c.max_component();
        return scale > 0 ? reflectance(c / scale) * scale : c;
    }

  private:
    static constexpr int kGrid = 33;
    static Rgb pick(const Bins& s, const std::array<int, 3>& bins) {
        return {float(s[size_t(bins[0])]), float(s[size_t(bins[1])]), float(s[size_t(bins[2])])};
    }
    std::map<std::array<float, 3>, Bins> exact_;
};

/// Every colour of the scene at three wavelengths.
void to_wavelengths(SceneDescription* scene, Spectra* spectra, const std::array<int, 3>& bins) {
    const auto exact = [&](const Rgb& c) { return spectra->at(c, bins); };
    const auto texel = [&](const Rgb& c) { return spectra->interpolated(c, bins); };
    std::set<TextureId> indices;
    for (const Material& m : scene->materials) indices.insert({m.eta, m.k});
    for (size_t i = 0; i < scene->textures.size(); ++i)
        if (!indices.count(TextureId(i))) scene->textures[i].value = exact(scene->textures[i].value);
    std::set<int32_t> lights;
    for (InfiniteLight& light : scene->infinite_lights) {
        lights.insert(light.image);
        light.radiance = Spectra::illuminant(light.radiance, exact);
    }
    for (size_t i = 0; i < scene->images.size(); ++i) {
        Image& image = scene->images[i];
        if (image.channels != 3) continue;
        const bool light = lights.count(int32_t(i)) > 0;
        std::vector<float> floats(size_t(image.width) * size_t(image.height) * 3);
        for (int y = 0; y < image.height; ++y)
            for (int x = 0; x < image.width; ++x) {
                const Rgb c = image.texel(x, y), v = light ? Spectra::illuminant(c, texel) : texel(c);
                float* out = &floats[(size_t(y) * size_t(image.width) + size_t(x)) * 3];
                out[0] = v.r, out[1] = v.g, out[2] = v.b;
            }
        image.bytes.clear();
        image.floats = std::move(floats);
    }
    for (AreaEmission& e : scene->emissions) e.radiance = Spectra::illuminant(e.radiance, exact);
    for (PointLight& l : scene->point_lights) l.intensity = Spectra::illuminant(l.intensity, exact);
    for (SpotLight& l : scene->spot_lights) l.intensity = Spectra::illuminant(l.intensity, exact);
    for (DistantLight& l : scene->distant_lights) l.irradiance = Spectra::illuminant(l.irradiance, exact);
}

using Regions = std::array<Triple, 10>;  ///< Mean colour of the whole and of nine regions.

Regions region_means(const RgbImage& image) {
    Regions means{};
    double count[10] = {};
    for (int y = 0; y < image.height; ++y)
        for (int x = 0; x < image.width; ++x) {
            const float* p = &image.pixels[(size_t(y) * size_t(image.width) + size_t(x)) * 3];
            for (const int r : {0, 1 + (y * 3 / image.height) * 3 + x * 3 / image.width}) {
                ++count[r];
                for (size_t c = 0; c < 3; ++c) means[size_t(r)][c] += p[c];
            }
        }
    for (size_t r = 0; r < 10; ++r)
        for (double& v : means[r]) v /= count[r];
    return means;
}

double luminance(const Triple& c) { return 0.2126 * c[0] + 0.7152 * c[1] + 0.0722 * c[2]; }

constexpr int kGroups = 8;

/// Means of each of kGroups group images with `path`.
Result<std::vector<Regions>> render_means(SceneDescription description, const SceneOptions& scene_options, uint64_t seed) {
    LoadedScene loaded;
    loaded.max_depth = description.max_depth;
    auto built = Scene::build(std::move(description), scene_options);
    if (!built.ok()) return built.status();
    loaded.scene = std::move(built).value();
    auto render = catalog_group(loaded, "path", seed);
    if (!render.ok()) return render.status();
    constexpr uint32_t kIterations = 2;
    const FrameLayout frame = loaded.scene->frame();
    std::vector<Regions> groups;
    for (uint32_t group = 0; group < kGroups; ++group) {
        auto partial = (*render)({uint64_t(group) * kIterations, kIterations, group, frame.crop, 0,
                                  uint64_t(kIterations) * uint64_t(frame.crop.area())});
        if (!partial.ok()) return partial.status();
        GroupSum sum(frame);
        Accumulation alone(frame);
        LL_RETURN_IF_ERROR(sum.add(*partial));
        LL_RETURN_IF_ERROR(alone.fold(sum, kIterations));
        groups.push_back(region_means(alone.develop()));
    }
    return groups;
}

}  // namespace

Status print_spectral_ratio(const Options& options, const std::string& name, const std::string& resolution) {
    auto imported = import_pbrt(options.shared + "/scenes/" + name + "/scene.pbrt");
    if (!imported.ok()) return imported.status();
    SceneOptions scene_options;
    if (std::sscanf(resolution.c_str(), "%dx%d", &scene_options.width, &scene_options.height) != 2)
        return invalid_argument(name + ": the resolution " + resolution + " is not WIDTHxHEIGHT");
    auto rgb = render_means(imported->description, scene_options, options.seed);
    if (!rgb.ok()) return rgb.status();
    std::vector<Regions> spectral(kGroups, Regions{});
    Spectra spectra;
    for (int first = 0; first < kBins; first += 3) {
        SceneDescription description = imported->description;
        to_wavelengths(&description, &spectra, {first, first + 1, first + 2});
        // The same random numbers for all wavelengths and for RGB: what is left in the ratio is colour.
        auto part = render_means(std::move(description), scene_options, options.seed);
        if (!part.ok()) return part.status();
        for (size_t g = 0; g < kGroups; ++g)
            for (size_t r = 0; r < 10; ++r)
                for (size_t k = 0; k < 3; ++k)
                    for (size_t c = 0; c < 3; ++c) spectral[g][r][c] += (*part)[g][r][k] * weights().rgb[size_t(first) + k][c];
    }
    double of_rgb[10] = {}, of_spectra[10] = {};
    WeightedMean ratios;
    Triple channels{}, channels_spectral{};
    for (size_t g = 0; g < kGroups; ++g)
        for (size_t r = 0; r < 10; ++r) {
            of_rgb[r] += luminance((*rgb)[g][r]);
            of_spectra[r] += luminance(spectral[g][r]);
            if (r > 0) continue;
            ratios.add(luminance((*rgb)[g][r]) / luminance(spectral[g][r]), 1);
            for (size_t c = 0; c < 3; ++c) channels[c] += (*rgb)[g][r][c], channels_spectral[c] += spectral[g][r][c];
        }
    std::printf("%-18s RGB / spectra %.4f +- %.4f  %.3f %.3f %.3f ", name.c_str(), of_rgb[0] / of_spectra[0],
                ratios.estimate().standard_error(), channels[0] / channels_spectral[0], channels[1] / channels_spectral[1],
                channels[2] / channels_spectral[2]);
    nlohmann::ordered_json line{
        {"scene", name}, {"rgb_over_spectra", of_rgb[0] / of_spectra[0]}, {"standard_error", ratios.estimate().standard_error()}};
    for (int r = 1; r < 10; ++r) {
        std::printf(" %.3f", of_rgb[r] / of_spectra[r]);
        line["regions"].push_back(of_rgb[r] / of_spectra[r]);
    }
    std::printf("\n");
    std::fflush(stdout);
    if (!options.json.empty()) std::ofstream(options.json, std::ios::app) << line.dump() << std::endl;
    return {};
}

}  // namespace lightloom::equivalence
