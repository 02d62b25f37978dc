#pragma once
// The camera sub-path: where samples of a pixel are placed, and the walk from the lens.

#include "common/path/connect.h"
#include "common/path/walk_sampler.h"

namespace lightloom {

/// Random numbers of one camera sample: keyed by (seed, iteration, pixel). The film position, the lens and the first
/// scattering and next event come from low-discrepancy sequences over the iterations of a pixel; the rest is independent.
class CameraSampler : public WalkSampler {
  public:
    LL_ALWAYS_INLINE CameraSampler(uint64_t seed, uint64_t iteration, uint64_t pixel)
        : WalkSampler({seed, Stage::kCamera, iteration, pixel}, Rng({seed, Stage::kPixelScramble, 0, pixel}).next_u64(),
                      uint32_t(iteration), 2) {}

    /// The ray of the sample through the pixel (px, py).
    Camera::CameraRay ray(const Camera& camera, int px, int py) const {
        const Vec2 film = point(0), lens = camera.has_lens() ? point(1) : Vec2{};
        return camera.sample_ray({float(px) + film.x, float(py) + film.y}, lens);
    }
    Vec2 next_event(int t) { return t == 2 ? point(3) : rng().uniform2(); }
    /// For draws of light sub-paths to connect to.
    Vec2 connection(int t) { return t == 2 ? point(4) : rng().uniform2(); }
};

/// The lens end of a camera sub-path: sets z_0 and returns the ray that leaves it.
inline WalkRay start_camera_path(const Scene& scene, const CameraSampler& sampler, int px, int py, PathVertex* z0) {
    const Camera::CameraRay lens_ray = sampler.ray(scene.camera(), px, py);
    z0->p = lens_ray.origin;
    z0->alpha = Rgb(1.0f);
    z0->delta = false;
    return {.origin = lens_ray.origin,
            .direction = lens_ray.direction,
            .alpha = z0->alpha,
            .pdf = lens_ray.pdf,
            .from_infinite = scene.camera().has_parallel_rays(),
            .clearance = scene.camera_clearance()};
}

/// Follows the ray that leaves z[*t - 1] to the next vertex, see trace_camera_path(). False where the sub-path ends.
template <class Visit, class Escape>
LL_ALWAYS_INLINE inline bool extend_camera_path(const Scene& scene, int max_edges, const WalkRay& ray, PathVertex* z, int* t,
                                                WalkCounters* counters, Visit&& visit, Escape&& escape) {
    SurfacePoint point;
    ++counters->rays;
    if (!scene.intersect(ray.origin, ray.direction, &point, ray.clearance)) {
        escape(*t, ray);
        return false;
    }
    PathVertex& v = z[*t];
    arrive<TransportMode::kRadiance>(ray, z[*t - 1].p, z[*t - 1].ng, *t > 1, point, &v);
    if (!(v.fwd > 0) || !std::isfinite(v.fwd)) return false;
    ++*t;
    ++counters->vertices;
    const bool may_follow = *t <= max_edges;
    if (may_follow)
        v.set_bsdf(scene.bsdf_at(point));
    else
        v.bsdf.kind = BsdfKind::kNull;  // only an emitter hit can still be counted: k = t - 1
    visit(*t);
    return may_follow;
}

/// Vertices of a camera sub-path from which more sub-paths are still to go on, the last one first.
class Branches {
  public:
    /// Most sub-paths that splitting adds to one camera sample: a bound on what a bad table can cost.
    static constexpr int kMost = 64;

    /// From the vertex number t, `expected` sub-paths go on, in expectation; `u` rounds. The vertices before it are open already.
    void open(int t, float expected, float u) {
        expected = std::min(expected, float(1 + kMost - split_));
        const int count = expected == 1 ? 1 : int(expected + u);
        split_ += std::max(0, count - 1);
        last_ = t;
        left_[t] = count, fresh_[t] = true, expected_[t] = expected;
    }
    /// The number of the vertex from which the next sub-path goes on; 0 when all are done. `first` tells whether it is the first
    /// one from there.
    int next(bool* first) {
        while (last_ > 1 && left_[last_] == 0) --last_;
        if (last_ <= 1) return 0;
        --left_[last_];
        *first = fresh_[last_];
        fresh_[last_] = false;
        return last_;
    }
    float expected(int t) const { return expected_[t]; }

