#include "client/bench/reference_maker.h"

#include <cstdio>
#include <filesystem>

#include "client/progress.h"
#include "common/core/atomic_file.h"
#include "common/work/identity.h"
#include "server/results.h"

namespace lightloom::client {
namespace {

/// Renders until the job's bound, collecting the means of groups.
Result<RegionMeans> render_all(ProgressiveRender& render, const JobSpec& spec, bool quiet, const std::stop_token& stop) {
    RegionMeans means(kCheckColumns, kCheckRows);
    const uint64_t limit = spec.samples_per_pixel > 0 ? spec.samples_per_pixel : std::numeric_limits<uint64_t>::max();
    double next_report = 10;
    while (render.iterations() < limit && (spec.time_limit_seconds <= 0 || render.seconds() < spec.time_limit_seconds)) {
        LL_RETURN_IF_ERROR(render.advance(limit, stop));
        const auto image = render.last_group_image();
        if (!image.ok()) return image.status();
        means.add(*image, render.last_group_iterations());
        if (quiet || render.seconds() < next_report) continue;
        const Estimate mean = means.estimates().front();
        std::fprintf(stderr, "%llu spp in %s, mean luminance %.6g +- %.2g %%\n",
                     static_cast<unsigned long long>(render.iterations()), duration_text(render.seconds()).c_str(), mean.mean,
                     100 * mean.standard_error() / mean.mean);
        next_report *= 2;
    }
    return means;
}

nlohmann::ordered_json describe(const JobSpec& spec, const ProgressiveRender& render, const std::vector<Estimate>& regions,
                                const std::string& exr) {
    const Estimate& mean = regions.front();
    const UnitCounters& counters = render.counters();
    nlohmann::ordered_json json = {
        {"format", "lightloom-reference 1"}, {"sha256", sha256(exr).hex()}, {"scene_digest", spec.scene_root.hex()}};
    json.update(settings_json(spec));
    json.update(nlohmann::ordered_json{{"width", spec.frame.width},
                                       {"height", spec.frame.height},
                                       {"samples_per_pixel", render.iterations()},
                                       {"groups", render.groups()},
                                       {"seconds", render.seconds()},
                                       {"preparation_seconds", render.preparation_seconds()},
                                       {"rays", counters.rays},
                                       {"dropped_samples", render.dropped()},
                                       {"mean_y", mean.mean},
                                       {"mean_y_se", mean.standard_error()},
                                       {"build", kBuildId}});
    nlohmann::ordered_json& means = json["regions"] = nlohmann::ordered_json::array();
    for (const Estimate& region : regions) {
        means.push_back({{"mean", region.mean}});
        // One group of samples knows no error.
        if (std::isfinite(region.standard_error())) means.back()["standard_error"] = region.standard_error();
    }
    return json;
}

}  // namespace

Result<MadeReference> make_reference(const std::shared_ptr<const Scene>& scene, const JobSpec& spec, const std::string& scene_file,
                                     uint32_t threads, const PreparationSource& tables, bool quiet, std::stop_token stop) {
    const RenderSettings settings = render_settings(spec);
    const auto preparation = tables(settings);
    if (!preparation.ok()) return preparation.status();
    auto render = ProgressiveRender::start(scene, settings, *preparation);
    if (!render.ok()) return render.status();
    const auto means = render_all(*render, spec, quiet, stop);
    if (!means.ok()) return means.status();
    MadeReference made{*std::move(render), means->estimates(), {}, {}, preparation->note};
    auto exr =
        encode_image(spec, {made.render.image(), made.render.variance(), made.render.iterations(), made.render.groups()}, {});
    if (!exr.ok()) return exr.status();
    made.exr = *std::move(exr);
    made.description = describe(spec, made.render, made.regions, made.exr);
    made.description["scene"] = scene_file;
    made.description["threads"] = threads;
    if (spec.algorithm.learning()) made.description["tables"] = preparation->cached ? "cached" : "made";
    return made;
}

std::string description_path(const std::string& exr_path) {
    return std::filesystem::path(exr_path).replace_extension(".json").string();
}

Status write_reference(const MadeReference& made, const std::string& exr_path) {
    LL_RETURN_IF_ERROR(write_file_atomically(description_path(exr_path), made.description.dump(1) + "\n"));
    return write_file_atomically(exr_path, made.exr);
}

}  // namespace lightloom::client
