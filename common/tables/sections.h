#pragma once
// The shape that all files of tables have: a line that names the format, then named sections, each with its size and SHA-256. The
// same content has the same bytes on every host, and no byte of a file can be wrong unnoticed.

#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "common/core/result.h"

namespace lightloom {

/// `name` has 1 to 31 printable characters and no space.
void put_section(std::string& out, std::string_view name, std::string_view bytes);

/// Name and bytes of the sections behind `magic`, in their order. kDataLoss when the magic is another, or a section is cut short,
/// malformed, damaged, or occurs twice.
Result<std::vector<std::pair<std::string, std::string_view>>> parse_sections(std::string_view bytes, std::string_view magic);

}  // namespace lightloom
