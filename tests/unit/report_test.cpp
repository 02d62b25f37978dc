// What a report reads, what it computes from it, and what stands on its page.

#include <gtest/gtest.h>
#include <unistd.h>

#include <cmath>
#include <filesystem>

#include "client/html.h"
#include "client/report/charts.h"
#include "client/report/gnuplot.h"
#include "client/report/page.h"
#include "client/report/plot.h"
#include "client/report/tables.h"
#include "common/core/atomic_file.h"
#include "common/film/exr_io.h"
#include "tests/support/bench_lines.h"
#include "tests/support/temp_directory.h"

namespace lightloom::client::report {
namespace {

namespace fs = std::filesystem;
using testing::BenchLine;
using testing::MadeRun;
using testing::scene_line;
using testing::start_line;
using testing::text_of;

Curve power_law(double at_one, double from, double to, double exponent = -1) {
    Curve curve;
    for (double x = from; x < to * 1.0001; x *= 1.3) curve.x.push_back(x), curve.y.push_back(at_one * std::pow(x, exponent));
    return curve;
}

TimedRun timed(double at_one, double seconds_per_iteration, double preparation = 0, int to = 100) {
    TimedRun run{{}, preparation};
    for (int n = 1; n <= to; n = n * 5 / 4 + 1) run.points.push_back({double(n), n * seconds_per_iteration, at_one / n});
    return run;
}

std::vector<BenchLine> made(const std::vector<MadeRun>& runs) {
    std::vector<BenchLine> lines;
    for (const MadeRun& run : runs)
        for (BenchLine& line : run.lines()) lines.push_back(std::move(line));
    return lines;
}

/// Three scenes, four algorithms, five seeds.
std::vector<BenchLine> suite() {
    std::vector<BenchLine> lines{start_line()};
    for (const std::string scene : {"slit", "lamps", "easy"}) {
        const double floor = scene == "slit" ? 1e-4 : scene == "easy" ? 0.02 : 0;
        lines.push_back(scene_line(scene, floor));
        for (const std::string label : {"path", "bdpt", "bdpt:heuristic=power", "spcbpt"}) {
            for (uint64_t seed = 1; seed <= 5; ++seed) {
                MadeRun run{scene, label, seed};
                run.error = scene == "easy" ? 1 : label == "path" ? 30 : 3;
                run.floor = floor;
                run.noise = 0.2;
                run.preparation = label == "spcbpt" ? 1.5 : 0;
                run.finished = !(label == "spcbpt" && seed == 5 && scene == "lamps");
                run.estimates = scene != "easy";
                for (BenchLine& line : run.lines()) {
                    if (line["type"] == "run" && scene == "lamps")
                        line["cut"] = {{"asked", {{"seconds", 10}}}, {"given_seconds", 4.5}}, line["budget"] = {{"seconds", 4.5}};
                    if (line["type"] == "run" && label == "path") line["capped"] = true, line["threshold_percent"] = 12;
                    lines.push_back(std::move(line));
                }
            }
        }
    }
    lines.push_back({{"type", "cut"}, {"scene", "lamps"}, {"what", "time of each run 10 -> 4.5 s"}});
    lines.push_back({{"type", "techniques"},
                     {"scene", "slit"},
                     {"label", "bdpt"},
                     {"classes",
                      {{{"name", "emitter hits"}, {"light", 0.25}, {"noise", 0.5}},
                       {{"name", "s = 1"}, {"light", 0.75}, {"noise", 0.5}},
                       {{"name", "merging"}, {"light", 0.0}}}}});
    return lines;
}

Results read(const std::vector<BenchLine>& lines) {
    Results results;
    const Status status = add_results(text_of(lines), "r.jsonl", &results);
    EXPECT_TRUE(status.ok()) << status.message();
    return results;
}

std::string fault(const std::string& text) {
    Results results;
    return add_results(text, "r.jsonl", &results).message();
}

std::string fault(std::vector<BenchLine> lines) { return fault(text_of(lines)); }

TEST(Median, IsTheMiddle) {
    EXPECT_EQ(median({3, 1, 2}), 2);
    EXPECT_EQ(median({4, 1, 2, 8}), 3);
    EXPECT_TRUE(std::isnan(median({})));
    EXPECT_FALSE(median_error({1}));
    EXPECT_EQ(*median_error({2, 2, 2}), 0);
    std::vector<double> normal;
    Rng rng(RngKey{1});
    for (int i = 0; i < 100; ++i) {
        double sum = 0;
        for (int k = 0; k < 12; ++k) sum += rng.uniform_double();
        normal.push_back(sum - 6);
    }
    EXPECT_NEAR(*median_error(normal), 0.125, 0.05) << "sqrt(pi / 2) / 10";
}

TEST(SeedBand, MeetsPowerLawsExactlyWhereAllSeedsAre) {
    const std::vector<Curve> curves{power_law(1, 1, 100), power_law(2, 1.7, 300), power_law(4, 0.5, 90)};
    const Band band = seed_band(curves);
    ASSERT_EQ(band.x.size(), 25u);
    EXPECT_NEAR(band.x.front(), 1.7, 1e-9);
    EXPECT_NEAR(band.x.back(), std::min(curves[0].x.back(), curves[2].x.back()), 1e-9);
    for (size_t i = 0; i < band.x.size(); ++i) {
        EXPECT_NEAR(band.low[i] * band.x[i], 1, 1e-9);
        EXPECT_NEAR(band.middle[i] * band.x[i], 2, 1e-9);
        EXPECT_NEAR(band.high[i] * band.x[i], 4, 1e-9);
    }
    const Band apart = seed_band(std::vector<Curve>{{{1}, {3}}, {{2}, {5}}});
    EXPECT_EQ(apart.x, std::vector<double>{1.5});
    EXPECT_EQ(apart.middle, std::vector<double>{4});
    EXPECT_EQ(seed_band(std::vector<Curve>{curves[0]}).x, curves[0].x);
    EXPECT_TRUE(seed_band({}).x.empty());
}

TEST(ParetoFront, ChangesWhereCurvesCross) {
    // 1 / x falls below 0.1 x^-1/2 at x = 100; the third curve is never the best.
    const std::vector<Curve> curves{power_law(1, 1, 1000), power_law(0.1, 10, 1000, -0.5), power_law(5, 1, 1000)};
    const std::vector<FrontPiece> front = pareto_front(curves);
    ASSERT_EQ(front.size(), 3u);
    EXPECT_EQ(front[0].curve, 0u);
    EXPECT_EQ(front[1].curve, 1u);
    EXPECT_EQ(front[2].curve, 0u);
    EXPECT_NEAR(front[1].line.x.front(), curves[1].x.front(), 0.3);
    EXPECT_NEAR(front[2].line.x.front(), 100, 3);
    for (const FrontPiece& piece : front)
        for (size_t i = 1; i < piece.line.y.size(); ++i) EXPECT_LE(piece.line.y[i], piece.line.y[i - 1]);
    EXPECT_TRUE(pareto_front({}).empty());
}

TEST(SpeedUps, AreKnownOnPowerLaws) {
    // relMSE 0.1 takes 100 iterations of 0.5 s, or 40 of 0.25 s after 2 s of preparation.
    const std::vector<TimedRun> slow(3, timed(10, 0.5, 0, 150)), fast(3, timed(4, 0.25, 2));
    const auto found = speed_up(slow, fast, 0.1);
    ASSERT_TRUE(found);
    EXPECT_NEAR(found->factor, 50.0 / 12, 1e-9);
    EXPECT_NEAR(*found->log_error, 0, 1e-12);
    EXPECT_FALSE(found->at_least || found->at_most || found->extrapolated);
    EXPECT_FALSE(speed_up(slow, {}, 0.1));
    EXPECT_FALSE(speed_up(slow, std::vector<TimedRun>{timed(4, 1)}, 0.1)->low) << "one seed has no interval";
}

TEST(SpeedUps, IntervalsAndBoundsAreMarked) {
    const std::vector<TimedRun> base{timed(9, 1), timed(10, 1), timed(11, 1)};
    const auto found = speed_up(base, std::vector<TimedRun>{timed(5, 1), timed(4.5, 1), timed(5.5, 1)}, 0.2);
    EXPECT_NEAR(found->factor, 2, 1e-9);
    EXPECT_LT(*found->low, 2);
    EXPECT_GT(*found->high, 2);
    EXPECT_NEAR(*found->low * *found->high, 4, 1e-9);
    EXPECT_EQ(to_text(*found), "2×");

    const auto better = speed_up(base, std::vector<TimedRun>{timed(0.1, 1)}, 0.2);
    EXPECT_TRUE(better->at_least);
    EXPECT_EQ(to_text(*better).substr(0, 3), "≥");
    const auto far = speed_up(base, std::vector<TimedRun>{timed(1000, 1)}, 0.2);
    EXPECT_TRUE(far->extrapolated);
    EXPECT_NEAR(far->factor, 0.01, 1e-4) << "by the law n^-1/2 of the root";
    TimedRun flat{{{1, 1, 3}, {10, 10, 2.9}, {20, 20, 2.9}, {40, 40, 2.8}}, 0};
    EXPECT_TRUE(speed_up(base, std::vector<TimedRun>{flat}, 0.2)->at_most);

    const std::vector<SpeedUp> factors{*found, SpeedUp{.factor = 8, .log_error = 0.0}};
    const auto mean = geometric_mean(factors);
    EXPECT_NEAR(mean->factor, 4, 1e-9);
    EXPECT_NEAR(*mean->log_error, *found->log_error / 2, 1e-12);
    EXPECT_FALSE(geometric_mean({}));
}

TEST(Labels, KeepTheirDistanceAndTheirOrder) {
    const std::vector<double> heights = spread_labels({0.5, 0.5, 0.98, 0.97, -3}, 0.1);
    EXPECT_NEAR(heights[4], 0, 1e-12);
    EXPECT_GE(heights[2] - heights[3], 0.1 - 1e-12);
    EXPECT_LE(heights[2], 1);
    EXPECT_GE(std::fabs(heights[0] - heights[1]), 0.1 - 1e-12);
}

TEST(AxisOfChart, HasAFewNamedTics) {
    const auto names = [](double low, double high) {
        const std::string tics = Axis{low, high}.tics();
        int count = 0;
        for (size_t at = 0; (at = tics.find(" 0", at)) != std::string::npos; ++at) ++count;
        return count;
    };
    for (const double factor : {4.0, 9.0, 50.0, 1e3, 1e7, 1e20}) {
        EXPECT_GE(names(0.023, 0.023 * factor), 2) << factor;
        EXPECT_LE(Axis::around(std::vector<double>{1, 1}).low, 0.51);
    }
    EXPECT_NEAR((Axis{1, 100}.position(10)), 0.5, 1e-12);
}

TEST(Results, AreReadWithNotesOnWhatIsLeftOut) {
    std::vector<BenchLine> lines{start_line(), scene_line("slit", 1e-4)};
    MadeRun whole{"slit", "path"}, killed{"slit", "bdpt"};
    killed.finished = false;
    for (BenchLine& line : made({whole, killed})) lines.push_back(std::move(line));
    Results results;
    ASSERT_TRUE(add_results(text_of(lines) + "{\"type\":\"ru", "r.jsonl", &results).ok());
    ASSERT_EQ(results.runs.size(), 1u);
    EXPECT_EQ(results.runs[0].end().iterations, 100);
    EXPECT_EQ(results.runs[0].curve.size(), whole.lines().size() - 1) << "the last checkpoint and the run's line are one point";
    EXPECT_EQ(results.runs[0].image, "r.images/slit-path-1.exr");
    ASSERT_EQ(results.notes.size(), 2u);
    EXPECT_NE(results.notes[0].find("r.jsonl:" + std::to_string(lines.size() + 1) + ": the beginning of a line"),
              std::string::npos);
    EXPECT_EQ(results.notes[1], "r.jsonl: slit, bdpt, seed 1 did not end and is left out");
    EXPECT_EQ(results.scene("slit")->max_depth, 20);
    EXPECT_EQ(results.scene("none"), nullptr);
}

TEST(Results, ARunThatBeganAgainCountsOnce) {
    MadeRun run{"slit", "path"}, killed = run;
    killed.finished = false;
    killed.error = 99;
    std::vector<BenchLine> lines{start_line(), scene_line("slit", 0)};
    for (BenchLine& line : killed.lines()) lines.push_back(std::move(line));
    lines.push_back(start_line());
    for (BenchLine& line : run.lines()) lines.push_back(std::move(line));
    const Results results = read(lines);
    ASSERT_EQ(results.runs.size(), 1u);
    EXPECT_EQ(results.runs[0].curve.front().relmse, 1);
    EXPECT_TRUE(results.notes.empty());
}

TEST(Results, FaultsAreOneLineWithTheirPlace) {
    EXPECT_NE(fault("").find("r.jsonl:1: no results"), std::string::npos);
    EXPECT_NE(fault("hello\nworld\n").find("r.jsonl:1: this is no line of JSON"), std::string::npos);
    EXPECT_NE(fault(std::vector{scene_line("a", 0)}).find("begins with a line of type \"start\""), std::string::npos);
    BenchLine old = start_line();
    old["format"] = "lightloom-bench 1";
    EXPECT_NE(fault(std::vector{old}).find("r.jsonl:1: the format is \"lightloom-bench 1\""), std::string::npos);
    BenchLine run = MadeRun{"slit", "path"}.lines().back();
    EXPECT_NE(fault(std::vector{start_line(), run}).find("r.jsonl:2: no line of type \"scene\""), std::string::npos);
    for (const char* key : {"relmse", "iterations", "seconds", "run", "label", "seed", "budget"}) {
        BenchLine bad = run;
        bad.erase(key);
        const std::string message = fault(std::vector{start_line(), scene_line("slit", 0), bad});
        EXPECT_EQ(message, "r.jsonl:3: \"" + std::string(key) + "\" is missing in this line");
    }
    run["relmse"] = "small";
    EXPECT_NE(fault(std::vector{start_line(), scene_line("slit", 0), run}).find("\"relmse\" of this line must be a number"),
              std::string::npos);
    EXPECT_NE(fault(text_of({start_line()}) + "{\"type\":\"ru\n" + text_of({scene_line("slit", 0)})).find("r.jsonl:2: "),
              std::string::npos)
        << "half a line that others follow";
}

TEST(Results, OfSeveralFilesBelongToTheSameScenes) {
    const auto file = [](const MadeRun& run, BenchLine scene) {
        std::vector<BenchLine> lines{start_line(), std::move(scene)};
        for (BenchLine& line : run.lines()) lines.push_back(std::move(line));
        return text_of(lines);
    };
    const MadeRun path{"slit", "path"}, bdpt{"slit", "bdpt"};
    Results results;
    ASSERT_TRUE(add_results(file(path, scene_line("slit", 0)), "a.jsonl", &results).ok());
    ASSERT_TRUE(add_results(file(bdpt, scene_line("slit", 0)), "b.jsonl", &results).ok());
    EXPECT_EQ(results.runs.size(), 2u);
    EXPECT_EQ(results.scenes.size(), 1u);
    EXPECT_NE(add_results(file(path, scene_line("slit", 0)), "a.jsonl", &results).message().find("give each file once"),
              std::string::npos);
    std::vector<BenchLine> tuesday{start_line(), scene_line("slit", 0)};
    for (BenchLine& line : path.lines()) {
        line["run"] = "another key";  // as of another build
        tuesday.push_back(std::move(line));
    }
    ASSERT_TRUE(add_results(text_of(tuesday), "days/tuesday.jsonl", &results).ok());
    EXPECT_EQ(results.runs.back().label, "path (tuesday)") << "the same seed of another day";
    BenchLine other = scene_line("slit", 0);
    other["scene_digest"] = "another";
    ASSERT_TRUE(add_results(file(MadeRun{"slit", "light"}, other), "c.jsonl", &results).ok());
    ASSERT_EQ(results.scenes.size(), 2u) << "another scene of the same name";
    EXPECT_EQ(results.scenes[1].name, "slit (made-up)");
    EXPECT_EQ(results.runs.back().scene, "slit (made-up)");
    other["scene_digest"] = "a third";
    EXPECT_NE(add_results(file(MadeRun{"slit", "lvcbpt"}, other), "d.jsonl", &results).message().find("d.jsonl:2: scene \"slit"),
              std::string::npos);
    EXPECT_FALSE(read_results(std::vector<std::string>{"/nowhere.jsonl"}).ok());
}

TEST(Panels, HoldKnownFigures) {
    std::vector<BenchLine> lines{start_line(), scene_line("slit", 1e-3)};
    for (uint64_t seed = 1; seed <= 3; ++seed) {
        MadeRun slow{"slit", "path", seed}, fast{"slit", "bdpt", seed};
        slow.error = 4, slow.floor = 1e-3;
        fast.error = 1, fast.floor = 1e-3, fast.preparation = 1;
        for (BenchLine& line : made({slow, fast})) lines.push_back(std::move(line));
    }
    const Results results = read(lines);
    const Comparison comparison = compare_results(results);
    ASSERT_EQ(comparison.panels.size(), 1u);
    const Panel& panel = comparison.panels[0];
    ASSERT_EQ(panel.series.size(), 2u);
    EXPECT_NEAR(panel.series[0].error, 0.04, 1e-9);
    EXPECT_NEAR(panel.level, 0.04, 1e-9);
    // 0.04 after 100 iterations or 25, of 0.1 s, the latter after 1 s of preparation.
    EXPECT_NEAR(panel.series[1].speed_up->factor, 10 / 3.5, 1e-6);
    EXPECT_NEAR(comparison.means[1]->factor, 10 / 3.5, 1e-6);
    EXPECT_NEAR(panel.series[1].seconds, 11, 1e-9);
    EXPECT_NEAR(panel.series[1].error, 0.01, 1e-9);
    EXPECT_FALSE(panel.series[1].near_floor);
    EXPECT_GT(panel.series[0].tracking.checkpoints, 3);
    EXPECT_EQ(panel.series[0].tracking.within, panel.series[0].tracking.checkpoints);
    const Checkpoint below{.relmse = 9e-4, .relmse_own = -1e-4};
    EXPECT_NEAR(shown_error(below, *panel.scene), 1e-4, 1e-12) << "a tenth of the reference's noise";
}

TEST(Panels, AreOnePerBudget) {
    std::vector<BenchLine> lines{start_line(), scene_line("slit", 0)};
    for (BenchLine& line : made({{"slit", "path", 1}, {"slit", "path", 2}})) {
        if (line["seed"] == 2) line["budget"] = {{"samples", 64}};
        lines.push_back(std::move(line));
    }
    const Results results = read(lines);
    const Comparison comparison = compare_results(results);
    ASSERT_EQ(comparison.panels.size(), 2u);
    EXPECT_EQ(comparison.panels[0].title, "slit, 10 s");
    EXPECT_EQ(comparison.panels[1].title, "slit, 64 samples per pixel");
}

TEST(Html, EscapesAndEmbeds) {
    EXPECT_EQ(escaped_html("<a href=\"x\">&"), "&lt;a href=&quot;x&quot;&gt;&amp;");
    EXPECT_EQ(data_url("image/png", "Man"), "data:image/png;base64,TWFu");
    EXPECT_EQ(data_url("a/b", "Ma"), "data:a/b;base64,TWE=");
    EXPECT_EQ(data_url("a/b", std::string("\xff\x00\x10\x80", 4)), "data:a/b;base64,/wAQgA==");
    EXPECT_EQ(number_html(0.01234), "0.0123");
    EXPECT_EQ(number_html(4096), "4096");
    EXPECT_EQ(number_html(1.234e-6), "1.23 · 10<sup>−6</sup>");
    EXPECT_EQ(seconds_text(125), "2 min 5 s");
    EXPECT_EQ(quoted("it's"), "'it''s'");
}

/// Pictures beside the results, but for one.
void write_images(const std::string& directory) {
    fs::create_directories(directory);
    ExrImage image;
    image.frame = {16, 12, {0, 0, 16, 12}};
    image.color = {16, 12, std::vector<float>(size_t(16) * 12 * 3, 0.5f)};
    for (const char* name : {"slit-reference", "slit-path-1", "slit-bdpt-1", "slit-bdpt:heuristic=power-1"})
        ASSERT_TRUE(write_exr(directory + "/" + name + ".exr", image).ok());
}

TEST(Page, HasEverySectionAndNothingFromElsewhere) {
    if (const Status found = find_gnuplot(); !found.ok()) GTEST_SKIP() << found.message();
    const testing::TempDirectory directory;
    ASSERT_TRUE(write_file_atomically(directory.file("r.jsonl"), text_of(suite())).ok());
    write_images(directory.file("r.images"));
    const Result<Results> results = read_results(std::vector<std::string>{directory.file("r.jsonl")});
    ASSERT_TRUE(results.ok()) << results.status().message();
    const Comparison comparison = compare_results(*results);
    ASSERT_EQ(comparison.panels.size(), 3u);
    std::vector<Drawn> drawn;
    for (const Panel& panel : comparison.panels) {
        Drawn& one = drawn.emplace_back();
        for (const ChartScript& chart : chart_scripts(panel, *results)) {
            const Result<std::string> svg = run_gnuplot(chart.script);
            ASSERT_TRUE(svg.ok()) << svg.status().message() << "\n" << chart.script;
            one.charts.push_back({chart.name, svg_of_page(*svg, "p-", "a chart")});
            const std::string alone = svg_alone(*svg, "a chart");
            EXPECT_EQ(alone.find("var("), std::string::npos);
            EXPECT_NE(alone.find("xmlns="), std::string::npos);
            for (const char* marker : {"rgb( 10", "rgb(10,", "rgb(1,1,1)", "#fefefe", "#FEFEFE", "gnuplot_"})
                EXPECT_EQ(alone.find(marker), std::string::npos) << marker << " in " << chart.name;
        }
        one.strip = make_strip(panel);
    }
    EXPECT_EQ(drawn[0].charts.size(), 6u);
    EXPECT_EQ(drawn[2].charts.size(), 4u) << "no estimates and no techniques";
    ASSERT_EQ(drawn[0].strip.pictures.size(), 4u);
    ASSERT_EQ(drawn[0].strip.notes.size(), 1u);
    EXPECT_NE(drawn[0].strip.notes[0].find("slit-spcbpt-1.exr"), std::string::npos);
    Result<std::vector<Judged>> judged = judge_results(results->lines);
    ASSERT_TRUE(judged.ok()) << judged.status().message();
    const Report report{*results, comparison, std::move(drawn), *std::move(judged), {"r.jsonl"}};
    const std::string page = report_page(report);
    for (const char* part : {"<title>made-up: speed and accuracy</title>",
                             "geometric mean",
                             "id=verdicts",
                             "What the budget cut",
                             "4.5 s",
                             "What is left out",
                             "slit &amp; its claim",
                             "error against time",
                             "error against samples",
                             "least error for the time",
                             "speed-up to equal error",
                             "estimated against true error",
                             "light and noise by technique",
                             "Images after equal time",
                             "signed error",
                             "How to read this",
                             "id=origin",
                             "A &lt;fast&gt; one",
                             "near the reference’s noise",
                             "12 % MAPE not reached",
                             "cut to 4.5 s",
                             "bdpt:heuristic=power",
                             "prefers-color-scheme:dark",
                             "@media print",
                             "noise of the reference"})
        EXPECT_NE(page.find(part), std::string::npos) << part;
    for (const char* part : {"http", "url(", "<script", "src=\"/", "xlink", ">nan", ">inf", "id=\"gnuplot_"}) {
        const size_t at = page.find(part);
        EXPECT_EQ(at, std::string::npos) << part << ": " << page.substr(at > 60 ? at - 60 : 0, 120);
    }
}

TEST(Gnuplot, FailsInOneClearLine) {
    const Status absent = find_gnuplot("no-such-gnuplot");
    EXPECT_EQ(absent.code(), StatusCode::kFailedPrecondition);
    EXPECT_NE(absent.message().find("apt-get install gnuplot-nox"), std::string::npos);
    if (const Status found = find_gnuplot(); !found.ok()) GTEST_SKIP() << found.message();
    const Result<std::string> bad = run_gnuplot("plot nothing with nowhere\n");
    ASSERT_FALSE(bad.ok());
    EXPECT_EQ(bad.status().message().find('\n'), std::string::npos);
    EXPECT_NE(bad.status().message().find("gnuplot refuses"), std::string::npos);
}

}  // namespace
}  // namespace lightloom::client::report