  private:
    int last_ = 1, split_ = 0;
    int left_[kMaxEdges + 2];
    bool fresh_[kMaxEdges + 2];
    float expected_[kMaxEdges + 2];
};

/// trace_camera_path<true>().
template <class Visit, class Escape>
int trace_branching_camera_path(const Scene& scene, CameraSampler& sampler, int px, int py, int max_edges, const GainTable& gain,
                                PathVertex* z, WalkCounters* counters, Visit&& visit, Escape&& escape) {
    WalkRay ray = start_camera_path(scene, sampler, px, py, &z[0]);
    const float inverse_brightness = 1 / gain.brightness(px, py);
    Branches branches;
    int t = 1, longest = 1;
    bool first = true;
    do {
        const bool goes_on = extend_camera_path(scene, max_edges, ray, z, &t, counters, visit, escape);
        longest = std::max(longest, t);
        if (goes_on) {
            const PathVertex& v = z[t - 1];
            // Glass that loses nothing only passes on what is behind it.
            const float expected =
                v.lossless ? 1
                           : gain.continuations(gain.at(v.p, face_forward(v.ng, v.wo)), scalar_of(v.alpha) * inverse_brightness);
            branches.open(t, expected, expected == 1 ? 0 : sampler.rng().uniform());
        }
        for (t = branches.next(&first); t > 0; t = branches.next(&first)) {
            PathVertex& v = z[t - 1];
            v.rev = 0, v.reverse_label = kNoLabel;  // they depended on the branch before
            // Numbers that are stratified over samples serve one sub-path only.
            if (!leave<TransportMode::kRadiance>(&v, &z[t - 2], sampler.scattering(first ? t : 0), &ray)) continue;
            ray.alpha *= 1 / branches.expected(t);
            ray.survival = v.survival * branches.expected(t);
            break;
        }
    } while (t > 0);
    return longest;
}

/// Walks from the lens along sampler.ray(). `z` has room for max_edges + 2 vertices. After each arrival `visit(t)` is
/// called with z[0 .. t-1] complete (material resolved unless nothing can follow), before the vertex scatters: the
/// callback is the place for next event estimation and emitter hits. `escape(t, ray)` is called when the sub-path of t
/// vertices leaves the scene. Where it `branches`, as rule.gain tells, the walk is a tree, depth first, and z[0 .. t-1] the branch
/// that ends at the vertex visited; otherwise rule.gain is not read. Returns the number of vertices, of the longest branch.
///
/// An algorithm whose walks may branch decides before it makes the objects that `visit` refers to (`path.h`): if both walks
/// could reach them, the compiler would keep them in memory for the one that is inlined, too.
template <bool branches = false, class Visit, class Escape>
int trace_camera_path(const Scene& scene, CameraSampler& sampler, int px, int py, int max_edges, const RouletteRule& rule,
                      PathVertex* z, WalkCounters* counters, Visit&& visit, Escape&& escape) {
    if constexpr (branches)
        return trace_branching_camera_path(scene, sampler, px, py, max_edges, *rule.gain, z, counters, visit, escape);
    WalkRay ray = start_camera_path(scene, sampler, px, py, &z[0]);
    int t = 1;
    while (extend_camera_path(scene, max_edges, ray, z, &t, counters, visit, escape)) {
        if (!leave<TransportMode::kRadiance>(&z[t - 1], &z[t - 2], sampler.scattering(t), &ray)) break;
        if (!survive(rule, t, 1.0f, sampler.roulette(), &ray)) break;
    }
    return t;
}

}  // namespace lightloom
