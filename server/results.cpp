#include "server/results.h"

#include <algorithm>
#include <ctime>
#include <nlohmann/json.hpp>

#include "common/core/atomic_file.h"
#include "common/film/exr_io.h"
#include "common/film/png.h"
#include "common/work/job_fields.h"

namespace lightloom {

using Json = nlohmann::ordered_json;

namespace {

/// Quotes a word so that a POSIX shell takes it literally.
std::string shell_word(const std::string& word) {
    const auto plain = [](char c) {
        return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') ||
               std::string_view("_-./,:=+@%").find(c) != std::string_view::npos;
    };
    if (!word.empty() && std::all_of(word.begin(), word.end(), plain)) return word;
    std::string out = "'";
    for (const char c : word) out += c == '\'' ? std::string("'\\''") : std::string(1, c);
    return out + "'";
}

template <class T>
Json value_json(const T& value) {
    return value;
}

Json value_json(const Digest& digest) { return digest.hex(); }

Json value_json(const Rect& window) { return {window.x0, window.y0, window.x1, window.y1}; }

Json value_json(const FrameLayout& frame) {
    return {{"width", frame.width}, {"height", frame.height}, {"crop", value_json(frame.crop)}};
}

/// The fields of a spec whose roles are among the chosen ones.
template <class Chosen>
Json fields_json(const JobSpec& spec, const Chosen& chosen) {
    Json json = Json::object();
    for_each_job_field([&]<unsigned Roles, class T>(const JobField<Roles, T>& field) {
        if (!chosen(Roles)) return;
        if constexpr (std::is_same_v<T, AlgorithmSettings>) {
            json[std::string(field.name)] = (spec.*field.member).name();
            json["parameters"] = (spec.*field.member).named_text();
        } else {
            json[std::string(field.name)] = value_json(spec.*field.member);
        }
    });
    return json;
}

/// The settings come first, then the rest of the request, last the scene and the frame.
Json spec_json(const JobSpec& spec, const std::string& scene) {
    using namespace job_role;
    const auto rest_of_manifest = [&](bool tables) {
        return fields_json(spec, [tables](unsigned roles) {
            return (roles & kManifest) && !(roles & kSettings) && bool(roles & kTables) == tables;
        });
    };
    Json json = settings_json(spec);
    json.update(rest_of_manifest(false));
    json["scene"] = scene;
    json.update(rest_of_manifest(true));
    return json;
}

}  // namespace

Json settings_json(const JobSpec& spec) {
    return fields_json(spec, [](unsigned roles) { return bool(roles & job_role::kSettings); });
}

Json to_json(const RareLightReport& report) {
    return {{"share", report.share},
            {"unreachable_share", report.unreachable_share},
            {"expected_hits", report.expected_hits},
            {"mean_error", report.mean_error}};
}

Json to_json(const std::optional<NoiseReport>& noise, double target) {
    if (!noise) return nullptr;
    return {{"relmse", noise->estimate.relmse},
            {"standard_error", noise->estimate.error},
            {"groups", noise->estimate.groups},
            {"samples_per_pixel", noise->estimate.iterations},
            {"target", target > 0 ? Json(target) : Json(nullptr)},
            {"reached", target > 0 ? Json(noise->reached) : Json(nullptr)},
            {"light_missing", noise->light_missing}};
}

Json to_json(const TablesInfo& t) {
    return {{"sha256", t.asset.digest.hex()},
            {"size_bytes", t.asset.size_bytes},
            {"cache_key", t.cache_key.hex()},
            {"from_cache", t.from_cache},
            {"light_subspaces", t.light_subspaces},
            {"eye_subspaces", t.eye_subspaces},
            {"training_samples", t.training_samples},
            {"capped_by_time_limit", t.capped_by_time_limit},
            {"seconds",
             {{"trace", t.trace_seconds},
              {"classifiers", t.classifier_seconds},
              {"energy", t.energy_seconds},
              {"gamma", t.gamma_seconds}}},
            {"held_out_loss", {{"uniform", t.uniform_loss}, {"tables", t.loss}, {"prior_strength", t.prior_strength}}},
            {"note", t.note}};
}

std::string utc_now() {
    const std::time_t now = std::time(nullptr);
    std::tm parts{};
    gmtime_r(&now, &parts);
    char text[32];
    std::strftime(text, sizeof text, "%Y-%m-%dT%H:%M:%SZ", &parts);
    return text;
}

std::string replay_command(const JobSpec& spec, const std::string& scene, const Reducer::Dropped& dropped,
                           const std::vector<std::string>& without) {
    const DroppedSample& sample = dropped.sample;
    const int width = spec.frame.crop.width();
    const int x = spec.frame.crop.x0 + int(sample.pixel) % width, y = spec.frame.crop.y0 + int(sample.pixel) / width;
    std::string command = "lightloom replay " + shell_word(scene) + " --algorithm " + shell_word(spec.algorithm.name());
    for (const auto& [key, value] : spec.algorithm.named_text()) command += " --set " + shell_word(key + "=" + value);
    for (size_t i = 0; i < without.size(); ++i) command += (i == 0 ? " --without " : ",") + without[i];
    command += " --seed " + std::to_string(spec.seed) + " --max-depth " + std::to_string(spec.max_depth);
    if (spec.width > 0) command += " --resolution " + std::to_string(spec.width) + "x" + std::to_string(spec.height);
    if (const Rect& c = spec.crop; c != Rect{}) {
        command += " --crop " + std::to_string(c.x0) + "," + std::to_string(c.x1) + "," + std::to_string(c.y0) + "," +
                   std::to_string(c.y1);
    }
    if (spec.samples_per_pixel > 0) command += " --spp " + std::to_string(spec.samples_per_pixel);
    if (sample.splat) return command + " --unit " + std::to_string(dropped.unit.group) + "," + std::to_string(dropped.unit.tile);
    return command + " --iteration " + std::to_string(sample.iteration) + " --pixel " + std::to_string(x) + "," + std::to_string(y);
}

std::string to_json(const Manifest& m) {
    const JobSpec& spec = m.job.spec;
    Json json;
    json["format"] = "lightloom-manifest 1";
    json["job"] = m.job.job_id;
    json["image"] = {{"sha256", m.job.image_digest.hex()},
                     {"size_bytes", m.job.image_size_bytes},
                     {"colour", "float"},
                     {"samples_per_pixel", m.iterations},
                     {"groups", m.groups},
                     {"spec_digest", spec.spec_digest().hex()}};
    if (is_terminal(m.job.state))  // without the image that was asked for
        json["partial"] = {{"state", to_string(m.job.state)}, {"message", m.job.message}};
    json["spec"] = spec_json(spec, m.scene_main);
    if (!m.without.empty()) json["spec"]["without"] = m.without;
    json["build"] = {{"build_id", m.identity.build_id},
                     {"math_profile", m.identity.math_profile},
                     {"golden_digest", m.identity.golden_digest.hex()}};
    json["times"] = {{"created", m.created_at},
                     {"finished", m.finished_at},
                     {"prepare_seconds", m.job.prepare_seconds},
                     {"render_seconds", m.job.render_seconds}};
    if (m.job.tables.asset.size_bytes > 0) json["tables"] = to_json(m.job.tables);
    json["work"] = {{"camera_samples", m.job.camera_samples},
                    {"light_paths", m.job.light_paths},
                    {"rays", m.job.rays},
                    {"units", m.units.size()},
                    {"expired_leases", m.expired_leases},
                    {"rejected_results", m.rejected_results},
                    {"duplicates_same", m.job.duplicates_same},
                    {"duplicates_different", m.job.duplicates_different}};
    if (m.job.rare_light != RareLightReport{}) json["rare_light"] = to_json(m.job.rare_light);
    if (m.job.noise) json["noise"] = to_json(m.job.noise, spec.noise_target);
    Json dropped = Json::array();
    for (const Reducer::Dropped& d : m.dropped) {
        dropped.push_back({{"unit", {d.unit.group, d.unit.tile}},
                           {"iteration", d.sample.iteration},
                           {"pixel", d.sample.pixel},
                           {"splat", d.sample.splat},
                           {"replay", replay_command(spec, m.scene_main, d, m.without)}});
    }
    json["dropped"] = {{"count", m.job.dropped_samples}, {"first", std::move(dropped)}};
    Json workers = Json::array();
    for (const ManifestWorker& w : m.workers) {
        Json units = Json::array();  // pairs [group, tile]
        for (const UnitTable::Merged& u : m.units) {
            if (u.worker == w.index) units.push_back({u.unit.group, u.unit.tile});
        }
        workers.push_back({{"worker", w.worker_id},
                           {"host", w.host},
                           {"process_id", w.process_id},
                           {"threads", w.thread_count},
                           {"units", std::move(units)}});
    }
    json["workers"] = std::move(workers);
    return json.dump(1) + "\n";
}

Result<std::string> encode_image(const JobSpec& spec, DevelopedImage developed, std::vector<ImageLayer> layers) {
    std::string parameters;  // with numbers for choices, as in the images of earlier versions: an image's bytes stay what they are
    for (const auto& [key, value] : spec.algorithm.text()) parameters += (parameters.empty() ? "" : " ") + key + "=" + value;
    ExrImage image;
    image.frame = spec.frame;
    image.color = std::move(developed.color);
    image.layers = std::move(layers);
    // An unknown variance is left out: it is not zero.
    if (!developed.variance.pixels.empty()) image.layers.push_back({"variance", "RGB", std::move(developed.variance.pixels)});
    image.attributes = {{exr_attribute::kAlgorithm, spec.algorithm.name()},
                        {exr_attribute::kParameters, parameters},
                        {exr_attribute::kSeed, std::to_string(spec.seed)},
                        {exr_attribute::kMaxDepth, std::to_string(spec.max_depth)},
                        {exr_attribute::kSamples, std::to_string(developed.iterations)},
                        {"lightloom.groups", std::to_string(developed.groups)},
                        {exr_attribute::kScene, spec.scene_root.hex()},
                        {"lightloom.specDigest", spec.spec_digest().hex()}};
    return encode_exr(image);
}

Result<std::string> encode_image(const JobSpec& spec, const Reducer& reducer, std::vector<ImageLayer> layers) {
    auto developed = reducer.developed(true);
    if (!developed.ok()) return developed.status();
    return encode_image(spec, *std::move(developed), std::move(layers));
}

Result<Preview> make_preview(const JobSpec& spec, const std::filesystem::path& written, const Reducer* reducer,
                             PreviewFormat format, double exposure) {
    DevelopedImage developed;
    if (reducer) {
        auto merged = reducer->developed(format == PreviewFormat::kExr);
        if (!merged.ok()) return merged.status();
        developed = *std::move(merged);
    } else {
        auto bytes = read_file(written.string());
        if (!bytes.ok()) return bytes.status();
        auto image = decode_exr(*bytes, "the image on disk");
        if (!image.ok()) return image.status();
        developed.iterations = std::strtoull(image->attribute(exr_attribute::kSamples).c_str(), nullptr, 10);
        if (format == PreviewFormat::kExr) return Preview{*std::move(bytes), developed.iterations};
        developed.color = std::move(image->color);
    }
    const uint64_t iterations = developed.iterations;
    JobSpec shown = spec;
    shown.first_hit_layers = false;  // the digest in the header is that of an image without them
    auto bytes =
        format == PreviewFormat::kPng ? encode_png(developed.color, exposure) : encode_image(shown, std::move(developed), {});
    if (!bytes.ok()) return bytes.status();
    return Preview{*std::move(bytes), iterations};
}

}  // namespace lightloom
