// lightloom report: the results of a benchmark as one page.

#include <array>
#include <cstdio>
#include <filesystem>
#include <memory>
#include <set>

#include "client/bench/verdicts.h"
#include "client/commands.h"
#include "client/html.h"
#include "client/output_files.h"
#include "client/report/charts.h"
#include "client/report/gnuplot.h"
#include "client/report/page.h"
#include "common/cli/command_line.h"
#include "common/core/atomic_file.h"

namespace lightloom::client {
namespace {

using namespace report;
namespace fs = std::filesystem;

constexpr const char* kFooter = R"(Examples:
  lightloom report quick.jsonl                                to quick.html
  lightloom report quick.jsonl -o report.html --svg charts    also every chart as a file of its own
  lightloom report monday.jsonl tuesday.jsonl -o both.html    runs of both, by scene and algorithm

RESULTS are the lines of `lightloom bench`; pictures are looked for in RESULTS with ".images" in place of ".jsonl". The page
needs nothing else, follows the reader's light or dark mode, and prints. Per scene it has error against time and against
samples, the Pareto front of both, the speed-up to equal error over the first algorithm with intervals, estimated against
true error, light and noise by technique, and the images. It explains its own terms.

Charts are drawn by gnuplot (apt-get install gnuplot-nox).

Exit code 0 if everything was written, 2 if results cannot be read or gnuplot is not there; then nothing was written.)";

struct ReportOptions {
    std::vector<std::string> results;
    std::string output, svg;
};

int refuse(const Status& status) {
    std::fprintf(stderr, "lightloom: %s\n", status.message().c_str());
    return kUsage;
}

/// A name for files: letters, digits and "-".
std::string file_name(const std::string& title) {
    std::string out;
    for (const char c : title) {
        const bool plain = (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '_' || c == '.';
        if (plain) out += c;
        if (!plain && !out.empty() && out.back() != '-') out += '-';
    }
    return out;
}

/// What the names of a chart's elements begin with.
std::string chart_id(int number) {
    char text[16];
    std::snprintf(text, sizeof text, "c%d-", number);
    return text;
}

struct SvgFile {
    std::string name, text;
};

/// Draws all charts. `files` are the charts alone.
Result<std::vector<Drawn>> draw(const Results& results, const Comparison& comparison, std::vector<SvgFile>* files) {
    std::vector<Drawn> drawn;
    std::set<std::string> names;
    int number = 0;
    for (const Panel& panel : comparison.panels) {
        Drawn& panel_drawn = drawn.emplace_back();
        std::string name = file_name(panel.title);
        while (!names.insert(name).second) name += '-';  // Two titles may differ in characters that names of files do not have.
        for (const ChartScript& chart : chart_scripts(panel, results)) {
            const Result<std::string> svg = run_gnuplot(chart.script);
            if (!svg.ok()) return svg.status();
            const std::string description = escaped_html(chart.description);
            panel_drawn.charts.push_back({chart.name, svg_of_page(*svg, chart_id(++number), description)});
            files->push_back({name + "-" + chart.name + ".svg", svg_alone(*svg, description)});
        }
        panel_drawn.strip = make_strip(panel);
    }
    return drawn;
}

Status write_all(const ReportOptions& options, const std::string& page, const std::vector<SvgFile>& files) {
    if (!options.svg.empty()) {
        std::error_code error;
        fs::create_directories(options.svg, error);
        if (error) return invalid_argument(options.svg + ": no folder can be made here: " + error.message());
        for (const SvgFile& file : files)
            LL_RETURN_IF_ERROR(write_file_atomically((fs::path(options.svg) / file.name).string(), file.text));
    }
    return write_file_atomically(options.output, page);
}

int run(ReportOptions options) {
    if (options.output.empty()) options.output = fs::path(options.results.front()).replace_extension(".html").string();
    const std::vector<fs::path> inputs(options.results.begin(), options.results.end());
    if (const Status s = check_output_files(inputs, std::array{options.output}); !s.ok()) return refuse(s);
    const Result<Results> results = read_results(options.results);
    if (!results.ok()) return refuse(results.status());
    if (results->runs.empty()) {
        return refuse(invalid_argument(options.results.front() + ": no run has ended yet: let the bench go on, with --resume"));
    }
    if (const Status s = find_gnuplot(); !s.ok()) return refuse(s);
    const Comparison comparison = compare_results(*results);
    std::vector<SvgFile> files;
    Result<std::vector<Drawn>> drawn = draw(*results, comparison, &files);
    if (!drawn.ok()) return refuse(drawn.status());
    Result<std::vector<Judged>> judged = judge_results(results->lines);
    if (!judged.ok()) {
        const std::string source = options.results.size() == 1 ? options.results.front() : "the files together";
        return refuse(invalid_argument(source + ": " + judged.status().message()));
    }
    const Report report{*results, comparison, *std::move(drawn), *std::move(judged), options.results};
    if (const Status s = write_all(options, report_page(report), files); !s.ok()) return refuse(s);
    for (const std::string& note : results->notes) std::fprintf(stderr, "lightloom: note: %s\n", note.c_str());
    for (const Drawn& panel : report.drawn)
        for (const std::string& note : panel.strip.notes) std::fprintf(stderr, "lightloom: note: %s\n", note.c_str());
    std::printf("%s\n", options.output.c_str());
    return kSuccess;
}

}  // namespace

void add_report_command(cli::App app, int* exit_code) {
    auto options = std::make_shared<ReportOptions>();
    const cli::App command = app.add_subcommand("report", "Make a page with charts of what bench measured");
    command->add_option("RESULTS", options->results, "Lines of lightloom bench; several files are reported together")
        ->type_name("FILE...")
        ->required();
    command->add_option("-o,--output", options->output, "The page (default: RESULTS with .html)")->type_name("FILE");
    command->add_option("--svg", options->svg, "Also write every chart as an SVG file, for white paper, into this folder")
        ->type_name("DIR");
    command->footer(kFooter);
    command->callback([options, exit_code] { *exit_code = run(*options); });
}

}  // namespace lightloom::client
