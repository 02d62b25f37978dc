#pragma once
// Parameter lists: "type name" followed by one or more values. The code that interprets a directive must ask for every
// parameter or name it as ignored; finish() reports the rest, so that nothing is silently dropped.

#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "common/core/vec.h"
#include "common/import/diagnostics.h"
#include "common/import/tokenizer.h"

namespace lightloom::import {

struct Parameter {
    std::string type, name;
    Location where;
    std::vector<double> numbers;       ///< float, integer, point*, vector*, normal, rgb, blackbody, spectrum values.
    std::vector<std::string> strings;  ///< string, texture, spectrum names and files.
    std::vector<bool> bools;
    bool from_attribute = false;  ///< Whether it is a default set by an Attribute directive, which may stay unused.
    mutable bool used = false;
};

class ParameterList {
  public:
    /// Reads parameters up to the next directive. `what` names the directive in messages, e.g. `Shape "sphere"`.
    static ParameterList parse(Tokenizer* tokens, const Location& where, std::string what);

    ParameterList() = default;
    ParameterList(const Location& where, std::string what) : where_(where), what_(std::move(what)) {}

    /// From now on unknown and refused parameters become faults of `diagnostics`, which may collect them; without this
    /// call they end the import.
    void report_to(Diagnostics* diagnostics) { diagnostics_ = diagnostics; }

    const Location& where() const { return where_; }
    const std::string& what() const { return what_; }

    /// The parameter of exactly this type and name, marked as used; null if there is none.
    const Parameter* find(std::string_view type, std::string_view name) const;
    /// The parameter of this name whatever its type, marked as used.
    const Parameter* find_any(std::string_view name) const;

    float one_float(std::string_view name, float fallback) const;
    int one_int(std::string_view name, int fallback) const;
    bool one_bool(std::string_view name, bool fallback) const;
    std::string one_string(std::string_view name, const std::string& fallback) const;
    /// The value, which must be one of `allowed`; the error lists these.
    std::string one_choice(std::string_view name, const std::string& fallback,
                           std::initializer_list<std::string_view> allowed) const;
    std::optional<Vec3> one_point3(std::string_view name) const;
    /// Numbers of a list parameter, in tuples of `tuple` (2 for point2, 3 for point3 ...); null if absent.
    const std::vector<double>* numbers(std::string_view type, std::string_view name, size_t tuple) const;

    /// The same as find_any(), but does not mark the parameter as used.
    const Parameter* peek(std::string_view name) const;
    void remove(std::string_view name);
    /// Removes the parameters that are not among `names`, which are separated by blanks.
    void keep_only(std::string_view names);
    /// Adds a parameter of numbers unless there is one of this name.
    void add_default(std::string_view type, std::string_view name, std::vector<double> numbers);

    /// Marks a parameter as ignored: if it is present, a warning gives the reason.
    void ignore(Diagnostics* diagnostics, std::string_view name, const std::string& reason) const;
    /// The same for every parameter of the list.
    void ignore_all(Diagnostics* diagnostics, const std::string& reason) const;
    /// Fails with the reason if the parameter is present.
    void refuse(std::string_view name, const std::string& reason) const;
    /// Accepts a parameter that cannot change anything here.
    void accept(std::string_view type, std::string_view name) const { find(type, name); }

    /// Fails if a parameter was not used: it is unknown or of the wrong type.
    void finish() const;
    /// Fails if a parameter that the list itself sets is not among the `known` ones, each a "type name": finish() does
    /// not check what comes from an Attribute directive, because a default need not suit every kind of shape, light ...
    void check(std::span<const std::string_view> known) const;
    /// Adds the defaults of Attribute directives that this list does not set itself.
    void add_defaults(const ParameterList& defaults);
    /// Replaces earlier values by later ones, for the Attribute directive.
    void override_with(const ParameterList& newer);

  private:
    void report(const Location& where, const std::string& what) const;
    const Parameter& expect_one(const Parameter& p, size_t count) const;
    /// Reports a parameter that is not among the `known` ones, either by its type or by its very name.
    void report_unknown(const Parameter& p, const std::vector<std::string_view>& known) const;

    Location where_;
    std::string what_;
    std::vector<Parameter> parameters_;
    Diagnostics* diagnostics_ = nullptr;
    mutable std::vector<std::string> asked_;  ///< "type name" of every typed question, for the wrong-type hint.
};

}  // namespace lightloom::import
