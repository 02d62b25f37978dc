#include "common/scene/bsdf_tables.h"

#include <array>
#include <atomic>
#include <memory>
#include <thread>

#include "common/scene/bsdf_fresnel.h"
#include "common/scene/bsdf_microfacet.h"

namespace lightloom {
namespace {

/// A list that only grows. Threads that need the same table at the same time share its rows out among themselves, so that
/// none is computed twice; they wait for nobody who waits in turn. Entries live as long as the program, because every
/// Bsdf may point into them.
class TableCache {
  public:
    using BuildRow = void (*)(float eta, float thickness, int row, DirectionalTable* table);
    explicit constexpr TableCache(BuildRow build_row) : build_row_(build_row) {}

    const DirectionalTable& get(float eta, float thickness) {
        Entry& entry = find_or_add(eta, thickness);
        if (entry.rows_done.load(std::memory_order_acquire) < DirectionalTable::kAlphas) complete(&entry);
        return entry.table;
    }
    uint64_t rows_built() const { return rows_built_.load(std::memory_order_relaxed); }

  private:
    struct Entry {
        float eta, thickness;
        Entry* next;
        std::atomic<int> next_row{0}, rows_done{0};
        DirectionalTable table{};
    };
    static Entry* find(Entry* from, const Entry* to, float eta, float thickness) {
        for (; from != to; from = from->next)
            if (from->eta == eta && from->thickness == thickness) return from;
        return nullptr;
    }

    Entry& find_or_add(float eta, float thickness) {
        Entry* head = head_.load(std::memory_order_acquire);
        if (Entry* found = find(head, nullptr, eta, thickness)) return *found;
        std::unique_ptr<Entry> fresh(new Entry{eta, thickness, head});
        while (!head_.compare_exchange_weak(fresh->next, fresh.get(), std::memory_order_acq_rel)) {
            if (Entry* found = find(fresh->next, head, eta, thickness)) return *found;
            head = fresh->next;
        }
        return *fresh.release();
    }

    void complete(Entry* entry) {
        for (int row; (row = entry->next_row.fetch_add(1, std::memory_order_relaxed)) < DirectionalTable::kAlphas;) {
            build_row_(entry->eta, entry->thickness, row, &entry->table);
            rows_built_.fetch_add(1, std::memory_order_relaxed);
            entry->rows_done.fetch_add(1, std::memory_order_acq_rel);
        }
        // The last rows are in the hands of threads that compute, for less than a millisecond.
        while (entry->rows_done.load(std::memory_order_acquire) < DirectionalTable::kAlphas) std::this_thread::yield();
    }

    std::atomic<Entry*> head_{nullptr};
    std::atomic<uint64_t> rows_built_{0};
    BuildRow build_row_;
};

float knot_cosine(int i) { return sqr(float(i) / (DirectionalTable::kCosines - 1)); }
float knot_alpha(int i) { return sqr(sqr(lerp(float(i) / (DirectionalTable::kAlphas - 1), DirectionalTable::kFirstRoot, 1.0f))); }

/// Integrates one microfacet event over visible normals: the mean of weight(wo.m, m, &wi) G2 / G1 for light that
/// arrives along `wo` in the xz plane and goes on along wi. The azimuth runs over half a turn, since the lobe of an
/// isotropic interface is symmetric; the height u of Ggx::sample_visible_normal is substituted by 1 - (1 - t)^2, which
/// puts more points into GGX's tail. The points of a ring share vector instructions, so a weight must not branch; each
/// operation rounds as it would alone, and the sum goes over the points in their order.
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
            float terms[kAzimuths];
            for (int i = 0; i < kAzimuths; ++i) {
                const Vec3 unnormalised{alpha * (radius * cosines_[i] + standard.x), alpha * radius * sines_[i], z + standard.z};
                const Vec3 m = unnormalised / std::sqrt(length_squared(unnormalised));
                const float cos_h = dot(wo, m);
                Vec3 wi;
                const float w = weight(cos_h > 1 ? 1.0f : cos_h, m, &wi);
                const float zi = std::fabs(wi.z);
                const float term = w * (so + wo.z) * zi / (so * zi + ggx.slope_length(wi) * wo.z);
                terms[i] = w > 0 ? term : 0.0f;
            }
            double ring = 0;
            for (const float term : terms) ring += term;
            sum += ring * (2 * rest);
        }
        return float(sum / (kAzimuths * kHeights));
    }

  private:
    static constexpr int kAzimuths = 24, kHeights = 32;
    float cosines_[kAzimuths], sines_[kAzimuths];
};

