// Bsdf::sample() against the density that Bsdf::eval() states for it.

#include <gtest/gtest.h>

#include "tests/support/statistics.h"
#include "tests/unit/bsdf_cases.h"

namespace lightloom::testing {
namespace {

/// A partition of the sphere into cells. Each side of the surface has its own pole, where the density peaks there, and rings
/// that are finer towards it the larger `power` is (equal solid angles for 1). Cells end at the horizon.
class SphereGrid {
  public:
    static constexpr int kRings = 16, kSectors = 24;

    SphereGrid(const Vec3& upper_pole, const Vec3& lower_pole, double power)
        : frames_{Frame(upper_pole), Frame(lower_pole)},
          power_(power) {}

    size_t cell(const Vec3& w) const {
        const int side = w.z > 0 ? 0 : 1;
        const Vec3 v = frames_[side].to_local(w);
        // 1 - cos without cancellation near the pole.
        const double r2 = double(v.x) * v.x + double(v.y) * v.y;
        const double height = v.z > 0 ? r2 / (1 + v.z) : 1.0 - v.z;
        const int ring = std::min(int(std::pow(height / 2, 1 / power_) * kRings), kRings - 1);
        double turn = std::atan2(v.y, v.x) / kTurn;
        turn -= std::floor(turn);
        return size_t((side * kRings + ring) * kSectors + std::min(int(turn * kSectors), kSectors - 1));
    }

    /// Integral of `density` over every cell, adaptive: peaks and horizons are wherever they are.
    template <typename Density>
    std::vector<double> integrate(Density density) const {
        std::vector<double> result;
        for (int side = 0; side < 2; ++side) {
            const auto f = [&](double t, double turn) {
                const double height = 2 * std::pow(t, power_), sin = std::sqrt(height * (2 - height));
                const Vec3 v{float(sin * std::cos(turn * kTurn)), float(sin * std::sin(turn * kTurn)), float(1 - height)};
                const Vec3 w = normalize(frames_[side].to_world(v));
                if ((w.z > 0) != (side == 0)) return 0.0;
                return density(w) * 2 * power_ * std::pow(t, power_ - 1) * kTurn;
            };
            for (int r = 0; r < kRings; ++r)
                for (int s = 0; s < kSectors; ++s) {
                    const double t = double(r) / kRings, u = double(s) / kSectors;
                    const double a = 1.0 / kRings, b = 1.0 / kSectors;
                    result.push_back(refine(f, t, u, a, b, gauss(f, t, u, a, b), 0));
                }
        }
        return result;
    }

  private:
    static constexpr double kTurn = 6.283185307179586;

    template <typename F>
    static double gauss(const F& f, double t, double u, double a, double b) {
        constexpr double x[3] = {0.1127016653792583, 0.5, 0.8872983346207417};
        constexpr double w[3] = {5.0 / 18, 8.0 / 18, 5.0 / 18};
        double sum = 0;
        for (int i = 0; i < 3; ++i)
            for (int j = 0; j < 3; ++j) sum += w[i] * w[j] * f(t + a * x[i], u + b * x[j]);
        return sum * a * b;
    }
    template <typename F>
    static double refine(const F& f, double t, double u, double a, double b, double coarse, int depth) {
        a /= 2, b /= 2;
        double parts[4], fine = 0;
        for (int k = 0; k < 4; ++k) fine += parts[k] = gauss(f, t + a * (k & 1), u + b * (k >> 1), a, b);
        if (depth >= 1 && (depth == 9 || std::fabs(fine - coarse) < 2e-7)) return fine;
        fine = 0;
        for (int k = 0; k < 4; ++k) fine += refine(f, t + a * (k & 1), u + b * (k >> 1), a, b, parts[k], depth + 1);
        return fine;
    }

