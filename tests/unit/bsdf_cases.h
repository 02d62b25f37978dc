#pragma once
// The materials and directions that every property of Bsdf is tested on.

#include <cmath>
#include <string>
#include <vector>

#include "common/core/rng.h"
#include "common/scene/bsdf.h"

namespace lightloom::testing {

struct BsdfCase {
    std::string name;
    Bsdf bsdf;
    float sharpness = 1;    ///< The narrowest lobe's alpha; 1 for diffuse.
    bool lossless = false;  ///< Densities plus delta pmfs must sum to one.
};

inline Rgb gold_eta() { return {0.143f, 0.375f, 1.442f}; }
inline Rgb gold_k() { return {3.983f, 2.386f, 1.603f}; }

inline std::vector<BsdfCase> bsdf_cases() {
    std::vector<BsdfCase> cases{
        {"diffuse", make_diffuse({0.8f, 0.5f, 0.1f}), 1, true},
        {"diffuse transmission", make_diffuse_transmission({0.6f, 0.3f, 0.2f}, {0.1f, 0.3f, 0.4f}), 1, true},
        {"mirror", make_conductor(gold_eta(), gold_k(), 0, 0), 1, true},
        {"glass", make_dielectric(1.5f, 0, 0), 1, true},
        {"bubble", make_dielectric(1 / 1.5f, 0, 0), 1, true},
        {"no interface", make_dielectric(1, 0.3f, 0.3f), 1, true},
        {"pane", make_thin_dielectric(1.5f), 1, true},
        {"smooth coat on diffuse", make_coated_diffuse({0.8f, 0.5f, 0.1f}, 1.5f, 0.01f, 0, 0), 1, true},
        {"smooth coat on black", make_coated_diffuse(Rgb(0), 1.5f, 0.01f, 0, 0), 1, true},
        {"smooth coat on mirror", make_coated_conductor(gold_eta(), gold_k(), 0, 0, 1.5f, 0.01f, 0, 0), 1, true},
        {"smooth coat on metal .3", make_coated_conductor(gold_eta(), gold_k(), 0.3f, 0.3f, 1.5f, 0.01f, 0, 0), 0.3f},
        {"smooth coat on metal .1/.5", make_coated_conductor(gold_eta(), gold_k(), 0.1f, 0.5f, 1.7f, 0.01f, 0, 0), 0.1f},
        {"rough coat on mirror", make_coated_conductor(gold_eta(), gold_k(), 0, 0, 1.5f, 0.01f, 0.4f, 0.4f), 0.09f},
        {"rough coat on rough metal", make_coated_conductor(gold_eta(), gold_k(), 0.6f, 0.6f, 1.5f, 0.01f, 0.2f, 0.2f), 0.2f},
        {"rough bubble on metal", make_coated_conductor(gold_eta(), gold_k(), 0.2f, 0.2f, 0.9f, 0.01f, 0.3f, 0.3f), 0.2f},
        {"rough bubble on metal .7", make_coated_conductor(gold_eta(), gold_k(), 0.4f, 0.4f, 0.7f, 0.01f, 0.3f, 0.3f), 0.3f},
        {"metal .1/.4", make_conductor(gold_eta(), gold_k(), 0.1f, 0.4f), 0.1f},
        {"metal .002/.3", make_conductor(gold_eta(), gold_k(), 0.002f, 0.3f), 0.002f},
        {"rough glass .1/.4", make_dielectric(1.5f, 0.1f, 0.4f), 0.1f},
        {"rough diamond", make_dielectric(2.4f, 0.3f, 0.3f), 0.3f},
        {"rough bubble", make_dielectric(1 / 1.33f, 0.25f, 0.25f), 0.25f},
        {"faint rough interface", make_dielectric(1.05f, 0.3f, 0.3f), 0.02f},
        {"coated .1/.3", make_coated_diffuse({0.3f, 0.5f, 0.9f}, 1.5f, 0.01f, 0.1f, 0.3f), 0.1f},
    };
    for (float alpha : {0.01f, 0.1f, 0.5f, 1.0f}) {
        const std::string a = " " + std::to_string(alpha).substr(0, 4);
        cases.push_back({"metal" + a, make_conductor(gold_eta(), gold_k(), alpha, alpha), alpha});
        cases.push_back({"rough glass" + a, make_dielectric(1.5f, alpha, alpha), alpha});
        cases.push_back({"rough coat" + a, make_coated_diffuse({0.8f, 0.5f, 0.1f}, 1.5f, 0.01f, alpha, alpha), alpha});
    }
    return cases;
}

inline Vec3 direction(double cos, double azimuth) {
    const double sin = std::sqrt(1 - cos * cos);
    return {float(sin * std::cos(azimuth)), float(sin * std::sin(azimuth)), float(cos)};
}

/// Normal incidence, oblique, grazing, on both sides.
inline std::vector<Vec3> outgoing_directions() {
    return {direction(1, 0), direction(0.7, 0.4), direction(-0.6, 2.2), direction(0.1, 4), direction(-0.1, 1)};
}

inline Vec3 uniform_direction(Rng* rng) {
    const Vec2 u = rng->uniform2();
    return direction(2.0 * u.x - 1, 6.283185307179586 * u.y);
}

inline constexpr TransportMode kModes[] = {TransportMode::kRadiance, TransportMode::kImportance};

}  // namespace lightloom::testing
