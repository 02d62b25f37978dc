#include "common/scene/bsdf_tables.h"

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
float knot_alpha(int i) { return sqr(float(i) / (DirectionalTable::kAlphas - 1)); }

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

/// Fills `table` with integrals over visible normals of weight(cos_h, wi) G2 / G1, for light arriving along the direction
/// direction_of(cosine). The azimuth runs over half a turn: the lobe of an isotropic interface is symmetric.
template <typename DirectionOf, typename Weight>
void integrate(int azimuths, int heights, DirectionOf direction_of, Weight weight, DirectionalTable* table) {
    for (int a = 0; a < DirectionalTable::kAlphas; ++a) {
        const Ggx ggx{knot_alpha(a), knot_alpha(a)};
        for (int c = 0; c < DirectionalTable::kCosines; ++c) {
            // The first knot stands for the limit at grazing incidence.
            const Vec3 wo = direction_of(std::max(knot_cosine(c), 1e-6f));
            if (a == 0) {
                table->values[a][c] = weight(wo.z, Vec3{-wo.x, -wo.y, wo.z});
                continue;
            }
            double sum = 0;
            for (int i = 0; i < azimuths; ++i) {
                for (int j = 0; j < heights; ++j) {
                    const Vec2 u{0.5f * (float(i) + 0.5f) / float(azimuths), (float(j) + 0.5f) / float(heights)};
                    const Vec3 m = ggx.sample_visible_normal(wo, u);
                    const float cos_h = dot(wo, m);
                    const Vec3 wi = 2 * cos_h * m - wo;
                    if (!(wi.z > 0)) continue;
                    const float so = ggx.slope_length(wo), si = ggx.slope_length(wi);
                    sum += weight(std::min(cos_h, 1.0f), wi) * (so + wo.z) * wi.z / (so * wi.z + si * wo.z);
                }
            }
            table->values[a][c] = float(sum / (double(azimuths) * heights));
        }
        table->means[a] = row_mean(table->values[a]);
    }
}

void build_coat_albedo(float eta, DirectionalTable* table) {
    integrate(
        16, 32, [](float cos) { return Vec3{safe_sqrt(1 - cos * cos), 0, cos}; },
        [eta](float cos_h, const Vec3&) { return fresnel_dielectric(cos_h, eta).reflectance; }, table);
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
        32, 64,
        [eta](float cos) {
            const float sin = safe_sqrt(1 - cos * cos) / std::max(eta, 1.0f);
            return Vec3{sin, 0, safe_sqrt(1 - sin * sin)};
        },
        [cos2_critical](float, const Vec3& wi) { return wi.z * wi.z < cos2_critical ? 1.0f : 0.0f; }, table);
    table->smooth_mean = 0;
}

constinit TableCache coat_albedo_cache{build_coat_albedo};
constinit TableCache trapped_cache{build_trapped};

}  // namespace

const DirectionalTable& coat_albedo_table(float eta) { return coat_albedo_cache.get(eta); }
const DirectionalTable& trapped_table(float eta) { return trapped_cache.get(eta); }

}  // namespace lightloom
