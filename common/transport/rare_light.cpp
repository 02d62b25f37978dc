#include "common/transport/rare_light.h"

#include <algorithm>
#include <boost/geometry.hpp>
#include <boost/geometry/geometries/point.hpp>
#include <boost/geometry/index/rtree.hpp>
#include <iterator>
#include <utility>
#include <vector>

#include "common/core/fork_join.h"
#include "common/path/camera_walk.h"
#include "common/path/light_walk.h"
#include "common/transport/catalog.h"
#include "common/transport/parameters.h"

namespace lightloom {
namespace {

namespace bg = boost::geometry;
using Point = bg::model::point<float, 3, bg::cs::cartesian>;
using Box = bg::model::box<Point>;
using Entry = std::pair<Point, uint32_t>;
using PhotonMap = bg::index::rtree<Entry, bg::index::quadratic<16>>;

constexpr size_t kPhotonPaths = 32768, kCameraSamples = 16384, kProbes = 2048, kChunk = 512;
/// Longest chain of mirrors and glass. Longer ones carry next to no light, and in a closed room of mirrors a walk would
/// not end.
constexpr int kLongestChain = 12;
/// Radius of the search over the width of what the frame shows there, as if it were square.
constexpr float kRadiusPerWidth = 1.0f / 80;

/// A place at which light arrived through mirrors and glass alone.
struct Photon {
    Vec3 p, ng, wo;
    Rgb flux;      ///< Per light sub-path.
    Rgb radiance;  ///< Radiance of the lamp towards the chain, as a camera sub-path from here would see it.
    int edges = 0;
    bool can_be_hit = false;
};

/// Whether a vertex has a mirror's or a smooth glass's part, perhaps beside others, as a varnish has.
bool has_dirac_lobe(const PathVertex& v) { return v.bsdf.has_delta_lobe(); }

struct Estimator {
    const Scene& scene;
    const uint64_t seed;
    const int max_edges;
    const Traces traces;
    const RouletteRule roulette{};

    /// Appends the photons of a light sub-path, one at each vertex that it reaches through Dirac events alone and that scatters
    /// otherwise as well; true if the sub-path met a mirror or glass at all.
    bool trace_photons(size_t number, std::vector<PathVertex>& y, std::vector<Photon>* out) const {
        LightSampler sampler({seed, Stage::kLightPool, 1, number});
        WalkCounters counters;
        const int n = trace_light_path(scene, sampler, int(y.size()), roulette, y.data(), &counters);
        if (n < 2 || !has_dirac_lobe(y[1])) return false;
        for (int s = 2; s < n && y[size_t(s) - 1].delta; ++s)
            if (y[size_t(s)].bsdf.has_smooth_lobe()) add_photon(y.data(), s, out);
        return true;
    }

    /// The photon y[s], s >= 2, behind the Dirac events y[1 .. s-1].
    void add_photon(const PathVertex* y, int s, std::vector<Photon>* out) const {
        const PathVertex &start = y[0], &end = y[s];
        // A camera sub-path that leaves the glass again regains the radiance that refraction took from it.
        float index_ratio = 1;
        for (int i = 1; i < s; ++i) {
            index_ratio *= index_ratio2(y[i], y[i].shading.to_local(normalize(y[i + 1].p - y[i].p)));
        }
        const EmitterSet& emitters = scene.emitters();
        const Emitter& e = emitters[uint32_t(start.emitter)];
        const Vec3 w = e.is_infinite() ? start.ng : normalize(y[1].p - start.p);
        out->push_back(
            {end.p, end.ng, end.wo, end.alpha, emitters.emitted(e, start.p, start.ng, w) * index_ratio, s, e.can_be_hit()});
    }

    /// Whether the camera sub-path z[0 .. t-1], whose end scatters to a photon's chain, has no edge that another technique
    /// connects.
    bool only_hits_follow(const PathVertex* z, int t) const {
        if (traces == Traces::kCamera) return true;
        bool previous_is_dirac = false;  // the lens
        for (int i = 1; i < t; ++i) {
            const bool dirac = i < t - 1 && z[i].delta;
            if (!dirac && !previous_is_dirac) return false;
            previous_is_dirac = dirac;
        }
        return true;
    }

    /// Adds the energy of the photons near the end of the camera sub-path z[0 .. t-1].
    void gather(const PhotonMap& map, const std::vector<Photon>& photons, const PathVertex* z, int t, float radius,
                RareLight* sum) const {
        const PathVertex& v = z[t - 1];
        const auto corner = [&](float r) { return Point(v.p.x + r, v.p.y + r, v.p.z + r); };
        const Box box(corner(-radius), corner(radius));
        for (auto found = map.qbegin(bg::index::intersects(box)); found != map.qend(); ++found) {
            const Photon& photon = photons[found->second];
            const Vec3 between = photon.p - v.p;
            if (dot(between, between) > radius * radius || std::fabs(dot(photon.ng, v.ng)) < 0.8f) continue;
            if (t - 1 + photon.edges > max_edges) continue;
            const Scatter event = scatter<TransportMode::kRadiance>(v, photon.wo);
            const float cosine = abs_dot(photon.wo, v.ng);
            if (!(event.pdf_fwd > 0) || !(cosine > 1e-3f)) continue;
            const Rgb density = photon.flux * (1 / (kPi * radius * radius * float(kPhotonPaths)));
            const Rgb energy = v.alpha * event.value * density * (1 / cosine);
            if (!is_finite(energy)) continue;
            ++sum->merges;
            if (!photon.can_be_hit) {
                sum->unreachable += energy;
                continue;
            }
            sum->by_chance += energy;
            // The value of the camera sample that goes on through the chain to the lamp, without the chain's absorption
            // and roulette.
            const Rgb hit = v.alpha * event.value * (1 / event.pdf_fwd) * photon.radiance;
            sum->second_moment += double(energy.luminance()) * double(hit.luminance());
        }
    }

