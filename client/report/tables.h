#pragma once
// The tables of a report's page, as HTML.

#include <string>

#include "client/report/page.h"

namespace lightloom::client::report {

/// "0.0123", "1.2 · 10<sup>−5</sup>".
std::string number_html(double value);
/// "0.4 s", "2 min 5 s".
std::string seconds_text(double seconds);
/// The algorithm's symbol in its colour, then its label.
std::string label_html(const std::string& label, size_t style);

/// Speed-ups of all algorithms on all scenes, with their geometric means.
std::string summary_table(const Report& report);
/// Figures of one scene.
std::string scene_table(const Report& report, const Panel& panel);
/// What every algorithm's runs say about its reliability; empty if nothing was judged.
std::string verdict_table_html(const Report& report);
/// Machine, build, suite and date of every process that measured.
std::string origin_table(const Report& report);

}  // namespace lightloom::client::report
