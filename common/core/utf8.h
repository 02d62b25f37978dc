#pragma once
// UTF-8, the encoding that texts on the wire and in JSON must have.

#include <string>
#include <string_view>

namespace lightloom {

/// Whether the text is well-formed UTF-8 [RFC 3629]: no overlong form, no surrogate, nothing above U+10FFFF.
bool is_utf8(std::string_view text);
/// At most `max_bytes` of the text, cut between two characters; U+FFFD stands for every byte that is not UTF-8.
std::string clipped_utf8(std::string_view text, size_t max_bytes);

/// Whether a terminal shows the text as one line from left to right: UTF-8 without control characters, line separators and
/// characters that turn the direction of the text.
bool is_one_line(std::string_view text);
/// The text with "\x1b" or "\u202e" in place of such characters, and U+FFFD in place of bytes that are not UTF-8.
std::string one_line(std::string_view text);
/// Characters of a UTF-8 text, each of which is taken to be one column wide.
size_t character_count(std::string_view text);
/// The first `count` characters of a UTF-8 text, or the last ones.
std::string_view first_characters(std::string_view text, size_t count);
std::string_view last_characters(std::string_view text, size_t count);

}  // namespace lightloom
