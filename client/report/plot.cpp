#include "client/report/plot.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <numeric>

#include "client/report/charts.h"
#include "client/report/gnuplot.h"
#include "common/core/utf8.h"

namespace lightloom::client::report {
namespace {

struct Style {
    int point;  ///< gnuplot's filled symbol; the open one is that before it.
    const char* dash;
    const char* symbol;
};
constexpr std::array<Style, 8> kStyles{{{7, "1", "●"},
                                        {5, "(7,3)", "■"},
                                        {9, "(2,2)", "▲"},
                                        {13, "(9,2,2,2)", "◆"},
                                        {11, "(4,4)", "▼"},
                                        {15, "(12,3)", "⬟"},
                                        {6, "(6,2,2,2,2,2)", "○"},
                                        {4, "(1,3)", "□"}}};

constexpr size_t kNameLength = 13;  ///< Characters that stand beside a chart.

/// Whether a name takes two lines.
bool is_long(const std::string& name) { return character_count(name) > kNameLength && name.find(':') != std::string::npos; }

/// "'0.01'", "'200'"; powers of ten far from 1 as such.
std::string tic_name(double value, int decade, int digit) {
    if (decade >= -3 && decade <= 4) return formatted("'%g'", value);
    const std::string power = "10^{" + std::to_string(decade) + "}'";
    return (digit == 1 ? "'" : std::string("'").append(std::to_string(digit)) + "·") + power;
}

}  // namespace

std::string quoted(const std::string& text) {
    std::string out = "'";
    for (const char c : one_line(text)) out += c == '\'' ? "''" : std::string(1, c);
    return out + "'";
}

std::string exact(double value) { return formatted("%.9g", value); }

std::string point_type(size_t style, bool open) {
    const int filled = kStyles[style % kStyles.size()].point;
    return std::to_string(open && filled % 2 == 1 ? filled - 1 : filled);
}

std::string dash_type(size_t style) { return kStyles[style % kStyles.size()].dash; }
const char* symbol(size_t style) { return kStyles[style % kStyles.size()].symbol; }

std::string shortened(const std::string& text, size_t count) {
    return character_count(text) <= count ? text : std::string(first_characters(text, count - 1)) + "…";
}

std::vector<double> spread_labels(const std::vector<double>& wanted, double distance) {
    std::vector<size_t> order(wanted.size());
    std::iota(order.begin(), order.end(), size_t(0));
    std::stable_sort(order.begin(), order.end(), [&](size_t a, size_t b) { return wanted[a] < wanted[b]; });
    std::vector<double> out(wanted.size());
    // Upwards, each at least above the one before; then down again from the top, as far as that is needed.
    double least = 0;
    for (const size_t i : order) {
        out[i] = std::max(std::clamp(wanted[i], 0.0, 1.0), least);
        least = out[i] + distance;
    }
    double most = 1;
    for (auto i = order.rbegin(); i != order.rend(); ++i) {
        out[*i] = std::min(out[*i], most);
        most = out[*i] - distance;
    }
    return out;
}

Axis Axis::around(std::span<const double> values) {
    const auto [least, greatest] = std::minmax_element(values.begin(), values.end());
    if (least == values.end()) return {};
    Axis axis{*least, *greatest};
    const double factor = axis.high / axis.low, room = std::max(1.15, std::sqrt(4 / factor));
    axis.low /= room;
    axis.high *= room;
    return axis;
}

double Axis::position(double value) const { return std::log(value / low) / std::log(high / low); }

std::string Axis::tics() const {
    const int from = int(std::floor(std::log10(low))), to = int(std::ceil(std::log10(high)));
    const double decades = std::log10(high / low);
    const int step = std::max(1, int(std::ceil(decades / 6)));
    std::string out;
    for (int decade = from; decade <= to; ++decade) {
        for (int digit = 1; digit < 10; ++digit) {
            const double value = digit * std::pow(10, decade);
            if (value < low * (1 - 1e-9) || value > high * (1 + 1e-9)) continue;
            const bool named = decades < 2 ? digit == 1 || digit == 2 || digit == 5 : digit == 1 && decade % step == 0;
            if (!named && decades > 4 && digit > 1) continue;
            out += (out.empty() ? "" : ", ") + (named ? tic_name(value, decade, digit) : "''") + " " + exact(value) +
                   (named ? " 0" : " 1");
        }
    }
    return out;
}

Plot::Plot(const std::string& title, const Margins& margins) {
    const auto screen = [](double value) { return " at screen " + formatted("%.4f", value); };
    text_ = "set terminal svg size " + std::to_string(kWidth) + "," + std::to_string(kHeight) +
            " dynamic enhanced font 'sans,11' linewidth 1 background '" + colour::kGround +
            "'\nset encoding utf8\nset minussign\nunset key\nset border 3 lc rgb '" + colour::kAxis + "' lw 0.8\n";
    line("set lmargin" + screen(margins.left));
    line("set rmargin" + screen(margins.right));
    line("set bmargin" + screen(margins.bottom));
    line("set tmargin" + screen(margins.top));
    line("set tics nomirror out scale 0.5,0.25 font ',10.5' textcolor rgb '" + std::string(colour::kSoft) + "'");
    line("set grid xtics ytics lc rgb '" + std::string(colour::kGrid) + "' lw 0.8 dt 1, lc rgb '" + colour::kGrid + "' lw 0 dt 1");
    label(title, "screen 0.012, screen 0.955 left", colour::kText, 13);
}

void Plot::log_axis(char name, const Axis& axis, const std::string& text) {
    const std::string letter(1, name);
    line("set logscale " + letter);
    line("set " + letter + "range [" + exact(axis.low) + ":" + exact(axis.high) + "]");
    line("set " + letter + "tics (" + axis.tics() + ")");
    line("set " + letter + "label " + quoted(text) + " noenhanced font ',11' textcolor rgb '" + colour::kText + "'" +
         (name == 'x' ? " offset 0,0.2" : " offset 0.6,0"));
}

void Plot::label(const std::string& text, const std::string& where, const std::string& colour, int size) {
    line("set label " + std::to_string(++labels_) + " " + quoted(text) + " at " + where + " noenhanced font '," +
         std::to_string(size) + "' textcolor rgb '" + colour + "' front");
}

void Plot::name(const std::string& text, const std::string& where, const std::string& colour) {
    const size_t colon = is_long(text) ? text.find(':') : std::string::npos;
    if (colon == std::string::npos) return label(shortened(text, kNameLength), where, colour);
    label(shortened(text.substr(0, colon), kNameLength), where + " offset 0,0.38", colour);
    label(shortened(text.substr(colon), kNameLength + 2), where + " offset 0,-0.5", colour, 9);
}

std::string Plot::data(const std::vector<std::vector<double>>& rows) {
    const std::string name = "$d" + std::to_string(++blocks_);
    text_ += name + " << EOD\n";
    for (const std::vector<double>& row : rows) {
        for (const double value : row) text_ += exact(value) + " ";
        text_ += "\n";
    }
    text_ += "EOD\n";
    return name;
}

void Plot::add(const std::string& element) { elements_.push_back(element); }

void Plot::series(const Band& band, size_t style, const std::string& name, double open_below) {
    if (band.x.empty()) return;
    const std::string paint = " lc rgb '" + colour::series(style) + "'", title = " title " + quoted(name) + " noenhanced";
    std::vector<std::vector<double>> ranges, middles, filled, open;
    for (size_t i = 0; i < band.x.size(); ++i) {
        ranges.push_back({band.x[i], band.low[i], band.high[i]});
        middles.push_back({band.x[i], band.middle[i]});
        const size_t from_end = band.x.size() - 1 - i;
        if (from_end % 4 == 0) (band.middle[i] < open_below ? open : filled).push_back(middles.back());
    }
    if (band.x.size() > 1) {
        add(data(ranges) + " using 1:2:3 with filledcurves fill transparent solid 0.16 noborder" + paint + " title ''");
        add(data(middles) + " using 1:2 with lines lw 1.8 dt " + dash_type(style) + paint + title);
    } else {
        add(data({{band.x[0], band.middle[0], band.low[0], band.high[0]}}) + " using 1:2:3:4 with yerrorbars pt 0 lw 1.4" + paint +
            " title ''");
    }
    if (!filled.empty()) add(data(filled) + " using 1:2 with points pt " + point_type(style, false) + " ps 0.55" + paint + title);
    if (!open.empty()) add(data(open) + " using 1:2 with points pt " + point_type(style, true) + " ps 0.55 lw 1.2" + paint + title);
}

void Plot::names(std::vector<Name> names) {
    constexpr double kLine = 0.078;  // Of the plot's height.
    std::vector<double> wanted;
    bool two_lines = false;
    for (const Name& name : names) {
        wanted.push_back(name.position);
        two_lines |= is_long(name.text);
    }
    const double distance = std::min(two_lines ? 1.75 * kLine : kLine, names.size() > 1 ? 1.0 / double(names.size() - 1) : 1.0);
    const std::vector<double> heights = spread_labels(wanted, distance);
    for (size_t i = 0; i < names.size(); ++i) {
        const Name& name = names[i];
        const std::string paint = name.soft ? colour::kSoft : colour::series(name.style);
        line("set label " + std::to_string(++labels_) + " '' at graph 1.045, graph " + exact(heights[i]) + " point pt " +
             point_type(name.style, false) + " ps 0.55 lc rgb '" + colour::series(name.style) + "' front");
        this->name(name.text, "graph 1.075, graph " + exact(heights[i]) + " left", paint);
    }
}

std::string Plot::script() const {
    std::string out = text_ + "plot ";
    for (size_t i = 0; i < elements_.size(); ++i) out += (i > 0 ? ", \\\n  " : "") + elements_[i];
    return out + "\n";
}

}  // namespace lightloom::client::report
