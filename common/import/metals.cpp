#include <array>

#include "common/import/spectra.h"

namespace lightloom::import {

std::optional<ConductorRgb> named_metal(const std::string& name) {
    struct Named {
        std::string_view name;
        ConductorRgb indices;
    };
    static constexpr std::array<Named, 1> kNamed{{{"metal-Cu", {{0.2004f, 0.9240f, 1.1022f}, {3.9129f, 2.4528f, 2.1422f}}}}};
    for (const Named& n : kNamed)
        if (n.name == name) return n.indices;
    return std::nullopt;
}

}  // namespace lightloom::import
