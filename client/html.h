#pragma once
// Text in pages.

#include <string>
#include <string_view>

namespace lightloom::client {

/// The text with entities in place of &, <, > and ", fit for elements and for attributes in double quotes.
std::string escaped_html(std::string_view text);

/// The bytes as a source of an <img>: "data:TYPE;base64,...".
std::string data_url(std::string_view type, std::string_view bytes);

}  // namespace lightloom::client
