#include "client/report/page.h"

#include <algorithm>
#include <cstdio>
#include <set>

#include "client/html.h"
#include "client/report/gnuplot.h"
#include "client/report/tables.h"

namespace lightloom::client::report {
namespace {

// Colours come before this, as variables of :root.
constexpr const char* kStyle = R"(
*{box-sizing:border-box}
html{-webkit-text-size-adjust:100%}
body{margin:0 auto;max-width:1360px;padding:1.6rem clamp(.9rem,3vw,2rem) 3rem;background:var(--page);color:var(--text);font:15px/1.5 system-ui,sans-serif;font-variant-numeric:tabular-nums}
h1{font-size:1.75rem;line-height:1.2;margin:0 0 .3rem;letter-spacing:-.01em;overflow-wrap:anywhere}
h2{font-size:1.3rem;line-height:1.25;margin:0 0 .3rem;overflow-wrap:anywhere}
h3{font-size:1rem;margin:1.6rem 0 .5rem}
p{margin:.3rem 0;max-width:48rem}
section{margin-top:2.6rem;padding-top:1.2rem;border-top:1px solid var(--grid)}
small,.soft,figcaption{color:var(--soft)}
small{font-size:.82em}
a{color:inherit;text-decoration-color:var(--axis);text-underline-offset:.18em}
a:focus-visible{outline:2px solid var(--s0);outline-offset:2px}
code{font-size:.92em}
nav{margin:.9rem 0 0;display:flex;flex-wrap:wrap;gap:.2rem 1.1rem}
.claim{font-size:1.05rem}
.scroll{overflow-x:auto;margin:.7rem 0}
table{border-collapse:collapse;background:var(--ground)}
th,td{padding:.32rem .75rem;text-align:left;vertical-align:baseline;font-weight:400;border-bottom:1px solid var(--grid)}
th small,td small{white-space:nowrap}
td.words small{white-space:normal}
thead th{color:var(--soft);font-size:.85rem;line-height:1.25;vertical-align:bottom;border-bottom:1px solid var(--axis)}
tbody th,tfoot th{overflow-wrap:anywhere;min-width:7.5rem;max-width:17rem}
thead th{max-width:11rem;overflow-wrap:anywhere}
tfoot>tr>*{border-top:1px solid var(--axis);border-bottom:0}
tfoot th{font-weight:600}
.n{text-align:right;white-space:nowrap}
td b{font-weight:600}
.up{background:rgb(var(--faster)/var(--a))}
.down{background:rgb(var(--slower)/var(--a))}
.key{font-size:.9em}
.verdicts .t{white-space:nowrap}
.group th{padding-top:1.1rem;font-weight:600;white-space:normal;border-bottom-color:var(--axis)}
.group small{font-weight:400;white-space:normal;margin-left:.5em}
.words{min-width:19rem;max-width:34rem}
.chip{display:inline-block;white-space:nowrap;border:1px solid;border-radius:4px;padding:0 .45em;font-size:.87em;font-weight:600;line-height:1.5}
.mark{font-size:.8em}
.good{color:var(--good)}.warn{color:var(--warn)}.bad{color:var(--bad)}.none{color:var(--soft)}
.charts{display:grid;grid-template-columns:repeat(auto-fill,minmax(min(100%,380px),1fr));gap:1.2rem 1.4rem;margin-top:1.1rem}
figure{margin:0;min-width:0}
.charts svg{display:block;width:100%;height:auto;max-width:560px;background:var(--ground)}
figcaption{font-size:.85rem;line-height:1.4;padding:.3rem .2rem 0}
.strip{display:grid;grid-template-columns:repeat(auto-fill,minmax(min(46%,180px),1fr));gap:1rem .8rem}
.strip figure{max-width:400px}
.strip img{display:block;width:100%;height:auto;background:#000;image-rendering:pixelated}
.strip img+img{margin-top:3px}
.strip figcaption{overflow-wrap:anywhere}
.strip figcaption b{color:var(--text);font-weight:600}
.scale{display:inline-block;width:7.5em;height:.7em;margin:0 .5em;vertical-align:baseline;border:1px solid var(--axis);background:linear-gradient(90deg,#00f,#fff,#f00)}
dl{display:grid;grid-template-columns:minmax(7rem,max-content) 1fr;gap:.45rem 1.2rem;max-width:62rem;margin:.8rem 0}
dt{font-weight:600}dd{margin:0}
ul{margin:.4rem 0;padding-left:1.2rem;max-width:60rem}
@media(max-width:640px){
body{font-size:14px}
th,td{padding:.3rem .5rem}
dl{display:block}dt{margin-top:.6rem}
.charts{gap:1rem}
}
@media print{
:root{--page:#fff}
@page{size:A4 portrait;margin:12mm}
body{max-width:none;padding:0;font-size:9.5pt;print-color-adjust:exact;-webkit-print-color-adjust:exact}
h1{font-size:17pt}h2{font-size:13pt}
nav{display:none}
section{margin-top:6mm;padding-top:4mm}
.scene{break-before:page;border:0;margin:0;padding:0}
.scroll{overflow:visible}
table{font-size:8pt;width:100%}
th,td{padding:1mm 1.6mm}
thead th{font-size:7.5pt}
tbody th{white-space:normal}
.words{min-width:0;max-width:none}
.charts{grid-template-columns:1fr 1fr;gap:4mm 5mm}
.strip{grid-template-columns:repeat(6,1fr);gap:2.5mm}
figcaption{font-size:8pt}
figure,tr{break-inside:avoid}
h2,h3{break-after:avoid}
}
)";

constexpr const char* kLight = "--page:#fdfcfa;--faster:0 120 150;--slower:200 90 0;--good:#1c6b3c;--warn:#8a5a00;--bad:#a8201a;";
constexpr const char* kDark = "--page:#161616;--faster:60 160 190;--slower:215 120 40;--good:#6fcf93;--warn:#f0b84a;--bad:#ff8a80;";

constexpr const char* kReading = R"(<section id=reading><h2>How to read this</h2>
<dl>
<dt>relMSE</dt><dd>Mean over pixels and channels of (x − r)² / (r² + 0.01) of image x and reference r. Where the reference’s own
noise is known, it is subtracted; of that noise a tenth is the least that is shown.</dd>
<dt>Noise of the reference</dt><dd>The dashed line. Open symbols and the remark “near the reference’s noise” stand below three times
that: an error there is not converged, it only cannot be measured better.</dd>
<dt>Lines and bands</dt><dd>Median over the seeds, and from the least to the greatest seed, at equal time or samples. Runs
are interpolated on straight lines in log-log coordinates, and over the range that all of them cover.</dd>
<dt>Error in tables</dt><dd>Median over the seeds at the end of the runs, ± its standard error (bootstrap over the seeds).</dd>
<dt>Time</dt><dd>Preparation (what an algorithm learns first) and rendering together, as one run takes it.</dd>
<dt>Least error for the time</dt><dd>The Pareto front: at each time the least median error that any algorithm has reached. Who is not on
it is beaten by another at every time.</dd>
<dt>Speed-up</dt><dd>How many times sooner an algorithm comes to the error with which the first one ends, as the ratio of
the geometric means over the seeds. Interval: 95 %, Student’s t on the logarithm with a jackknife over the seeds.
≥: its first checkpoint was better already. ≤: its error does not fall as n<sup>−1/2</sup> yet. ~: extrapolated by that law to more
than twice the run. ?: bounds of both kinds. In the summary the tint is left out where the interval holds 1; the interval of a geometric mean says what the seeds leave
open, not what other scenes would give.</dd>
<dt>Estimated error</dt><dd>What a run says of its own relMSE, from its independent groups and without a reference. “Within 1.5×” counts
checkpoints of the last three octaves of samples, all seeds, away from the reference’s noise.</dd>
<dt>Light and noise by technique</dt><dd>Shares of the image’s light, and of the noise of all techniques.</dd>
<dt>Signed error</dt><dd>Of the luminance, relative to the reference’s + 0.01: <span class=scale></span> from −100 % (blue: darker) over
none (white) to +100 % (red: brighter).</dd>
<dt>Fireflies</dt><dd>Pixels far above what the reference has there, and the light in them.</dd>
<dt>Slope</dt><dd>Of the logarithm of the root of relMSE over that of samples: −0.5 where the variance is finite.</dd>
<dt>Spread</dt><dd>Greatest over least relMSE among the seeds at the end.</dd>
</dl></section>
)";

std::string list(const std::vector<std::string>& items) {
    std::string out = "<ul>\n";
    for (const std::string& item : items) out += "<li>" + item + "</li>\n";
    return out + "</ul>\n";
}

std::string join(const std::set<std::string>& parts) {
    std::string out;
    for (const std::string& part : parts)
        if (!part.empty()) out += (out.empty() ? "" : ", ") + escaped_html(part);
    return out;
}

std::string count(size_t number, const char* one, const char* many) {
    return std::to_string(number) + " " + (number == 1 ? one : many);
}

std::string title_of(const Report& report) {
    std::set<std::string> suites;
    for (const Start& start : report.results.starts) suites.insert(start.suite);
    const std::string names = join(suites);
    return names.empty() ? "Speed and accuracy" : names + ": speed and accuracy";
}

std::string head(const Report& report) {
    const Results& results = report.results;
    std::string out = "<header><h1>" + title_of(report) + "</h1>\n<p class=soft>";
    std::set<uint64_t> seeds;
    std::set<std::string> builds, processors;
    for (const Run& run : results.runs) seeds.insert(run.seed);
    for (const Start& start : results.starts) builds.insert(start.build), processors.insert(start.processor);
    out += count(results.scenes.size(), "scene", "scenes") + ", " +
           count(report.comparison.labels.size(), "algorithm", "algorithms") + ", " + count(seeds.size(), "seed", "seeds") + ", " +
           count(results.runs.size(), "run", "runs");
    if (!results.starts.empty()) out += "; begun " + escaped_html(results.starts.front().utc.substr(0, 10));
    if (const std::string names = join(builds); !names.empty()) out += ", lightloom " + names;
    if (const std::string names = join(processors); !names.empty()) out += ", " + names;
    return out + "</p></header>\n";
}

std::string summary(const Report& report) {
    const std::string first = escaped_html(report.comparison.labels.front());
    std::string out =
        "<section id=summary><h2>Summary</h2>\n<p>How many times as fast each algorithm comes to the error with which " + first +
        " ends; below it the relMSE at its own end.</p>\n";
    out += summary_table(report);
    out += "<nav aria-label=Sections>";
    if (!report.judged.empty()) out += "<a href=\"#verdicts\">Reliability</a>";
    return out + "<a href=\"#reading\">How to read this</a><a href=\"#origin\">Where the figures come from</a></nav></section>\n";
}

std::string left_out(const Report& report) {
    std::string out;
    if (!report.results.cuts.empty()) {
        std::vector<std::string> items;
        for (const Cut& cut : report.results.cuts)
            items.push_back((cut.scene.empty() ? "" : "<b>" + escaped_html(cut.scene) + "</b>: ") + escaped_html(cut.what));
        out += "<h3>What the budget cut</h3>\n" + list(items);
    }
    std::vector<std::string> notes;
    for (const std::string& note : report.results.notes) notes.push_back(escaped_html(note));
    for (const Drawn& drawn : report.drawn)
        for (const std::string& note : drawn.strip.notes) notes.push_back(escaped_html(note));
    if (!notes.empty()) out += "<h3>What is left out</h3>\n" + list(notes);
    return out.empty() ? "" : "<section id=cuts>" + out + "</section>\n";
}

std::string front_words(const Panel& panel) {
    std::string out;
    for (size_t i = 0; i < panel.front.size(); ++i) {
        const FrontPiece& piece = panel.front[i];
        out += (i > 0 ? ", then " : "") + escaped_html(panel.series[piece.curve].label);
        if (i + 1 < panel.front.size()) out += " until " + seconds_text(piece.line.x.back());
    }
    return out.empty() ? "" : "On the front: " + out + ".";
}

std::string caption(const Panel& panel, const std::string& chart) {
    if (chart == "pareto") return front_words(panel);
    if (chart == "speed-up") {
        return "To relMSE " + number_html(panel.level) + ", with which " + escaped_html(panel.series.front().label) +
               " ends. Bars: 95 % over the seeds; open symbols: bounds and extrapolations.";
    }
    if (chart == "techniques") return "Noise: each class’s part of the variance of all of them.";
    if (chart == "estimate") return "Shaded: within a factor of 1.5. Without points near the reference’s noise.";
    return "";
}

std::string facts(const Panel& panel) {
    const SceneInfo& scene = *panel.scene;
    std::string out = escaped_html(scene.file) + (scene.file.empty() ? "" : ", ") + std::to_string(scene.width) + " × " +
                      std::to_string(scene.height);
    if (scene.max_depth > 0) out += ", maximal depth " + std::to_string(scene.max_depth);
    out += ", " + panel.budget.text() + " per run. Reference: ";
    if (scene.reference_samples) out += number_html(*scene.reference_samples) + " samples per pixel";
    if (!scene.reference_algorithm.empty())
        out += (scene.reference_samples ? " by " : "") + escaped_html(scene.reference_algorithm);
    if (!scene.reference_samples && scene.reference_algorithm.empty()) out += escaped_html(scene.reference);
    out += scene.floor ? ", of relMSE " + number_html(*scene.floor) : ", its noise not known";
    return out + ".";
}

std::string strip_html(const Panel& panel, const Strip& strip) {
    if (strip.pictures.empty()) return "";
    std::string out = panel.budget.seconds > 0 ? "<h3>Images after equal time" : "<h3>Images after equal samples";
    out += "</h3>\n<p class=soft>The first seed of each; below the image its signed error. ";
    if (strip.stops != 0)
        out += "Shown " + std::string(strip.stops > 0 ? "brighter" : "darker") + " by " +
               count(size_t(std::abs(strip.stops)), "stop", "stops") + ". ";
    if (strip.shrunk > 1)
        out += "One pixel stands for " + std::to_string(strip.shrunk) + " × " + std::to_string(strip.shrunk) +
               ", so that noise looks smaller.";
    out += "</p>\n<div class=strip>\n";
    for (const Picture& picture : strip.pictures) {
        const std::string name = picture.series ? picture.series->label : "reference";
        out += "<figure><img src=\"" + picture.image + "\" alt=\"" + escaped_html(panel.title + ", " + name) + "\">";
        if (!picture.error.empty()) out += "<img src=\"" + picture.error + "\" alt=\"signed error of " + escaped_html(name) + "\">";
        out += "<figcaption>";
        if (picture.series) {
            out += "<b>" + label_html(picture.series->label, picture.series->style) + "</b><br>relMSE " +
                   number_html(picture.relmse) + ", " + seconds_text(picture.seconds) + ", seed " + std::to_string(picture.seed);
        } else {
            out += "<b>reference</b>";
        }
        out += "</figcaption></figure>\n";
    }
    return out + "</div>\n";
}

std::string scene_section(const Report& report, size_t index) {
    const Panel& panel = report.comparison.panels[index];
    const Drawn& drawn = report.drawn[index];
    std::string out =
        "<section class=scene id=scene-" + std::to_string(index + 1) + "><h2>" + escaped_html(panel.title) + "</h2>\n";
    if (!panel.scene->claim.empty()) out += "<p class=claim>" + escaped_html(panel.scene->claim) + "</p>\n";
    out += "<p class=soft>" + facts(panel) + "</p>\n" + scene_table(report, panel) + "<div class=charts>\n";
    for (const DrawnChart& chart : drawn.charts) {
        const std::string words = caption(panel, chart.name);
        out += "<figure>" + chart.svg + (words.empty() ? "" : "<figcaption>" + words + "</figcaption>") + "</figure>\n";
    }
    return out + "</div>\n" + strip_html(panel, drawn.strip) + "</section>\n";
}

std::string verdicts(const Report& report) {
    if (report.judged.empty()) return "";
    return "<section id=verdicts><h2>Reliability</h2>\n<p>What the seeds of each algorithm say together: whether its error falls "
           "as "
           "it must, whether the image’s light is right, and what rare paths do to single runs.</p>\n" +
           verdict_table_html(report) + "</section>\n";
}

std::string origin(const Report& report) {
    std::string out =
        "<section id=origin><h2>Where the figures come from</h2>\n" + origin_table(report) + "<p class=soft>Read from ";
    for (size_t i = 0; i < report.files.size(); ++i) out += (i > 0 ? ", " : "") + escaped_html(report.files[i]);
    return out + ".</p></section>\n";
}

}  // namespace

std::string report_page(const Report& report) {
    std::string out =
        "<!doctype html>\n<html lang=en><head><meta charset=utf-8>"
        "<meta name=viewport content=\"width=device-width,initial-scale=1\">\n<title>" +
        title_of(report) + "</title>\n<style>\n:root{color-scheme:light dark;" + colour_variables(false) + kLight +
        "}\n@media screen and (prefers-color-scheme:dark){:root{" + colour_variables(true) + kDark + "}}" + kStyle +
        "</style></head>\n<body>\n";
    const auto& starts = report.results.starts;
    const bool stability = std::any_of(starts.begin(), starts.end(), [](const Start& start) { return start.stability; });
    out += head(report) + summary(report) + (stability ? verdicts(report) : "") + left_out(report) + "<main>\n";
    for (size_t i = 0; i < report.comparison.panels.size(); ++i) out += scene_section(report, i);
    out += "</main>\n" + (stability ? "" : verdicts(report));
    out += kReading;
    return out + origin(report) + "</body></html>\n";
}

}  // namespace lightloom::client::report
