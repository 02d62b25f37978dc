// lightloom compare: how far an image is from a reference.

#include <array>
#include <cstdio>
#include <memory>
#include <nlohmann/json.hpp>
#include <string>

#include "client/commands.h"
#include "client/output_files.h"
#include "common/cli/command_line.h"
#include "common/cli/numbers.h"
#include "common/core/atomic_file.h"
#include "common/film/exr_io.h"
#include "common/film/png.h"
#include "common/metrics/metrics.h"

namespace lightloom::client {

namespace {

constexpr const char* kFooter = R"(Examples:
  lightloom compare room.exr room-ref.exr
  lightloom compare room.exr room-ref.exr -o error.png --regions 3x3
  lightloom compare room.exr room-ref.exr --json              the metrics as JSON, and nothing else

Exit code 0 if the images could be compared, 2 if a file cannot be read or the frames differ.)";

struct CompareOptions {
    std::string image, reference, json, heat, regions;
    bool json_wanted = false;
    double trim_percent = 0.1, heat_range = 1;
};

struct Comparison {
    Metrics metrics;
    std::vector<RegionRatio> regions;
    std::string warning;  ///< Empty if there is none.
};

int refuse(const Status& status) {
    std::fprintf(stderr, "lightloom: %s\n", status.message().c_str());
    return kUsage;
}

Status parse_grid(const std::string& text, int* columns, int* rows) {
    int used = 0;
    if (std::sscanf(text.c_str(), "%4dx%4d%n", columns, rows, &used) == 2 && size_t(used) == text.size() && *columns > 0 &&
        *rows > 0) {
        return Status::ok_status();
    }
    return invalid_argument("--regions " + text + ": give columns x rows, for example 3x3");
}

Result<Comparison> compare(const CompareOptions& options, const ExrImage& image, const ExrImage& reference) {
    LL_RETURN_IF_ERROR(check_comparable(image, reference));
    Comparison comparison;
    if (!options.regions.empty()) {
        int columns = 0, rows = 0;
        LL_RETURN_IF_ERROR(parse_grid(options.regions, &columns, &rows));
        Result<std::vector<RegionRatio>> regions = region_ratios(image.color, reference.color, columns, rows);
        if (!regions.ok()) return regions.status();
        comparison.regions = std::move(regions).value();
    }
    Result<Metrics> metrics = compute_metrics(image.color, reference.color, options.trim_percent);
    if (!metrics.ok()) return metrics.status();
    comparison.metrics = *metrics;
    const std::string algorithm = image.attribute(exr_attribute::kAlgorithm);
    if (!algorithm.empty() && algorithm == reference.attribute(exr_attribute::kAlgorithm)) {
        comparison.warning = "both images were made by algorithm \"" + algorithm +
                             "\": a bias that it has is in the reference too and does not show";
    }
    return comparison;
}

nlohmann::ordered_json to_json(const CompareOptions& options, const Comparison& comparison) {
    const Metrics& m = comparison.metrics;
    nlohmann::ordered_json json{{"image", options.image},
                                {"reference", options.reference},
                                {"mape_percent", m.mape},
                                {"mape_unclamped_percent", m.mape_unclamped},
                                {"relmse", m.relmse},
                                {"relmse_trimmed", m.relmse_trimmed},
                                {"trim_percent", m.trim_percent},
                                {"rmse", m.rmse},
                                {"srrmse", m.srrmse},
                                {"ssim", m.ssim},
                                {"flip", m.flip},
                                {"hdr_flip", m.hdr_flip},
                                {"mean_ratio", m.mean_ratio},
                                {"mean_image", m.mean_image},
                                {"mean_reference", m.mean_reference}};
    if (!comparison.regions.empty()) {
        json["regions"] = nlohmann::ordered_json::array();
        for (const RegionRatio& r : comparison.regions) {
            json["regions"].push_back({{"rect", {r.rect.x0, r.rect.y0, r.rect.x1, r.rect.y1}},
                                       {"mean_image", r.mean_image},
                                       {"mean_reference", r.mean_reference},
                                       {"mean_ratio", r.ratio}});
        }
    }
    json["warnings"] = nlohmann::ordered_json::array();
    if (!comparison.warning.empty()) json["warnings"].push_back(comparison.warning);
    return json;
}

void print_table(const CompareOptions& options, const Comparison& comparison) {
    const Metrics& m = comparison.metrics;
    std::printf("%s against %s\n", options.image.c_str(), options.reference.c_str());
    std::printf("  %-26s %12.4f %%   |x-r| / (r + 0.01), at most 10 per pixel\n", "MAPE", m.mape);
    std::printf("  %-26s %12.4f %%\n", "MAPE, unclamped", m.mape_unclamped);
    std::printf("  %-26s %12.6g     (x-r)^2 / (r^2 + 0.01)\n", "relMSE", m.relmse);
    char name[64];
    std::snprintf(name, sizeof name, "relMSE, without top %g %%", m.trim_percent);
    std::printf("  %-26s %12.6g\n", name, m.relmse_trimmed);
    std::printf("  %-26s %12.6g\n", "RMSE", m.rmse);
    std::printf("  %-26s %12.6g     (x-r) / ((x+r)/2)\n", "SRRMSE", m.srrmse);
    std::printf("  %-26s %12.6f     1 = equal\n", "SSIM", m.ssim);
    std::printf("  %-26s %12.6f     clamped to [0,1], 67.02 pixels per degree\n", "FLIP", m.flip);
    std::printf("  %-26s %12.6f     ACES, automatic exposures\n", "HDR-FLIP", m.hdr_flip);
    std::printf("  %-26s %12.6f     sum x / sum r\n", "mean ratio", m.mean_ratio);
    std::printf("  %-26s %12.6g %.6g %.6g\n", "mean R G B, image", m.mean_image[0], m.mean_image[1], m.mean_image[2]);
    std::printf("  %-26s %12.6g %.6g %.6g\n", "mean R G B, reference", m.mean_reference[0], m.mean_reference[1],
                m.mean_reference[2]);
    int row = -1;
    for (const RegionRatio& r : comparison.regions) {
        if (row < 0) std::printf("  mean ratio by region");
        if (r.rect.y0 != row) std::printf("\n   "), row = r.rect.y0;
        std::printf(" %10.6f", r.ratio);
    }
    if (row >= 0) std::printf("\n");
}

int run(const CompareOptions& options) {
    const std::array<std::filesystem::path, 2> inputs{options.image, options.reference};
    if (const Status s = check_output_files(inputs, std::array{options.json, options.heat}); !s.ok()) return refuse(s);
    Result<ExrImage> image = read_exr(options.image);
    if (!image.ok()) return refuse(image.status());
    Result<ExrImage> reference = read_exr(options.reference);
    if (!reference.ok()) return refuse(reference.status());
    Result<Comparison> comparison = compare(options, *image, *reference);
    if (!comparison.ok()) return refuse(comparison.status());

    if (!options.heat.empty()) {
        const std::vector<uint8_t> picture = signed_error_picture(image->color, reference->color, options.heat_range);
        const Status written = write_png8(options.heat, image->color.width, image->color.height, picture);
        if (!written.ok()) return refuse(written);
    }
    if (!comparison->warning.empty()) {
        std::fprintf(stderr, "lightloom: warning: %s\n", comparison->warning.c_str());
    }
    const bool json_to_stdout = options.json_wanted && options.json.empty();
    if (options.json_wanted) {
        const std::string text = to_json(options, *comparison).dump(2) + "\n";
        if (json_to_stdout) {
            std::fputs(text.c_str(), stdout);
        } else if (const Status written = write_file_atomically(options.json, text); !written.ok()) {
            return refuse(written);
        }
    }
    if (!json_to_stdout) print_table(options, *comparison);
    return kSuccess;
}

}  // namespace

