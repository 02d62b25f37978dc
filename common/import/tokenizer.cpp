#include "common/import/tokenizer.h"

#include <charconv>
#include <cmath>

namespace lightloom::import {
namespace {

bool is_space(char c) { return c == ' ' || c == '\t' || c == '\r' || c == '\n'; }

}  // namespace

const Token& Tokenizer::peek() {
    if (!ready_) scan();
    ready_ = true;
    return token_;
}

Token Tokenizer::next() {
    peek();
    ready_ = false;
    return token_;
}

void Tokenizer::scan() {
    while (pos_ < text_.size()) {
        const char c = text_[pos_];
        if (is_space(c)) {
            // A carriage return alone ends a line, too, which matters for comments.
            line_ += c == '\n' || (c == '\r' && (pos_ + 1 == text_.size() || text_[pos_ + 1] != '\n'));
            ++pos_;
        } else if (c == '#') {
            while (pos_ < text_.size() && text_[pos_] != '\n' && text_[pos_] != '\r') ++pos_;
        } else {
            break;
        }
    }
    token_ = {TokenKind::kEnd, {}, {file_, line_}};
    if (pos_ == text_.size()) return;
    const char c = text_[pos_];
    if (c == '[' || c == ']') {
        token_.kind = c == '[' ? TokenKind::kOpen : TokenKind::kClose;
        token_.text = text_.substr(pos_++, 1);
    } else if (c == '"') {
        scan_string();
    } else {
        const size_t begin = pos_;
        while (pos_ < text_.size() && !is_space(text_[pos_]) && text_[pos_] != '"' && text_[pos_] != '[' && text_[pos_] != ']' &&
               text_[pos_] != '#')
            ++pos_;
        token_.kind = TokenKind::kWord;
        token_.text = text_.substr(begin, pos_ - begin);
    }
}

void Tokenizer::scan_string() {
    const size_t begin = ++pos_;
    bool escaped = false;
    while (pos_ < text_.size() && text_[pos_] != '"') {
        if (text_[pos_] == '\n') fail(token_.where, "a quoted string is not closed on its line; add the missing \"");
        if (text_[pos_] == '\\') {
            escaped = true;
            ++pos_;
            if (pos_ == text_.size()) break;
        }
        ++pos_;
    }
    if (pos_ >= text_.size()) fail(token_.where, "the file ends inside a quoted string; add the missing \"");
    token_.kind = TokenKind::kString;
    token_.text = text_.substr(begin, pos_ - begin);
    ++pos_;
    if (!escaped) return;
    unescaped_.clear();
    for (size_t i = 0; i < token_.text.size(); ++i) {
        char c = token_.text[i];
        if (c == '\\') {
            c = token_.text[++i];
            switch (c) {
                case 'n': c = '\n'; break;
                case 't': c = '\t'; break;
                case 'r': c = '\r'; break;
                case 'b': c = '\b'; break;
                case 'f': c = '\f'; break;
                case '\\':
                case '\'':
                case '"': break;
                default: fail(token_.where, "unknown escape \\" + quoted(std::string(1, c)) + " in a quoted string");
            }
        }
        unescaped_ += c;
    }
    token_.text = unescaped_;
}

bool parse_number(std::string_view text, double* out) {
    if (!text.empty() && text.front() == '+') text.remove_prefix(1);
    if (text.empty() || text.front() == '+') return false;
    const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), *out);
    return error == std::errc() && end == text.data() + text.size() && std::isfinite(*out);
}

}  // namespace lightloom::import
