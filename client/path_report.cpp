#include "client/path_report.h"

#include <cmath>
#include <cstdarg>
#include <cstdio>
#include <limits>
#include <nlohmann/json.hpp>

namespace lightloom::client {
namespace {

using Json = nlohmann::ordered_json;

constexpr double kNotThere = std::numeric_limits<double>::quiet_NaN();

std::string_view name_of(BsdfKind kind) {
    switch (kind) {
        case BsdfKind::kNull: return "not resolved";
        case BsdfKind::kDiffuse: return "diffuse";
        case BsdfKind::kDiffuseTransmission: return "diffuse transmission";
        case BsdfKind::kConductor: return "conductor";
        case BsdfKind::kDielectric: return "dielectric";
        case BsdfKind::kThinDielectric: return "thin dielectric";
        case BsdfKind::kCoatedDiffuse: return "coated diffuse";
        case BsdfKind::kCoatedConductor: return "coated conductor";
    }
    return "";
}

std::string_view name_of(EmitterKind kind) {
    switch (kind) {
        case EmitterKind::kTriangle: return "triangle light";
        case EmitterKind::kSphere: return "sphere light";
        case EmitterKind::kPoint: return "point light";
        case EmitterKind::kSpot: return "spot light";
        case EmitterKind::kDistant: return "distant light";
        case EmitterKind::kEnvironment: return "environment";
        case EmitterKind::kProjection: return "projection light";
        case EmitterKind::kGoniometric: return "goniometric light";
    }
    return "";
}

/// x_i as the sub-path that traced it knows it.
ReportedVertex surface_vertex(const SubPathVertex& v, BsdfKind kind) {
    return {.kind = name_of(kind),
            .position = v.p,
            .normal = v.ng,
            .emitter = v.emitter == kNone ? -1 : int64_t(v.emitter),
            .survival = v.survival,
            .throughput = v.alpha};
}

int label_of(uint16_t label) { return label == kNoLabel ? -1 : int(label); }

}  // namespace

ReportedPath report_path(const Scene& scene, const SeenContribution& seen) {
    const PathContribution& found = seen.found;
    const PathView& view = seen.view;
    const Rect& crop = scene.frame().crop;
    const Emitter* emitter = nullptr;
    ReportedPath path{.technique = found.technique,
                      .k = view.k,
                      .t = found.t,
                      .next_event = view.k >= 2 ? view.next_event : kNotThere,
                      .survival = found.survival,
                      .value = found.value,
                      .weight = float(seen.weight),
                      .weighted = found.value * float(seen.weight),
                      .x = crop.x0 + int(seen.pixel % uint32_t(crop.width())),
                      .y = crop.y0 + int(seen.pixel / uint32_t(crop.width())),
                      .iteration = seen.iteration};
    const int k = view.k, s = found.technique.s;
    const bool merged = found.technique.kind == TechniqueKind::kMerge;
    for (int i = 0; i <= k; ++i) {
        ReportedVertex v;
        if (i == k) {
            v = {.kind = "lens", .position = found.z[0].p, .throughput = Rgb(1), .fwd = kNotThere, .rev = kNotThere};
        } else if (i == 0) {
            // A light sub-path of its own knows where it began; for all others the contribution does.
            const bool own = found.y && (s >= 2 || merged);
            const bool hit = s == 0 && k == found.t - 1;
            if (hit) v = surface_vertex(found.z[k], found.z[k].bsdf.kind);
            if (own) v = surface_vertex(found.y[0], found.y.bsdf_kind(0));
            if (!own) v.position = found.position, v.normal = found.normal, v.emitter = int64_t(found.emitter);
            if (!own && !hit) {
                v.survival = s == 0 ? found.survival : 1;
                v.throughput = found.y ? found.y[0].alpha : Rgb(float(kNotThere));
            }
            emitter = &scene.emitters()[uint32_t(v.emitter)];
            v.kind = name_of(emitter->kind);
        } else {
            v = i < s ? surface_vertex(found.y[i], found.y.bsdf_kind(i)) : surface_vertex(found.z[k - i], found.z[k - i].bsdf.kind);
        }
        if (i < k) {
            // An algorithm that needs no more fills in the view of the vertices beside the connection only. Further out the
            // sub-paths know the same densities.
            const bool in_view = i <= s + 1 || merged;
            v.fwd = in_view ? view.fwd[i] : found.z[k - i].rev;
            v.rev = in_view ? view.rev[i] : found.z[k - i].fwd;
            v.dirac = in_view ? view.delta[i] : found.z[k - i].delta;
            if (seen.labelled && i + 1 < k) v.light_label = label_of(view.light_label[i + 1]);
            if (seen.labelled && i > 0) v.eye_label = label_of(view.eye_label[i]);
        }
        path.vertices.push_back(v);
    }
    path.source_measure = emitter->is_discrete() ? "discrete" : emitter->is_infinite() ? "solid angle" : "area";
    const Rgb camera = found.t > 1 ? found.z[found.t - 1].alpha : Rgb(1);
    const Rgb light = s >= 2 || merged ? found.y[merged ? s : s - 1].alpha : Rgb(1);
    path.throughput = camera * light;
    return path;
}

std::array<double, 3> SampleReport::sum() const {
    Rgb total;
    for (const ReportedPath& path : paths) total += path.weighted;
    return response.of(total);
}

namespace {

[[gnu::format(printf, 2, 3)]] void append(std::string& out, const char* format, ...) {
    char text[512];
    va_list arguments;
    va_start(arguments, format);
    std::vsnprintf(text, sizeof text, format, arguments);
    va_end(arguments);
    out += text;
}

std::string rgb_text(const FilmResponse::Triple& c) {
    std::string out;
    append(out, "%.6g %.6g %.6g", c[0], c[1], c[2]);
    return out;
}

std::string vec_text(const Vec3& v) {
    std::string out;
    append(out, "(%.4g %.4g %.4g)", double(v.x), double(v.y), double(v.z));
    return out;
}

void append_path(std::string& out, const ReportedPath& path, size_t number, bool splat, const FilmResponse& response) {
    append(out, "%zu  %s  s %d  t %d  k %d", number, std::string(to_string(path.technique.kind)).c_str(), path.technique.s, path.t,
           path.k);
    if (splat) append(out, "  splat at %d,%d", path.x, path.y);
    append(out, "\n   value %s  x weight %.9g  =  %s\n", rgb_text(response.of(path.value)).c_str(), double(path.weight),
           rgb_text(response.of(path.weighted)).c_str());
    append(out, "   throughput %s  roulette survival %.4g", rgb_text(FilmResponse::triple(path.throughput)).c_str(),
           double(path.survival));
    if (!std::isnan(path.next_event)) append(out, "  next-event density of x0 %.6g", path.next_event);
    append(out, "\n");
    bool labels = false;
    for (const ReportedVertex& v : path.vertices) labels |= v.light_label >= 0 || v.eye_label >= 0;
    append(out, "   %-5s %-25s %-26s %-24s %12s %12s %9s%s\n", "", "", "position", "normal", "fwd", "rev", "survival",
           labels ? "  light/eye" : "");
    for (size_t i = 0; i < path.vertices.size(); ++i) {
        const ReportedVertex& v = path.vertices[i];
        const bool lens = i + 1 == path.vertices.size();
        std::string kind(v.kind);
        if (v.emitter >= 0) {
            if (i > 0) kind += ", emitter";
            kind += ' ';
            kind += std::to_string(v.emitter);
        }
        if (v.dirac) kind += ", Dirac";
        append(out, "   x%-4zu %-25s %-26s %-24s", i, kind.c_str(), vec_text(v.position).c_str(),
               lens ? "" : vec_text(v.normal).c_str());
        if (!lens) append(out, " %12.6g %12.6g %9.4g", v.fwd, v.rev, double(v.survival));
        if (labels && !lens)
            append(out, "  %s/%s", v.light_label < 0 ? "-" : std::to_string(v.light_label).c_str(),
                   v.eye_label < 0 ? "-" : std::to_string(v.eye_label).c_str());
        while (out.back() == ' ') out.pop_back();
        out += '\n';
    }
}

Json number(double value) { return std::isfinite(value) ? Json(value) : Json(); }
Json json_of(const Vec3& v) { return {number(double(v.x)), number(double(v.y)), number(double(v.z))}; }
Json json_of(const std::array<double, 3>& c) { return {number(c[0]), number(c[1]), number(c[2])}; }
/// An exposure is a float, and the product of two floats is exact in double: without white balance the sum can be made again from
/// what is printed.
Json json_of(const Rgb& c, const FilmResponse& response = {}) { return json_of(response.of(c)); }
Json index_or_null(int64_t index) { return index < 0 ? Json() : Json(index); }

Json json_of(const ReportedPath& path, const FilmResponse& response) {
    Json vertices = Json::array();
    for (const ReportedVertex& v : path.vertices) {
        vertices.push_back({{"kind", v.kind},
                            {"position", json_of(v.position)},
                            {"normal", json_of(v.normal)},
                            {"emitter", index_or_null(v.emitter)},
                            {"dirac", v.dirac},
                            {"survival", number(double(v.survival))},
                            {"throughput", json_of(v.throughput)},
                            {"fwd", number(v.fwd)},
                            {"rev", number(v.rev)},
                            {"light_label", index_or_null(v.light_label)},
                            {"eye_label", index_or_null(v.eye_label)}});
    }
    return {{"technique", to_string(path.technique.kind)},
            {"s", path.technique.s},
            {"t", path.t},
            {"k", path.k},
            {"pixel", {path.x, path.y}},
            {"iteration", path.iteration},
            {"value", json_of(path.value, response)},
            {"weight", number(double(path.weight))},
            {"weighted", json_of(path.weighted, response)},
            {"throughput", json_of(path.throughput)},
            {"survival", number(double(path.survival))},
            {"source_measure", path.source_measure},
            {"next_event", number(path.next_event)},
            {"vertices", std::move(vertices)}};
}

}  // namespace

std::string to_text(const SampleReport& report) {
    std::string out;
    append(out, "unit %u,%u  camera %.9g %.9g %.9g\n", report.group, report.tile, report.camera[0], report.camera[1],
           report.camera[2]);
    append(out, "%zu contributions to pixel %d,%d in iteration %llu; densities per area (m^-2), of x0 in its emitter's measure\n",
           report.paths.size(), report.x, report.y, static_cast<unsigned long long>(report.iteration));
    size_t number = 0;
    for (const ReportedPath& path : report.paths) append_path(out, path, ++number, false, report.response);
    const auto total = report.sum();
    append(out, "sum of weight x value  %.9g %.9g %.9g\n", total[0], total[1], total[2]);
    if (report.splats_left_out) {
        out += "splats are those of the unit's light paths, not of this sample's: --splats shows what lands in this pixel\n";
    } else if (report.splats_of_unit || !report.splats.empty()) {
        append(out, "%zu splats %s\n", report.splats.size(),
               report.splats_of_unit ? "of the unit's light paths in this pixel" : "of the sample's own light path");
        for (const ReportedPath& path : report.splats) append_path(out, path, ++number, true, report.response);
    }
    append(out, "dropped %llu\n", static_cast<unsigned long long>(report.dropped));
    return out;
}

std::string to_json(const SampleReport& report) {
    const auto list = [&](const std::vector<ReportedPath>& paths) {
        Json out = Json::array();
        for (const ReportedPath& path : paths) out.push_back(json_of(path, report.response));
        return out;
    };
    const Json json = {{"algorithm", report.algorithm},
                       {"iteration", report.iteration},
                       {"pixel", {report.x, report.y}},
                       {"unit", {report.group, report.tile}},
                       {"exposure_scale", report.response.exposure},
                       {"colour_matrix", report.response.colour},
                       {"dropped", report.dropped},
                       {"camera", json_of(report.camera)},
                       {"sum", json_of(report.sum())},
                       {"paths", list(report.paths)},
                       {"splats", report.splats_left_out ? Json() : list(report.splats)}};
    return json.dump(1, ' ') + "\n";
}

}  // namespace lightloom::client
