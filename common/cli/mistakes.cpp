#include "common/cli/mistakes.h"

#include <algorithm>
#include <vector>

#include "common/core/nearest.h"

namespace lightloom {
namespace {

std::string did_you_mean_one_of(const std::string& word, const std::vector<std::string>& known) {
    return did_you_mean(word, std::vector<std::string_view>(known.begin(), known.end()));
}

bool is_option(const std::string& word) { return word.size() > 1 && word[0] == '-'; }

/// "--spp" of "--spp=4".
std::string option_name(const std::string& word) { return word.substr(0, word.find('=')); }

/// The long options that help shows.
std::vector<std::string> options_of(const CLI::App& command) {
    std::vector<std::string> names;
    for (const CLI::Option* option : command.get_options()) {
        if (option->get_group().empty()) continue;
        for (const std::string& name : option->get_lnames()) names.push_back("--" + name);
    }
    return names;
}

std::vector<std::string> command_names_of(const CLI::App& app) {
    std::vector<std::string> names;
    for (const CLI::App* command : app.get_subcommands([](const CLI::App*) { return true; })) names.push_back(command->get_name());
    return names;
}

/// The word that stands where a command should, and is none; empty if there is no such word. A word behind an unknown option may
/// be that option's value.
std::string unknown_command(const CLI::App& app) {
    if (!app.get_subcommands().empty() || command_names_of(app).empty()) return {};
    const std::vector<std::string> rest = app.remaining();
    return rest.empty() || is_option(rest.front()) ? std::string() : rest.front();
}

}  // namespace

bool is_mistake(const CLI::App& app, const CLI::ParseError& error) {
    return error.get_exit_code() != int(CLI::ExitCodes::Success) || !unknown_command(app).empty();
}

std::string mistake_text(const CLI::App& app, const CLI::ParseError& error) {
    const std::vector<CLI::App*> used = app.get_subcommands();
    const CLI::App& command = used.empty() ? app : *used.back();
    const std::string help = "`" + app.get_name() + (used.empty() ? "" : " " + command.get_name()) + " --help`";
    if (const std::string word = unknown_command(app); !word.empty())
        return "there is no command '" + word + "'" + did_you_mean_one_of(word, command_names_of(app)) + "; " + help +
               " lists them";
    // CLI11 names an ExtrasError after the program, so kinds are told by their codes.
    const bool required = error.get_exit_code() == int(CLI::ExitCodes::RequiredError);
    // A word that was left over explains why something else is missing: an option's value may stand where the scene should.
    if (required || error.get_exit_code() == int(CLI::ExitCodes::ExtrasError)) {
        std::vector<std::string> rest = app.remaining();
        if (!used.empty()) {
            const std::vector<std::string> more = command.remaining();
            rest.insert(rest.end(), more.begin(), more.end());
        }
        const auto option = std::find_if(rest.begin(), rest.end(), is_option);
        if (option != rest.end()) {
            const std::string name = option_name(*option);
            return "there is no option '" + name + "'" + did_you_mean_one_of(name, options_of(command)) + "; " + help +
                   " lists them";
        }
        if (!rest.empty()) return "'" + rest.front() + "' was not expected; see " + help;
        if (used.empty() && !command_names_of(app).empty()) return "a command is missing; " + help + " lists them";
    }
    return std::string(error.what()) + "; see " + help;
}

}  // namespace lightloom
