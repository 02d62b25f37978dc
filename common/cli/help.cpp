#include "common/cli/help.h"

#include <algorithm>

namespace lightloom {

std::string wrapped(std::string_view text, size_t indent) {
    std::string out;
    size_t column = 0;
    while (!text.empty()) {
        const size_t end = std::min(text.find(' '), text.size());
        if (column > 0 && column + 1 + end <= kHelpWidth) {
            out += ' ';
            ++column;
        } else {
            out += (column > 0 ? "\n" : "") + std::string(indent, ' ');
            column = indent;
        }
        out += text.substr(0, end);
        column += end;
        text.remove_prefix(std::min(end + 1, text.size()));
    }
    return out + "\n";
}

std::string HelpFormatter::entry(const std::string& name, const std::string& description) const {
    const std::string head = "  " + name;
    if (description.empty()) return head + "\n";
    const std::string body = wrapped(description, column_width_);
    if (head.size() >= column_width_) return head + "\n" + body;
    return head + body.substr(head.size());
}

std::string HelpFormatter::make_option(const CLI::Option* option, bool is_positional) const {
    return entry(make_option_name(option, is_positional) + make_option_opts(option), make_option_desc(option));
}

std::string HelpFormatter::make_subcommand(const CLI::App* command) const {
    return entry(command->get_display_name(true), command->get_description());
}

}  // namespace lightloom