/// fresnel_dielectric() without branches.
inline DielectricFresnel fresnel_in_ring(float cos_i, float eta) {
    const float e = cos_i < 0 ? 1 / eta : eta, cos = std::fabs(cos_i), cos2_t = 1 - (1 - cos * cos) / (e * e);
    const float cos_t = std::sqrt(cos2_t > 0 ? cos2_t : 0.0f);
    const float reflectance = cos2_t > 0 ? fresnel_from_cosines(cos, cos_t, e) : 1.0f;
    return {e == 1 ? 0.0f : reflectance, e == 1 ? cos : cos_t, e};
}

Vec3 at_cosine(float cos) { return {safe_sqrt(1 - cos * cos), 0, cos}; }

void build_coat_row(float eta, float thickness, int a, DirectionalTable* table) {
    const EventQuadrature event;
    const float alpha = knot_alpha(a);
    for (int c = 0; c < DirectionalTable::kCosines; ++c) {
        // The first knot stands for the limit at grazing incidence.
        const Vec3 wo = at_cosine(std::max(knot_cosine(c), 1e-6f));
        table->values[a][c] = event(alpha, wo, [=](float cos_h, const Vec3& m, Vec3* wi) {
            const DielectricFresnel f = fresnel_in_ring(cos_h, eta);
            *wi = m * (cos_h / f.eta - f.cos_t) - wo / f.eta;
            const float passed = (1 - f.reflectance) * slab_transmittance(thickness, -wi->z);
            return wi->z < 0 ? passed : 0.0f;
        });
    }
    // Diffuse light inside is represented by midpoints of equal projected solid angle.
    constexpr int kInner = 24;
    double returned = 0;
    for (int c = 0; c < kInner; ++c) {
        const Vec3 wo = at_cosine(std::sqrt((float(c) + 0.5f) / kInner));
        returned += slab_transmittance(thickness, wo.z) * event(alpha, wo, [=](float cos_h, const Vec3& m, Vec3* wi) {
                        *wi = 2 * cos_h * m - wo;
                        const float kept = fresnel_in_ring(cos_h, 1 / eta).reflectance * slab_transmittance(thickness, wi->z);
                        return wi->z > 0 ? kept : 0.0f;
                    });
    }
    table->per_alpha[a] = float(returned / kInner);
    if (a > 0) return;
    returned = 0;
    constexpr int kSteps = 8192;
    for (int i = 0; i < kSteps; ++i) {
        const float cos = std::sqrt((float(i) + 0.5f) / kSteps);
        returned += sqr(slab_transmittance(thickness, cos)) * fresnel_dielectric(cos, 1 / eta).reflectance;
    }
    table->at_zero = float(returned / kSteps);
}

void build_trapped_row(float eta, float, int a, DirectionalTable* table) {
    if (eta <= 1) return;  // the table stays zero
    const EventQuadrature event;
    const float cos2_critical = 1 - 1 / (eta * eta);
    for (int c = 0; c < DirectionalTable::kCosines; ++c) {
        const float sin = at_cosine(std::max(knot_cosine(c), 1e-6f)).x / eta;
        const Vec3 wo{sin, 0, std::sqrt(1 - sin * sin)};
        table->values[a][c] = event(knot_alpha(a), wo, [=](float cos_h, const Vec3& m, Vec3* wi) {
            *wi = 2 * cos_h * m - wo;
            const float beyond = wi->z * wi->z < cos2_critical ? 1.0f : 0.0f;
            return wi->z > 0 ? beyond : 0.0f;
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

constinit TableCache coat_cache{build_coat_row};
constinit TableCache trapped_cache{build_trapped_row};

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
uint64_t coat_table_rows_built() { return coat_cache.rows_built() + trapped_cache.rows_built(); }

}  // namespace lightloom