void add_compare_command(cli::App app, int* exit_code) {
    auto options = std::make_shared<CompareOptions>();
    const cli::App command = app.add_subcommand("compare", "Measure how far an EXR image is from a reference of the same frame");
    command->add_option("IMAGE", options->image, "EXR to judge")->type_name("FILE")->required();
    command->add_option("REFERENCE", options->reference, "EXR to measure it by, of the same frame")->type_name("FILE")->required();
    const cli::Option json =
        command
            ->add_option("--json", options->json,
                         "Write the metrics as JSON to FILE, or to standard output instead of the table if no FILE "
                         "follows (then give it last)")
            ->type_name("[FILE]")
            ->expected(0, 1);
    command
        ->add_option("-o,--output,--heat", options->heat,
                     "Also write the signed relative error as a PNG: blue where the image is darker, red where it is brighter")
        ->type_name("FILE");
    command->add_option("--heat-range", options->heat_range, "Relative error that gets the full colour")
        ->type_name("X")
        ->capture_default_str()
        ->check(number_between(1e-6, 1e6));
    command->add_option("--trim", options->trim_percent, "Share of the largest terms that the trimmed relMSE leaves out")
        ->type_name("PERCENT")
        ->capture_default_str()
        ->check(number_between(0.0, 99.9));
    command->add_option("--regions", options->regions, "Also print the mean ratio of every cell of a grid, for example 3x3")
        ->type_name("CxR");
    command->footer(kFooter);
    command->callback([options, json, exit_code] {
        options->json_wanted = json->count() > 0;
        *exit_code = run(*options);
    });
}

}  // namespace lightloom::client
