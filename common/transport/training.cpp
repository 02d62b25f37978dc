#include "common/transport/training.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <utility>

#include "common/core/fork_join.h"
#include "common/path/throughput.h"
#include "common/tables/emission_part.h"
#include "common/transport/bdpt.h"
#include "common/transport/merging_parameters.h"
#include "common/transport/parameters.h"
#include "common/transport/path.h"
#include "common/transport/spcbpt_merging.h"
#include "common/transport/visits.h"

namespace lightloom {
namespace {

constexpr uint64_t kTrainingSeed = 0x7472'6169'6e69'6e67ull;
constexpr uint64_t kChunk = kTrainingChunkSamples;

/// The affinity while nothing is learned: one draw per prefix and unit of its throughput.
struct UnlearnedAffinity {
    double operator()(const PathView&, int, double share) const { return share; }
};
/// The selection that the render will use, except for what the tables will decide.
using RenderSelection = Corrected<SubspaceSelection<UnlearnedAffinity>>;

/// What Reservoir::offer() needs to know of the render that the tables are for.
struct RenderToCome {
    const EmitterSet& emitters;
    RenderSelection selection;
    std::shared_ptr<const MergeTerms> merging;  ///< Of the first iteration; null if it does not merge.
};

/// What a contribution is worth to the image; 0 where that is no finite number.
double estimate_of(const PathContribution& c, double weight, double scale) {
    const double estimate = weight * double(scalar_of(c.value)) * scale;
    return estimate > 0 && std::isfinite(estimate) ? estimate : 0;
}

/// Keeps one of the contributions of a sub-path, in proportion to their estimates.
class Reservoir {
  public:
    /// Offers a contribution, whose weight is that of the generator's techniques and whose value is to be multiplied by
    /// `scale`. Returns the estimate.
    double offer(const PathContribution& c, PathView& view, double weight, double scale, uint32_t block, const RenderToCome& render,
                 Rng& rng) {
        const double contribution = double(scalar_of(c.value)) * scale, estimate = estimate_of(c, weight, scale);
        if (!(estimate > 0)) return 0;
        const int k = view.k;
        if (k < 2) return estimate;  // a directly visible emitter: nothing to learn
        sum_ += estimate;
        if (!(rng.uniform_double() * sum_ < estimate)) return estimate;
        path_.block = block;
        contribution_ = contribution;
        path_.vertex_count = uint32_t(k + 1);
        vertices_.resize(size_t(k) + 1);
        path_.emitter = c.emitter;
        vertices_[0] = {c.position, c.normal, 0};
        for (int i = 1; i < k; ++i) {
            const SubPathVertex& v = i < c.technique.light_vertices() ? c.y[i] : c.z[k - i];
            vertices_[size_t(i)] = {v.p, v.ng, 0};
        }
        vertices_[size_t(k)] = {c.z[0].p, {}, 0};
        view_throughput(c.y, c.technique.light_vertices(), c.z, &view);
        view_footprint(render.emitters[c.emitter], c.y, c.technique.light_vertices(), c.z, c.t, &view);
        const double inverse_own = double(c.inverse_density) * scale / double(c.survival);
        path_.next_event = path_.lens = 0;
        const auto on = render.selection.on(view);
        std::optional<MergesOnPath> merges;
        if (render.merging) {
            view.footprint_distance2 = c.t >= 2 ? camera_distance2(c.z, c.t) : view.primary_distance2;
            merges.emplace(view, *render.merging, render.selection.correction);
        }
        double merged = 0;
        const auto keep_merge = [&](int i, const WideProduct& chain) {
            if (merges && i > 0 && i < k && !view.delta[i])
                merged += chain.value(view.fwd[i] * inverse_own * merges->sigma(i, on.survival));
        };
        const auto keep = [&](int s, double ratio) {
            if (!can_connect(view, s)) return;
            const double sub_paths = ratio * inverse_own * on.survivors(s);
            if (s == 0) return void(vertices_[0].density = single(sub_paths * on.hit()));
            if (s == k) return void(path_.lens = single(sub_paths * on.lens()));
            if (s == 1) path_.next_event = single(sub_paths * on.next_event());
            vertices_[size_t(s)].density = single(sub_paths * on.connect(s));
        };
        const int own = c.technique.s;
        keep(own, 1);
        keep_merge(own, {});
        for_each_split(view, own, 0, k, [&](int s, const WideProduct& chain) {
            keep(s, chain.value(1));
            keep_merge(s, chain);
        });
        if (merged > 0) path_.lens = single(double(path_.lens) + merged);
        return estimate;
    }
    /// Adds the path that was kept, if any, to `data`; the reservoir is empty again.
    void move_to(TrainingData* data) {
        if (sum_ > 0) {
            path_.first_vertex = uint32_t(data->vertices.size());
            path_.estimate = single(sum_);
            path_.square = single(contribution_ * sum_);  // c^2 w / ((c w) / sum)
            data->paths.push_back(path_);
            data->vertices.insert(data->vertices.end(), vertices_.begin(), vertices_.end());
        }
        path_ = {}, sum_ = 0, contribution_ = 0;
    }

