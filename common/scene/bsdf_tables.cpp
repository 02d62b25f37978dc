#include "common/scene/bsdf_tables.h"

#include <array>
#include <atomic>

#include "common/scene/bsdf_fresnel.h"
#include "common/scene/bsdf_microfacet.h"

namespace lightloom {
namespace {

/// A list that only grows: readers never wait, and two threads that build the same table compute the same numbers.
/// Entries live as long as the program, because every Bsdf may point into them.
class TableCache {
  public:
    using Build = void (*)(float eta, float thickness, DirectionalTable* table);
    explicit constexpr TableCache(Build build) : build_(build) {}

    const DirectionalTable& get(float eta, float thickness) {
        Entry* head = head_.load(std::memory_order_acquire);
        if (const Entry* found = find(head, nullptr, eta, thickness)) return found->table;
        Entry* fresh = new Entry{eta, thickness, {}, head};
        build_(eta, thickness, &fresh->table);
        while (!head_.compare_exchange_weak(fresh->next, fresh, std::memory_order_acq_rel)) {
            if (const Entry* found = find(fresh->next, head, eta, thickness)) {
                delete fresh;
                return found->table;
            }
            head = fresh->next;
        }
        return fresh->table;
    }

  private:
    struct Entry {
        float eta, thickness;
        DirectionalTable table;
        Entry* next;
    };
    static const Entry* find(const Entry* from, const Entry* to, float eta, float thickness) {
        for (; from != to; from = from->next)
            if (from->eta == eta && from->thickness == thickness) return from;
        return nullptr;
    }

    std::atomic<Entry*> head_{nullptr};
    Build build_;
};

float knot_cosine(int i) { return sqr(float(i) / (DirectionalTable::kCosines - 1)); }
float knot_alpha(int i) { return sqr(sqr(lerp(float(i) / (DirectionalTable::kAlphas - 1), DirectionalTable::kFirstRoot, 1.0f))); }

/// Integrates one microfacet event over visible normals: the mean of weight(wo.m, m, &wi) G2 / G1 for light that
/// arrives along `wo` in the xz plane and goes on along wi. The azimuth runs over half a turn, since the lobe of an
/// isotropic interface is symmetric; the height u of Ggx::sample_visible_normal is substituted by 1 - (1 - t)^2, which
/// puts more points into GGX's tail.
class EventQuadrature {
  public:
    EventQuadrature() {
        for (int i = 0; i < kAzimuths; ++i) {
            const math::SinCos azimuth = math::sincos_turns(0.5 * (i + 0.5) / kAzimuths);
            cosines_[i] = float(azimuth.cos);
            sines_[i] = float(azimuth.sin);
        }
    }

    template <typename Weight>
    float operator()(float alpha, const Vec3& wo, Weight weight) const {
        const Ggx ggx{alpha, alpha};
        const float so = ggx.slope_length(wo);
        const Vec3 standard = normalize(Vec3{alpha * wo.x, 0, wo.z});
        double sum = 0;
        for (int j = 0; j < kHeights; ++j) {
            const float rest = 1 - (float(j) + 0.5f) / kHeights;
            const float z = rest * rest * (1 + standard.z) - standard.z, radius = safe_sqrt(1 - z * z);
            double ring = 0;
            for (int i = 0; i < kAzimuths; ++i) {
                const Vec3 unnormalised{alpha * (radius * cosines_[i] + standard.x), alpha * radius * sines_[i], z + standard.z};
                const Vec3 m = unnormalised / std::sqrt(length_squared(unnormalised));
                Vec3 wi;
                const float w = weight(std::min(dot(wo, m), 1.0f), m, &wi);
                const float zi = std::fabs(wi.z);
                if (w > 0) ring += w * (so + wo.z) * zi / (so * zi + ggx.slope_length(wi) * wo.z);
            }
            sum += ring * (2 * rest);
        }
        return float(sum / (kAzimuths * kHeights));
    }

