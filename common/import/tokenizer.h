#pragma once
// Splits pbrt text into tokens.

#include <string>
#include <string_view>

#include "common/import/diagnostics.h"

namespace lightloom::import {

enum class TokenKind { kWord, kString, kOpen, kClose, kEnd };

struct Token {
    TokenKind kind = TokenKind::kEnd;
    std::string_view text;  ///< A word, or a string without its quotes. Valid until the next token is read.
    Location where;
};

/// One file's tokens, with one token of look-ahead. Comments run from '#' to the end of the line.
class Tokenizer {
  public:
    /// `text` and `file` must outlive the tokenizer.
    Tokenizer(std::string_view text, const std::string* file) : text_(text), file_(file) {}

    const Token& peek();
    Token next();

  private:
    void scan();
    void scan_string();

    std::string_view text_;
    const std::string* file_;
    size_t pos_ = 0;
    int line_ = 1;
    bool ready_ = false;
    Token token_;
    std::string unescaped_;
};

/// Parses all of `text` as a finite number; false if it is not one.
bool parse_number(std::string_view text, double* out);

}  // namespace lightloom::import
