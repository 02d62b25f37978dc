#pragma once
// UTF-8, the encoding that texts on the wire and in JSON must have.

#include <string>
#include <string_view>

namespace lightloom {

/// Whether the text is well-formed UTF-8 [RFC 3629]: no overlong form, no surrogate, nothing above U+10FFFF.
bool is_utf8(std::string_view text);
/// At most `max_bytes` of the text, cut between two characters; U+FFFD stands for every byte that is not UTF-8.
std::string clipped_utf8(std::string_view text, size_t max_bytes);

}  // namespace lightloom
