#include "common/transport/training.h"

#include <algorithm>
#include <cmath>

#include "common/core/fork_join.h"
#include "common/path/throughput.h"
#include "common/transport/bdpt.h"
#include "common/transport/parameters.h"

namespace lightloom {
namespace {

constexpr uint64_t kTrainingSeed = 0x7472'6169'6e69'6e67ull;
constexpr uint64_t kChunk = 512;
constexpr double kSamplesPerBlock = 200;

/// Calls visit(s, ratio) with C(s) A(s) / (C(base) A(base)) for every s that can be connected, base included.
template <class Visit>
void for_each_density(const PathView& view, int base, Visit&& visit) {
    const int k = view.k;
    const auto connectible = [&](int s) { return !(s > 0 && view.delta[s - 1]) && !(s > 0 && s < k && view.delta[s]); };
    visit(base, 1.0);
    WideProduct chain;
    for (int s = base; s < k; ++s) {
        chain.multiply(view.fwd[s] / view.rev[s]);
        if (chain.mantissa == 0) break;
        if (connectible(s + 1)) visit(s + 1, chain.value(1));
    }
    chain = WideProduct{};
    for (int s = base; s > 0; --s) {
        chain.multiply(view.rev[s - 1] / view.fwd[s - 1]);
        if (chain.mantissa == 0) break;
        if (connectible(s - 1)) visit(s - 1, chain.value(1));
    }
}

/// Keeps one of the contributions of a sub-path, in proportion to their estimates.
class Reservoir {
  public:
    void clear() { path_ = {}, sum_ = 0, vertices_.clear(); }

    /// Returns the estimate.
    double offer(const BdptContribution& c, PathView& view, double scale, uint32_t block, const BdptSelection& generator,
                 double light_paths_per_iteration, Rng& rng) {
        const double weight = mis_weight(view, {TechniqueKind::kConnect, c.s}, generator);
        const double contribution = double(scalar_of(c.value)) * scale, estimate = weight * contribution;
        if (!(estimate > 0) || !std::isfinite(estimate)) return 0;
        const int k = view.k;
        if (k < 2) return estimate;  // a directly visible emitter: nothing to learn
        sum_ += estimate;
        if (!(rng.uniform_double() * sum_ < estimate)) return estimate;
        path_.block = block;
        contribution_ = contribution;
        path_.vertex_count = uint32_t(k + 1);
        vertices_.resize(size_t(k) + 1);
        vertices_[0] = {c.position, c.normal, 0, c.emitter};
        for (int i = 1; i < k; ++i) {
            const PathVertex& v = i < c.s ? c.y[i] : c.z[k - i];
            vertices_[size_t(i)] = {v.p, v.ng, 0, 0};
        }
        vertices_[size_t(k)] = {c.z[0].p, {}, 0, 0};
        view_throughput(c.y, c.s, c.z, &view);
        const double inv_own = 1 / generator.connect_factor(view, c.s);
        for_each_density(view, c.s, [&](int s, double ratio) {
            const double density = ratio * inv_own * (s == 0 ? 1 : s == k ? light_paths_per_iteration : view.light_throughput[s]);
            if (std::isfinite(density)) vertices_[s == k ? 0 : size_t(s)].density += float(density);
        });
        return estimate;
    }
    void move_to(TrainingData* data) {
        if (!(sum_ > 0)) return;
        path_.first_vertex = uint32_t(data->vertices.size());
        path_.estimate = float(sum_);
        path_.square = float(contribution_ * sum_);  // c^2 w / ((c w) / sum)
        data->paths.push_back(path_);
        data->vertices.insert(data->vertices.end(), vertices_.begin(), vertices_.end());
    }

  private:
    TrainingPath path_;
    double sum_ = 0, contribution_ = 0;
    std::vector<TrainingVertex> vertices_;
};

void keep_light_path(const PathVertex* y, int n, int max_edges, TrainingData* data) {
    if (n == 0) return;
    TrainingPath path;
    path.first_vertex = uint32_t(data->vertices.size());
    path.vertex_count = uint32_t(n);
    for (int i = 0; i < n; ++i) {
        const bool candidate = (i == 0 || y[i].bsdf.has_smooth_lobe()) && i + 1 < max_edges;
        data->vertices.push_back({y[i].p, y[i].ng, candidate ? scalar_of(y[i].alpha) : 0, i == 0 ? uint32_t(y[0].emitter) : 0});
    }
    data->light_paths.push_back(path);
}

/// The frame in blocks of about kSamplesPerBlock samples.
struct Blocks {
    Rect crop;
    int edge = 1;

