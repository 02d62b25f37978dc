#include "common/scene/bsdf_tables.h"

#include <array>
#include <atomic>

#include "common/scene/bsdf_fresnel.h"
#include "common/scene/bsdf_microfacet.h"

namespace lightloom {
namespace {

/// Insert-only list: readers never wait, and two threads that build the same table build the same numbers. Entries live as
/// long as the program, because every Bsdf may point into them.
class TableCache {
  public:
    using Build = void (*)(float eta, DirectionalTable* table);
    explicit constexpr TableCache(Build build) : build_(build) {}

    const DirectionalTable& get(float eta) {
        Entry* head = head_.load(std::memory_order_acquire);
        if (const Entry* found = find(head, nullptr, eta)) return found->table;
        Entry* fresh = new Entry{eta, {}, head};
        build_(eta, &fresh->table);
        while (!head_.compare_exchange_weak(fresh->next, fresh, std::memory_order_acq_rel)) {
            if (const Entry* found = find(fresh->next, head, eta)) {
                delete fresh;
                return found->table;
            }
            head = fresh->next;
        }
        return fresh->table;
    }

  private:
    struct Entry {
        float eta;
        DirectionalTable table;
        Entry* next;
    };
    static const Entry* find(const Entry* from, const Entry* to, float eta) {
        for (; from != to; from = from->next)
            if (from->eta == eta) return from;
        return nullptr;
    }