  private:
    /// Values beyond single precision become infinity: training leaves the path out and reports it
    /// (TrainingData::in_range).
    static float single(double v) { return v > double(std::numeric_limits<float>::max()) ? HUGE_VALF : float(v); }

    TrainingPath path_;
    double sum_ = 0, contribution_ = 0;
    std::vector<TrainingVertex> vertices_;
};

/// The reservoirs of a camera sample: some for every length of its sub-path, because each length teaches another eye
/// subspace. The connections of one vertex teach different light subspaces, so each length has more than one reservoir.
/// Which reservoir a contribution is offered to does not depend on its value.
class CameraReservoirs {
  public:
    Reservoir& of(const PathContribution& c) {
        Length& length = lengths_[std::clamp(c.t - 2, 0, kTrainingLengths - 1)];
        return length.reservoirs[length.dealt++ % kTrainingPathsPerLength];
    }
    void move_to(TrainingData* data) {
        for (Length& length : lengths_)
            for (Reservoir& r : length.reservoirs) r.move_to(data);
    }

  private:
    struct Length {
        Reservoir reservoirs[kTrainingPathsPerLength];
        int dealt = 0;
    };
    Length lengths_[kTrainingLengths];
};

void keep_light_path(const LightSubPath& y, int n, int max_edges, TrainingData* data) {
    if (n == 0) return;
    TrainingPath path;
    path.first_vertex = uint32_t(data->vertices.size());
    path.vertex_count = uint32_t(n);
    path.emitter = uint32_t(y[0].emitter);
    for (int i = 0; i < n; ++i) {
        const bool candidate = (i == 0 || y.has_smooth_lobe(i)) && i + 1 < max_edges;
        data->vertices.push_back({y[i].p, y[i].ng, candidate ? scalar_of(y[i].alpha) : 0});
    }
    data->light_paths.push_back(path);
}

}  // namespace

Result<TrainingGenerator> TrainingGenerator::create(const Scene& scene, const RenderSettings& settings, const Tables& guide) {
    LL_RETURN_IF_ERROR(check_depth(settings.max_depth));
    const AlgorithmSettings& algorithm = settings.algorithm;
    if (!algorithm.learning()) return failed_precondition("algorithm '" + algorithm.name() + "' learns nothing");
    TrainingGenerator generator(scene);
    if (auto emission = emission_of(guide)) {
        LL_RETURN_IF_ERROR(guide.validate(scene.emitters()));
        generator.lit_ = scene.with_emission(std::move(emission));
        generator.scene_ = generator.lit_.get();
    }
    generator.roulette_ = generator.camera_roulette_ = roulette_of(algorithm);
    generator.heuristic_ = heuristic_of(algorithm);
    generator.plan_ = learning_plan(algorithm);
    if (generator.plan_.keeps_visits) generator.camera_roulette_.min_survival = 1;
    generator.next_event_ = algorithm.has(kNextEvent.name) ? next_event_of(algorithm) : NextEventRays{};
    generator.unidirectional_ = algorithm.info().traces == Traces::kCamera;
    int windows = 1;  // of the render's cache, as far as it is known
    generator.light_paths_per_iteration_ = algorithm.light_paths_per_iteration(scene.frame().crop.area());
    if (!guide.empty()) {
        LL_RETURN_IF_ERROR(guide.validate(scene.emitters()));
        const auto parts = algorithm.learning()->parts;
        if (std::find(parts.begin(), parts.end(), &SubspaceTables::kPart) != parts.end() && !guide.get<SubspaceTables>())
            return failed_precondition("the tables of the first round have no subspaces to guide the second one");
        if (const auto subspaces = guide.get<SubspaceTables>()) {
            // Training traces one light sub-path per camera sample, however large the caches of the render will be.
            SubspaceTables tables = *subspaces;
            windows = PreparedTables::largest_window(tables);
            std::fill(tables.window.begin(), tables.window.end(), uint16_t(1));
            generator.guide_ = std::make_shared<const PreparedTables>(std::move(tables));
        }
    }
    if (merging_on(algorithm))
        generator.merging_ = std::make_shared<const MergeTerms>(spcbpt_merge_terms(algorithm, scene, windows));
    generator.seed_ = settings.seed ^ kTrainingSeed;
    generator.max_edges_ = settings.max_edges();
    return generator;
}

/// What both generators share: where samples lie, and the loop over them in chunks whose data are joined in order.
class TrainingGenerator::Unit {
  public:
    Unit(const TrainingGenerator& generator, const TrainingWork& work, std::stop_token stop)
        : generator_(generator),
          work_(work),
          stop_(std::move(stop)),
          blocks_(crop()) {}

