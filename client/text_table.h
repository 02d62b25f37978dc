#pragma once
// Tables of text for a terminal, and the escaping of texts that may come from anybody.

#include <string>
#include <vector>

namespace lightloom::client {

/// Prints one line per row with columns as wide as their longest cell; no blanks follow a line's last text. Cells are UTF-8.
std::string text_table(const std::vector<std::vector<std::string>>& rows);

/// Makes a cell of a text: "-" if it is empty, with control characters escaped, and cut to `width` characters with an ellipsis.
/// A text keeps its beginning, a path its end.
std::string cell(const std::string& text, size_t width);
std::string path_cell(const std::string& path, size_t width);

}  // namespace lightloom::client