    /// Adds the light that camera sample number i finds; true if the sample met a mirror or glass.
    bool trace_camera(size_t i, const PhotonMap* map, const std::vector<Photon>& photons, std::vector<PathVertex>& z,
                      RareLight* sum) const {
        const Rect crop = scene.frame().crop;
        const Vec2 place = low_discrepancy_point(uint32_t(i), seed);
        const int px = crop.x0 + std::min(crop.width() - 1, int(place.x * float(crop.width())));
        const int py = crop.y0 + std::min(crop.height() - 1, int(place.y * float(crop.height())));
        CameraSampler sampler(seed, uint64_t(i), uint64_t(crop.index(px, py)));
        WalkCounters counters;
        bool met_dirac = false;
        // The radius follows the frame as far as the first surface that scatters; light that goes on from there is not looked at
        // any closer.
        float distance = 0, radius = 0;
        const float pdf = sampler.ray(scene.camera(), px, py).pdf;
        const float width = std::sqrt(float(crop.area()) / pdf);  // at distance 1, or of parallel rays
        const auto visit = [&](int t) {
            const PathVertex& v = z[size_t(t) - 1];
            distance += length(v.p - z[size_t(t) - 2].p);
            if (t > max_edges) return;
            met_dirac |= has_dirac_lobe(v);
            if (!v.bsdf.has_smooth_lobe()) return;
            if (radius == 0) radius = kRadiusPerWidth * width * (scene.camera().has_parallel_rays() ? 1 : distance);
            if (map && only_hits_follow(z.data(), t)) gather(*map, photons, z.data(), t, radius, sum);
        };
        trace_camera_path(scene, sampler, px, py, max_edges, roulette, z.data(), &counters, visit, [](int, const WalkRay&) {});
        return met_dirac;
    }
};

/// Calls each(i, vertices, chunk) for i in [0, count), in chunks whose results are joined in their order.
template <class Chunk, class Each>
std::vector<Chunk> in_chunks(size_t count, size_t room, const Each& each) {
    std::vector<Chunk> chunks((count + kChunk - 1) / kChunk);
    fork_join(chunks.size(), [&](size_t first, size_t last) {
        std::vector<PathVertex> vertices(room);
        for (size_t c = first; c < last; ++c)
            for (size_t i = c * kChunk; i < std::min(count, (c + 1) * kChunk); ++i) each(i, vertices, &chunks[c]);
    });
    return chunks;
}

}  // namespace

RareLight estimate_rare_light(const Scene& scene, const RenderSettings& settings, std::stop_token stop) {
    const AlgorithmInfo& info = settings.algorithm.info();
    if (info.traces == Traces::kLight || settings.algorithm.merges() || scene.emitters().empty()) return {};
    const Estimator estimator{scene, settings.seed, settings.max_edges(), info.traces};
    const size_t light_room = size_t(std::min(settings.max_edges(), kLongestChain)) + 1,
                 camera_room = size_t(settings.max_edges()) + 2;

    // Most scenes have neither mirrors nor glass: a few sub-paths of both kinds show whether this one does.
    bool met_dirac = false;
    {
        std::vector<PathVertex> vertices(std::max(light_room, camera_room));
        std::vector<Photon> photons;
        RareLight nothing;
        std::vector<PathVertex> chain(light_room);
        for (size_t i = 0; i < kProbes && !met_dirac; ++i)
            met_dirac =
                estimator.trace_photons(i, chain, &photons) || estimator.trace_camera(i, nullptr, photons, vertices, &nothing);
    }
    if (!met_dirac || stop.stop_requested()) return {};

    std::vector<Photon> photons;
    for (auto& chunk : in_chunks<std::vector<Photon>>(kPhotonPaths, light_room, [&](size_t i, auto&y, auto*out) {
             if (!stop.stop_requested()) estimator.trace_photons(i, y, out);
         }))
        photons.insert(photons.end(), std::make_move_iterator(chunk.begin()), std::make_move_iterator(chunk.end()));
    std::vector<Entry> entries;
    for (size_t i = 0; i < photons.size(); ++i)
        entries.emplace_back(Point(photons[i].p.x, photons[i].p.y, photons[i].p.z), uint32_t(i));
    const PhotonMap map(entries.begin(), entries.end());

    RareLight sum;
    for (const RareLight& chunk : in_chunks<RareLight>(kCameraSamples, camera_room, [&](size_t i, auto&z, RareLight*out) {
             if (!stop.stop_requested()) estimator.trace_camera(i, &map, photons, z, out);
         })) {
        sum.by_chance += chunk.by_chance;
        sum.unreachable += chunk.unreachable;
        sum.second_moment += chunk.second_moment;
        sum.merges += chunk.merges;
    }
    if (stop.stop_requested()) return {};
    const float share = 1 / float(kCameraSamples);
    sum.by_chance *= share, sum.unreachable *= share, sum.second_moment *= double(share);
    return sum;
}

}  // namespace lightloom
