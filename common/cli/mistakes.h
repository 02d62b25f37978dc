#pragma once
// What is said about a command line that is not understood.

#include <CLI/CLI.hpp>

#include <string>

namespace lightloom {

/// Whether the command line is wrong, and `error` no mere wish for help or for the version: "rendr --help" is wrong.
bool is_mistake(const CLI::App& app, const CLI::ParseError& error);
/// One line without the program's name: what is wrong, which known command or option is near, and where help is. `app` is the whole
/// program, whose parse() threw `error`.
std::string mistake_text(const CLI::App& app, const CLI::ParseError& error);

}  // namespace lightloom