  private:
    static constexpr int kAzimuths = 24, kHeights = 32;
    float cosines_[kAzimuths], sines_[kAzimuths];
};

Vec3 at_cosine(float cos) { return {safe_sqrt(1 - cos * cos), 0, cos}; }

void build_coat(float eta, float thickness, DirectionalTable* table) {
    const EventQuadrature event;
    // Diffuse light inside is represented by midpoints of equal projected solid angle.
    constexpr int kInner = 24;
    for (int a = 0; a < DirectionalTable::kAlphas; ++a) {
        const float alpha = knot_alpha(a);
        for (int c = 0; c < DirectionalTable::kCosines; ++c) {
            // The first knot stands for the limit at grazing incidence.
            const Vec3 wo = at_cosine(std::max(knot_cosine(c), 1e-6f));
            table->values[a][c] = event(alpha, wo, [&](float cos_h, const Vec3& m, Vec3* wi) {
                const DielectricFresnel f = fresnel_dielectric(cos_h, eta);
                *wi = m * (cos_h / f.eta - f.cos_t) - wo / f.eta;
                return wi->z < 0 ? (1 - f.reflectance) * slab_transmittance(thickness, -wi->z) : 0.0f;
            });
        }
        double returned = 0;
        for (int c = 0; c < kInner; ++c) {
            const Vec3 wo = at_cosine(std::sqrt((float(c) + 0.5f) / kInner));
            returned +=
                slab_transmittance(thickness, wo.z) * event(alpha, wo, [&](float cos_h, const Vec3& m, Vec3* wi) {
                    *wi = 2 * cos_h * m - wo;
                    return wi->z > 0 ? fresnel_dielectric(cos_h, 1 / eta).reflectance * slab_transmittance(thickness, wi->z) : 0.0f;
                });
        }
        table->per_alpha[a] = float(returned / kInner);
    }
    double returned = 0;
    constexpr int kSteps = 8192;
    for (int i = 0; i < kSteps; ++i) {
        const float cos = std::sqrt((float(i) + 0.5f) / kSteps);
        returned += sqr(slab_transmittance(thickness, cos)) * fresnel_dielectric(cos, 1 / eta).reflectance;
    }
    table->at_zero = float(returned / kSteps);
}

void build_trapped(float eta, float, DirectionalTable* table) {
    *table = {};
    if (eta <= 1) return;
    const EventQuadrature event;
    const float cos2_critical = 1 - 1 / (eta * eta);
    for (int a = 0; a < DirectionalTable::kAlphas; ++a)
        for (int c = 0; c < DirectionalTable::kCosines; ++c) {
            const float sin = at_cosine(std::max(knot_cosine(c), 1e-6f)).x / eta;
            const Vec3 wo{sin, 0, std::sqrt(1 - sin * sin)};
            table->values[a][c] = event(knot_alpha(a), wo, [&](float cos_h, const Vec3& m, Vec3* wi) {
                *wi = 2 * cos_h * m - wo;
                return wi->z > 0 && wi->z * wi->z < cos2_critical ? 1.0f : 0.0f;
            });
        }
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

constinit TableCache coat_cache{build_coat};
constinit TableCache trapped_cache{build_trapped};

}  // namespace

float cosine_mean_of_product(const TableRows& a, const TableRows& b) {
    constexpr int kLanes = 8;
    static_assert(DirectionalTable::kCosines % kLanes == 0);
    const float *a0 = a.rows, *a1 = a.rows + DirectionalTable::kCosines;
    const float *b0 = b.rows, *b1 = b.rows + DirectionalTable::kCosines;
    // The sums are independent, so that the compiler may use vectors without reordering additions.
    float sums[kLanes] = {};
    for (int i = 0; i < DirectionalTable::kCosines; i += kLanes)
        for (int l = 0; l < kLanes; ++l) {
            const int k = i + l;
            sums[l] += kProductWeights[size_t(k)] * lerp(a.fraction, a0[k], a1[k]) * lerp(b.fraction, b0[k], b1[k]);
        }
    float sum = 0;
    for (float s : sums) sum += s;
    return sum;
}

const DirectionalTable& coat_table(float eta, float thickness) { return coat_cache.get(eta, thickness); }
const DirectionalTable& trapped_table(float eta) { return trapped_cache.get(eta, 0); }

}  // namespace lightloom
