// The summary that ends a benchmark.

#include <algorithm>
#include <cmath>
#include <cstdarg>

#include "client/bench/numbers.h"
#include "client/bench/suite_table.h"

namespace lightloom::client {
namespace {

/// What a finished run says about the threshold.
struct Finish {
    double iterations = 0, seconds = 0, preparation = 0;
    bool capped = false, lower_bound = false;
    bool cached = false;                                   ///< The preparation is that of another run, which made the tables.
    double rendered_iterations = 0, rendered_seconds = 0;  ///< Where a capped run ended.
};

double number(const Json& json, const char* key) {
    const auto value = json.find(key);
    return value != json.end() && value->is_number() ? value->get<double>() : std::nan("");
}

Finish finish_of(const Json& done) {
    Finish f;
    f.preparation = number(done, "preparation_seconds");
    f.rendered_iterations = number(done, "iterations");
    f.rendered_seconds = number(done, "seconds");
    f.cached = done.value("tables", std::string()) == "cached";
    f.capped = !done.contains("reached");
    const Json where = done.value(f.capped ? "extrapolated" : "reached", Json::object());
    f.lower_bound = where.contains("lower_bound");
    f.iterations = number(where, "iterations");
    f.seconds = number(where, "seconds");
    return f;
}

/// Of one field.
template <class Field>
double median(const std::vector<Finish>& runs, Field field) {
    std::vector<double> values;
    for (const Finish& run : runs) values.push_back(field(run));
    return client::median(std::move(values));
}

[[gnu::format(printf, 1, 2)]] std::string format(const char* pattern, ...) {
    char line[256];
    va_list arguments;
    va_start(arguments, pattern);
    const int length = std::vsnprintf(line, sizeof line, pattern, arguments);
    va_end(arguments);
    return std::string(line, size_t(std::clamp(length, 0, int(sizeof line) - 1)));
}

}  // namespace

std::string threshold_table(const std::vector<std::string>& algorithms, const std::vector<Json>& done, double threshold) {
    size_t width = 9;
    for (const std::string& name : algorithms) width = std::max(width, name.size());
    std::string table = format("to MAPE %g %%, medians over seeds; ratios: first row / row, above 1 is better\n", threshold);
    table += format("%-*s %5s %6s %12s %10s %10s %10s %11s %11s\n", int(width), "algorithm", "runs", "capped", "iterations",
                    "render s", "prepare s", "together s", "iterations", "together");
    double first_iterations = 0, first_seconds = 0;
    bool any_capped = false, any_cached = false;
    for (const std::string& name : algorithms) {
        std::vector<Finish> runs;
        for (const Json& line : done) {
            if (line.value("label", std::string()) == name) runs.push_back(finish_of(line));
        }
        if (runs.empty()) {
            table += format("%-*s %5d\n", int(width), name.c_str(), 0);
            continue;
        }
        const auto capped = std::count_if(runs.begin(), runs.end(), [](const Finish& f) { return f.capped; });
        // With half of the runs capped, at least one of the values that a median is made of is an extrapolation.
        const bool estimate = size_t(capped) * 2 >= runs.size();
        any_capped |= capped > 0;
        const double iterations = median(runs, [](const Finish& f) { return f.iterations; });
        const double seconds = median(runs, [](const Finish& f) { return f.seconds; });
        const double preparation = median(runs, [](const Finish& f) { return f.preparation; });
        const double together = median(runs, [](const Finish& f) { return f.seconds + f.preparation; });
        if (name == algorithms.front()) first_iterations = iterations, first_seconds = together;
        const bool bound = std::any_of(runs.begin(), runs.end(), [](const Finish& f) { return f.lower_bound; });
        const bool cached = std::any_of(runs.begin(), runs.end(), [](const Finish& f) { return f.cached; });
        any_cached |= cached;
        const char* mark = !estimate ? "" : bound ? ">~" : "~";
        table += format("%-*s %5zu %6zu %12s %10s %10s %10s %11.2f %11.2f\n", int(width), name.c_str(), runs.size(), size_t(capped),
                        format("%s%.1f", mark, iterations).c_str(), format("%s%.2f", mark, seconds).c_str(),
                        format("%s%.2f", cached ? "*" : "", preparation).c_str(), format("%s%.2f", mark, together).c_str(),
                        first_iterations / iterations, first_seconds / together);
        if (estimate) {
            table += format("%-*s not reached: > %.0f iterations, > %.2f s\n", int(width), "",
                            median(runs, [](const Finish& f) { return f.rendered_iterations; }),
                            median(runs, [](const Finish& f) { return f.rendered_seconds + f.preparation; }));
        }
    }
    if (any_capped)
        table +=
            "~ extrapolated by error ~ n^-1/2 from runs that ended above the threshold; a bias breaks that law\n"
            ">~ the same where the error does not fall like that yet: at least so much\n";
    if (any_cached) table += "* as recorded when the tables were made: some runs found theirs in the cache\n";
    return table;
}

}  // namespace lightloom::client
