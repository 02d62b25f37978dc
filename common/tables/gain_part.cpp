#include "common/tables/gain_part.h"

#include "common/tables/arrays.h"
#include "common/tables/sections.h"

namespace lightloom {
namespace {

constexpr std::string_view kGainMagic = "lightloom-gain 1\n";

}  // namespace

const TablePart GainPart::kPart{
    .name = "gain",
    .serialize = [](const void* part) { return serialize(static_cast<const GainPart*>(part)->data); },
    .parse = [](std::string_view bytes) -> Result<std::shared_ptr<const void>> {
        auto data = parse_gain(bytes);
        if (!data.ok()) return data.status();
        return std::shared_ptr<const void>(std::make_shared<const GainPart>(GainPart{*std::move(data)}));
    },
    .validate = [](const void* part, const EmitterSet&) { return static_cast<const GainPart*>(part)->data.validate(); },
};

Result<std::shared_ptr<const GainTable>> gain_of(const Tables& tables, const Rect& crop) {
    const auto part = tables.get<GainPart>();
    if (!part || !part->data.learned()) return std::shared_ptr<const GainTable>();
    const FrameBlocks blocks(crop);
    if (part->data.blocks_x != blocks.columns() || part->data.blocks_y != blocks.rows())
        return failed_precondition("the gain table is that of another frame");
    return std::make_shared<const GainTable>(part->data, crop);
}

std::string serialize(const GainData& d) {
    std::string out(kGainMagic);
    put_section(out, "blocks", bytes_of(std::vector<int32_t>{d.blocks_x, d.blocks_y}));
    put_section(out, "brightness", bytes_of(d.brightness));
    put_section(out, "nodes", bytes_of(d.nodes));
    put_section(out, "gains", bytes_of(d.gains));
    return out;
}

Result<GainData> parse_gain(std::string_view bytes) {
    const auto sections = parse_sections(bytes, kGainMagic);
    if (!sections.ok()) return sections.status();
    const auto read = [&](const char* name, auto* values) { return read_section(*sections, name, values); };
    GainData d;
    std::vector<int32_t> blocks;
    if (!read("blocks", &blocks) || blocks.size() != 2 || !read("brightness", &d.brightness) || !read("nodes", &d.nodes) ||
        !read("gains", &d.gains))
        return data_loss("the gain table lacks a part, or one is malformed");
    d.blocks_x = blocks[0], d.blocks_y = blocks[1];
    return d;
}

}  // namespace lightloom
