#pragma once
// A script for gnuplot in the making: axes, labels and the style of every algorithm.

#include <span>
#include <string>
#include <vector>

#include "client/report/figures.h"

namespace lightloom::client::report {

/// A logarithmic axis.
struct Axis {
    double low = 1, high = 10;

    /// Around all values, with a little room, and at least a factor of four.
    static Axis around(std::span<const double> values);
    double position(double value) const;  ///< 0 at its low end, 1 at its high end.
    std::string tics() const;             ///< The list in "set xtics (...)".
};

/// Where the plot lies on its canvas, as shares of width and height.
struct Margins {
    double left = 0.165, right = 0.765, bottom = 0.17, top = 0.89;
};

class Plot {
  public:
    static constexpr int kWidth = 420, kHeight = 300;

    explicit Plot(const std::string& title, const Margins& margins = {});
    void log_axis(char name, const Axis& axis, const std::string& label);
    void line(const std::string& command) { text_ += command + "\n"; }
    /// A text in the canvas; `where` as in "graph 1.02, graph 0.5 left".
    void label(const std::string& text, const std::string& where, const std::string& colour, int size = 11);
    /// The name of an algorithm, in two lines where it is long.
    void name(const std::string& text, const std::string& where, const std::string& colour);
    /// A named block of data; returns the name.
    std::string data(const std::vector<std::vector<double>>& rows);
    /// One more element of the plot command.
    void add(const std::string& element);
    /// The median with its band, symbols and, below `open_below`, open ones.
    void series(const Band& band, size_t style, const std::string& label, double open_below);
    /// Names of algorithms beside their ends, from the top: each with its symbol.
    struct Name {
        double position = 0;  ///< Of the curve's end: 0 is the bottom of the plot, 1 its top.
        size_t style = 0;
        std::string text;
        bool soft = false;  ///< Of less importance.
    };
    void names(std::vector<Name> names);
    std::string script() const;

  private:
    std::string text_;
    std::vector<std::string> elements_;
    int blocks_ = 0, labels_ = 0;
};

/// gnuplot's text in single quotes.
std::string quoted(const std::string& text);
/// A number that gnuplot reads back as the same.
std::string exact(double value);
std::string point_type(size_t style, bool open);
std::string dash_type(size_t style);
/// At most `count` characters, with an ellipsis where there are more.
std::string shortened(const std::string& text, size_t count);

}  // namespace lightloom::client::report
