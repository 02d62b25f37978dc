// lightloom fetch: the image of a finished job, or what there is of another one.

#include <array>
#include <cstdio>
#include <filesystem>
#include <nlohmann/json.hpp>

#include "client/commands.h"
#include "client/output_files.h"
#include "client/run_job.h"
#include "client/service_options.h"
#include "common/core/atomic_file.h"
#include "common/film/exr_io.h"
#include "common/film/png.h"

namespace lightloom::client {
namespace {

Status write_all(const std::array<std::pair<std::string, std::string_view>, 2>& files) {
    for (const auto& [path, bytes] : files)
        if (!path.empty()) LL_RETURN_IF_ERROR(write_file_atomically(path, bytes));
    return {};
}

/// The manifest of a job that has ended names the image that came before it.
Status check_partial(const std::string& manifest, const std::string& image) {
    const auto json = nlohmann::json::parse(manifest, nullptr, false);
    if (json.is_object() && json.contains("image") && json["image"].value("sha256", std::string()) == sha256(image).hex())
        return {};
    return data_loss("the image that arrived is not the one that its manifest names; fetch it again");
}

int fetch_partial(const ServiceOptions& options, GrpcJobPort& port, const JobInfo& job) {
    const JobOptions& wanted = options.job;
    const std::string output = wanted.output.empty() ? options.job_id + "-partial.exr" : wanted.output;
    if (std::filesystem::path(output).extension() != ".exr")
        return report_error(invalid_argument(output + ": the image is an EXR; name it so, and a picture with --png"));
    // The counts of a job that runs are old before they are written.
    const bool ended = is_terminal(job.state);
    const std::string beside = ended ? std::filesystem::path(output).replace_extension(".manifest.json").string() : std::string();
    if (Status s = check_output_files({}, std::array{output, beside, wanted.png}); !s.ok()) return report_error(s);
    const auto image = port.image(options.job_id, ImageKind::kPartial);
    if (!image.ok()) return job_error(options, image.status());
    std::string manifest;
    if (ended) {
        auto text = port.manifest(options.job_id, ManifestKind::kPartial);
        if (!text.ok()) return job_error(options, text.status());
        manifest = *std::move(text);
        if (Status s = check_partial(manifest, *image); !s.ok()) return report_error(s);
    }
    const auto decoded = decode_exr(*image, output);
    if (!decoded.ok()) return report_error(decoded.status());
    Status written = write_all({{{output, *image}, {beside, manifest}}});
    if (written.ok() && !wanted.png.empty()) written = write_png(wanted.png, decoded->color, wanted.exposure);
    if (!written.ok()) return report_error(written);
    if (wanted.quiet) return kSuccess;
    std::printf("%s  %s spp of a job that is %s\n", output.c_str(), decoded->attribute(exr_attribute::kSamples).c_str(),
                std::string(to_string(job.state)).c_str());
    if (!wanted.png.empty()) std::printf("%s\n", wanted.png.c_str());
    return kSuccess;
}

}  // namespace

int fetch_job(const ServiceOptions& options) {
    GrpcJobPort port = connect(options);
    const auto job = port.get_job(options.job_id);
    if (!job.ok()) return job_error(options, job.status());
    if (options.partial) return fetch_partial(options, port, *job);
    JobOptions output = options.job;
    if (output.output.empty()) output.output = options.job_id + ".exr";
    if (job->state != JobState::kSucceeded) {
        const std::string what = "job " + options.job_id + " is " + std::string(to_string(job->state)) +
                                 (job->message.empty() ? "" : ": " + job->message);
        if (job->state == JobState::kCancelled) return report_error({StatusCode::kCancelled, what});
        const bool over = is_terminal(job->state);
        return report_error(failed_precondition(over ? what : what + "; `lightloom watch " + options.job_id + "` waits for it"));
    }
    if (Status s = check_outputs(output, beside_image(output, AfterFetch::kImageStays), nullptr); !s.ok()) return report_error(s);
    return fetch(port, *job, output, {}, AfterFetch::kImageStays);
}

}  // namespace lightloom::client
