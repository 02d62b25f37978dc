#include "common/tables/emission_part.h"

#include "common/tables/arrays.h"
#include "common/tables/sections.h"

namespace lightloom {
namespace {

constexpr std::string_view kEmissionMagic = "lightloom-emission 1\n";

struct Shares {
    float power, places, directions;
};

}  // namespace

const TablePart EmissionPart::kPart{
    .name = "emission",
    .serialize = [](const void* part) { return serialize(static_cast<const EmissionPart*>(part)->data); },
    .parse = [](std::string_view bytes) -> Result<std::shared_ptr<const void>> {
        auto data = parse_emission(bytes);
        if (!data.ok()) return data.status();
        return std::shared_ptr<const void>(std::make_shared<const EmissionPart>(EmissionPart{*std::move(data)}));
    },
    .validate =
        [](const void* part, const EmitterSet& emitters) {
            return static_cast<const EmissionPart*>(part)->data.validate(emitters.all().size());
        },
};

std::shared_ptr<const EmissionTable> emission_of(const Tables& tables) {
    const auto part = tables.get<EmissionPart>();
    return part && part->data.learned() ? std::make_shared<const EmissionTable>(part->data) : nullptr;
}

std::string serialize(const EmissionData& d) {
    std::string out(kEmissionMagic);
    put_section(out, "shares", bytes_of(std::vector<Shares>{{d.power_share, d.power_places, d.power_directions}}));
    put_section(out, "emitters", bytes_of(d.emitters));
    put_section(out, "places", bytes_of(d.places));
    put_section(out, "finite", bytes_of(d.finite));
    put_section(out, "infinite", bytes_of(d.infinite));
    put_section(out, "cells", bytes_of(d.cells));
    put_section(out, "squares", bytes_of(d.squares));
    return out;
}

Result<EmissionData> parse_emission(std::string_view bytes) {
    const auto sections = parse_sections(bytes, kEmissionMagic);
    if (!sections.ok()) return sections.status();
    const auto read = [&](const char* name, auto* values) { return read_section(*sections, name, values); };
    EmissionData d;
    std::vector<Shares> shares;
    if (!read("shares", &shares) || shares.size() != 1 || !read("emitters", &d.emitters) || !read("places", &d.places) ||
        !read("finite", &d.finite) || !read("infinite", &d.infinite) || !read("cells", &d.cells) || !read("squares", &d.squares))
        return data_loss("the emission table lacks a part, or one is malformed");
    d.power_share = shares[0].power, d.power_places = shares[0].places, d.power_directions = shares[0].directions;
    return d;
}

}  // namespace lightloom
