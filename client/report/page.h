#pragma once
// The page of a report: one HTML file without anything from elsewhere, for screens and for paper.

#include <optional>
#include <span>
#include <string>
#include <vector>

#include "client/bench/verdicts.h"
#include "client/report/panel.h"
#include "client/report/strips.h"

namespace lightloom::client::report {

struct DrawnChart {
    std::string name;  ///< As of ChartScript.
    std::string svg;   ///< As svg_of_page() makes it.
};

/// What was drawn for one panel.
struct Drawn {
    std::vector<DrawnChart> charts;
    Strip strip;
};

/// Everything that the page shows. `drawn` has one entry per panel.
struct Report {
    const Results& results;
    const Comparison& comparison;
    std::vector<Drawn> drawn;
    std::vector<Judged> judged;
    std::vector<std::string> files;  ///< Names of the results, as they were given.
};

std::string report_page(const Report& report);

}  // namespace lightloom::client::report
