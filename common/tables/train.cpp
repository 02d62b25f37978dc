#include "common/tables/train.h"

#include <algorithm>
#include <cfloat>
#include <cmath>
#include <optional>

#include "common/core/fork_join.h"
#include "common/core/stopwatch.h"
#include "common/tables/train_classifier.h"
#include "common/tables/train_division.h"

namespace lightloom {
namespace {

constexpr size_t kClassifierEnds = 200000;  ///< Enough for 1000 centroids and their borders.

/// A cell of points on lights is not divided where a cache would hold fewer points than this in a part. A draw from an empty
/// subspace gives nothing, and the loss, which is that of endless caches, does not know it (measured).
constexpr double kFewestInSourceCell = 16;

/// The paths' weights are cut at this quantile. Otherwise a handful of paths would decide what Gamma is and how
/// strongly its prior counts. The cut biases no image, because every Gamma gives the right mean.
constexpr double kWeightCut = 0.99;

constexpr double kSamplesPerBlock = 200;

/// Fewest nodes per subspace, on average, with which the data can tell subspaces apart: four independent ones. The
/// paths of one length that a camera sample keeps share a camera sub-path.
constexpr uint64_t kFewestNodes = 4 * kTrainingPathsPerLength;

/// Share of the time that has passed when these phases begin, for progress reports (measured with 5e5 samples of a
/// difficult interior).
constexpr double kEnergyBegins = 0.1, kGammaBegins = 0.15;

/// Most entries of Gamma: 64 MB in single precision, which every worker receives.
constexpr uint64_t kMaxGammaCells = uint64_t(1) << 24;

/// How much denser light sub-paths that begin as v[0], v[1] will be in the render than where the data were traced.
double emission_ratio(const TrainingOptions& o, const TrainingPath& p, const TrainingVertex* v) {
    if (!o.traced || !o.rendered) return 1;
    const EmitterSet &traced = *o.traced, &rendered = *o.rendered;
    const Emitter &a = traced[p.emitter], &b = rendered[p.emitter];
    const Vec3 normal = v[0].normal;
    Vec3 w = normal;
    if (!a.is_infinite() && p.vertex_count > 1) w = normalize(v[1].position - v[0].position);
    const Vec3& x1 = v[p.vertex_count > 1 ? 1 : 0].position;
    const EmissionDensities before = traced.emission_densities(a, v[0].position, normal, w, x1);
    const EmissionDensities after = rendered.emission_densities(b, v[0].position, normal, w, x1);
    double ratio = double(after.position) / double(before.position);
    if (p.vertex_count > 1) ratio *= double(after.direction) / double(before.direction);
    return std::isfinite(ratio) ? ratio : 1;
}

SubPathEnd end_between(const TrainingVertex& v, const TrainingVertex& predecessor) {
    const Vec3 d = predecessor.position - v.position;
    const float length2 = length_squared(d);
    const Vec3 normal = v.normal;
    return sub_path_end(v.position, normal, length2 > 0 ? d / std::sqrt(length2) : normal);
}

uint32_t source_label(const LightDivision& division, const EmitterSet& emitters, const TrainingPath& p, const TrainingVertex& x0) {
    return division.label(emitters, p.emitter, x0.position, x0.normal);
}

/// What the classifiers are learned from.
struct Ends {
    std::vector<WeightedEnd> light, eye;
    std::vector<WeightedSource> seen, emitted;  ///< Prefixes of one vertex: those of paths, and of all light sub-paths.
};

/// Takes about kClassifierEnds ends of each kind.
Ends collect_ends(const TrainingData& d, const std::vector<double>& brightness, const TrainingOptions& o) {
    Ends ends;
    size_t nodes = 0;
    for (const TrainingPath& p : d.paths) nodes += p.vertex_count;
    const size_t stride = std::max<size_t>(1, nodes / kClassifierEnds);
    for (size_t x = 0; x < d.paths.size(); x += stride) {
        const TrainingPath& p = d.paths[x];
        const TrainingVertex* v = &d.vertices[p.first_vertex];
        const float weight = float(double(p.estimate) / brightness[p.block]);
        if (!(weight > 0) || !std::isfinite(weight) || !d.in_range(p)) continue;
        for (uint32_t s = 1; s + 1 < p.vertex_count; ++s) {
            if (!(v[s].density > 0)) continue;
            ends.eye.push_back({end_between(v[s], v[s + 1]), weight});
            if (s >= 2) ends.light.push_back({end_between(v[s - 1], v[s - 2]), weight});
            if (s == 1) ends.seen.push_back({p.emitter, v[0].position, v[0].normal, weight, 0});
        }
    }
    // These are alike, so that fewer tell as much.
    const size_t light_stride = std::max<size_t>(1, 4 * d.light_paths.size() / kClassifierEnds);
    for (size_t x = 0; x < d.light_paths.size(); x += light_stride) {
        const TrainingPath& p = d.light_paths[x];
        const TrainingVertex& y0 = d.vertices[p.first_vertex];
        if (!d.in_range(p)) continue;
        const double paths = double(light_stride) / double(std::max<uint64_t>(1, d.light_samples)) * emission_ratio(o, p, &y0);
        ends.emitted.push_back({p.emitter, y0.position, y0.normal, y0.density, float(paths * o.nominal_paths)});
    }
    return ends;
}

/// Trains kappa, the classifiers of both sides.
void train_classifiers(const TrainingData& d, const std::vector<double>& brightness, const EmitterSet& emitters,
                       const TrainingOptions& o, std::stop_token stop, SubspaceTables* tables) {
    const Ends ends = collect_ends(d, brightness, o);
    const uint32_t most_cells = std::max(o.light_subspaces, 2u) - 1;  // at least one label is left for longer prefixes
    const uint32_t source_cells = std::clamp(uint32_t(double(o.light_subspaces) * o.source_share), 1u, most_cells);
    tables->division = train_division(emitters, ends.seen, ends.emitted, {source_cells, kFewestInSourceCell, stop});
    const uint32_t sources = tables->division.cell_count();
    ClassifierOptions light_options;
    light_options.subspaces = o.light_subspaces > sources ? o.light_subspaces - sources : 1;
    light_options.first_label = sources;
    light_options.direction_weight = float(o.direction_weight);
    light_options.seed = o.seed;
    light_options.stop = stop;
    ClassifierOptions eye_options = light_options;
    eye_options.subspaces = o.eye_subspaces;
    eye_options.first_label = 0;
    eye_options.seed = o.seed + 1;
    tables->light_tree = train_classifier(ends.light, light_options);
    tables->eye_tree = train_classifier(ends.eye, eye_options);
    tables->light_count = tables->light_tree.label_end();
    tables->eye_count = tables->eye_tree.label_end();
}

/// Measures Q, the windows and the mean number of connectible vertices.
void measure_energy(const TrainingData& d, const EmitterSet& emitters, const TrainingOptions& o, std::stop_token stop,
                    SubspaceTables* t) {
    std::vector<double> sum(t->light_count, 0.0), count(t->light_count, 0.0);
    double vertices = 0;
    for (const TrainingPath& p : d.light_paths) {
        if (stop.stop_requested()) return;
        if (!d.in_range(p)) continue;
        const TrainingVertex* v = &d.vertices[p.first_vertex];
        const double ratio = emission_ratio(o, p, v);
        for (uint32_t i = 0; i < p.vertex_count; ++i) {
            if (!(v[i].density > 0)) continue;
            const uint32_t label =
                i == 0 ? source_label(t->division, emitters, p, v[0]) : t->light_label(end_between(v[i], v[i - 1]));
            sum[label] += double(v[i].density);
            count[label] += ratio;
            vertices += ratio;
        }
    }
    const double paths = double(std::max<uint64_t>(1, d.light_samples));
    double total = 0;
    for (const double s : sum) total += s / paths;
    // The floor keeps every subspace reachable: with a zero, light of delta lights that only these prefixes carry would
    // be lost.
    const double floor = total > 0 ? 1e-3 * total / t->light_count : 1;
    t->energy.clear(), t->window.clear();
    for (uint32_t i = 0; i < t->light_count; ++i) {
        t->energy.push_back(float(std::min(sum[i] / paths + floor, double(FLT_MAX))));
        const double expected = count[i] / paths * o.nominal_paths;
        const double windows = expected > 0 ? std::ceil(o.reuse_target / expected) : double(o.reuse_windows);
        t->window.push_back(uint16_t(std::clamp(windows, 1.0, double(o.reuse_windows))));
    }
    t->vertices_per_path = vertices > 0 ? vertices / paths : 1;
}

/// Whether two neighbours among the paths are of one camera sample: then they have its first hit in common.
bool share_camera_sample(const TrainingData& d, size_t x, size_t y) {
    const auto first_hit = [&](const TrainingPath& p) {
        return d.vertices[p.first_vertex + std::max(p.vertex_count, 2u) - 2].position;
    };
    return first_hit(d.paths[x]) == first_hit(d.paths[y]);
}

/// What Gamma is learned from, of the paths first .. last - 1; the number of a path's camera sample is that of the
/// sample's first path.
void add_to_dataset(const TrainingData& d, const std::vector<double>& brightness, const EmitterSet& emitters,
                    const TrainingOptions& o, const SubspaceTables& t, size_t first, size_t last, GammaDataset* out) {
    uint32_t part = uint32_t(std::upper_bound(d.part_ends.begin(), d.part_ends.end(), first) - d.part_ends.begin());
    uint32_t sample = 0;
    for (size_t x = first; x < last; ++x) {
        const TrainingPath& p = d.paths[x];
        while (part < d.part_ends.size() && x >= d.part_ends[part]) ++part;
        const TrainingVertex* v = &d.vertices[p.first_vertex];
        if (x == first || !share_camera_sample(d, x - 1, x)) sample = uint32_t(x);
        if (!d.in_range(p)) continue;
        GammaPath path;
        path.batch = part;
        path.sample = sample;
        path.first_node = uint32_t(out->nodes.size());
        for (uint32_t s = 1; s + 1 < p.vertex_count; ++s) {
            if (!(v[s].density > 0)) continue;
            GammaNode node;
            node.light =
                uint16_t(s == 1 ? source_label(t.division, emitters, p, v[0]) : t.light_label(end_between(v[s - 1], v[s - 2])));
            node.eye = uint16_t(t.eye_label(end_between(v[s], v[s + 1])));
            node.g = float(o.connections(int(p.vertex_count - s)) * double(v[s].density) / double(t.energy[node.light]));
            if (node.g > 0 && std::isfinite(node.g)) out->nodes.push_back(node);
        }
        path.node_count = uint32_t(out->nodes.size()) - path.first_node;
        if (path.node_count == 0) continue;
        path.weight = float(double(p.square) / (brightness[p.block] * brightness[p.block]));
        path.fixed = v[0].density + p.next_event + float(double(p.lens) * emission_ratio(o, p, v));
        path.contribution = float(double(p.estimate) / brightness[p.block]);
        if (!std::isfinite(path.weight) || !(path.weight > 0)) continue;
        out->paths.push_back(path);
    }
}

GammaDataset gamma_dataset(const TrainingData& d, const std::vector<double>& brightness, const EmitterSet& emitters,
                           const TrainingOptions& o, std::stop_token stop, const SubspaceTables& t) {
    GammaDataset out;
    out.light_count = t.light_count, out.eye_count = t.eye_count;
    out.source_count = t.division.cell_count();
    out.energy = t.energy;
    // Labels take most of the time. No part divides the paths of a camera sample.
    constexpr size_t kPart = 1 << 15;
    std::vector<size_t> begins{0};
    for (size_t x = kPart; x < d.paths.size(); x = begins.back() + kPart) {
        while (x < d.paths.size() && share_camera_sample(d, x - 1, x)) ++x;
        begins.push_back(x);
    }
    begins.push_back(d.paths.size());
    std::vector<GammaDataset> parts(begins.size() - 1);
    fork_join(parts.size(), [&](size_t first, size_t last) {
        for (size_t i = first; i < last && !stop.stop_requested(); ++i)
            add_to_dataset(d, brightness, emitters, o, t, begins[i], begins[i + 1], &parts[i]);
    });
    if (stop.stop_requested()) return out;
    size_t nodes = 0, paths = 0;
    for (const GammaDataset& part : parts) nodes += part.nodes.size(), paths += part.paths.size();
    out.nodes.reserve(nodes), out.paths.reserve(paths);
    for (GammaDataset& part : parts) {
        for (GammaPath path : part.paths) {
            path.first_node += uint32_t(out.nodes.size());
            out.paths.push_back(path);
        }
        out.nodes.insert(out.nodes.end(), part.nodes.begin(), part.nodes.end());
        part = {};
    }
    if (out.paths.size() > 100) {
        std::vector<float> weights;
        for (const GammaPath& p : out.paths) weights.push_back(p.weight);
        const auto cut = weights.begin() + std::ptrdiff_t(double(weights.size() - 1) * kWeightCut);
        std::nth_element(weights.begin(), cut, weights.end());
        for (GammaPath& p : out.paths) p.weight = std::min(p.weight, *cut);
    }
    return out;
}

}  // namespace

std::vector<double> block_brightness(const TrainingData& d) {
    const int w = d.blocks_x, h = d.blocks_y;
    const double per_block = double(std::max<uint64_t>(1, d.samples)) / double(d.block_sum.size());
    const int side = std::clamp(int(std::ceil(std::sqrt(kSamplesPerBlock / per_block))), 1, std::max(w, h));
    const int columns = (w + side - 1) / side, rows = (h + side - 1) / side;
    std::vector<double> sum(size_t(columns * rows), 0.0), count(sum.size(), 0.0);
    double mean = 0;
    for (int y = 0; y < h; ++y) {
        for (int x = 0; x < w; ++x) {
            // A block whose sum is not finite counts as black here and gets its brightness from its neighbours.
            const double s = d.block_sum[size_t(y * w + x)], known = std::isfinite(s) ? s / per_block : 0;
            const size_t joined = size_t(y / side * columns + x / side);
            sum[joined] += known, count[joined] += 1;
            mean += known / double(d.block_sum.size());
        }
    }
    std::vector<double> smooth(sum.size());
    for (int y = 0; y < rows; ++y) {
        for (int x = 0; x < columns; ++x) {
            double total = 0, blocks = 0;
            for (int j = std::max(0, y - 1); j <= std::min(rows - 1, y + 1); ++j)
                for (int i = std::max(0, x - 1); i <= std::min(columns - 1, x + 1); ++i)
                    total += sum[size_t(j * columns + i)], blocks += count[size_t(j * columns + i)];
            smooth[size_t(y * columns + x)] = total / blocks + 0.1 * mean;
        }
    }
    std::vector<double> out(d.block_sum.size());
    for (int y = 0; y < h; ++y)
        for (int x = 0; x < w; ++x) out[size_t(y * w + x)] = smooth[size_t(y / side * columns + x / side)];
    return out;
}

Result<SubspaceTables> train_tables(const TrainingData& data, const EmitterSet& emitters, const TrainingOptions& asked,
                                    const TrainingControl& control, TrainingReport* report) {
    *report = {};
    TrainingOptions options = asked;
    if (const double cells = double(asked.light_subspaces) * asked.eye_subspaces; cells > double(kMaxGammaCells)) {
        const double smaller = std::sqrt(double(kMaxGammaCells) / cells);
        options.light_subspaces = std::max(1u, uint32_t(smaller * asked.light_subspaces));
        options.eye_subspaces = std::max(1u, uint32_t(smaller * asked.eye_subspaces));
        report->note = "Gamma may have " + std::to_string(kMaxGammaCells) + " entries: at most " +
                       std::to_string(options.light_subspaces) + " light and " + std::to_string(options.eye_subspaces) +
                       " eye subspaces";
    }
    const std::stop_token& stop = control.stop;
    const auto passed = [&](double share) {
        if (control.progress) control.progress(share);
    };
    const Status cancelled(StatusCode::kCancelled, "training was cancelled");
    Stopwatch watch;
    SubspaceTables tables;
    const std::vector<double> brightness = block_brightness(data);
    train_classifiers(data, brightness, emitters, options, stop, &tables);
    if (stop.stop_requested()) return cancelled;
    report->classifier_seconds = watch.lap();
    if (uint64_t(tables.light_count) * tables.eye_count > kMaxGammaCells)
        return internal_error("Gamma has " + std::to_string(tables.light_count) + " x " + std::to_string(tables.eye_count) +
                              " entries, more than subspaces were asked for");
    passed(kEnergyBegins);
    measure_energy(data, emitters, options, stop, &tables);
    report->energy_seconds = watch.lap();
    passed(kGammaBegins);
    const GammaDataset dataset = gamma_dataset(data, brightness, emitters, options, stop, tables);
    if (stop.stop_requested()) return cancelled;
    for (const std::vector<TrainingPath>* list : {&data.paths, &data.light_paths})
        for (const TrainingPath& p : *list) report->out_of_range += !data.in_range(p);
    const uint64_t all_paths = data.paths.size() + data.light_paths.size();
    std::optional<GammaDataset> judged;
    if (options.judged && options.trainer == GammaTrainer::kMm)
        judged = gamma_dataset(data, brightness, emitters, options, stop, *options.judged);
    if (control.data_read) control.data_read();
    report->paths = dataset.paths.size(), report->nodes = dataset.nodes.size();
    if (dataset.paths.empty()) report->add_note("no path of this scene can be connected; the tables are uniform");
    GammaOptions gamma;
    gamma.trainer = options.trainer;
    gamma.mix = options.mix;
    gamma.seed = options.seed;
    gamma.stop = stop;
    gamma.progress = [&](double share) { passed(kGammaBegins + (1 - kGammaBegins) * share); };
    if (judged) report->judged_loss = held_out_loss(*judged, options.judged->gamma, gamma);
    judged.reset();
    tables.gamma = train_gamma(dataset, gamma, &report->gamma);
    if (stop.stop_requested()) return cancelled;
    report->gamma_seconds = watch.lap();
    const uint32_t supported = uint32_t(std::max<uint64_t>(1, report->nodes / kFewestNodes));
    const uint32_t light = std::min({tables.light_count, report->gamma.light_resolution, supported});
    const uint32_t eye = std::min({tables.eye_count, report->gamma.eye_resolution, supported});
    if (report->note.empty() && (2 * light <= options.light_subspaces || 2 * eye <= options.eye_subspaces))
        report->note = "the training set tells " + std::to_string(light) + " light and " + std::to_string(eye) +
                       " eye subspaces apart, of " + std::to_string(options.light_subspaces) + " and " +
                       std::to_string(options.eye_subspaces) + " asked for";
    if (report->out_of_range > 0)
        report->add_note(std::to_string(report->out_of_range) + " of " + std::to_string(all_paths) +
                         " training paths left the range of single precision and were left out");
    LL_RETURN_IF_ERROR(tables.validate(emitters));
    report->light_subspaces = tables.light_count, report->eye_subspaces = tables.eye_count;
    return tables;
}

}  // namespace lightloom
