#include "common/tables/subspace_tables.h"

#include <cmath>

#include "common/tables/arrays.h"
#include "common/tables/sections.h"

namespace lightloom {
namespace {

constexpr std::string_view kMagic = "lightloom-subspaces 2\n";

Status positive(const std::vector<float>& values, size_t count, const char* name) {
    if (values.size() != count) return data_loss(std::string(name) + " has the wrong size");
    for (const float v : values) {
        if (!(v > 0 && std::isfinite(v))) return data_loss(std::string(name) + " holds a value that is not positive");
    }
    return {};
}

struct Shape {
    uint32_t light_count, eye_count;
    double vertices_per_path;
};

}  // namespace

const TablePart SubspaceTables::kPart{
    .name = "subspaces",
    .serialize = [](const void* part) { return serialize(*static_cast<const SubspaceTables*>(part)); },
    .parse = [](std::string_view bytes) -> Result<std::shared_ptr<const void>> {
        auto tables = parse_subspace_tables(bytes);
        if (!tables.ok()) return tables.status();
        return std::shared_ptr<const void>(std::make_shared<const SubspaceTables>(*std::move(tables)));
    },
    .validate = [](const void* part,
                   const EmitterSet& emitters) { return static_cast<const SubspaceTables*>(part)->validate(emitters); },
};

Status SubspaceTables::validate(const EmitterSet& emitters) const {
    if (light_count < 1 || eye_count < 1 || light_count > kMaxSubspaces || eye_count > kMaxSubspaces)
        return data_loss("the number of subspaces is out of range");
    LL_RETURN_IF_ERROR(division.validate(emitters, light_count));
    LL_RETURN_IF_ERROR(light_tree.validate(light_count));
    LL_RETURN_IF_ERROR(eye_tree.validate(eye_count));
    LL_RETURN_IF_ERROR(positive(energy, light_count, "Q"));
    LL_RETURN_IF_ERROR(positive(gamma, size_t(light_count) * eye_count, "Gamma"));
    for (uint32_t j = 0; j < eye_count; ++j) {
        double sum = 0;
        for (uint32_t i = 0; i < light_count; ++i) sum += double(column(j)[i]);
        if (std::fabs(sum - 1) > 1e-4) return data_loss("a column of Gamma does not sum to one");
    }
    if (window.size() != light_count) return data_loss("the window table has the wrong size");
    for (const uint16_t w : window) {
        if (w < 1 || w > kMaxWindow) return data_loss("the window table holds a number out of range");
    }
    if (!(vertices_per_path > 0 && std::isfinite(vertices_per_path)))
        return data_loss("the number of light vertices per path is not positive and finite");
    return {};
}

SubspaceTables trivial_tables(const EmitterSet& emitters) {
    SubspaceTables t;
    t.division = LightDivision::whole(emitters);
    t.energy = {1};
    t.gamma = {1};
    t.window = {1};
    return t;
}

std::string serialize(const SubspaceTables& t) {
    std::string out(kMagic);
    put_section(out, "shape", bytes_of(std::vector<Shape>{{t.light_count, t.eye_count, t.vertices_per_path}}));
    put_section(out, "division", bytes_of(t.division.cells()));
    put_section(out, "kappa-source", bytes_of(t.division.finite().nodes()));
    put_section(out, "kappa-light", bytes_of(t.light_tree.nodes()));
    put_section(out, "kappa-eye", bytes_of(t.eye_tree.nodes()));
    put_section(out, "Q", bytes_of(t.energy));
    put_section(out, "Gamma", bytes_of(t.gamma));
    put_section(out, "window", bytes_of(t.window));
    return out;
}

Result<SubspaceTables> parse_subspace_tables(std::string_view bytes) {
    const auto sections = parse_sections(bytes, kMagic);
    if (!sections.ok()) return sections.status();
    SubspaceTables t;
    std::vector<Shape> shape;
    std::vector<LightDivision::Cells> cells;
    std::vector<SubspaceTree::Node> source, light, eye;
    const auto read = [&](const char* name, auto* values) { return read_section(*sections, name, values); };
    if (!read("shape", &shape) || shape.size() != 1 || !read("division", &cells) || !read("kappa-source", &source) ||
        !read("kappa-light", &light) || !read("kappa-eye", &eye) || !read("Q", &t.energy) || !read("Gamma", &t.gamma) ||
        !read("window", &t.window))
        return data_loss("a table is missing or malformed");
    t.light_count = shape[0].light_count, t.eye_count = shape[0].eye_count;
    t.vertices_per_path = shape[0].vertices_per_path;
    t.division = LightDivision(std::move(cells), SubspaceTree(std::move(source)));
    t.light_tree = SubspaceTree(std::move(light));
    t.eye_tree = SubspaceTree(std::move(eye));
    return t;
}

}  // namespace lightloom