    Blocks(const Rect& r, uint64_t samples) : crop(r) {
        const double pixels = kSamplesPerBlock * double(r.area()) / double(std::max<uint64_t>(1, samples));
        edge = std::max(1, int(std::ceil(std::sqrt(pixels))));
    }
    int columns() const { return (crop.width() + edge - 1) / edge; }
    int rows() const { return (crop.height() + edge - 1) / edge; }
    uint32_t at(int px, int py) const { return uint32_t(((py - crop.y0) / edge) * columns() + (px - crop.x0) / edge); }
};

}  // namespace

Result<TrainingData> trace_training(const Scene& scene, const RenderSettings& settings, const TrainingWork& work,
                                    std::stop_token stop) {
    const Result<TransportParameters> parameters = TransportParameters::read(settings);
    if (!parameters.ok()) return parameters.status();
    const Rect crop = scene.frame().crop;
    const Blocks blocks(crop, work.total_samples);
    const BdptSelection generator{double(crop.area())};
    const double render_light_paths = parameters->light_paths * double(crop.area());
    const uint64_t seed = settings.seed ^ kTrainingSeed;
    std::vector<TrainingData> chunks(size_t((work.sample_count + kChunk - 1) / kChunk));
    fork_join(chunks.size(), [&](size_t first_chunk, size_t last_chunk) {
        std::vector<PathVertex> camera_path(size_t(settings.max_depth) + 3), light_path(size_t(settings.max_depth) + 2);
        std::vector<Splat> no_splats;
        Reservoir from_camera, from_light;
        for (size_t c = first_chunk; c != last_chunk && !stop.stop_requested(); ++c) {
            TrainingData& data = chunks[c];
            data.blocks_x = blocks.columns(), data.blocks_y = blocks.rows();
            data.block_sum.assign(size_t(data.blocks_x) * size_t(data.blocks_y), 0.0);
            const uint64_t begin = work.first_sample + c * kChunk;
            const uint64_t end = work.first_sample + std::min(work.sample_count, (c + 1) * kChunk);
            data.samples = end - begin;
            for (uint64_t n = begin; n < end; ++n) {
                SampleContext context{.scene = scene,
                                      .seed = seed,
                                      .max_edges = settings.max_depth + 1,
                                      .roulette = parameters->roulette,
                                      .camera_path = camera_path.data(),
                                      .light_path_vertices = light_path.data(),
                                      .splats = &no_splats,
                                      .counters = {}};
                const Vec2 place = low_discrepancy_point(uint32_t(n), seed);
                context.px = crop.x0 + std::min(crop.width() - 1, int(place.x * float(crop.width())));
                context.py = crop.y0 + std::min(crop.height() - 1, int(place.y * float(crop.height())));
                context.pixel = uint32_t(crop.index(context.px, context.py));
                context.iteration = n;
                context.light_path = n;
                const uint32_t camera_block = blocks.at(context.px, context.py);
                Rng rng({seed, Stage::kTraining, 0, n});
                from_camera.clear(), from_light.clear();
                trace_bdpt_sample<ViewDetail::kSubspace>(
                    context, [&](const PathVertex* y, int count) { keep_light_path(y, count, context.max_edges, &data); },
                    [&](const BdptContribution& found, PathView& view) {
                        // A light path may land in any pixel, a camera sample in one: the scale of algorithms.md 0, N1.
                        const bool splat = found.t == 1 && found.s > 0;
                        const double scale = splat ? 1 / double(crop.area()) : 1;
                        const uint32_t block = splat ? blocks.at(int(found.film.x), int(found.film.y)) : camera_block;
                        Reservoir& reservoir = splat ? from_light : from_camera;
                        data.block_sum[block] +=
                            reservoir.offer(found, view, scale, block, generator, render_light_paths, rng);
                    });
                from_camera.move_to(&data);
                from_light.move_to(&data);
            }
        }
    });
    if (stop.stop_requested()) return Status(StatusCode::kCancelled, "training was cancelled");
    TrainingData all;
    for (const TrainingData& data : chunks) LL_RETURN_IF_ERROR(all.append(data));
    return all;
}

Result<SubspaceTables> make_tables(const Scene& scene, const RenderSettings& settings, std::stop_token stop,
                                   TrainingReport* report) {
    const Result<TransportParameters> parameters = TransportParameters::read(settings);
    if (!parameters.ok()) return parameters.status();
    const uint64_t samples = parameters->training_samples;
    TrainingData data;
    for (uint64_t first = 0; first < samples; first += kTrainingUnitSamples) {
        const Result<TrainingData> unit =
            trace_training(scene, settings, {first, std::min(kTrainingUnitSamples, samples - first), samples}, stop);
        if (!unit.ok()) return unit.status();
        LL_RETURN_IF_ERROR(data.append(*unit));
    }
    return train_tables(data, scene.emitters(), parameters->training, stop, report);
}

Result<std::unique_ptr<Renderer>> create_with_tables(std::shared_ptr<const Scene> scene, const RenderSettings& settings,
                                                     std::stop_token stop) {
    const Result<TransportParameters> parameters = TransportParameters::read(settings);
    if (!parameters.ok()) return parameters.status();
    std::shared_ptr<const SubspaceTables> tables;
    if (parameters->needs_tables) {
        TrainingReport report;
        auto made = make_tables(*scene, settings, stop, &report);
        if (!made.ok()) return made.status();
        tables = std::make_shared<const SubspaceTables>(*std::move(made));
    }
    return Renderer::create(std::move(scene), settings, std::move(tables));
}

}  // namespace lightloom
