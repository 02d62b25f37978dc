// The coated diffuse model against the nested estimator by which pbrt-v4 evaluates f of the same layers: light enters towards
// the base, bounces, and leaves by one of two techniques at every bounce off the base, a connection through the coat to a
// direction sampled from wi, or the direction that the base sampled; both are weighted by the power heuristic.
//
// The weight of the second needs the density with which the first would have sampled the same direction inside. pbrt (bxdfs.h,
// LayeredBxDF::f) takes the density of the outer direction from the inner one instead, smaller by about eta^2: the weights sum
// to more than one and its f is too bright, while its Sample_f, a plain walk, is not. This test states by how much, because
// next events and connections, and with them the reference images, carry that factor (tests/bench/README.md).

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <initializer_list>

#include "common/scene/bsdf_fresnel.h"
#include "tests/unit/bsdf_cases.h"

namespace lightloom::testing {
namespace {

constexpr TransportMode kImportance = TransportMode::kImportance, kRadiance = TransportMode::kRadiance;
constexpr float kEta = 1.5f, kThickness = 0.01f;
constexpr double kPi = 3.141592653589793;

struct Event {
    Vec3 wi;
    double weight = 0;  ///< f |cos| / density, both given that the event is of the wanted kind.
    double pdf = 0;     ///< Solid angle.
};

/// Share of a facet's light that refraction between `w` and `wi` passes on.
double passed(const Bsdf& coat, const Vec3& w, const Vec3& wi) {
    const float eta = w.z > 0 ? coat.eta : 1 / coat.eta;
    const Vec3 h = w + eta * wi;
    const float inv = 1 / std::sqrt(length_squared(h));
    return 1 - fresnel_from_cosines(std::fabs(dot(w, h)) * inv, std::fabs(dot(wi, h)) * inv, eta);
}

double density_through(const Bsdf& coat, const Vec3& from, const Vec3& to, TransportMode mode) {
    const float pdf = coat.eval(from, to, mode).pdf_fwd;
    return pdf > 0 ? pdf / passed(coat, from, to) : 0;
}

/// Only refraction, or only reflection; false when the facet cannot do it.
bool scatter(const Bsdf& coat, const Vec3& w, bool refract, TransportMode mode, Rng* rng, Event* out) {
    BsdfSample s;
    if (!coat.sample(w, refract ? 0.99999994f : 0.0f, rng->uniform2(), mode, &s) || (s.wi.z > 0) == ((w.z > 0) == refract))
        return false;
    double kind;
    if (refract) {
        kind = passed(coat, w, s.wi);
    } else {
        const float cos_h = std::min(0.5f * std::sqrt(length_squared(w + s.wi)), 1.0f);
        kind = fresnel_dielectric(w.z > 0 ? cos_h : -cos_h, coat.eta).reflectance;
    }
    if (!(kind > 0)) return false;
    *out = {s.wi, s.weight.r * kind, s.pdf_fwd / kind};
    return true;
}

double power(double own, double other) { return own * own / (own * own + other * other); }
double slab(const Vec3& w) { return std::exp(-kThickness / std::fabs(double(w.z))); }

struct BothWeights {
    double right = 0, published = 0;
};

/// One estimate of what the base contributes to f(wo, wi).
BothWeights nested_estimate(const Bsdf& coat, double rho, const Vec3& wo, const Vec3& wi, Rng* rng) {
    BothWeights f;
    Event in, exit;
    if (!scatter(coat, wo, true, kRadiance, rng, &in) || !scatter(coat, wi, true, kImportance, rng, &exit)) return f;
    double beta = in.weight;
    Vec3 w = in.wi;
    for (int base_bounce = 0; base_bounce < 5; ++base_bounce) {
        beta *= slab(w);
        // exit.weight is f |cos| / density with the cosine of the inner direction, which the base's f |cos| needs anyway.
        const double connect = beta * rho / kPi * exit.weight * slab(exit.wi) * power(exit.pdf, std::fabs(exit.wi.z) / kPi);
        f.right += connect, f.published += connect;
        w = sample_cosine_hemisphere(rng->uniform2());
        beta *= rho;
        const double through = beta * slab(w) * coat.eval(-w, wi, kRadiance).f.r, own = w.z / kPi;
        if (through > 0) {
            f.right += through * power(own, density_through(coat, wi, -w, kImportance));
            f.published += through * power(own, density_through(coat, -w, wi, kRadiance));
        }
        beta *= slab(w);
        Event back;
        if (!scatter(coat, -w, false, kRadiance, rng, &back)) break;
        beta *= back.weight;
        w = back.wi;
    }
    return f;
}

TEST(BsdfLayers, CoatedDiffuseIsTheNestedEstimatorWithWeightsThatSumToOne) {
    struct Case {
        float alpha;
        double excess;  ///< Of f with the published weights, over wi with cosine weight.
    };
    for (const auto [alpha, excess] : {Case{0.15f, 0.055}, Case{0.25f, 0.076}})
        for (const float rho : {0.2f, 0.73f}) {
            const Bsdf coat = make_dielectric(kEta, alpha, alpha);
            const Bsdf model = make_coated_diffuse(Rgb(rho), kEta, kThickness, alpha, alpha, 5);
            const Vec3 wo = direction(0.5, 0);
            Rng rng({21});
            constexpr int kSamples = 60000;
            double difference = 0, difference2 = 0, right = 0, published = 0;
            for (int n = 0; n < kSamples; ++n) {
                const Vec3 wi = sample_cosine_hemisphere(rng.uniform2());
                const double base = model.eval(wo, wi, kRadiance).f.r - coat.eval(wo, wi, kRadiance).f.r;
                const BothWeights f = nested_estimate(coat, rho, wo, wi, &rng);
                difference += f.right - base, difference2 += (f.right - base) * (f.right - base);
                right += f.right, published += f.published;
            }
            const double mean = difference / kSamples;
            const double sigma = std::sqrt((difference2 / kSamples - mean * mean) / kSamples);
            EXPECT_NEAR(mean, 0, 4.5 * sigma + 1e-3 * right / kSamples) << "alpha " << alpha << " rho " << rho;
            EXPECT_NEAR(published / right - 1, excess, 0.004) << "alpha " << alpha << " rho " << rho;
        }
}

}  // namespace
}  // namespace lightloom::testing
