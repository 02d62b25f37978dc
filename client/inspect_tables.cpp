#include "client/inspect_tables.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <nlohmann/json.hpp>
#include <set>

#include "client/inspect_density.h"
#include "client/inspect_emission.h"
#include "client/inspect_gain.h"
#include "common/core/atomic_file.h"
#include "common/core/fork_join.h"
#include "common/core/rng.h"
#include "common/film/png.h"
#include "server/table_cache.h"

namespace lightloom::client {
namespace {

constexpr int kMaxPicture = 1024;  // pixels of a side; larger tables are averaged
constexpr int kBarHeight = 256;

struct Picture {
    int width, height;
    std::vector<uint8_t> rgb;
    Picture(int w, int h) : width(w), height(h), rgb(size_t(3) * size_t(w) * size_t(h), 0) {}
    void set(int x, int y, double r, double g, double b) {
        uint8_t* const pixel = &rgb[3 * (size_t(y) * size_t(width) + size_t(x))];
        const double channels[3] = {r, g, b};
        for (int c = 0; c < 3; ++c) pixel[c] = uint8_t(std::clamp(channels[c], 0.0, 1.0) * 255 + 0.5);
    }
    Status write(const std::string& path) const { return write_png8(path, width, height, rgb); }
};

size_t used_labels(const SubspaceTree& tree) {
    std::set<uint32_t> labels;
    for (const SubspaceTree::Node& node : tree.nodes())
        if (node.axis() == SubspaceTree::kLeaf) labels.insert(node.child());
    return labels.size();
}

/// Of sorted values.
double quantile(const std::vector<float>& sorted, double q) { return double(sorted[size_t(q * double(sorted.size() - 1) + 0.5)]); }

struct SubspaceStatistics {
    size_t light_labels = 0, eye_labels = 0, windows = 0;
    double q[5] = {};        // minimum, 10 %, median, 90 %, maximum
    double q_top_ten = 0;    // share of the ten largest
    double entropy[3] = {};  // minimum, mean, maximum
};

SubspaceStatistics measure(const SubspaceTables& t) {
    SubspaceStatistics s;
    s.light_labels = used_labels(t.light_tree) + t.division.cell_count();
    s.eye_labels = used_labels(t.eye_tree);
    for (const uint16_t w : t.window) s.windows += w > 1;
    std::vector<float> sorted = t.energy;
    std::sort(sorted.begin(), sorted.end());
    const double levels[5] = {0, 0.1, 0.5, 0.9, 1};
    for (int i = 0; i < 5; ++i) s.q[i] = quantile(sorted, levels[i]);
    double total = 0, top = 0;
    for (size_t i = 0; i < sorted.size(); ++i) {
        total += double(sorted[i]);
        if (i + 10 >= sorted.size()) top += double(sorted[i]);
    }
    s.q_top_ten = top / total;
    s.entropy[0] = 1e300;
    for (uint32_t j = 0; j < t.eye_count; ++j) {
        double bits = 0;
        for (uint32_t i = 0; i < t.light_count; ++i) bits -= double(t.column(j)[i]) * std::log2(double(t.column(j)[i]));
        s.entropy[0] = std::min(s.entropy[0], bits);
        s.entropy[1] += bits / t.eye_count;
        s.entropy[2] = std::max(s.entropy[2], bits);
    }
    return s;
}

void set_label(Picture* picture, int x, int y, uint32_t label) {
    const uint64_t bits = mix64(uint64_t(label) + 1);
    picture->set(x, y, 0.15 + 0.85 * double(bits & 255) / 255, 0.15 + 0.85 * double(bits >> 8 & 255) / 255,
                 0.15 + 0.85 * double(bits >> 16 & 255) / 255);
}

Status draw_kappa(const SubspaceTables& tables, const Scene& scene, const std::string& prefix) {
    const Rect crop = scene.frame().crop;
    Picture eye(crop.width(), crop.height()), light(crop.width(), crop.height());
    fork_join(size_t(crop.height()), [&](size_t first, size_t last) {
        for (int y = int(first); y < int(last); ++y) {
            for (int x = 0; x < crop.width(); ++x) {
                const Camera::CameraRay ray =
                    scene.camera().sample_ray({float(crop.x0 + x) + 0.5f, float(crop.y0 + y) + 0.5f}, {0.5f, 0.5f});
                SurfacePoint point;
                if (!scene.intersect(ray.origin, ray.direction, &point, scene.camera_clearance())) continue;
                const Vec3 normal = face_forward(point.ng, -ray.direction);
                set_label(&eye, x, y, tables.eye_label(sub_path_end(point.p, point.ng, -ray.direction)));
                set_label(&light, x, y, tables.light_label(sub_path_end(point.p, normal, normal)));
            }
        }
    });
    LL_RETURN_IF_ERROR(eye.write(prefix + kTablePictures[0]));
    return light.write(prefix + kTablePictures[1]);
}

/// First element of cell `i` of `cells` over `count` elements.
uint32_t cell_begin(int i, int cells, uint32_t count) { return uint32_t(uint64_t(i) * count / uint64_t(cells)); }

Status draw_gamma(const SubspaceTables& t, const std::string& path) {
    Picture picture(int(std::min<uint32_t>(t.eye_count, kMaxPicture)), int(std::min<uint32_t>(t.light_count, kMaxPicture)));
    for (int x = 0; x < picture.width; ++x) {
        for (int y = 0; y < picture.height; ++y) {
            double sum = 0, count = 0;
            const uint32_t eye_end = cell_begin(x + 1, picture.width, t.eye_count);
            const uint32_t light_end = cell_begin(y + 1, picture.height, t.light_count);
            for (uint32_t j = cell_begin(x, picture.width, t.eye_count); j < eye_end; ++j) {
                for (uint32_t i = cell_begin(y, picture.height, t.light_count); i < light_end; ++i) {
                    sum += double(t.column(j)[i]);
                    count += 1;
                }
            }
            // From 1/32 of uniform, black, to 256 times uniform, white.
            const double heat = (std::log2(sum / count * t.light_count) + 5) / 13;
            picture.set(x, y, 3 * heat, 3 * heat - 1, 3 * heat - 2);
        }
    }
    return picture.write(path);
}

Status draw_energy(const SubspaceTables& t, const std::string& path) {
    Picture picture(int(std::min<uint32_t>(t.light_count, kMaxPicture)), kBarHeight);
    const double top = std::log2(double(*std::max_element(t.energy.begin(), t.energy.end())));
    for (int x = 0; x < picture.width; ++x) {
        const uint32_t first = cell_begin(x, picture.width, t.light_count);
        double sum = 0, count = 0;
        for (uint32_t i = first; i < cell_begin(x + 1, picture.width, t.light_count); ++i) sum += double(t.energy[i]), count += 1;
        // Sixteen doublings over the height.
        const double level = 1 + (std::log2(sum / count) - top) / 16;
        const bool source = first < t.division.cell_count();
        for (int y = 0; y < int(std::clamp(level, 0.0, 1.0) * kBarHeight); ++y)
            picture.set(x, kBarHeight - 1 - y, source ? 1 : 0.3, source ? 0.75 : 0.6, source ? 0.2 : 1);
    }
    return picture.write(path);
}

nlohmann::ordered_json describe_subspaces(const SubspaceTables& t) {
    const SubspaceStatistics s = measure(t);
    return {{"light_subspaces", {{"count", t.light_count}, {"emitter_cells", t.division.cell_count()}, {"labels", s.light_labels}}},
            {"eye_subspaces", {{"count", t.eye_count}, {"labels", s.eye_labels}}},
            {"q",
             {{"minimum", s.q[0]},
              {"p10", s.q[1]},
              {"median", s.q[2]},
              {"p90", s.q[3]},
              {"maximum", s.q[4]},
              {"share_of_top_ten", s.q_top_ten}}},
            {"gamma_column_entropy_bits",
             {{"minimum", s.entropy[0]},
              {"mean", s.entropy[1]},
              {"maximum", s.entropy[2]},
              {"uniform", std::log2(double(t.light_count))}}},
            {"subspaces_with_more_than_one_window", s.windows},
            {"vertices_per_path", t.vertices_per_path}};
}

void print_subspaces(const SubspaceTables& t) {
    const SubspaceStatistics s = measure(t);
    std::printf("  light      %u subspaces, %u of them cells of emitters; %zu labels occur; %.3g connectible vertices per path\n",
                t.light_count, t.division.cell_count(), s.light_labels, t.vertices_per_path);
    std::printf("  eye        %u subspaces; %zu labels occur\n", t.eye_count, s.eye_labels);
    std::printf("  Q          minimum %.4g, 10 %% %.4g, median %.4g, 90 %% %.4g, maximum %.4g; the ten largest hold %.1f %%\n",
                s.q[0], s.q[1], s.q[2], s.q[3], s.q[4], 100 * s.q_top_ten);
    std::printf("  Gamma      entropy of a column %.2f to %.2f bits, mean %.2f; uniform would be %.2f\n", s.entropy[0],
                s.entropy[2], s.entropy[1], std::log2(double(t.light_count)));
    std::printf("  windows    %zu subspaces keep more than one\n", s.windows);
}

}  // namespace

Result<TableFile> read_tables(const std::string& path, const Scene& scene) {
    auto bytes = read_file(path);
    if (!bytes.ok()) return bytes.status();
    const auto content = tables_of_file(*std::move(bytes));
    if (!content.ok()) return invalid_argument(path + ": " + content.status().message());
    const TablePart* const known[] = {&EmissionPart::kPart, &GainPart::kPart, &DensityPart::kPart, &SubspaceTables::kPart};
    const auto parts = parse_tables(*content, known);
    if (!parts.ok()) return invalid_argument(path + ": " + parts.status().message());
    if (const Status s = parts->validate(scene.emitters()); !s.ok())
        return invalid_argument(path + ": the tables are not those of this scene: " + s.message());
    return TableFile{parts->get<SubspaceTables>(), parts->get<EmissionPart>(), parts->get<GainPart>(),
                     parts->get<DensityPart>(),    sha256(*content),           content->size()};
}

nlohmann::ordered_json describe(const TableFile& file, const Scene& scene) {
    nlohmann::ordered_json out{{"sha256", file.digest.hex()}, {"size_bytes", file.size_bytes}};
    if (file.subspaces) out.update(describe_subspaces(*file.subspaces));
    if (file.emission) out["emission"] = describe_emission(file.emission->data, scene);
    if (file.gain) out["gain"] = describe_gain(file.gain->data);
    if (file.density) out["photons"] = describe_density(file.density->data);
    return out;
}

void print(const TableFile& file, const Scene& scene) {
    std::printf("tables %s, %.1f MB\n", file.digest.hex().c_str(), double(file.size_bytes) * 1e-6);
    if (file.subspaces) print_subspaces(*file.subspaces);
    if (file.emission) print_emission(file.emission->data, scene);
    if (file.gain) print_gain(file.gain->data);
    if (file.density) print_density(file.density->data);
}

Status draw(const TableFile& file, const Scene& scene, const std::string& prefix) {
    if (!file.subspaces) return invalid_argument("--draw shows subspaces, and these tables have none");
    LL_RETURN_IF_ERROR(draw_kappa(*file.subspaces, scene, prefix));
    LL_RETURN_IF_ERROR(draw_gamma(*file.subspaces, prefix + kTablePictures[2]));
    return draw_energy(*file.subspaces, prefix + kTablePictures[3]);
}

}  // namespace lightloom::client
