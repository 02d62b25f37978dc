#include "common/tables/density_part.h"

#include "common/tables/arrays.h"
#include "common/tables/sections.h"

namespace lightloom {
namespace {

constexpr std::string_view kDensityMagic = "lightloom-density 1\n";

}  // namespace

const TablePart DensityPart::kPart{
    .name = "density",
    .serialize = [](const void* part) { return serialize(static_cast<const DensityPart*>(part)->data); },
    .parse = [](std::string_view bytes) -> Result<std::shared_ptr<const void>> {
        auto data = parse_density(bytes);
        if (!data.ok()) return data.status();
        return std::shared_ptr<const void>(std::make_shared<const DensityPart>(DensityPart{*std::move(data)}));
    },
    .validate = [](const void* part, const EmitterSet&) { return static_cast<const DensityPart*>(part)->data.validate(); },
};

std::shared_ptr<const DensityMap> density_of(const Tables& tables) {
    const auto part = tables.get<DensityPart>();
    if (!part || !part->data.learned()) return nullptr;
    return std::make_shared<const DensityMap>(part->data);
}

std::string serialize(const DensityData& d) {
    std::string out(kDensityMagic);
    put_section(out, "root", bytes_of(std::vector<float>{d.corner.x, d.corner.y, d.corner.z, d.side}));
    put_section(out, "nodes", bytes_of(d.nodes));
    put_section(out, "densities", bytes_of(d.densities));
    return out;
}

Result<DensityData> parse_density(std::string_view bytes) {
    const auto sections = parse_sections(bytes, kDensityMagic);
    if (!sections.ok()) return sections.status();
    DensityData d;
    std::vector<float> root;
    if (!read_section(*sections, "root", &root) || root.size() != 4 || !read_section(*sections, "nodes", &d.nodes) ||
        !read_section(*sections, "densities", &d.densities))
        return data_loss("the density map lacks a part, or one is malformed");
    d.corner = {root[0], root[1], root[2]};
    d.side = root[3];
    return d;
}

}  // namespace lightloom
