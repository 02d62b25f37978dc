#include "client/pyramid_page.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <nlohmann/json.hpp>

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
td figure{margin:0 0 .6rem;width:clamp(104px,calc((100vw - 11rem)/var(--columns) - .8rem),300px)}
td figure:last-child{margin-bottom:0}
td figcaption{font-size:12px;line-height:1.4;margin-top:.25rem}
figcaption b{font-weight:600}
figcaption span{color:var(--soft);white-space:nowrap}
figcaption .row{display:flex;justify-content:space-between;gap:.4rem;flex-wrap:wrap}
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

std::string escaped(const std::string& text) {
    std::string out;
    for (const char c : text) {
        switch (c) {
            case '&': out += "&amp;"; break;
            case '<': out += "&lt;"; break;
            case '>': out += "&gt;"; break;
            case '"': out += "&quot;"; break;
            default: out += c;
        }
    }
    return out;
}

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
    return (stops > 0 ? "+" : "−") + std::to_string(std::abs(stops)) + (std::abs(stops) == 1 ? " stop" : " stops");
}

std::string bar(double share, const char* kind) {
    const double width = std::isnan(share) ? 0 : std::clamp(100 * share, 0.0, 100.0);
    return "<div class=bar><i class=" + std::string(kind) + " style=\"width:" + formatted("%.2f", width) + "%\"></i></div>";
}

std::string picture_html(const PyramidPicture& p, const PyramidRow& row) {
    const std::string kind(to_string(p.kind));
    const bool merge = p.kind == TechniqueKind::kMerge;
    std::string split;
    if (row.k > 0) split = "s " + std::to_string(p.s) + (merge ? "" : ", t " + std::to_string(row.k + 1 - p.s));
    const auto image = [&](const char* weighting, const char* visible) {
        const std::string file = std::string(weighting) + "-" + p.name;
        return "<a class=" + std::string(visible) + " href=\"" + file + ".exr\"><img loading=lazy src=\"" + file + ".png\" alt=\"" +
               kind + (split.empty() ? "" : ", " + split) + ", " + weighting + "\"></a>";
    };
    return "<figure>" + image("weighted", "w") + image("unweighted", "u") + "<figcaption><div class=row><b>" + kind + "</b><span>" +
           split + "</span></div>" + "<div class=w><div class=row><span>light</span>" + percent(p.light_share) + "</div>" +
           bar(p.light_share, "light") + "<div class=row><span>variance</span>" + percent(p.noise_share) + "</div>" +
           bar(p.noise_share, "noise") + "<div class=row><span>mean</span>" + formatted("%.3g", p.weighted) + "</div></div>" +
           "<div class=u><div class=row><span>of the row</span>" + percent(p.row_share) + "</div>" + bar(p.row_share, "light") +
           "<div class=row><span>mean</span>" + formatted("%.3g", p.unweighted) + "</div></div></figcaption></figure>\n";
}

/// By number of light vertices; the last row has no such number and keeps the order of kinds.
size_t column_of(const PyramidPicture& p, const PyramidRow& row) { return row.k > 0 ? size_t(p.s) : size_t(p.kind); }

}  // namespace

std::string pyramid_html(const PyramidPage& page) {
    size_t columns = 1;
    for (const PyramidRow& row : page.rows)
        for (const PyramidPicture& p : row.pictures) columns = std::max(columns, column_of(p, row) + 1);
    const std::string title = escaped(page.scene) + ", " + escaped(page.algorithm) + ", by technique";
    std::string out =
        "<!doctype html>\n<html lang=en><head><meta charset=utf-8>"
        "<meta name=viewport content=\"width=device-width,initial-scale=1\">\n<title>" +
        title + "</title>\n<style>" + kStyle + "\n</style></head>\n<body>\n<header><div><h1>" + title + "</h1>\n";
    out += "<p class=facts>" + std::to_string(page.samples_per_pixel) + " samples per pixel, " + std::to_string(page.width) +
           " × " + std::to_string(page.height) + ", paths of at most " + std::to_string(page.max_depth + 1) + " edges, seed " +
           std::to_string(page.seed) + ", lightloom " + escaped(page.build);
    for (const auto& [key, value] : page.parameters) out += ", " + escaped(key) + "=" + escaped(value);
    out +=
        "</p>\n<div class=switch role=group aria-label=\"Which pictures\"><button value=weighted "
        "aria-pressed=true>weighted</button>"
        "<button value=unweighted aria-pressed=false>unweighted</button></div>\n";
    out +=
        "<div class=w><p>What each technique gives to the image: its contributions times their weights. All pictures together "
        "are the image.</p><p class=note><i class=\"key light\"></i>share of the image’s mean luminance <i class=\"key noise\" "
        "style=\"margin-left:.8em\"></i>share of the variance, relative to the squared luminance of each pixel plus 0.01" +
        std::string(page.samples_per_pixel < 2 ? " (not known from one sample per pixel)" : "") + "</p></div>\n";
    out +=
        "<div class=u><p>What each technique finds by itself, without weights. Pictures of one row estimate the same light, each "
        "as "
        "far as its technique can find it.</p><p class=note><i class=\"key light\"></i>mean luminance relative to that of the "
        "row’s "
        "weighted pictures together</p></div>\n";
    out +=
        "<p class=note>Rows: edges k of the path. Columns: light vertices s. Every row is brightened by whole stops of its own; "
        "the EXR behind a picture is not.";
    if (page.not_finite > 0) out += " " + std::to_string(page.not_finite) + " contributions that are not finite are left out.";
    out +=
        "</p></div>\n<figure><a href=\"image.exr\"><img src=\"image.png\" alt=\"the image\"></a><figcaption class=note>the "
        "image, " +
        stops_text(page.stops) + ", mean luminance " + formatted("%.4g", page.mean) + "</figcaption></figure></header>\n";
    out += "<main class=scroll><table style=\"--columns:" + std::to_string(columns) + "\">\n<thead><tr><th></th>";
    for (size_t s = 0; s < columns; ++s) out += "<th scope=col>s = " + std::to_string(s) + "</th>";
    out += "</tr></thead>\n<tbody>\n";
    for (const PyramidRow& row : page.rows) {
        out += "<tr><th scope=row><b>" + (row.k > 0 ? "k = " + std::to_string(row.k) : "k &gt; " + std::to_string(page.depth)) +
               "</b>" + percent(row.light_share) + " of the light<br><span class=note>" + stops_text(row.stops) +
               (row.k > 0 ? "" : "<br>all s together") + "</span></th>\n";
        for (size_t column = 0; column < columns; ++column) {
            out += "<td>";
            for (const PyramidPicture& p : row.pictures)
                if (column_of(p, row) == column) out += picture_html(p, row);
            out += "</td>";
        }
        out += "</tr>\n";
    }
    return out + "</tbody></table></main>\n<script>" + kScript + "\n</script>\n</body></html>\n";
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
                                {"png_stops", row.stops}});
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
