// lightloom algorithms: the catalog.

#include <cstdio>
#include <memory>

#include "client/commands.h"
#include "common/transport/catalog.h"

namespace lightloom::client {

void add_algorithms_command(cli::App app, int* exit_code) {
    const cli::App command = app.add_subcommand("algorithms", "List the algorithms and their parameters (--set)");
    command->callback([exit_code] {
        for (const AlgorithmInfo* row : catalog()) {
            const AlgorithmInfo& algorithm = *row;
            std::printf("%s: %s\n  source: %s\n  %s\n", std::string(algorithm.name).c_str(), std::string(algorithm.summary).c_str(),
                        std::string(algorithm.source).c_str(), std::string(algorithm.bias).c_str());
            for (const ParameterInfo& p : algorithm.parameters) {
                std::printf("  --set %s=%g  %s; %s from %g to %g\n", std::string(p.name).c_str(), p.default_value,
                            std::string(p.help).c_str(), p.integer ? "integer" : "number", p.min_value, p.max_value);
            }
            std::printf("\n");
        }
        *exit_code = kSuccess;
    });
}

}  // namespace lightloom::client
