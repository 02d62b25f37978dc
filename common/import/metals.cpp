// Named metals, reduced once with conductor_rgb() from the measured spectra that pbrt-v4 knows by these names (Johnson
// and Christy, Palik, refractiveindex.info), between 380 and 780 nm.

#include <array>

#include "common/import/spectra.h"

namespace lightloom::import {

std::optional<ConductorRgb> named_metal(const std::string& name) {
    struct Named {
        std::string_view name;
        ConductorRgb indices;
    };
    static constexpr std::array<Named, 7> kNamed{{
        {"metal-Ag", {{0.1290f, 0.1264f, 0.1482f}, {4.1032f, 3.3686f, 2.3836f}}},
        {"metal-Al", {{1.2147f, 0.9207f, 0.6293f}, {7.1452f, 6.5747f, 5.5375f}}},
        {"metal-Au", {{0.2826f, 0.4793f, 1.4353f}, {106.31f, 2.5735f, 1.6769f}}},
        {"metal-Cu", {{0.4311f, 0.9639f, 1.1625f}, {6.0454f, 2.6043f, 2.3220f}}},
        // Brass has its indices near 620, 540 and 460 nm.
        {"metal-CuZn", {{0.4450f, 0.5682f, 0.9470f}, {3.5220f, 2.5880f, 1.9200f}}},
        {"metal-MgO", {{1.7371f, 1.7417f, 1.7522f}, {0.0000f, 0.0000f, 0.0413f}}},
        {"metal-TiO2", {{2.9095f, 2.9711f, 3.1602f}, {0.0001f, 0.0000f, 0.2692f}}},
    }};
    for (const Named& n : kNamed)
        if (n.name == name) return n.indices;
    return std::nullopt;
}

}  // namespace lightloom::import
