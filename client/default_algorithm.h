#pragma once
// What renders where the command line names no algorithm: what the scene's own Integrator asks for, as far as the catalog has it.

#include <string>

namespace lightloom::client {

struct DefaultAlgorithm {
    std::string name;    ///< Of a row of the catalog.
    std::string reason;  ///< For the user, one line: who chose it, and how to choose otherwise.
};

/// `integrator` is that of the scene file, empty if it has none.
DefaultAlgorithm default_algorithm(const std::string& integrator);

}  // namespace lightloom::client
