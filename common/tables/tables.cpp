#include "common/tables/tables.h"

#include <algorithm>

#include "common/tables/sections.h"

namespace lightloom {
namespace {

constexpr std::string_view kMagic = "lightloom-tables 2\n";
static_assert(kMagic.starts_with(kTablesPrefix));
constexpr std::string_view kAlgorithm = "algorithm";  // no part has this name

}  // namespace

void Tables::put(const TablePart* part, std::shared_ptr<const void> value) {
    const auto at = std::lower_bound(parts_.begin(), parts_.end(), part->name,
                                     [](const Entry& e, std::string_view name) { return e.part->name < name; });
    if (at != parts_.end() && at->part->name == part->name) {
        at->value = std::move(value);
    } else {
        parts_.insert(at, {part, std::move(value)});
    }
}

std::shared_ptr<const void> Tables::find(const TablePart* part) const {
    for (const Entry& e : parts_)
        if (e.part == part) return e.value;
    return nullptr;
}

bool Tables::consist_of(std::span<const TablePart* const> parts) const {
    return parts.size() == parts_.size() &&
           std::all_of(parts.begin(), parts.end(), [&](const TablePart* p) { return find(p) != nullptr; });
}

Status Tables::validate(const EmitterSet& emitters) const {
    for (const Entry& e : parts_) LL_RETURN_IF_ERROR(e.part->validate(e.value.get(), emitters));
    return {};
}

std::string serialize(const Tables& tables) {
    std::string out(kMagic);
    put_section(out, kAlgorithm, tables.algorithm_);
    for (const Tables::Entry& e : tables.parts_) put_section(out, e.part->name, e.part->serialize(e.value.get()));
    return out;
}

Result<Tables> parse_tables(std::string_view bytes, std::span<const TablePart* const> known) {
    const auto sections = parse_sections(bytes, kMagic);
    if (!sections.ok()) return sections.status();
    Tables tables;
    for (const auto& section : *sections) {
        const std::string& name = section.first;
        const std::string_view content = section.second;
        if (name == kAlgorithm) {
            tables.belong_to(std::string(content));
            continue;
        }
        const auto part = std::find_if(known.begin(), known.end(), [&](const TablePart* p) { return p->name == name; });
        if (part == known.end())
            return failed_precondition("the tables have a part '" + name +
                                       "' that this algorithm does not read; they belong to another algorithm");
        auto value = (*part)->parse(content);
        if (!value.ok()) return value.status();
        tables.put(*part, *std::move(value));
    }
    return tables;
}

}  // namespace lightloom