    Frame frames_[2];
    double power_;
};

/// The grid that resolves a case's sharpest lobes: poles in the mirror direction and in the refracted one.
SphereGrid grid_for(const BsdfCase& c, const Vec3& wo) {
    if (c.sharpness >= 0.3f) return {{0, 0, 1}, {0, 0, -1}, 1};
    const Vec3 mirrored{-wo.x, -wo.y, wo.z};
    const float eta = wo.z > 0 ? c.bsdf.eta : 1 / c.bsdf.eta;
    const float x = -wo.x / eta, y = -wo.y / eta, z = safe_sqrt(1 - x * x - y * y);
    const Vec3 refracted = normalize(Vec3{x, y, wo.z > 0 ? -z : z});
    const double power = c.sharpness < 0.05f ? 6 : 3;
    return wo.z > 0 ? SphereGrid{mirrored, refracted, power} : SphereGrid{refracted, mirrored, power};
}

/// Total pmf of the delta lobes seen from wo: each is found by scanning the lobe number.
double delta_pmf(const Bsdf& bsdf, const Vec3& wo) {
    double sum = 0;
    float last = -1;
    for (int i = 0; i < 4096; ++i) {
        BsdfSample s;
        if (!bsdf.sample(wo, (float(i) + 0.5f) / 4096, {0.5f, 0.5f}, TransportMode::kImportance, &s) || !s.delta) continue;
        if (s.pdf_fwd != last) sum += s.pdf_fwd;
        last = s.pdf_fwd;
    }
    return sum;
}

TEST(BsdfSampling, ChiSquareOfEveryMaterialDirectionAndMode) {
    struct Run {
        BsdfCase c;
        Vec3 wo;
        TransportMode mode;
    };
    std::vector<Run> runs;
    for (const BsdfCase& c : bsdf_cases())
        for (const Vec3& wo : outgoing_directions())
            for (TransportMode mode : kModes) {
                if (mode == TransportMode::kImportance || c.bsdf.kind == BsdfKind::kDielectric) runs.push_back({c, wo, mode});
            }
    const double level = sidak(0.001, int(runs.size()));
    constexpr int kSamples = 100000;
    uint64_t index = 0;
    for (const Run& run : runs) {
        const SphereGrid grid = grid_for(run.c, run.wo);
        std::vector<double> expected =
            grid.integrate([&](const Vec3& wi) { return double(run.c.bsdf.eval(run.wo, wi, run.mode).pdf_fwd); });
        double total = 0;
        for (double& e : expected) total += e, e *= kSamples;
        const double delta = delta_pmf(run.c.bsdf, run.wo);
        const double lost = 1 - delta - total;
        EXPECT_GT(lost, -5e-4) << run.c.name << " cos " << run.wo.z << ": the density integrates to " << total + delta;
        if (run.c.lossless) {
            EXPECT_LT(lost, 5e-4) << run.c.name << " cos " << run.wo.z;
        }
        expected.push_back(kSamples * delta);
        expected.push_back(std::max(kSamples * lost, 0.0));

        std::vector<double> observed(expected.size());
        Rng rng({7, Stage::kCamera, 0, index++});
        for (int n = 0; n < kSamples; ++n) {
            BsdfSample s;
            const float lobe = rng.uniform();
            const bool alive = run.c.bsdf.sample(run.wo, lobe, rng.uniform2(), run.mode, &s);
            const size_t bin = !alive ? expected.size() - 1 : (s.delta ? expected.size() - 2 : grid.cell(s.wi));
            observed[bin] += 1;
        }
        const ChiSquare chi = chi_square_test(observed, expected);
        EXPECT_GT(chi.p_value, level) << run.c.name << " wo " << run.wo.x << " " << run.wo.y << " " << run.wo.z << ": chi2 "
                                      << chi.statistic << " with " << chi.degrees << " degrees, lost " << lost << ", delta "
                                      << delta;
    }
}

TEST(BsdfSampling, SampleAgreesWithEvalToTheBit) {
    uint64_t index = 0;
    for (const BsdfCase& c : bsdf_cases())
        for (const Vec3& wo : outgoing_directions())
            for (TransportMode mode : kModes) {
                Rng rng({8, Stage::kCamera, 0, index++});
                for (int n = 0; n < 2000; ++n) {
                    BsdfSample s;
                    const float lobe = rng.uniform();
                    if (!c.bsdf.sample(wo, lobe, rng.uniform2(), mode, &s)) continue;
                    ASSERT_NEAR(length(s.wi), 1, 1e-5f) << c.name;
                    ASSERT_GT(s.pdf_fwd, 0) << c.name;
                    ASSERT_TRUE(s.weight.r >= 0 && s.weight.g >= 0 && s.weight.b >= 0) << c.name;
                    if (s.delta) {
                        ASSERT_LE(s.pdf_fwd, 1) << c.name;
                        continue;
                    }
                    const BsdfEval e = c.bsdf.eval(wo, s.wi, mode);
                    ASSERT_EQ(s.pdf_fwd, e.pdf_fwd) << c.name;
                    ASSERT_EQ(s.pdf_rev, e.pdf_rev) << c.name;
                    for (int i = 0; i < 3; ++i)
                        ASSERT_NEAR(s.weight[i], e.f[i] * std::fabs(s.wi.z) / e.pdf_fwd, 1e-5f * (1 + s.weight[i])) << c.name;
                }
            }
}

TEST(BsdfSampling, DeltaLobesOccurWithTheirPmf) {
    struct Run {
        BsdfCase c;
        Vec3 wo;
    };
    std::vector<Run> runs;
    for (const BsdfCase& c : bsdf_cases())
        if (c.bsdf.has_delta_lobe())
            for (const Vec3& wo : outgoing_directions()) runs.push_back({c, wo});
    constexpr int kSamples = 200000;
    const double level = sidak(0.001, int(runs.size()));
    uint64_t index = 0;
    for (const Run& run : runs) {
        // A lobe is known by its direction; up to two of them (reflected and transmitted).
        Vec3 lobes[2];
        double pmf[2] = {}, counts[2] = {};
        int found = 0;
        Rng rng({9, Stage::kCamera, 0, index++});
        for (int n = 0; n < kSamples; ++n) {
            BsdfSample s;
            const float lobe = rng.uniform();
            const Vec2 u = rng.uniform2();
            if (!run.c.bsdf.sample(run.wo, lobe, u, TransportMode::kImportance, &s) || !s.delta) continue;
            int k = 0;
            while (k < found && !(lobes[k] == s.wi)) ++k;
            ASSERT_LT(k, 2) << run.c.name;
            if (k == found) lobes[found] = s.wi, pmf[found++] = s.pdf_fwd;
            ASSERT_EQ(pmf[k], double(s.pdf_fwd)) << run.c.name;
            counts[k] += 1;
            // The reversed event must have the pmf stated here, up to the rounding of the direction.
            const bool into_horizon = std::fabs(s.wi.z) < 1e-3f;
            BsdfSample back;
            if (!into_horizon && run.c.bsdf.sample(s.wi, lobe, u, TransportMode::kImportance, &back) && back.delta &&
                dot(back.wi, run.wo) > 0.9999f) {
                ASSERT_NEAR(back.pdf_fwd, s.pdf_rev, 1e-4) << run.c.name;
            }
        }
        ASSERT_GT(found, 0) << run.c.name;
        for (int k = 0; k < found; ++k) {
            const double sigma = std::sqrt(std::max(kSamples * pmf[k] * (1 - pmf[k]), 1e-9));
            EXPECT_GT(normal_p_value((counts[k] - kSamples * pmf[k]) / sigma), level) << run.c.name << " pmf " << pmf[k];
        }
    }
}

}  // namespace
}  // namespace lightloom::testing
