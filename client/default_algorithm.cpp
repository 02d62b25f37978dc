#include "client/default_algorithm.h"

#include <string_view>

#include "common/import/diagnostics.h"
#include "common/transport/catalog.h"

namespace lightloom::client {
namespace {

struct Translation {
    std::string_view integrator, algorithm;
};

/// pbrt's names and ours. The importer refuses media, so that volpath has nothing to do that path does not.
constexpr Translation kTranslations[] = {{"path", "path"}, {"volpath", "path"}, {"bdpt", "bdpt"}, {"lightpath", "light"}};

/// For every other scene: the algorithm that misses least without having to learn first.
constexpr std::string_view kOtherwise = "bdpt";

}  // namespace

DefaultAlgorithm default_algorithm(const std::string& integrator) {
    const std::string overrides = "; --algorithm overrides", otherwise(kOtherwise);
    for (const Translation& t : kTranslations) {
        if (t.integrator != integrator || !find_algorithm(t.algorithm).ok()) continue;
        const std::string name(t.algorithm);
        return {name, "the scene's Integrator " + import::quoted(integrator) + " asks for " + name + overrides};
    }
    if (integrator.empty()) return {otherwise, "the scene names no Integrator: rendering with " + otherwise + overrides};
    return {otherwise,
            "no algorithm for the scene's Integrator " + import::quoted(integrator) + ": rendering with " + otherwise + overrides};
}

}  // namespace lightloom::client
