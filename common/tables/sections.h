#pragma once
// The format of all table files: a line that names the version, then named sections, each with its size and SHA-256.
// The same content has the same bytes on every host, and every damaged byte is noticed.

#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "common/core/result.h"

namespace lightloom {

/// Appends a section; `name` has 1 to 31 printable characters and no space.
void put_section(std::string& out, std::string_view name, std::string_view bytes);

/// Returns name and bytes of the sections after `magic`, in their order. kDataLoss when the magic differs, or a section
/// is cut short, malformed, damaged, or occurs twice.
Result<std::vector<std::pair<std::string, std::string_view>>> parse_sections(std::string_view bytes, std::string_view magic);

}  // namespace lightloom
