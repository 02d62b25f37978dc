// lightloom preview: the image of a running job as it is now.

#include <array>
#include <cstdio>
#include <filesystem>

#include "client/commands.h"
#include "client/output_files.h"
#include "client/service_options.h"
#include "common/core/atomic_file.h"

namespace lightloom::client {

int preview_job(const ServiceOptions& options) {
    const std::string output = options.job.output.empty() ? options.job_id + "-preview.png" : options.job.output;
    const auto extension = std::filesystem::path(output).extension();
    if (extension != ".png" && extension != ".exr")
        return report_error(invalid_argument(output + ": a preview is a .png or an .exr; name it so"));
    const auto format = extension == ".png" ? PreviewFormat::kPng : PreviewFormat::kExr;
    if (format == PreviewFormat::kExr && options.job.exposure != 0)
        return report_error(invalid_argument("--exposure brightens a PNG; an EXR never is"));
    if (Status s = check_output_files({}, std::array{output}); !s.ok()) return report_error(s);
    GrpcJobPort port = connect(options);
    const auto preview = port.preview(options.job_id, format, options.job.exposure);
    if (!preview.ok()) return job_error(options, preview.status());
    if (Status s = write_file_atomically(output, preview->bytes); !s.ok()) return report_error(s);
    if (!options.job.quiet)
        std::printf("%s  %llu spp\n", output.c_str(), static_cast<unsigned long long>(preview->samples_per_pixel));
    return kSuccess;
}

}  // namespace lightloom::client
