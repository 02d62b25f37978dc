#pragma once
// Completion of command lines in a shell. The scripts are made from the options that a program declares, so they cannot offer what
// the program does not take.

#include <map>
#include <string>
#include <vector>

namespace CLI {
class App;
}

namespace lightloom {

/// Values of options that take one of a few words, by the option's long name with its dashes; --log is known. Other values are
/// completed as names of files.
using OptionWords = std::map<std::string, std::vector<std::string>>;

/// --completion SHELL, which help does not show: prints the script for bash or zsh and ends the program with success. Options and
/// commands may be added before or after it.
void add_completion_option(CLI::App& app, OptionWords words = {});

/// The scripts. They leave out the options that help does not show. Commands have no commands of their own.
std::string bash_completion(const CLI::App& app, const OptionWords& words);
std::string zsh_completion(const CLI::App& app, const OptionWords& words);

}  // namespace lightloom
