#include "common/tables/sections.h"

#include <algorithm>
#include <cstdio>

#include "common/core/digest.h"

namespace lightloom {

void put_section(std::string& out, std::string_view name, std::string_view bytes) {
    out += name;
    out += ' ' + std::to_string(bytes.size()) + ' ' + sha256(bytes).hex() + '\n';
    out += bytes;
    out += '\n';
}

Result<std::vector<std::pair<std::string, std::string_view>>> parse_sections(std::string_view bytes, std::string_view magic) {
    if (bytes.substr(0, magic.size()) != magic) return data_loss("not a table file of a known version");
    std::vector<std::pair<std::string, std::string_view>> sections;
    size_t at = magic.size();
    while (at < bytes.size()) {
        const size_t line_end = bytes.find('\n', at);
        if (line_end == std::string_view::npos) return data_loss("the tables are cut short");
        const std::string line(bytes.substr(at, line_end - at));
        char name[32], hex[65];
        unsigned long long size = 0;
        if (std::sscanf(line.c_str(), "%31s %llu %64s", name, &size, hex) != 3) return data_loss("malformed table header");
        at = line_end + 1;
        if (size >= bytes.size() || at + size + 1 > bytes.size()) return data_loss("the tables are cut short");
        const std::string_view content = bytes.substr(at, size_t(size));
        // Only what put_section() writes is accepted.
        if (line != std::string(name) + ' ' + std::to_string(size) + ' ' + hex || bytes[at + size_t(size)] != '\n')
            return data_loss("malformed table header");
        if (sha256(content).hex() != hex) return data_loss(std::string("table ") + name + " is damaged");
        if (std::any_of(sections.begin(), sections.end(), [&](const auto& s) { return s.first == name; }))
            return data_loss(std::string("table ") + name + " occurs twice");
        sections.emplace_back(name, content);
        at += size_t(size) + 1;
    }
    return sections;
}

}  // namespace lightloom
