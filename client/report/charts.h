#pragma once
// The charts of a report, as scripts for gnuplot.

#include <string>
#include <vector>

#include "client/report/panel.h"

namespace lightloom::client::report {

/// A chart before it is drawn.
struct ChartScript {
    std::string name;         ///< For a file: "error-time".
    std::string description;  ///< One sentence for those who do not see it.
    std::string script;
};

/// The charts of one panel that its results can fill.
std::vector<ChartScript> chart_scripts(const Panel& panel, const Results& results);

/// Symbol that charts draw for the algorithm of that style, as a character: "●".
const char* symbol(size_t style);

/// Positions as near to the wanted ones as can be, in their order, at least `distance` apart and within [0, 1] where there is room:
/// heights of the labels beside a chart.
std::vector<double> spread_labels(const std::vector<double>& wanted, double distance);

}  // namespace lightloom::client::report
