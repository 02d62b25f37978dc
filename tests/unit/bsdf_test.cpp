// Values of Bsdf against independent computations: textbook formulas in double, random walks through the layers, furnaces.

#include <gtest/gtest.h>

#include <complex>

#include "common/scene/bsdf_fresnel.h"
#include "tests/unit/bsdf_cases.h"

namespace lightloom::testing {
namespace {

constexpr TransportMode kImportance = TransportMode::kImportance;
constexpr TransportMode kRadiance = TransportMode::kRadiance;

/// Mean of value(lobe, u) over a low-discrepancy sequence (generalised golden ratio), and the standard error that
/// independent samples would have.
struct Estimate {
    double mean = 0, sigma = 0;
};
template <typename Value>
Estimate average(int n, Value value) {
    double sum = 0, sum2 = 0, p[3] = {0.5, 0.5, 0.5};
    constexpr double step[3] = {0.8191725133961645, 0.6710436067037893, 0.5497004779019703};
    for (int i = 0; i < n; ++i) {
        for (int k = 0; k < 3; ++k) p[k] += step[k], p[k] -= std::floor(p[k]);
        const double v = value(std::min(float(p[0]), 0.99999994f), Vec2{float(p[1]), float(p[2]) < 1 ? float(p[2]) : 0.5f});
        sum += v, sum2 += v * v;
    }
    const double mean = sum / n;
    return {mean, std::sqrt(std::max(sum2 / n - mean * mean, 0.0) / n)};
}

/// Directional albedo of channel 0.
Estimate albedo(const Bsdf& b, const Vec3& wo, TransportMode mode, int n = 1 << 16) {
    return average(n, [&](float lobe, Vec2 u) {
        BsdfSample s;
        return b.sample(wo, lobe, u, mode, &s) ? double(s.weight.r) : 0.0;
    });
}

double textbook_fresnel(double cos_i, double eta) {
    const double sin2 = (1 - cos_i * cos_i) / (eta * eta);
    if (sin2 >= 1) return 1;
    const double cos_t = std::sqrt(1 - sin2);
    const double s = (cos_i - eta * cos_t) / (cos_i + eta * cos_t), p = (eta * cos_i - cos_t) / (eta * cos_i + cos_t);
    return (s * s + p * p) / 2;
}

double textbook_conductor(double cos_i, std::complex<double> n) {
    const std::complex<double> cos_t = std::sqrt(1.0 - (1 - cos_i * cos_i) / (n * n));
    const auto p = (n * cos_i - cos_t) / (n * cos_i + cos_t), s = (cos_i - n * cos_t) / (cos_i + n * cos_t);
    return (std::norm(p) + std::norm(s)) / 2;
}

struct V3 {
    double x, y, z;
};
double dot(V3 a, V3 b) { return a.x * b.x + a.y * b.y + a.z * b.z; }

/// Walter et al. 2007 as printed (with height-correlated G), in double; reflection or refraction by the directions' sides.
double textbook_dielectric(V3 o, V3 i, double eta, double ax, double ay, bool radiance) {
    const bool reflect = o.z * i.z > 0;
    const double etap = reflect ? 1 : (o.z > 0 ? eta : 1 / eta);
    V3 m{o.x + etap * i.x, o.y + etap * i.y, o.z + etap * i.z};
    const double length = std::sqrt(dot(m, m)) * (m.z < 0 ? -1 : 1);
    m = {m.x / length, m.y / length, m.z / length};
    const double om = dot(o, m), im = dot(i, m);
    if (om * o.z <= 0 || im * i.z <= 0) return 0;
    const double fresnel = textbook_fresnel(std::fabs(om), o.z > 0 ? eta : 1 / eta);
    const double tan2 = (m.x * m.x / (ax * ax) + m.y * m.y / (ay * ay)) / (m.z * m.z);
    const double d = 1 / (3.14159265358979 * ax * ay * std::pow(m.z, 4) * (1 + tan2) * (1 + tan2));
    const auto lambda = [&](V3 w) { return (std::sqrt(1 + (w.x * w.x * ax * ax + w.y * w.y * ay * ay) / (w.z * w.z)) - 1) / 2; };
    const double g = 1 / (1 + lambda(o) + lambda(i));
    if (reflect) return d * g * fresnel / (4 * std::fabs(o.z * i.z));
    const double f = d * g * (1 - fresnel) * std::fabs(im * om / (o.z * i.z)) / std::pow(im + om / etap, 2);
    return radiance ? f / (etap * etap) : f;
}

TEST(Bsdf, FresnelMatchesComplexArithmetic) {
    Rng rng({1});
    for (int n = 0; n < 20000; ++n) {
        const float cos = n % 10 ? rng.uniform() : 1e-3f * rng.uniform();
        const float eta = 0.05f + 4 * rng.uniform(), k = n % 3 ? 8 * rng.uniform() : 200 * rng.uniform();
        EXPECT_NEAR(fresnel_conductor(cos, eta, k), textbook_conductor(cos, {eta, k}), 3e-6) << cos << " " << eta << " " << k;
        // Near the critical angle the reflectance amplifies the rounding of the cosine.
        EXPECT_NEAR(fresnel_dielectric(cos, eta).reflectance, textbook_fresnel(cos, eta), 3e-4) << cos << " " << eta;
        EXPECT_NEAR(fresnel_dielectric(-cos, eta).reflectance, textbook_fresnel(cos, 1.0 / eta), 3e-4) << cos << " " << eta;
    }
    // pbrt's reading of a conductor's "reflectance" is its value at normal incidence.
    for (float r : {0.0f, 0.2f, 0.9f, 0.9999f}) EXPECT_NEAR(fresnel_conductor(1, 1, conductor_k(Rgb(r)).r), r, 2e-6);
    EXPECT_NEAR(fresnel_conductor(1, 1, conductor_k(Rgb(1)).r), 0.9999, 2e-6);
}

TEST(Bsdf, MicrofacetsMatchTheTextbook) {
    Rng rng({2});
    int compared = 0;
    for (int n = 0; n < 40000; ++n) {
        const float ax = 0.02f + 0.9f * rng.uniform(), ay = n % 2 ? ax : 0.02f + 0.9f * rng.uniform();
        const float eta = n % 3 ? 1.1f + rng.uniform() : 1 / (1.1f + rng.uniform());
        const Bsdf b = make_dielectric(eta, ax, ay);
        const Vec3 wo = uniform_direction(&rng);
        BsdfSample s;
        const float lobe = rng.uniform();
        Vec3 wi = uniform_direction(&rng);
        if (n % 4 && b.sample(wo, lobe, rng.uniform2(), kRadiance, &s)) wi = s.wi;
        const V3 o{wo.x, wo.y, wo.z}, i{wi.x, wi.y, wi.z};
        for (TransportMode mode : kModes) {
            const double expected = textbook_dielectric(o, i, eta, ax, ay, mode == kRadiance);
            const double f = b.eval(wo, wi, mode).f.r;
            ASSERT_NEAR(f, expected, 2e-3 * expected + 1e-5)
                << "alpha " << ax << " " << ay << " eta " << eta << " cos " << wo.z << " " << wi.z;
            compared += expected > 1e-3;
        }
        // A conductor differs from the dielectric's reflection by Fresnel's factor alone.
        if (wo.z * wi.z > 0) {
            const Bsdf metal = make_conductor(Rgb(0.2f), Rgb(3), ax, ay);
            const double cos_h = std::sqrt(0.5 * (1 + dot(o, i)));
            const double expected = textbook_dielectric(o, i, 1e-6, ax, ay, false) * textbook_conductor(cos_h, {0.2, 3});
            ASSERT_NEAR(metal.eval(wo, wi, kRadiance).f.r, expected, 2e-3 * expected + 1e-5);
        }
    }
    EXPECT_GT(compared, 20000);
}

TEST(Bsdf, ReciprocityAndReverseDensities) {
    uint64_t index = 0;
    for (const BsdfCase& c : bsdf_cases()) {
        Rng rng({3, Stage::kCamera, 0, index++});
        for (int n = 0; n < 4000; ++n) {
            const Vec3 wo = uniform_direction(&rng);
            Vec3 wi = uniform_direction(&rng);
            BsdfSample s;
            const float lobe = rng.uniform();
            if (n % 4 && c.bsdf.sample(wo, lobe, rng.uniform2(), kRadiance, &s)) wi = s.wi;
            const BsdfEval there = c.bsdf.eval(wo, wi, kImportance), back = c.bsdf.eval(wi, wo, kRadiance);
            const float tolerance = c.sharpness < 0.05f ? 2e-2f : 2e-4f;
            const auto close = [&](float a, float b) { return std::fabs(a - b) <= tolerance * (std::fabs(a) + 1e-3f); };
            // A light particle and the camera ray that runs against it see the same value.
            for (int k = 0; k < 3; ++k)
                ASSERT_TRUE(close(there.f[k], back.f[k])) << c.name << " " << there.f[k] << " " << back.f[k];
            ASSERT_TRUE(close(there.pdf_fwd, back.pdf_rev)) << c.name << " " << there.pdf_fwd << " " << back.pdf_rev;
            ASSERT_TRUE(close(there.pdf_rev, back.pdf_fwd)) << c.name << " " << there.pdf_rev << " " << back.pdf_fwd;
            const BsdfEval radiance = c.bsdf.eval(wo, wi, kRadiance);
            ASSERT_EQ(radiance.pdf_fwd, there.pdf_fwd) << c.name;
            const float etap =
                wo.z * wi.z > 0 || c.bsdf.kind != BsdfKind::kDielectric ? 1 : (wo.z > 0 ? c.bsdf.eta : 1 / c.bsdf.eta);
            ASSERT_TRUE(close(radiance.f.r * etap * etap, there.f.r)) << c.name;
        }
    }
}

TEST(Bsdf, NothingGainsEnergy) {
    for (const BsdfCase& c : bsdf_cases())
        for (const Vec3& wo : outgoing_directions()) {
            const Estimate e = albedo(c.bsdf, wo, kImportance);
            EXPECT_LT(e.mean, 1 + 1e-3 + 0.1 * e.sigma) << c.name << " cos " << wo.z;
        }
    // White bases: the worst case for the layered kinds.
    for (float coat : {0.0f, 0.05f, 0.3f, 0.8f})
        for (float base : {0.0f, 0.05f, 0.2f, 0.5f, 1.0f})
            for (float eta : {1.2f, 1.5f, 2.0f})
                for (float cos : {1.0f, 0.6f, 0.25f, 0.05f}) {
                    const Bsdf b = make_coated_conductor(Rgb(1), conductor_k(Rgb(1)), base, base, eta, 0, coat, coat);
                    const Estimate e = albedo(b, direction(cos, 1), kImportance, 1 << 14);
                    EXPECT_LT(e.mean, 1 + 4 * e.sigma) << "coat " << coat << " base " << base << " eta " << eta << " cos " << cos;
                }
}

TEST(Bsdf, SmoothCoatOnWhiteIsAFurnace) {
    for (float eta : {1.0f, 1.33f, 1.5f, 2.0f})
        for (float cos : {1.0f, 0.8f, 0.5f, 0.3f, 0.1f, 0.04f}) {
            const Bsdf b = make_coated_diffuse(Rgb(1), eta, 0, 0, 0);
            const Estimate e = albedo(b, direction(cos, 0.3), kImportance, 1 << 17);
            EXPECT_NEAR(e.mean, 1, 1e-3) << "eta " << eta << " cos " << cos;
        }
}

/// Light followed through a coat and off its base, event by event, as pbrt does but without an end. Albedo of one direction.
Estimate walk_through_layers(const Bsdf& coat, const Bsdf& base, float thickness, float cos, int walks) {
    Rng rng({5});
    const auto slab = [thickness](float z) { return std::exp(-thickness / std::fabs(double(z))); };
    double sum = 0, sum2 = 0;
    for (int n = 0; n < walks; ++n) {
        Vec3 w = direction(cos, 0);
        double energy = 1;
        for (bool outside = true; energy > 1e-7;) {
            BsdfSample s;
            float lobe = rng.uniform();
            if (!coat.sample(outside ? w : -w, lobe, rng.uniform2(), kImportance, &s)) {
                energy = 0;
                break;
            }
            energy *= s.weight.r;
            if (s.wi.z > 0) break;
            energy *= slab(s.wi.z);
            lobe = rng.uniform();
            if (!base.sample(-s.wi, lobe, rng.uniform2(), kImportance, &s)) {
                energy = 0;
                break;
            }
            w = s.wi;
            energy *= s.weight.r * slab(w.z);
            outside = false;
        }
        sum += energy, sum2 += energy * energy;
    }
    const double mean = sum / walks;
    return {mean, std::sqrt(std::max(sum2 / walks - mean * mean, 0.0) / walks)};
}

TEST(Bsdf, CoatedDiffuseIsTheMeanOfTheLayeredWalk) {
    for (float alpha : {0.0f, 0.05f, 0.25f, 0.8f})
        for (float rho : {0.3f, 1.0f})
            for (float cos : {1.0f, 0.5f, 0.15f})
                for (float thickness : {0.01f, 0.1f}) {
                    const Estimate walk =
                        walk_through_layers(make_dielectric(1.5f, alpha, alpha), make_diffuse(Rgb(rho)), thickness, cos, 40000);
                    const Estimate model =
                        albedo(make_coated_diffuse(Rgb(rho), 1.5f, thickness, alpha, alpha), direction(cos, 0), kImportance);
                    EXPECT_NEAR(model.mean, walk.mean, 4.5 * walk.sigma + 0.1 * model.sigma + 1e-3)
                        << "alpha " << alpha << " rho " << rho << " cos " << cos << " thickness " << thickness;
                }
}

TEST(Bsdf, CoatedConductorIsCloseToTheLayeredWalk) {
    // Exact when every layer is smooth; a smooth coat on a base of some roughness within 12 %
    // (the walk loses the base's single-scattering loss anew at every bounce).
    for (float base : {0.0f, 0.05f, 0.1f})
        for (float cos : {1.0f, 0.5f, 0.15f}) {
            const Rgb eta(0.2f), k(3.9f);
            const Estimate walk = walk_through_layers(make_dielectric(1.5f, 0, 0), make_conductor(eta / 1.5f, k / 1.5f, base, base),
                                                      0.01f, cos, 100000);
            const Estimate model =
                albedo(make_coated_conductor(eta, k, base, base, 1.5f, 0.01f, 0, 0), direction(cos, 0), kImportance);
            const double tolerance = base == 0 ? 1e-3 : 0.12 * walk.mean;
            EXPECT_NEAR(model.mean, walk.mean, 4.5 * walk.sigma + tolerance) << "base " << base << " cos " << cos;
        }
}

TEST(Bsdf, SmoothDielectricsLoseNothing) {
    for (float eta : {1.0f, 1.5f, 1 / 1.5f, 2.4f})
        for (const Vec3& wo : outgoing_directions()) {
            EXPECT_NEAR(albedo(make_dielectric(eta, 0, 0), wo, kImportance).mean, 1, 1e-6);
            EXPECT_NEAR(albedo(make_thin_dielectric(eta), wo, kImportance).mean, 1, 1e-6);
        }
}

TEST(Bsdf, RoughInterfacesLoseOnlyWhatTheyShadow) {
    // Single scattering from normal incidence, F = 1: a facet tilted beyond 45 degrees, of which GGX has
    // alpha^2 / (1 + alpha^2), mirrors below the horizon; masking on the way out takes no more than the same again.
    for (float alpha : {0.02f, 0.1f, 0.2f, 0.4f}) {
        const double beyond = alpha * alpha / (1 + alpha * alpha);
        const double metal = albedo(make_conductor(Rgb(1), conductor_k(Rgb(1)), alpha, alpha), {0, 0, 1}, kImportance).mean;
        EXPECT_LT(metal, 1 - beyond + 1e-3) << alpha;
        EXPECT_GT(metal, 1 - 2.2 * beyond - 1e-3) << alpha;
        // Into glass from above refraction bends towards the normal and loses far less.
        EXPECT_GT(albedo(make_dielectric(1.5f, alpha, alpha), {0, 0, 1}, kImportance).mean, 1 - 0.35 * beyond - 1e-3) << alpha;
    }
}

TEST(Bsdf, ThinPaneSumsItsInterReflections) {
    for (float cos : {1.0f, 0.5f, 0.1f}) {
        const double r = textbook_fresnel(cos, 1.5);
        double sum = r, inside = (1 - r) * r;
        for (int n = 0; n < 2000; ++n, inside *= r * r) sum += inside * (1 - r);
        BsdfSample s;
        ASSERT_TRUE(make_thin_dielectric(1.5f).sample(direction(cos, 1), 0, {0.5f, 0.5f}, kRadiance, &s));
        EXPECT_TRUE(s.delta);
        EXPECT_NEAR(s.pdf_fwd, sum, 1e-5);
        ASSERT_TRUE(make_thin_dielectric(1.5f).sample(direction(cos, 1), 0.9999f, {0.5f, 0.5f}, kRadiance, &s));
        EXPECT_EQ(s.wi, -direction(cos, 1));
    }
}

TEST(Bsdf, LobeFlagsTellTheTruth) {
    Rng rng({6});
    for (const BsdfCase& c : bsdf_cases()) {
        bool delta = false, smooth = false;
        for (int n = 0; n < 3000; ++n) {
            BsdfSample s;
            const Vec3 wo = uniform_direction(&rng);
            const float lobe = rng.uniform();
            if (c.bsdf.sample(wo, lobe, rng.uniform2(), kRadiance, &s)) (s.delta ? delta : smooth) |= !s.weight.is_black();
        }
        EXPECT_EQ(delta, c.bsdf.has_delta_lobe()) << c.name;
        EXPECT_EQ(smooth, c.bsdf.has_smooth_lobe()) << c.name;
        const Rgb a = c.bsdf.albedo();
        for (int k = 0; k < 3; ++k) EXPECT_TRUE(a[k] >= 0 && a[k] <= 1) << c.name;
    }
    EXPECT_FALSE(Bsdf{}.has_smooth_lobe());
    EXPECT_FALSE(make_diffuse(Rgb(0)).has_smooth_lobe());
}

TEST(Bsdf, NothingIsEverNotANumber) {
    std::vector<Vec3> awkward{{0, 0, 1}, {0, 0, -1}, {1, 0, 0}, {0, -1, 0}, {0, 0, 0}};
    for (float z : {1e-3f, 1e-7f, 1e-20f, 1e-38f, 1e-45f, -1e-6f, -1e-45f}) {
        awkward.push_back(normalize(Vec3{0.6f, 0.8f, z}));
        awkward.push_back({0.6f, -0.8f, z});
        awkward.push_back({z, z, 1});
    }
    uint64_t index = 0;
    for (const BsdfCase& c : bsdf_cases()) {
        Rng rng({7, Stage::kCamera, 0, index++});
        const auto pick = [&](int n) {
            if (n % 3 == 0) return awkward[rng.below(uint32_t(awkward.size()))];
            Vec3 w = uniform_direction(&rng);
            if (n % 3 == 1) w = normalize(Vec3{w.x, w.y, w.z * 1e-4f});
            return w;
        };
        for (int n = 0; n < 30000; ++n) {
            const Vec3 wo = pick(n), wi = pick(n / 3);
            const TransportMode mode = kModes[n & 1];
            const BsdfEval e = c.bsdf.eval(wo, wi, mode);
            ASSERT_TRUE(is_finite(e.f) && e.f.r >= 0 && e.f.g >= 0 && e.f.b >= 0) << c.name << " " << wo.z << " " << wi.z;
            ASSERT_TRUE(std::isfinite(e.pdf_fwd) && std::isfinite(e.pdf_rev) && e.pdf_fwd >= 0 && e.pdf_rev >= 0) << c.name;
            BsdfSample s;
            Vec2 u = rng.uniform2();
            if (n % 7 == 0) u = {n % 2 ? 0.0f : 0.99999994f, n % 5 ? 0.0f : 0.99999994f};
            const float lobe = n % 11 ? rng.uniform() : (n & 1 ? 0.0f : 0.99999994f);
            if (!c.bsdf.sample(wo, lobe, u, mode, &s)) continue;
            ASSERT_TRUE(is_finite(s.wi) && is_finite(s.weight) && std::isfinite(s.pdf_fwd) && std::isfinite(s.pdf_rev))
                << c.name << " " << wo.x << " " << wo.y << " " << wo.z << " u " << u.x << " " << u.y;
            ASSERT_TRUE(s.weight.r >= 0 && s.weight.g >= 0 && s.weight.b >= 0) << c.name;
        }
    }
}

}  // namespace
}  // namespace lightloom::testing
