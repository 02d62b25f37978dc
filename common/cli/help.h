#pragma once
// How --help looks.

#include <CLI/CLI.hpp>

#include <cstddef>
#include <string>
#include <string_view>

namespace lightloom {

/// Columns of everything that --help and lists print.
inline constexpr size_t kHelpWidth = 100;

/// The text in lines of at most kHelpWidth columns, broken at spaces, each behind `indent` spaces; ends with a newline.
std::string wrapped(std::string_view text, size_t indent);

/// CLI11's own, with descriptions in lines that a terminal can show. Commands take it over from the program, so it is set before
/// they are added.
class HelpFormatter : public CLI::Formatter {
  public:
    std::string make_option(const CLI::Option* option, bool is_positional) const override;
    std::string make_subcommand(const CLI::App* command) const override;

  private:
    std::string entry(const std::string& name, const std::string& description) const;
};

}  // namespace lightloom