    std::atomic<Entry*> head_{nullptr};
    Build build_;
};

float knot_cosine(int i) { return sqr(float(i) / (DirectionalTable::kCosines - 1)); }
float knot_alpha(int i) {
    return sqr(sqr(lerp(float(i) / (DirectionalTable::kAlphas - 1), DirectionalTable::kFirstRoot, 1.0f)));
}

/// 2 integral of row(c) c dc over [0, 1]: with x = sqrt(c) it is 4 integral of row x^3 dx, and the row is linear in x.
float row_mean(const float* row) {
    double sum = 0;
    const auto power_integral = [](double a, double b, int n) {
        double pa = 1, pb = 1;
        for (int i = 0; i <= n; ++i) pa *= a, pb *= b;
        return (pb - pa) / (n + 1);
    };
    for (int i = 0; i + 1 < DirectionalTable::kCosines; ++i) {
        const double a = double(i) / (DirectionalTable::kCosines - 1);
        const double b = double(i + 1) / (DirectionalTable::kCosines - 1);
        const double slope = (double(row[i + 1]) - row[i]) / (b - a);
        sum += 4 * ((row[i] - slope * a) * power_integral(a, b, 3) + slope * power_integral(a, b, 4));
    }
    return float(sum);
}

/// Fills `table` with integrals over visible normals of weight(cos_h, cos_i) G2 / G1, for light arriving in the xz plane
/// along direction_of(cosine). The azimuth runs over half a turn, since the lobe of an isotropic interface is symmetric; the
/// height u of Ggx::sample_visible_normal is substituted by 1 - (1 - t)^2, which gathers points in GGX's tail.
template <typename DirectionOf, typename Weight>
void integrate(DirectionOf direction_of, Weight weight, DirectionalTable* table) {
    constexpr int kAzimuths = 24, kHeights = 32;
    float cosines[kAzimuths], sines[kAzimuths];
    for (int i = 0; i < kAzimuths; ++i) {
        const math::SinCos azimuth = math::sincos_turns(0.5 * (i + 0.5) / kAzimuths);
        cosines[i] = float(azimuth.cos);
        sines[i] = float(azimuth.sin);
    }
    for (int a = 0; a < DirectionalTable::kAlphas; ++a) {
        const float alpha = knot_alpha(a);
        const Ggx ggx{alpha, alpha};
        for (int c = 0; c < DirectionalTable::kCosines; ++c) {
            // The first knot stands for the limit at grazing incidence.
            const Vec3 wo = direction_of(std::max(knot_cosine(c), 1e-6f));
            const float so = ggx.slope_length(wo);
            const Vec3 standard = normalize(Vec3{alpha * wo.x, 0, wo.z});
            double sum = 0;
            for (int j = 0; j < kHeights; ++j) {
                const float rest = 1 - (float(j) + 0.5f) / kHeights;
                const float z = rest * rest * (1 + standard.z) - standard.z, radius = safe_sqrt(1 - z * z);
                double ring = 0;
                for (int i = 0; i < kAzimuths; ++i) {
                    const Vec3 m{alpha * (radius * cosines[i] + standard.x), alpha * radius * sines[i], z + standard.z};
                    const float length2 = length_squared(m), cosine = wo.x * m.x + wo.z * m.z;
                    const Vec3 wi = (2 * cosine / length2) * m - wo;
                    if (!(wi.z > 0)) continue;
                    const float cos_h = std::min(cosine / std::sqrt(length2), 1.0f);
                    ring += weight(cos_h, wi.z) * (so + wo.z) * wi.z / (so * wi.z + ggx.slope_length(wi) * wo.z);
                }
                sum += ring * (2 * rest);
            }
            table->values[a][c] = float(sum / (kAzimuths * kHeights));
        }
        table->means[a] = row_mean(table->values[a]);
    }
}

void build_coat_albedo(float eta, DirectionalTable* table) {
    integrate(
        [](float cos) { return Vec3{safe_sqrt(1 - cos * cos), 0, cos}; },
        [eta](float cos_h, float) { return fresnel_dielectric(cos_h, eta).reflectance; }, table);
    double mean = 0;
    constexpr int kSteps = 4096;
    for (int i = 0; i < kSteps; ++i) {
        const double x = (i + 0.5) / kSteps;
        mean += 4 * x * x * x * fresnel_dielectric(float(x * x), eta).reflectance / kSteps;
    }
    table->smooth_mean = float(mean);
}

void build_trapped(float eta, DirectionalTable* table) {
    const float cos2_critical = 1 - 1 / (eta * eta);
    integrate(
        [eta](float cos) {
            const float sin = safe_sqrt(1 - cos * cos) / std::max(eta, 1.0f);
            return Vec3{sin, 0, safe_sqrt(1 - sin * sin)};
        },
        [cos2_critical](float, float cos_i) { return cos_i * cos_i < cos2_critical ? 1.0f : 0.0f; }, table);
    table->smooth_mean = 0;
}

/// Weights of the trapezoidal rule for 4 integral of f x^3 dx over the knots of x = sqrt(cos).
constexpr std::array<float, DirectionalTable::kCosines> product_weights() {
    std::array<float, DirectionalTable::kCosines> weights{};
    double sum = 0;
    for (int pass = 0; pass < 2; ++pass)
        for (int i = 0; i < DirectionalTable::kCosines; ++i) {
            const double x = double(i) / (DirectionalTable::kCosines - 1);
            const double w = 4 * x * x * x / (DirectionalTable::kCosines - 1) * (i + 1 == DirectionalTable::kCosines ? 0.5 : 1);
            if (pass == 0) sum += w;
            if (pass == 1) weights[size_t(i)] = float(w / sum);
        }
    return weights;
}
constexpr auto kProductWeights = product_weights();

constinit TableCache coat_albedo_cache{build_coat_albedo};
constinit TableCache trapped_cache{build_trapped};

}  // namespace

float cosine_mean_of_product(const TableRows& a, const TableRows& b) {
    constexpr int kLanes = 8;
    static_assert(DirectionalTable::kCosines % kLanes == 0);
    const float *a0 = a.rows, *a1 = a.rows + DirectionalTable::kCosines;
    const float *b0 = b.rows, *b1 = b.rows + DirectionalTable::kCosines;
    // Independent sums, so that the compiler may use vectors without reordering anything.
    float sums[kLanes] = {};
    for (int i = 0; i < DirectionalTable::kCosines; i += kLanes)
        for (int l = 0; l < kLanes; ++l) {
            const int k = i + l;
            sums[l] += kProductWeights[size_t(k)] * (1 - lerp(a.fraction, a0[k], a1[k])) * lerp(b.fraction, b0[k], b1[k]);
        }
    float sum = 0;
    for (float s : sums) sum += s;
    return sum;
}

const DirectionalTable& coat_albedo_table(float eta) { return coat_albedo_cache.get(eta); }
const DirectionalTable& trapped_table(float eta) { return trapped_cache.get(eta); }

}  // namespace lightloom