    Rect crop() const { return generator_.scene_->frame().crop; }
    double pixels() const { return double(crop().area()); }
    const FrameBlocks& blocks() const { return blocks_; }
    RenderToCome render() const {
        const LearningPlan& plan = generator_.plan_;
        return {generator_.scene_->emitters(),
                {{{},
                  double(generator_.light_paths_per_iteration_),
                  plan.connections.each([](int n) { return double(n); }),
                  0,
                  TypicalSurvival(generator_.roulette_),
                  plan.rays},
                 plan.correction},
                generator_.merging_};
    }
    TrainingData empty() const {
        TrainingData data;
        data.blocks_x = blocks_.columns(), data.blocks_y = blocks_.rows();
        data.block_sum.assign(size_t(data.blocks_x) * size_t(data.blocks_y), 0.0);
        if (generator_.plan_.keeps_visits) data.block_square.assign(data.block_sum.size(), 0.0);
        return data;
    }
    RenderUnit light_work() const {
        RenderUnit work;
        work.tile = crop();
        work.first_light_path = work_.first_sample, work.light_path_count = work_.sample_count;
        work.group_first_iteration = work_.first_sample;  // no two units share a light sub-path
        return work;
    }
    /// How many light sub-paths measure Q for sample n.
    uint64_t energy_share(uint64_t n) const { return energy_paths_before(n + 1) - energy_paths_before(n); }
    UnitScope scope(const RenderUnit& work) const {
        return {*generator_.scene_, generator_.seed_, generator_.max_edges_, generator_.roulette_, work, stop_};
    }

    /// Calls sample(context, block, data, rng) for every sample.
    template <class Sample>
    Result<TrainingData> trace(TrainingData all, const RouletteRule& roulette, Sample&& sample) const {
        std::vector<TrainingData> chunks(size_t((work_.sample_count + kChunk - 1) / kChunk));
        fork_join(chunks.size(), [&](size_t first_chunk, size_t last_chunk) {
            std::vector<PathVertex> camera_path(size_t(generator_.max_edges_) + 2), light_path(size_t(generator_.max_edges_) + 1);
            for (size_t c = first_chunk; c != last_chunk && !stop_.stop_requested(); ++c) {
                TrainingData& data = chunks[c] = empty();
                const uint64_t begin = work_.first_sample + c * kChunk;
                const uint64_t end = work_.first_sample + std::min(work_.sample_count, (c + 1) * kChunk);
                data.samples = end - begin;
                data.light_samples = energy_paths_before(end) - energy_paths_before(begin);
                for (uint64_t n = begin; n < end; ++n) {
                    SampleContext context{.scene = *generator_.scene_,
                                          .seed = generator_.seed_,
                                          .max_edges = generator_.max_edges_,
                                          .roulette = roulette,
                                          .camera_path = camera_path.data(),
                                          .light_path_vertices = light_path.data(),
                                          .counters = {}};
                    const Vec2 place = low_discrepancy_point(uint32_t(n), generator_.seed_);
                    context.px = crop().x0 + std::min(crop().width() - 1, int(place.x * float(crop().width())));
                    context.py = crop().y0 + std::min(crop().height() - 1, int(place.y * float(crop().height())));
                    context.pixel = uint32_t(crop().index(context.px, context.py));
                    context.iteration = n;
                    context.light_path = n;
                    Rng rng({generator_.seed_, Stage::kTraining, 0, n});
                    sample(context, blocks_.at(context.px, context.py), data, rng);
                    for (uint64_t extra = 1; extra < energy_share(n); ++extra)
                        trace_for_energy(context, energy_paths_before(n) + extra, &data);
                }
            }
        });
        if (stop_.stop_requested()) return Status(StatusCode::kCancelled, "training was cancelled");
        for (TrainingData& data : chunks) {
            LL_RETURN_IF_ERROR(all.append(data));
            data = {};
        }
        return all;
    }

