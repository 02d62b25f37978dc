#include "client/pyramid_page.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <nlohmann/json.hpp>

#include "client/html.h"

namespace lightloom::client {
namespace {

// The page's own pieces. `--columns` is set on the table; a picture is as wide as the window has room for.
constexpr const char* kStyle = R"(
:root{color-scheme:light dark;--ground:#fbfaf7;--text:#1d1c1a;--soft:#6a665f;--line:#dcd8cf;--light:#c98a0a;--noise:#5472b8;--on:#1d1c1a;--on-text:#fff}
@media(prefers-color-scheme:dark){:root{--ground:#161616;--text:#ececea;--soft:#a3a09a;--line:#383735;--light:#e3a72c;--noise:#86a3e6;--on:#ececea;--on-text:#161616}}
*{box-sizing:border-box}
body{margin:0;padding:1.25rem 1.5rem 2.5rem;background:var(--ground);color:var(--text);font:14px/1.45 system-ui,sans-serif;font-variant-numeric:tabular-nums}
h1{margin:0;font-size:1.4rem;line-height:1.25;overflow-wrap:anywhere}
p{margin:.35rem 0;max-width:58rem}
.facts,.note{color:var(--soft)}
header{display:flex;gap:1.5rem;align-items:flex-start;flex-wrap:wrap}
header>div{flex:1 1 24rem;min-width:0}
header figure{margin:0;flex:0 1 300px}
img{display:block;width:100%;height:auto;background:#000}
.switch{display:inline-flex;margin:.6rem 0 .2rem;border:1px solid var(--line);border-radius:6px;overflow:hidden}
.switch button{font:inherit;color:inherit;background:none;border:0;padding:.35rem .9rem;cursor:pointer}
.switch button[aria-pressed=true]{background:var(--on);color:var(--on-text)}
.switch button:focus-visible{outline:2px solid var(--noise);outline-offset:-3px}
.unweighted .w,body:not(.unweighted) .u{display:none}
.scroll{overflow-x:auto;margin-top:1rem}
table{border-collapse:collapse}
th,td{padding:.5rem .35rem;vertical-align:top;text-align:left;font-weight:400}
thead th{color:var(--soft);padding-bottom:0;border-bottom:1px solid var(--line)}
tbody tr+tr>*{border-top:1px solid var(--line)}
tbody th{width:7rem;min-width:7rem;padding-right:.75rem;position:sticky;left:0;background:var(--ground);z-index:1}
tbody th b{font-size:1.1rem;display:block}
td figure{margin:0 0 .6rem;width:clamp(122px,calc((100vw - 11rem)/var(--columns) - .8rem),300px)}
td figure:last-child{margin-bottom:0}
.together{display:flex;gap:.7rem}
.together figure{margin:0}
td figcaption{font-size:12px;line-height:1.4;margin-top:.25rem}
figcaption b{font-weight:600}
figcaption span{color:var(--soft);white-space:nowrap}
figcaption .row{display:flex;justify-content:space-between;gap:0 .4rem;flex-wrap:wrap;white-space:nowrap}
.bar{height:4px;margin:1px 0 2px;background:var(--line)}
.bar i{display:block;height:100%}
.light{background:var(--light)}.noise{background:var(--noise)}
.key{display:inline-block;width:.8em;height:.8em;margin-right:.3em}
a{color:inherit}
@media print{
:root{color-scheme:light;--ground:#fff;--text:#000;--soft:#444;--line:#bbb;--light:#c98a0a;--noise:#5472b8;--on:#000;--on-text:#fff}
@page{size:landscape;margin:10mm}
body{padding:0;print-color-adjust:exact;-webkit-print-color-adjust:exact}
.switch button[aria-pressed=false]{display:none}
.switch{border:0}
.scroll{overflow:visible}
tbody th{position:static}
tr{break-inside:avoid}
td figure{width:calc(235mm/var(--columns) - 3mm);max-width:70mm}
td figcaption{font-size:7pt}
})";

constexpr const char* kScript = R"(
for(const button of document.querySelectorAll('.switch button'))button.onclick=()=>{
document.body.classList.toggle('unweighted',button.value==='unweighted');
for(const other of document.querySelectorAll('.switch button'))other.setAttribute('aria-pressed',other===button)})";

std::string formatted(const char* format, double value) {
    char text[64];
    std::snprintf(text, sizeof text, format, value);
    return text;
}

/// "12.3 %", or an en dash for what is not known.
std::string percent(double share) {
    if (std::isnan(share)) return "–";
    const double value = 100 * share;
    if (value > 0 && value < 0.1) return "&lt; 0.1 %";
    return formatted(value < 99.95 ? "%.1f %%" : "%.0f %%", value);
}

std::string stops_text(int stops) {
    if (stops == 0) return "as stored";
    std::string out(stops > 0 ? "+" : "−");
    out += std::to_string(std::abs(stops));
    return out + (std::abs(stops) == 1 ? " stop" : " stops");
}

std::string bar(double share, const char* kind) {
    const double width = std::isnan(share) ? 0 : std::clamp(100 * share, 0.0, 100.0);
    return "<div class=bar><i class=" + std::string(kind) + " style=\"width:" + formatted("%.2f", width) + "%\"></i></div>";
}

std::string picture_html(const PyramidPicture& p, const PyramidRow& row) {
    const std::string kind(to_string(p.kind));
    std::string split = "all s";
    if (row.k > 0) split = "s " + std::to_string(p.s);
    if (row.k > 0 && p.kind != TechniqueKind::kMerge) split += ", t " + std::to_string(row.k + 1 - p.s);
    const auto image = [&](const std::string& weighting, const std::string& shown) {
        const std::string file = weighting + "-" + p.name;
        return "<a class=" + shown + " href=\"" + file + ".exr\"><img loading=lazy src=\"" + file + ".png\" alt=\"" + kind + ", " +
               split + ", " + weighting + "\"></a>";
    };
    const auto line = [](const char* name, const std::string& value) {
        return "<div class=row><span>" + std::string(name) + "</span>" + value + "</div>";
    };
    std::string out = "<figure>" + image("weighted", "w") + image("unweighted", "u");
    out += "<figcaption><div class=row><b>" + kind + "</b><span>" + split + "</span></div>";
    out += "<div class=w>" + line("light", percent(p.light_share)) + bar(p.light_share, "light");
    out += line("variance", percent(p.noise_share)) + bar(p.noise_share, "noise");
    out += line("mean", formatted("%.3g", p.weighted)) + "</div>";
    out += "<div class=u>" + line("of the row", percent(p.row_share)) + bar(p.row_share, "light");
    out += line("mean", formatted("%.3g", p.unweighted)) + "</div>";
    return out + "</figcaption></figure>\n";
}

std::string row_html(const PyramidRow& row, int depth, size_t columns) {
    const std::string edges = row.k > 0 ? "k = " + std::to_string(row.k) : "k &gt; " + std::to_string(depth);
    std::string out = "<tr><th scope=row><b>" + edges + "</b>" + percent(row.light_share) + " of the light<br><span class=note>";
    out +=
        "<span class=w>" + stops_text(row.weighted_stops) + "</span><span class=u>" + stops_text(row.unweighted_stops) + "</span>";
    out += "</span></th>\n";
    if (row.k == 0) {  // These have no place among the columns.
        out += "<td colspan=" + std::to_string(columns) + "><div class=together>";
        for (const PyramidPicture& p : row.pictures) out += picture_html(p, row);
        return out + "</div></td></tr>\n";
    }
    for (size_t s = 0; s < columns; ++s) {
        out += "<td>";
        for (const PyramidPicture& p : row.pictures)
            if (size_t(p.s) == s) out += picture_html(p, row);
        out += "</td>";
    }
    return out + "</tr>\n";
}

constexpr const char* kSwitch = R"(<div class=switch role=group aria-label="Which pictures">
<button value=weighted aria-pressed=true>weighted</button><button value=unweighted aria-pressed=false>unweighted</button></div>
)";
constexpr const char* kLegend = R"(<div class=w><p>What each technique gives to the image: its contributions times their weights.
All pictures together are the image.</p>
<p class=note><i class="key light"></i>share of the image’s mean luminance<br>
<i class="key noise"></i>share of the variance, each pixel’s relative to its squared luminance + 0.01; techniques that vary
together make the image’s own differ from the sum</p></div>
<div class=u><p>What each technique finds by itself, without weights. Pictures of one row estimate the same light, each as far as
its technique can find it.</p>
<p class=note><i class="key light"></i>mean luminance relative to that of the row’s weighted pictures together</p></div>
<p class=note>Rows: edges k of the path. Columns: light vertices s. The pictures of a row are brightened by the same whole stops;
the EXR behind each is not.)";

}  // namespace

std::string pyramid_html(const PyramidPage& page) {
    size_t columns = 1;
    for (const PyramidRow& row : page.rows)
        for (const PyramidPicture& p : row.pictures) columns = std::max(columns, size_t(p.s) + 1);
    const std::string title = escaped_html(page.scene) + ", " + escaped_html(page.algorithm) + ", by technique";
    std::string out = "<!doctype html>\n<html lang=en><head><meta charset=utf-8>";
    out += "<meta name=viewport content=\"width=device-width,initial-scale=1\">\n<title>" + title + "</title>\n<style>";
    out += kStyle;
    out += "\n</style></head>\n<body>\n<header><div><h1>" + title + "</h1>\n<p class=facts>";
    out += std::to_string(page.samples_per_pixel) + (page.samples_per_pixel == 1 ? " sample" : " samples") + " per pixel, ";
    out += std::to_string(page.width) + " × " + std::to_string(page.height) + ", paths of at most ";
    out += std::to_string(page.max_depth + 1) + " edges, seed " + std::to_string(page.seed) + ", lightloom " +
           escaped_html(page.build);
    for (const auto& [key, value] : page.parameters) out += ", " + escaped_html(key) + "=" + escaped_html(value);
    out += "</p>\n";
    out += kSwitch;
    out += kLegend;
    if (page.not_finite > 0) out += " " + std::to_string(page.not_finite) + " contributions that are not finite are left out.";
    out += "</p></div>\n<figure><a href=\"image.exr\"><img src=\"image.png\" alt=\"the image\"></a><figcaption class=note>";
    out += "the image, " + stops_text(page.stops) + ", mean luminance " + formatted("%.4g", page.mean) + "</figcaption></figure>";
    out += "</header>\n<main class=scroll><table style=\"--columns:" + std::to_string(columns) + "\">\n<thead><tr><th></th>";
    for (size_t s = 0; s < columns; ++s) out += "<th scope=col>s = " + std::to_string(s) + "</th>";
    out += "</tr></thead>\n<tbody>\n";
    for (const PyramidRow& row : page.rows) out += row_html(row, page.depth, columns);
    out += "</tbody></table></main>\n<script>";
    out += kScript;
    return out + "\n</script>\n</body></html>\n";
}

std::string pyramid_json(const PyramidPage& page) {
    using Json = nlohmann::ordered_json;
    Json parameters = Json::object();
    for (const auto& [key, value] : page.parameters) parameters[key] = value;
    Json pictures = Json::array();
    for (const PyramidRow& row : page.rows) {
        for (const PyramidPicture& p : row.pictures) {
            pictures.push_back({{"technique", to_string(p.kind)},
                                {"k", row.k > 0 ? Json(row.k) : Json()},
                                {"s", row.k > 0 ? Json(p.s) : Json()},
                                {"name", p.name},
                                {"weighted_mean", p.weighted},
                                {"unweighted_mean", p.unweighted},
                                {"light_share", p.light_share},
                                {"noise_share", std::isnan(p.noise_share) ? Json() : Json(p.noise_share)},
                                {"weighted_png_stops", row.weighted_stops},
                                {"unweighted_png_stops", row.unweighted_stops}});
        }
    }
    const Json json = {{"lightloom_pyramid", 1},
                       {"scene", page.scene},
                       {"algorithm", page.algorithm},
                       {"parameters", std::move(parameters)},
                       {"seed", page.seed},
                       {"samples_per_pixel", page.samples_per_pixel},
                       {"width", page.width},
                       {"height", page.height},
                       {"max_depth", page.max_depth},
                       {"depth", page.depth},
                       {"build", page.build},
                       {"mean", page.mean},
                       {"png_stops", page.stops},
                       {"not_finite", page.not_finite},
                       {"pictures", std::move(pictures)}};
    return json.dump(1, ' ', false, Json::error_handler_t::replace) + "\n";
}

}  // namespace lightloom::client
