#include "common/cli/completion.h"

#include <CLI/CLI.hpp>
#include <algorithm>
#include <iterator>

#include "common/cli/log.h"

namespace lightloom {
namespace {

/// An option of a program or of one of its commands.
struct Option {
    std::vector<std::string> names;  ///< With their dashes.
    std::string type;                ///< What kind of value it takes, without quotes and colons.
    std::string description;
    bool takes_value = false, repeats = false;
    const std::vector<std::string>* words = nullptr;
};

std::vector<Option> options_of(const CLI::App& app, const OptionWords& words) {
    std::vector<Option> options;
    for (const CLI::Option* declared : app.get_options()) {
        if (declared->get_group().empty() || !declared->nonpositional()) continue;
        Option option{.description = declared->get_description()};
        for (const std::string& name : declared->get_snames()) option.names.push_back("-" + name);
        for (const std::string& name : declared->get_lnames()) option.names.push_back("--" + name);
        option.takes_value = declared->get_items_expected_max() > 0;
        option.repeats = declared->get_items_expected_max() > 1;
        option.type = declared->get_type_name().substr(0, declared->get_type_name().find(':'));
        std::erase(option.type, '\'');
        if (option.type.empty()) option.type = "value";
        for (const std::string& name : option.names)
            if (const auto found = words.find(name); found != words.end()) option.words = &found->second;
        options.push_back(std::move(option));
    }
    return options;
}

std::vector<const CLI::App*> commands_of(const CLI::App& app) {
    return app.get_subcommands([](const CLI::App* command) { return !command->get_group().empty(); });
}

std::string joined(const std::vector<std::string>& words, const char* between) {
    std::string text;
    for (const std::string& word : words) text += (text.empty() ? "" : between) + word;
    return text;
}

/// As one word of a shell.
std::string in_quotes(const std::string& text) {
    std::string quoted = "'";
    for (const char c : text) quoted += c == '\'' ? std::string("'\\''") : std::string(1, c);
    return quoted + "'";
}

std::string with_backslashes(const std::string& text, std::string_view before) {
    std::string escaped;
    for (const char c : text) {
        if (c == '\\' || before.find(c) != before.npos) escaped += '\\';
        escaped += c;
    }
    return escaped;
}

/// Sets what bash completes after the command (or before one is given).
std::string bash_case(const std::string& pattern, const CLI::App& app, const OptionWords& words) {
    std::vector<std::string> names, with_value;
    for (const Option& option : options_of(app, words)) {
        names.insert(names.end(), option.names.begin(), option.names.end());
        if (option.takes_value) with_value.insert(with_value.end(), option.names.begin(), option.names.end());
    }
    return "        " + pattern + ")\n            options=" + in_quotes(joined(names, " ")) +
           "\n            with_value=" + in_quotes(joined(with_value, " ")) + " ;;\n";
}

/// The arguments of zsh's _arguments for the options, one to a line.
std::string zsh_options(const CLI::App& app, const OptionWords& words, const std::string& indent) {
    std::string text;
    for (const Option& option : options_of(app, words)) {
        for (const std::string& name : option.names) {
            std::string line = option.repeats ? "*" : "(" + joined(option.names, " ") + ")";
            line += name;
            if (option.takes_value) line += name.starts_with("--") ? "=" : "+";
            line += "[" + with_backslashes(option.description, "[]") + "]";
            if (option.takes_value)
                line += ":" + option.type + ":" + (option.words ? "(" + joined(*option.words, " ") + ")" : "_files");
            text += " \\\n" + indent + in_quotes(line);
        }
    }
    return text;
}

}  // namespace

std::string bash_completion(const CLI::App& app, const OptionWords& words) {
    const std::string function = "_" + app.get_name();
    std::vector<std::string> commands;
    std::string cases = bash_case("''", app, words);
    for (const CLI::App* command : commands_of(app)) {
        commands.push_back(command->get_name());
        cases += bash_case(command->get_name(), *command, words);
    }
    std::string program_options;
    for (const Option& option : options_of(app, words))
        if (option.takes_value) program_options += (program_options.empty() ? "" : " | ") + joined(option.names, " | ");
    std::string values;
    for (const auto& [option, choices] : words) {
        std::vector<std::string> names{option};
        const auto add_names = [&](const CLI::App& owner) {
            for (const Option& o : options_of(owner, words))
                if (o.words == &choices) names.insert(names.end(), o.names.begin(), o.names.end());
        };
        add_names(app);
        for (const CLI::App* command : commands_of(app)) add_names(*command);
        std::sort(names.begin(), names.end());
        names.erase(std::unique(names.begin(), names.end()), names.end());
        values += "            " + joined(names, " | ") + ") COMPREPLY=($(compgen -W " + in_quotes(joined(choices, " ")) +
                  " -- \"$word\")) ;;\n";
    }
    std::string text = "# Completion of " + app.get_name() + " in bash, as printed by: " + app.get_name() + " --completion bash\n";
    text += function + "() {\n    local word=$2 previous=$3 command='' options='' with_value='' i\n    COMPREPLY=()\n";
    if (!commands.empty()) {
        text +=
            "    # The command is the first word that is neither an option nor an option's value.\n"
            "    for ((i = 1; i < COMP_CWORD; ++i)); do\n        case ${COMP_WORDS[i]} in\n";
        if (!program_options.empty()) text += "        " + program_options + ") ((++i)) ;;\n";
        text += "        -*) ;;\n        *)\n            command=${COMP_WORDS[i]}\n            break ;;\n        esac\n    done\n";
    }
    text += "    case $command in\n" + cases + "    esac\n";
    text += "    if [[ \" $with_value \" == *\" $previous \"* ]]; then\n        case $previous in\n" + values +
            "            *) ;;  # the name of a file\n        esac\n"
            "    elif [[ $word == -* ]]; then\n        COMPREPLY=($(compgen -W \"$options\" -- \"$word\"))\n";
    if (!commands.empty())
        text += "    elif [[ -z $command ]]; then\n        COMPREPLY=($(compgen -W " + in_quotes(joined(commands, " ")) +
                " -- \"$word\"))\n";
    text += "    fi\n}\ncomplete -o default -F " + function + " " + app.get_name() + "\n";
    return text;
}

std::string zsh_completion(const CLI::App& app, const OptionWords& words) {
    const std::string function = "_" + app.get_name();
    std::string text = "#compdef " + app.get_name() + "\n# Completion of " + app.get_name() +
                       " in zsh, as printed by: " + app.get_name() + " --completion zsh\n" + function + "() {\n";
    const std::vector<const CLI::App*> commands = commands_of(app);
    if (commands.empty()) {
        text += "    _arguments -s" + zsh_options(app, words, "        ") + "\n";
    } else {
        std::string described, cases;
        for (const CLI::App* command : commands) {
            described += " \\\n                " + in_quotes(command->get_name() + ":" + command->get_description());
            cases += "                " + command->get_name() + ")\n                    _arguments -s" +
                     zsh_options(*command, words, "                        ") + " \\\n                        '*:file:_files' ;;\n";
        }
        text +=
            "    local curcontext=$curcontext state line\n    local -a commands\n    typeset -A opt_args\n    _arguments -C -s" +
            zsh_options(app, words, "        ") + " \\\n        '1: :->command' '*:: :->arguments'\n";
        text += "    case $state in\n        command)\n            commands=(" + described +
                ")\n            _describe command commands ;;\n        arguments)\n            case $line[1] in\n" + cases +
                "            esac ;;\n    esac\n";
    }
    // A file of $fpath is the function's body at its first call; a script that is sourced only declares it.
    text += "}\nif [[ $funcstack[1] == " + function + " ]]; then\n    " + function + " \"$@\"\nelse\n    compdef " + function +
            " " + app.get_name() + "\nfi\n";
    return text;
}

void add_completion_option(CLI::App& app, OptionWords words) {
    words["--log"].assign(std::begin(kLogLevels), std::end(kLogLevels));
    const auto print = [&app, words = std::move(words)](const std::string& shell) {
        if (shell != "bash" && shell != "zsh") throw CLI::ValidationError("--completion", "takes bash or zsh, not " + shell);
        // Like --version: CLI11 prints the text and ends with success.
        throw CLI::CallForVersion(shell == "bash" ? bash_completion(app, words) : zsh_completion(app, words), 0);
    };
    app.add_option_function<std::string>("--completion", print, "Print a script that completes command lines in bash or zsh")
        ->group("");
}

}  // namespace lightloom