  private:
    uint64_t energy_paths_before(uint64_t sample) const { return generator_.plan_.energy_paths_before(sample); }
    void trace_for_energy(SampleContext& context, uint64_t number, TrainingData* data) const {
        LightSampler sampler({generator_.seed_, Stage::kLightPool, 0, number});
        PathVertex* y = context.light_path_vertices;
        const int n = trace_light_path(context.scene, sampler, context.max_edges, generator_.roulette_, y, &context.counters);
        keep_light_path(y, n, context.max_edges, data);
    }

    const TrainingGenerator& generator_;
    const TrainingWork& work_;
    std::stop_token stop_;
    FrameBlocks blocks_;
};

Result<TrainingData> TrainingGenerator::trace(const TrainingWork& work, std::stop_token stop) const {
    const Unit unit(*this, work, std::move(stop));
    if (unidirectional_) return trace_unidirectional(unit);
    return guide_ ? trace_guided(unit) : trace_pairs(unit);
}

/// Light sub-paths would find other light than such an algorithm does.
Result<TrainingData> TrainingGenerator::trace_unidirectional(const Unit& unit) const {
    const PathAlgorithm<> generator{{next_event_}, heuristic_};
    return unit.trace(unit.empty(), camera_roulette_, [&](SampleContext& context, uint32_t block, TrainingData& data, Rng&) {
        Visits visits(plan_.keeps_visits);
        const int t = generator.trace(context, [&](const PathContribution& found, PathView& view) {
            const double estimate = estimate_of(found, double(generator.weight(view, found.technique)), 1);
            visits.add(found, estimate);
            data.block_sum[block] += estimate;
        });
        visits.move_to(&data, context.camera_path, t, max_edges_, block);
    });
}

Result<TrainingData> TrainingGenerator::trace_pairs(const Unit& unit) const {
    const BdptSelection generator{unit.pixels()};
    const RenderToCome render = unit.render();
    return unit.trace(unit.empty(), roulette_, [&](SampleContext& context, uint32_t camera_block, TrainingData& data, Rng& rng) {
        CameraReservoirs from_camera;
        Reservoir from_light;
        Visits visits(plan_.keeps_visits);
        const int t = trace_bdpt_sample<ViewDetail::kSubspace>(
            context, camera_roulette_, {},
            [&](const PathVertex* y, int count) {
                if (unit.energy_share(context.light_path) > 0) keep_light_path(y, count, context.max_edges, &data);
            },
            [&](const PathContribution& found, PathView& view) {
                // A light path may land in any pixel and a camera sample in one, hence the scale of splats
                // (common/path/README.md, "Training set").
                const bool splat = found.technique.splats();
                const uint32_t block = splat ? unit.blocks().at(int(found.film.x), int(found.film.y)) : camera_block;
                const double weight = mis_weight(view, found.technique, generator.on(view));
                const double estimate = (splat ? from_light : from_camera.of(found))
                                            .offer(found, view, weight, splat ? 1 / unit.pixels() : 1, block, render, rng);
                data.block_sum[block] += estimate;
                if (!splat) visits.add(found, estimate);
            });
        visits.move_to(&data, context.camera_path, t, max_edges_, camera_block);
        from_camera.move_to(&data);
        from_light.move_to(&data);
    });
}

Result<TrainingData> TrainingGenerator::trace_guided(const Unit& unit) const {
    const SpcbptSelection selection = spcbpt_selection(guide_, {.light_paths_per_iteration = unit.pixels(),
                                                                .connections = plan_.connections,
                                                                .correction = plan_.correction,
                                                                .roulette = roulette_,
                                                                .rays = plan_.rays});
    const SpcbptAlgorithm<> generator{{selection, guide_, plan_.connections}, heuristic_, 1};
    const RenderUnit work = unit.light_work();
    const RenderToCome render = unit.render();
    // Light sub-paths are traced in parallel; their results are joined in the order of their numbers.
    struct FromLight {
        Reservoir reservoir;
        std::vector<std::pair<uint32_t, double>> estimates;  ///< Pairs of block and estimate.
    };
    std::vector<FromLight> from_light(work.light_path_count);
    UnitPreparation preparation;
    const auto state = generator.prepare(
        unit.scope(work), &preparation, [&](const PathContribution& found, PathView& view, float weight, uint64_t m, auto&) {
            Rng rng({seed_, Stage::kTraining, 1 + uint64_t(found.technique.s), work.first_light_path + m});
            const uint32_t block = unit.blocks().at(int(found.film.x), int(found.film.y));
            const double estimate =
                from_light[m].reservoir.offer(found, view, double(weight), 1 / unit.pixels(), block, render, rng);
            from_light[m].estimates.push_back({block, estimate});
        });
    TrainingData data = unit.empty();
    if (!unit.scope(work).stop.stop_requested()) {
        for (uint64_t m = 0; m < work.light_path_count; ++m) {
            const LightCache::Path path = state.cache.paths[m];
            if (unit.energy_share(work.first_light_path + m) > 0 && path.length > 0)
                keep_light_path(state.cache.at(path.first_vertex), int(path.length), max_edges_, &data);
            for (const auto& [block, estimate] : from_light[m].estimates) data.block_sum[block] += estimate;
            from_light[m].reservoir.move_to(&data);
        }
    }
    return unit.trace(std::move(data), camera_roulette_,
                      [&](SampleContext& context, uint32_t block, TrainingData& chunk, Rng& rng) {
                          CameraReservoirs from_camera;
                          Visits visits(plan_.keeps_visits);
                          const int t = generator.trace(context, state, [&](const PathContribution& found, PathView& view) {
                              const double estimate = from_camera.of(found).offer(
                                  found, view, double(generator.weight(state, view, found.technique)), 1, block, render, rng);
                              chunk.block_sum[block] += estimate;
                              visits.add(found, estimate);
                          });
                          visits.move_to(&chunk, context.camera_path, t, max_edges_, block);
                          from_camera.move_to(&chunk);
                      });
}

Result<Tables> make_tables(const Scene& scene, const RenderSettings& settings, std::stop_token stop, TrainingReport* report) {
    Tables tables;
    if (!settings.algorithm.learning()) return tables;
    const LearningPlan plan = learning_plan(settings.algorithm);
    *report = {};
    TrainingData data;
    for (size_t round = 0; round < plan.rounds.size(); ++round) {
        const Tables guide = plan.rounds[round].guided ? tables : Tables();
        const Result<TrainingGenerator> generator = TrainingGenerator::create(scene, settings, guide);
        if (!generator.ok()) return generator.status();
        if (!plan.rounds[round].guided || !plan.rounds[round - 1].guided) data = {};
        const uint64_t begin = plan.first_sample(round), end = begin + plan.rounds[round].samples;
        for (uint64_t first = begin; first < end; first += std::min(kTrainingUnitSamples, end - first)) {
            const Result<TrainingData> unit =
                generator->trace({first, std::min(kTrainingUnitSamples, end - first), plan.samples}, stop);
            if (!unit.ok()) return unit.status();
            LL_RETURN_IF_ERROR(data.append(*unit));
        }
        TrainingReport of_round;
        const auto read = [&, last = round + 1 == plan.rounds.size()] {
            if (last) data = {};
        };
        auto learned = learn({data, round, guide, scene.emitters(), settings, {stop, {}, read}, &of_round});
        if (!learned.ok()) return learned.status();
        tables = *std::move(learned);
        // The report describes the last round's tables, but its times are those of all rounds together.
        of_round.classifier_seconds += report->classifier_seconds;
        of_round.energy_seconds += report->energy_seconds;
        of_round.gamma_seconds += report->gamma_seconds;
        *report = std::move(of_round);
    }
    return tables;
}

Result<std::unique_ptr<Renderer>> create_with_tables(std::shared_ptr<const Scene> scene, const RenderSettings& settings,
                                                     std::stop_token stop, const TechniqueMask* mask) {
    TrainingReport report;
    const auto tables = make_tables(*scene, settings, std::move(stop), &report);
    if (!tables.ok()) return tables.status();
    return Renderer::create(std::move(scene), settings, *tables, mask);
}

}  // namespace lightloom
