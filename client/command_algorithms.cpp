// lightloom algorithms: the catalog, for people and as JSON.

#include <algorithm>
#include <cstdio>
#include <memory>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "client/commands.h"
#include "client/job_options.h"
#include "common/cli/command_line.h"
#include "common/cli/help.h"
#include "common/transport/catalog.h"

namespace lightloom::client {
namespace {

using Json = nlohmann::ordered_json;

constexpr const char* kFooter = R"(Examples:
  lightloom algorithms                 all of them, and each parameter once
  lightloom algorithms spcbpt          one of them, with all of its parameters
  lightloom algorithms --json          for programs

A parameter is set by --set KEY=VALUE in `render`, `submit`, `reference` and `replay`, and by NAME:KEY=VALUE in `bench`.)";

/// A parameter, and those that have it just so.
struct Shared {
    const ParameterInfo* parameter;
    std::string owners;
};

bool same(const ParameterInfo& a, const ParameterInfo& b) {
    return a.name == b.name && a.default_value == b.default_value && a.min_value == b.min_value && a.max_value == b.max_value &&
           a.integer == b.integer && a.help == b.help && a.by_depth == b.by_depth &&
           std::equal(a.choices.begin(), a.choices.end(), b.choices.begin(), b.choices.end());
}

std::vector<Shared> parameters_of(std::span<const AlgorithmInfo* const> rows) {
    std::vector<Shared> all;
    for (const AlgorithmInfo* row : rows) {
        for (const ParameterInfo& p : row->parameters) {
            const auto known = std::find_if(all.begin(), all.end(), [&](const Shared& s) { return same(*s.parameter, p); });
            if (known == all.end())
                all.push_back({&p, std::string(row->name)});
            else
                known->owners += ", " + std::string(row->name);
        }
    }
    return all;
}

void print(std::span<const AlgorithmInfo* const> rows) {
    const bool one = rows.size() == 1;
    std::string text;
    if (!one) text += "Algorithms (--algorithm NAME; `lightloom algorithms NAME` shows one in full)\n\n";
    for (const AlgorithmInfo* row : rows) {
        text += std::string(row->name) + "\n" + wrapped(row->summary, 4) + wrapped("source: " + std::string(row->source), 4) +
                wrapped("bias: " + std::string(row->bias), 4);
        std::string names;
        for (const ParameterInfo& p : row->parameters) names += (names.empty() ? "" : ", ") + std::string(p.name);
        if (!one) text += wrapped("parameters: " + (names.empty() ? "none" : names), 4);
        text += "\n";
    }
    const std::vector<Shared> parameters = parameters_of(rows);
    if (!parameters.empty()) text += "Parameters with their defaults (--set KEY=VALUE)\n\n";
    for (const Shared& shared : parameters) {
        const ParameterInfo& p = *shared.parameter;
        text += std::string(p.name) + "=" + p.text_of(p.default_value) + "\n" + wrapped(p.help, 4) + wrapped(p.range(), 4);
        if (!one) text += wrapped("of: " + shared.owners, 4);
        text += "\n";
    }
    text.pop_back();  // no empty line at the end
    std::fputs(text.c_str(), stdout);
}

Json describe(const ParameterInfo& p) {
    Json json{{"name", p.name}};
    if (!p.choices.empty()) {
        json["type"] = "choice";
        json["default"] = p.text_of(p.default_value);
        json["choices"] = std::vector<std::string>(p.choices.begin(), p.choices.end());
    } else {
        const auto number = [&](double value) { return p.integer ? Json(int64_t(value)) : Json(value); };
        json["type"] = p.integer ? "integer" : "number";
        json["by_depth"] = p.by_depth;
        json["default"] = p.by_depth ? Json(p.text_of(p.default_value)) : number(p.default_value.at_first);
        json["min"] = number(p.min_value);
        json["max"] = number(p.max_value);
    }
    json["help"] = p.help;
    return json;
}

Json describe(const AlgorithmInfo& row) {
    Json parameters = Json::array();
    for (const ParameterInfo& p : row.parameters) parameters.push_back(describe(p));
    return {{"name", row.name},
            {"summary", row.summary},
            {"source", row.source},
            {"bias", row.bias},
            {"tables", row.learning != nullptr},
            {"parameters", std::move(parameters)}};
}

int run(const std::string& name, bool json) {
    std::vector<const AlgorithmInfo*> rows(catalog().begin(), catalog().end());
    if (!name.empty()) {
        const auto row = find_algorithm(name);
        if (!row.ok()) return report_error(row.status());
        rows = {*row};
    }
    if (!json) {
        print(rows);
        return kSuccess;
    }
    Json all = Json::array();
    for (const AlgorithmInfo* row : rows) all.push_back(describe(*row));
    std::printf("%s\n", Json{{"algorithms", std::move(all)}}.dump(1).c_str());
    return kSuccess;
}

}  // namespace

void add_algorithms_command(cli::App app, int* exit_code) {
    struct Options {
        std::string name;
        bool json = false;
    };
    const auto options = std::make_shared<Options>();
    const cli::App command = app.add_subcommand("algorithms", "List the algorithms and their parameters (--algorithm, --set)");
    command->footer(kFooter);
    command->add_option("NAME", options->name, "Show this one alone, with all of its parameters");
    command->add_flag("--json", options->json, "Print one JSON document instead of text");
    command->callback([options, exit_code] { *exit_code = run(options->name, options->json); });
}

}  // namespace lightloom::client
