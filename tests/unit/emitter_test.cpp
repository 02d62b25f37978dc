// Every way to start at a light: emission and next event of each emitter kind are drawn with the
// densities that the weights use (chi-square), those densities integrate to one, and the energy is
// the analytic power.

#include "common/scene/emitter.h"

#include <gtest/gtest.h>

#include "common/core/math.h"
#include "common/core/rng.h"
#include "emitter_cases.h"
#include "tests/support/statistics.h"

namespace lightloom {
namespace {

using testing::Case;
using testing::cases;
using testing::Cells;
using testing::EnvironmentCase;
using testing::flux;
using testing::kCentre;
using testing::kRadius;
using testing::quarter_of;
using testing::set_of;
using testing::sphere;
using testing::spot;

constexpr int kSamples = 100000;

TEST(Emission, IsDrawnWithItsDensities) {
    testing::TestFamily family;
    for (const Case& c : cases()) {
        const EnvironmentCase source(c.environment);
        const EmitterSet set = set_of(c, source);
        const Emitter& e = set[0];
        const Cells directions{e.is_area() || !e.is_infinite() ? 10 : 1, e.is_infinite() ? 1 : 8}, discs{6, 8}, spheres{4, 8};
        const bool map = e.kind == EmitterKind::kEnvironment;
        const int square = 16;  // cells of the environment's own map, two to a texel side
        const int position_bins = e.kind == EmitterKind::kTriangle ? 4
                                  : e.kind == EmitterKind::kSphere ? spheres.count()
                                  : map                            ? square * square
                                                                   : 1;
        const int direction_bins = e.is_infinite() ? discs.count() : directions.count();
        const Mat4 map_to_world = map && !source.lights.empty() ? source.lights.back().light_to_world : Mat4{};
        const Mat4 world_to_map = *inverse(map_to_world);
        std::vector<double> observed(size_t(position_bins * direction_bins), 0), expected(observed.size(), 0);
        Rng rng({1, Stage::kTraining, 0, 0});
        int drawn = 0;
        for (int i = 0; i < kSamples; ++i) {
            EmissionSample s;
            const double pick = rng.uniform_double();
            const Vec2 u = rng.uniform2(), v = rng.uniform2();
            if (!set.sample_emission(pick, u, v, &s) || s.emitter != 0) continue;
            ++drawn;
            EXPECT_FLOAT_EQ(s.pdf_position, set.pdf_position(e, s.position, s.direction)) << c.name;
            EXPECT_FLOAT_EQ(s.pdf_direction, set.emission_densities(e, s.position, s.normal, s.direction, s.position).direction)
                << c.name;
            int position = 0, direction = 0;
            if (e.kind == EmitterKind::kTriangle) position = quarter_of(e, s.position);
            if (e.kind == EmitterKind::kSphere) {
                const Vec3 n = (s.position - e.position) / e.radius;
                EXPECT_NEAR(length(n), 1, 1e-5f);
                EXPECT_NEAR(dot(n, s.normal), e.inward ? -1 : 1, 1e-5f);
                position = spheres.of((1 + double(n.z)) / 2, n.x, n.y);
            }
            if (map) {
                const Vec2 uv = equal_area_sphere_to_square(normalize(world_to_map.vector(-s.direction)));
                position = std::min(int(uv.y * square), square - 1) * square + std::min(int(uv.x * square), square - 1);
            }
            if (e.is_infinite()) {
                const Vec3 d = Frame(s.direction).to_local(s.position - kCentre) / kRadius;
                EXPECT_NEAR(d.z, -1, 1e-5f) << "starts outside of the scene";
                direction = discs.of(double(d.x) * d.x + double(d.y) * d.y, d.x, d.y);
            } else {
                const Vec3 d = Frame(e.is_area()                    ? s.normal
                                     : e.kind == EmitterKind::kSpot ? e.normal
                                                                    : Vec3{0, 0, 1})
                                   .to_local(s.direction);
                direction = directions.of((1 + double(d.z)) / 2, d.x, d.y);
            }
            ++observed[size_t(position * direction_bins + direction)];
        }
        // What the densities predict, by the midpoint rule.
        double total = 0;
        for (int p = 0; p < position_bins; ++p) {
            double position = 0;  // probability of the cell
            if (e.kind == EmitterKind::kTriangle)
                position = double(e.pmf) * e.inv_area * 0.25 / e.inv_area;
            else if (e.kind == EmitterKind::kSphere)
                position = double(set.pdf_position(e, {}, {})) * 4 * kPiD * e.radius * e.radius / position_bins;
            else if (map) {
                const int n = c.environment == 3 ? 16 : 1;  // one lobe is turned against these cells
                for (int i = 0; i < n * n; ++i) {
                    const Vec2 uv{(float(p % square) + (float(i % n) + 0.5f) / float(n)) / square,
                                  (float(p / square) + (float(i / n) + 0.5f) / float(n)) / square};
                    const Vec3 d = normalize(map_to_world.vector(equal_area_square_to_sphere(uv)));
                    position += double(set.pdf_position(e, {}, -d)) * 4 * kPiD / (square * square * n * n);
                }
            } else
                position = set.pdf_position(e, {}, e.normal);
            for (int d = 0; d < direction_bins; ++d) {
                double direction = 0;
                if (e.is_infinite()) {
                    direction = double(set.emission_densities(e, {}, {}, e.normal, {}).direction) * kPiD * kRadius * kRadius /
                                direction_bins;
                } else {
                    // Only images depend on the azimuth.
                    const int n = e.has_direction_map() ? 256 : 64, azimuths = e.has_direction_map() ? n : 1;
                    for (int i = 0; i < n * azimuths; ++i) {
                        const double z = 2 * (d / directions.columns + (i % n + 0.5) / n) / directions.rows - 1;
                        const double turns = (d % directions.columns + (i / n + 0.5) / azimuths) / directions.columns - 0.5;
                        const Vec3 axis = e.is_area() ? Vec3{0, 0, 1} : e.kind == EmitterKind::kSpot ? e.normal : Vec3{0, 0, 1};
                        const double r = std::sqrt(1 - z * z), angle = 2 * kPiD * turns;
                        const Vec3 w = Frame(axis).to_world({float(r * std::cos(angle)), float(r * std::sin(angle)), float(z)});
                        direction += double(set.emission_densities(e, {}, axis, w, {}).direction) * 4 * kPiD /
                                     (double(direction_bins) * n * azimuths);
                    }
                }
                total += expected[size_t(p * direction_bins + d)] = position * direction;
            }
        }
        EXPECT_NEAR(total / double(e.pmf), 1, 2e-3) << c.name << ": the densities do not integrate to the pmf";
        for (double& x : expected) x *= double(drawn) / total;
        EXPECT_NEAR(drawn, kSamples * double(e.pmf), 5 * std::sqrt(kSamples * 0.25)) << c.name;
        family.add(testing::chi_square_test(observed, expected).p_value, c.name);
    }
    family.check();
}

/// Mean emitted throughput = power of all lights, whatever the density; selection is proportional
/// to power.
TEST(Emission, CarriesTheAnalyticPower) {
    testing::TestFamily family;
    for (const Case& c : cases()) {
        const EnvironmentCase source(c.environment);
        const EmitterSet set({c.emitter}, c.environment != 0 ? source.make() : Environment(), kCentre, kRadius, c.maps);
        const Rgb expected = flux(c);
        // That of images is the sum of a rule.
        const double tolerance = !c.maps.surfaces.empty() ? 1e-2 : !c.maps.directions.empty() ? 1e-3 : 1e-4;
        EXPECT_NEAR(set.power(set[0]) / scalar_of(expected), 1, tolerance) << c.name;
        std::vector<double> groups[3];
        Rng rng({2, Stage::kTraining, 0, 0});
        for (int g = 0; g < 20; ++g) {
            double sum[3] = {};
            for (int i = 0; i < kSamples / 20; ++i) {
                EmissionSample s;
                const double pick = rng.uniform_double();
                const Vec2 u = rng.uniform2(), v = rng.uniform2();
                if (!set.sample_emission(pick, u, v, &s)) continue;
                sum[0] += s.alpha.r, sum[1] += s.alpha.g, sum[2] += s.alpha.b;
            }
            for (int channel = 0; channel < 3; ++channel) groups[channel].push_back(sum[channel] / (kSamples / 20));
        }
        const double wanted[3] = {expected.r, expected.g, expected.b};
        for (int channel = 0; channel < 3; ++channel) {
            const testing::Sample sample(groups[channel]);
            // A perfect sampler has no variance: then only rounding remains.
            if (std::fabs(sample.mean / wanted[channel] - 1) > 1e-5)
                family.add(testing::one_sample_p_value(sample, wanted[channel]), c.name + ", channel " + std::to_string(channel));
        }
    }
    family.check();
}

/// Of a cone of a hundredth of a degree the cosine keeps no digit.
TEST(Emission, NarrowSpotsKeepTheirPower) {
    for (const double degrees : {0.01, 0.03, 0.1, 1.0, 60.0, 180.0}) {
        for (const double full : {0.0, 0.5, 1.0}) {
            const auto height = [](double angle) { return float(1 - std::cos(angle * kPiD / 180)); };
            const auto precise = [&](double angle) {
                const double s = std::sin(angle * kPiD / 360);
                return angle < 10 ? float(2 * s * s) : height(angle);
            };
            Emitter e = spot();
            e.total_height = precise(degrees), e.falloff_height = precise(degrees * full);
            const EmitterSet set({e}, Environment(), kCentre, kRadius);
            const double power = kPiD * scalar_of(e.radiance) * (double(e.total_height) + double(e.falloff_height));
            EXPECT_NEAR(set.power(set[0]) / power, 1, 1e-5) << degrees;
            Rng rng({3, Stage::kTraining, 0, 0});
            constexpr int kCount = 40000;
            double sum = 0;
            for (int i = 0; i < kCount; ++i) {
                EmissionSample s;
                const double pick = rng.uniform_double();
                const Vec2 u = rng.uniform2(), v = rng.uniform2();
                if (set.sample_emission(pick, u, v, &s)) sum += scalar_of(s.alpha);
            }
            // The smoothstep's deviation is below the mean: 1 / sqrt(40000) of it, times five.
            EXPECT_NEAR(sum / kCount / power, 1, full == 1.0 ? 2e-3 : 0.025) << degrees << " " << full;
        }
    }
}

/// A camera may find by itself what has an extent and can be met; x_0 of the others has a density all the same.
TEST(Emission, WhatCanBeHit) {
    for (const Case& c : cases()) {
        const bool named = c.name.find("hidden") != std::string::npos;
        EXPECT_EQ(c.emitter.can_be_hit(), !c.emitter.is_discrete() && !named) << c.name;
    }
}

/// Irradiance of a sphere, facing it: pi L (r / d)^2, down to a lamp of a millimetre seen from ten kilometres.
TEST(NextEvent, FindsASphereHoweverSmallItLooks) {
    for (const double ratio : {2.0, 1e3, 1e5, 1e6, 1e7}) {
        Emitter e = sphere(false);
        const Vec3 reference = e.position + normalize(Vec3{0.3f, -1.2f, 0.8f}) * float(ratio * double(e.radius));
        const EmitterSet set({e}, Environment(), {}, float(2 * ratio));
        const double d = double(length(reference - e.position));
        Rng rng({7, Stage::kTraining, 0, 0});
        double sum = 0;
        constexpr int kCount = 20000;
        for (int i = 0; i < kCount; ++i) {
            NextEventSample s;
            const double pick = rng.uniform_double();
            const Vec2 u = rng.uniform2();
            if (!set.sample_next_event(reference, pick, u, &s)) continue;
            const double cosine = double(dot(s.wi, normalize(e.position - reference)));
            sum += double(s.radiance.g) * double(s.geometry) * cosine / double(s.pdf);
        }
        const double exact = kPiD * double(e.radiance.g) * double(e.radius) * double(e.radius) / (d * d);
        EXPECT_NEAR(sum / kCount / exact, 1, ratio < 10 ? 0.01 : 1e-3) << ratio;
    }
}

/// Next event from a point outside (and, for the room-like sphere, inside): the points found follow
/// pdf_next_event.
TEST(NextEvent, IsDrawnWithItsDensity) {
    testing::TestFamily family;
    for (const Case& c : cases()) {
        const EnvironmentCase source(c.environment);
        const EmitterSet set = set_of(c, source);
        const Emitter& e = set[0];
        const bool round = e.kind == EmitterKind::kSphere, map = e.kind == EmitterKind::kEnvironment;
        std::vector<Vec3> references = {{0.3f, -1.2f, 0.8f}, {-0.5f, 1.2f, 0.72f}};
        if (round) references = {{0.3f, -1.2f, 0.8f}, {-0.5f, 0.4f, 0.7f + 0.6f * 1.02f}, {-0.4f, 0.5f, 0.9f}};
        for (const Vec3& reference : references) {
            // Bins: quarters of a triangle; (z, azimuth) on the sphere about the axis to the
            // reference; texels.
            const Vec3 axis = round ? normalize(reference - e.position) : Vec3{0, 0, 1};
            const double distance = length(reference - e.position);
            const bool cone = round && !e.inward && !(e.hidden && e.two_sided) && distance > e.radius;
            // A cap from outside, all of the sphere from inside.
            const double lowest = cone ? e.radius / distance : -1;
            const Cells cap{12, 8};
            const int square = 16, bins = e.kind == EmitterKind::kTriangle ? 4 : round ? cap.count() : map ? square * square : 1;
            const Mat4 map_to_world = map ? source.lights.back().light_to_world : Mat4{};
            const Mat4 world_to_map = *inverse(map_to_world);
            std::vector<double> observed(size_t(bins) + 1, 0), expected(size_t(bins) + 1, 0);
            Rng rng({3, Stage::kTraining, 0, 0});
            for (int i = 0; i < kSamples; ++i) {
                NextEventSample s;
                const double pick = rng.uniform_double();
                const Vec2 u = rng.uniform2();
                if (!set.sample_next_event(reference, pick, u, &s) || s.emitter != 0) {
                    ++observed[size_t(bins)];
                    continue;
                }
                EXPECT_NEAR(s.pdf / set.pdf_next_event(e, reference, s.position, s.normal, s.wi), 1, 1e-4) << c.name;
                int bin = 0;
                if (e.kind == EmitterKind::kTriangle) bin = quarter_of(e, s.position);
                if (round) {
                    const Vec3 n = Frame(axis).to_local((s.position - e.position) / e.radius);
                    bin = cap.of((double(n.z) - lowest) / (1 - lowest), n.x, n.y);
                }
                if (map) {
                    const Vec2 uv = equal_area_sphere_to_square(normalize(world_to_map.vector(s.wi)));
                    bin = std::min(int(uv.y * square), square - 1) * square + std::min(int(uv.x * square), square - 1);
                }
                if (!e.is_infinite()) {
                    const Vec3 d = s.position - reference;
                    EXPECT_NEAR(dot(normalize(d), s.wi), 1, 1e-5f);
                    const double wanted = (e.is_area() ? double(abs_dot(s.normal, s.wi)) : 1.0) / length_squared(d);
                    EXPECT_NEAR(s.geometry / wanted, 1, 1e-4) << c.name;
                }
                ++observed[size_t(bin)];
            }
            double total = 0;
            // A density counts where the point emits towards the reference; samples elsewhere are
            // refused.
            const auto density = [&](const Vec3& p, const Vec3& n) {
                const Vec3 wi = normalize(p - reference);
                return set.emitted(e, p, n, -wi).is_black() ? 0.0 : double(set.pdf_next_event(e, reference, p, n, wi));
            };
            for (int b = 0; b < bins; ++b) {
                double sum = 0;
                const int n = round ? 64 : 16;
                if (e.kind == EmitterKind::kTriangle) {
                    const Vec3 middle = e.position + (e.edge1 + e.edge2) / 3.0f;
                    sum = density(middle, e.normal) / e.inv_area * 0.25;
                } else if (round) {
                    for (int i = 0; i < n; ++i) {
                        const double z = lowest + (1 - lowest) * (b / cap.columns + (i + 0.5) / n) / cap.rows;
                        const Vec3 w = Frame(axis).to_world({float(std::sqrt(1 - z * z)), 0, float(z)});
                        sum += density(e.position + w * e.radius, e.inward ? -w : w) * 2 * kPiD * (1 - lowest) * e.radius *
                               e.radius / (double(bins) * n);
                    }
                } else if (map) {
                    for (int i = 0; i < n * n; ++i) {
                        const Vec2 uv{(float(b % square) + (float(i % n) + 0.5f) / float(n)) / square,
                                      (float(b / square) + (float(i / n) + 0.5f) / float(n)) / square};
                        const Vec3 d = normalize(map_to_world.vector(equal_area_square_to_sphere(uv)));
                        sum += double(set.pdf_next_event(e, reference, {}, {}, d)) * 4 * kPiD / (square * square * n * n);
                    }
                } else {
                    const bool lit = !set.emitted(e, e.position, {}, normalize(reference - e.position)).is_black();
                    sum = lit ? double(set.pdf_next_event(e, reference, e.position, {}, {})) : 0;
                }
                total += expected[size_t(b)] = sum * kSamples;
            }
            if (cone && !e.two_sided) {
                EXPECT_NEAR(total / (double(e.pmf) * kSamples), 1, 1e-2) << c.name << ": the density does not integrate to the pmf";
            }
            expected[size_t(bins)] = kSamples - total;
            family.add(testing::chi_square_test(observed, expected).p_value, c.name + " from distance " + std::to_string(distance));
        }
    }
    family.check();
}

}  // namespace
}  // namespace lightloom
