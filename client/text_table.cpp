#include "client/text_table.h"

#include <algorithm>

#include "common/core/utf8.h"

namespace lightloom::client {
namespace {

constexpr const char* kEllipsis = "\xe2\x80\xa6";

}  // namespace

std::string text_table(const std::vector<std::vector<std::string>>& rows) {
    std::vector<size_t> widths;
    for (const auto& row : rows) {
        widths.resize(std::max(widths.size(), row.size()));
        for (size_t i = 0; i < row.size(); ++i) widths[i] = std::max(widths[i], character_count(row[i]));
    }
    std::string out;
    for (const auto& row : rows) {
        std::string line;
        for (size_t i = 0; i < row.size(); ++i) line += row[i] + std::string(widths[i] - character_count(row[i]) + 2, ' ');
        line.erase(line.find_last_not_of(' ') + 1);
        out += line + '\n';
    }
    return out;
}

std::string cell(const std::string& text, size_t width) {
    const std::string line = one_line(text);
    if (line.empty()) return "-";
    return character_count(line) <= width ? line : std::string(first_characters(line, width - 1)) + kEllipsis;
}

std::string path_cell(const std::string& path, size_t width) {
    const std::string line = one_line(path);
    if (line.empty()) return "-";
    return character_count(line) <= width ? line : kEllipsis + std::string(last_characters(line, width - 1));
}

}  // namespace lightloom::client
