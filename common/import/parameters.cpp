#include "common/import/parameters.h"

#include <algorithm>
#include <array>
#include <climits>
#include <cmath>

namespace lightloom::import {
namespace {

enum class Values { kNumbers, kStrings, kBools, kNumbersOrStrings };

struct TypeRow {
    std::string_view name, canonical;
    Values values;
    size_t tuple;
};

// pbrt accepts a few spellings of the geometric types.
constexpr std::array<TypeRow, 19> kTypes{{
    {"float", "float", Values::kNumbers, 1},
    {"integer", "integer", Values::kNumbers, 1},
    {"bool", "bool", Values::kBools, 1},
    {"string", "string", Values::kStrings, 1},
    {"texture", "texture", Values::kStrings, 1},
    {"point2", "point2", Values::kNumbers, 2},
    {"vector2", "vector2", Values::kNumbers, 2},
    {"point3", "point3", Values::kNumbers, 3},
    {"point", "point3", Values::kNumbers, 3},
    {"vector3", "vector3", Values::kNumbers, 3},
    {"vector", "vector3", Values::kNumbers, 3},
    {"normal3", "normal", Values::kNumbers, 3},
    {"normal", "normal", Values::kNumbers, 3},
    {"rgb", "rgb", Values::kNumbers, 3},
    {"color", "rgb", Values::kNumbers, 3},
    {"blackbody", "blackbody", Values::kNumbers, 1},
    {"spectrum", "spectrum", Values::kNumbersOrStrings, 1},
    {"float3", "vector3", Values::kNumbers, 3},
    {"int", "integer", Values::kNumbers, 1},
}};

std::string title(const Parameter& p) { return quoted(p.type + " " + p.name); }

void add_value(const Token& token, const TypeRow& row, Parameter* p) {
    const std::string text(token.text);
    if (token.kind == TokenKind::kString) {
        if (row.values == Values::kBools && (text == "true" || text == "false")) {
            p->bools.push_back(text == "true");
        } else if (row.values == Values::kStrings || row.values == Values::kNumbersOrStrings) {
            p->strings.push_back(text);
        } else {
            fail(token.where, "the parameter " + title(*p) + " cannot have the string value " + quoted(text));
        }
        return;
    }
    if (row.values == Values::kBools) {
        if (text != "true" && text != "false")
            fail(token.where, "the parameter " + title(*p) + " must be true or false, not " + quoted(text));
        p->bools.push_back(text == "true");
        return;
    }
    if (row.values == Values::kStrings)
        fail(token.where, "the parameter " + title(*p) + " needs a quoted string, not " + quoted(text));
    double number = 0;
    if (!parse_number(token.text, &number))
        fail(token.where, "the parameter " + title(*p) + " has the value " + quoted(text) + ", which is not a finite number");
    if (row.canonical == "integer") {
        if (number != std::floor(number) || number < INT_MIN || number > INT_MAX)
            fail(token.where, "the parameter " + title(*p) + " has the value " + quoted(text) + ", which is not a 32-bit integer");
    } else if (!std::isfinite(float(number))) {
        fail(token.where, "the parameter " + title(*p) + " has the value " + quoted(text) + ", which is beyond single precision");
    }
    p->numbers.push_back(number);
}

}  // namespace

ParameterList ParameterList::parse(Tokenizer* tokens, const Location& where, std::string what) {
    ParameterList list(where, std::move(what));
    while (tokens->peek().kind == TokenKind::kString) {
        const Token declaration = tokens->next();
        Parameter p;
        p.where = declaration.where;
        const std::string text(declaration.text);
        const size_t space = text.find_first_of(" \t");
        const size_t name_begin = text.find_first_not_of(" \t", space);
        if (space == std::string::npos || space == 0 || name_begin == std::string::npos)
            fail(p.where, "expected a parameter like \"float radius\" in " + list.what_ + ", not " + quoted(text));
        p.type = text.substr(0, space);
        p.name = text.substr(name_begin, text.find_last_not_of(" \t") + 1 - name_begin);
        const auto row = std::find_if(kTypes.begin(), kTypes.end(), [&](const TypeRow& r) { return r.name == p.type; });
        if (row == kTypes.end())
            fail(p.where, "unknown parameter type " + quoted(p.type) + " of " + quoted(text) + " in " + list.what_);
        p.type = row->canonical;
        for (const Parameter& other : list.parameters_)
            if (other.name == p.name) fail(p.where, "the parameter " + quoted(p.name) + " is given twice in " + list.what_);
        if (tokens->peek().kind == TokenKind::kOpen) {
            tokens->next();
            while (tokens->peek().kind != TokenKind::kClose) {
                const Token value = tokens->next();
                if (value.kind == TokenKind::kEnd || value.kind == TokenKind::kOpen)
                    fail(p.where, "the value list of " + title(p) + " in " + list.what_ + " is not closed; add the missing ]");
                add_value(value, *row, &p);
            }
            tokens->next();
        } else {
            const Token value = tokens->next();
            if (value.kind != TokenKind::kWord && value.kind != TokenKind::kString)
                fail(p.where, "the parameter " + title(p) + " in " + list.what_ + " has no value");
            add_value(value, *row, &p);
        }
        const size_t count = p.numbers.size() + p.strings.size() + p.bools.size();
        if (count == 0) fail(p.where, "the parameter " + title(p) + " in " + list.what_ + " has no value");
        if (count % row->tuple != 0)
            fail(p.where, "the parameter " + title(p) + " in " + list.what_ + " has " + std::to_string(count) +
                              " values, which is not a multiple of " + std::to_string(row->tuple));
        list.parameters_.push_back(std::move(p));
    }
    return list;
}

const Parameter* ParameterList::find(std::string_view type, std::string_view name) const {
    for (const Parameter& p : parameters_)
        if (p.name == name && p.type == type) {
            p.used = true;
            return &p;
        }
    asked_.push_back(std::string(type) + " " + std::string(name));
    return nullptr;
}

const Parameter* ParameterList::find_any(std::string_view name) const {
    for (const Parameter& p : parameters_)
        if (p.name == name) {
            p.used = true;
            return &p;
        }
    return nullptr;
}

const Parameter& ParameterList::expect_one(const Parameter& p, size_t count) const {
    const size_t given = p.numbers.size() + p.strings.size() + p.bools.size();
    if (given != count)
        fail(p.where, "the parameter " + title(p) + " in " + what_ + " needs " + std::to_string(count) + " value" +
                          (count == 1 ? "" : "s") + ", not " + std::to_string(given));
    return p;
}

float ParameterList::one_float(std::string_view name, float fallback) const {
    const Parameter* p = find("float", name);
    return p ? float(expect_one(*p, 1).numbers[0]) : fallback;
}

int ParameterList::one_int(std::string_view name, int fallback) const {
    const Parameter* p = find("integer", name);
    return p ? int(expect_one(*p, 1).numbers[0]) : fallback;
}

bool ParameterList::one_bool(std::string_view name, bool fallback) const {
    const Parameter* p = find("bool", name);
    return p ? bool(expect_one(*p, 1).bools[0]) : fallback;
}

std::string ParameterList::one_string(std::string_view name, const std::string& fallback) const {
    const Parameter* p = find("string", name);
    return p ? expect_one(*p, 1).strings[0] : fallback;
}

std::string ParameterList::one_choice(std::string_view name, const std::string& fallback,
                                      std::initializer_list<std::string_view> allowed) const {
    const std::string value = one_string(name, fallback);
    if (std::find(allowed.begin(), allowed.end(), value) != allowed.end()) return value;
    std::string list;
    for (const std::string_view a : allowed) list.append(list.empty() ? "" : ", ").append(a);
    fail(where_, what_ + ": " + quoted(std::string(name)) + " is " + quoted(value) + "; supported: " + list);
}

std::optional<Vec3> ParameterList::one_point3(std::string_view name) const {
    const Parameter* p = find("point3", name);
    if (!p) return std::nullopt;
    expect_one(*p, 3);
    return Vec3{float(p->numbers[0]), float(p->numbers[1]), float(p->numbers[2])};
}

const std::vector<double>* ParameterList::numbers(std::string_view type, std::string_view name, size_t tuple) const {
    const Parameter* p = find(type, name);
    if (!p) return nullptr;
    if (p->numbers.size() % tuple != 0)
        fail(p->where, "the parameter " + title(*p) + " in " + what_ + " needs a multiple of " + std::to_string(tuple) +
                           " values, not " + std::to_string(p->numbers.size()));
    return &p->numbers;
}

void ParameterList::ignore(Diagnostics* diagnostics, std::string_view name, const std::string& reason) const {
    if (const Parameter* p = find_any(name)) diagnostics->warn(p->where, what_ + ": " + title(*p) + " is ignored: " + reason);
}

void ParameterList::ignore_all(Diagnostics* diagnostics, const std::string& reason) const {
    for (const Parameter& p : parameters_) ignore(diagnostics, p.name, reason);
}

void ParameterList::refuse(std::string_view name, const std::string& reason) const {
    if (const Parameter* p = find_any(name)) report(p->where, what_ + ": " + title(*p) + " is not supported: " + reason);
}

void ParameterList::report(const Location& where, const std::string& what) const {
    if (!diagnostics_) fail(where, what);
    diagnostics_->fault({where, what, {}});
}

const Parameter* ParameterList::peek(std::string_view name) const {
    const auto it = std::find_if(parameters_.begin(), parameters_.end(), [&](const Parameter& p) { return p.name == name; });
    return it == parameters_.end() ? nullptr : &*it;
}

void ParameterList::remove(std::string_view name) {
    std::erase_if(parameters_, [&](const Parameter& p) { return p.name == name; });
}

void ParameterList::keep_only(std::string_view names) {
    const std::string padded = " " + std::string(names) + " ";
    std::erase_if(parameters_, [&](const Parameter& p) { return padded.find(" " + p.name + " ") == std::string::npos; });
}

void ParameterList::add_default(std::string_view type, std::string_view name, std::vector<double> numbers) {
    if (peek(name)) return;
    Parameter p;
    p.type = type;
    p.name = name;
    p.where = where_;
    p.numbers = std::move(numbers);
    parameters_.push_back(std::move(p));
}

void ParameterList::finish() const {
    for (const Parameter& p : parameters_)
        if (!p.used && !p.from_attribute) report_unknown(p, {asked_.begin(), asked_.end()});
}

void ParameterList::check(std::span<const std::string_view> known) const {
    for (const Parameter& p : parameters_)
        if (!p.from_attribute && std::find(known.begin(), known.end(), p.type + " " + p.name) == known.end())
            report_unknown(p, {known.begin(), known.end()});
}

void ParameterList::report_unknown(const Parameter& p, const std::vector<std::string_view>& known) const {
    std::vector<std::string> right;
    for (const std::string_view k : known) {
        if (k.substr(k.find(' ') + 1) != p.name) continue;
        std::string declaration = quoted(std::string(k));
        if (std::find(right.begin(), right.end(), declaration) == right.end()) right.push_back(std::move(declaration));
    }
    if (right.empty()) return report(p.where, what_ + ": unknown parameter " + title(p) + "; remove it or correct its name");
    std::string list = right[0];
    for (size_t i = 1; i < right.size(); ++i) list += " or " + right[i];
    report(p.where, what_ + ": " + title(p) + " has the wrong type; write " + list);
}

void ParameterList::add_defaults(const ParameterList& defaults) {
    for (const Parameter& d : defaults.parameters_) {
        const auto same = [&](const Parameter& p) { return p.name == d.name; };
        if (std::any_of(parameters_.begin(), parameters_.end(), same)) continue;
        parameters_.push_back(d);
        parameters_.back().from_attribute = true;
        parameters_.back().used = false;
    }
}

void ParameterList::override_with(const ParameterList& newer) {
    for (const Parameter& n : newer.parameters_) {
        std::erase_if(parameters_, [&](const Parameter& p) { return p.name == n.name; });
        parameters_.push_back(n);
    }
}

}  // namespace lightloom::import
