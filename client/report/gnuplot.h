#pragma once
// Charts as SVG by gnuplot, an installed program of others.

#include <string>
#include <string_view>

#include "common/core/result.h"

namespace lightloom::client::report {

/// Whether `program` can be started; kFailedPrecondition with a line that says what to install if it cannot.
Status find_gnuplot(const std::string& program = "gnuplot");

/// What the script prints. It goes in and out through memory: no file is made. kFailedPrecondition if gnuplot is not there,
/// kInternal with the first line of its complaint if it fails.
Result<std::string> run_gnuplot(std::string_view script, const std::string& program = "gnuplot");

/// Colours that scripts use; svg_of_page() and svg_alone() put real ones in their place.
namespace colour {
inline constexpr const char* kGround = "#fefefe";
inline constexpr const char* kText = "#010101";
inline constexpr const char* kAxis = "#020202";
inline constexpr const char* kGrid = "#030303";
inline constexpr const char* kSoft = "#040404";
std::string series(size_t style);        ///< Of the algorithms, eight in turn.
std::string technique(size_t position);  ///< Of the classes of techniques, six in turn, from dark to light.
}  // namespace colour

/// The CSS variables behind the colours, "--s0:#0072b2;...", for a light or a dark ground.
std::string colour_variables(bool dark);

/// gnuplot's SVG without what nothing uses, as an element of an HTML page: colours are the page's variables, so that they follow
/// its light and dark mode, and names of elements begin with `prefix`, so that charts of one page do not share them. `description`
/// is read out in place of the chart.
std::string svg_of_page(std::string_view svg, const std::string& prefix, const std::string& description);
/// The same as a file of its own, with colours for white paper.
std::string svg_alone(std::string_view svg, const std::string& description);

}  // namespace lightloom::client::report
