#include "common/transport/renderer.h"

#include <algorithm>

#include "common/path/path_view.h"
#include "common/transport/bdpt.h"
#include "common/transport/light.h"
#include "common/transport/path.h"
#include "common/transport/unit_loop.h"

namespace lightloom {
namespace {

template <UnitAlgorithm A>
class UnitRenderer final : public Renderer {
  public:
    UnitRenderer(std::shared_ptr<const Scene> scene, RenderSettings settings, RouletteRule roulette, A algorithm)
        : scene_(std::move(scene)), settings_(std::move(settings)), roulette_(roulette), algorithm_(std::move(algorithm)) {}

    Result<Partial> render(const UnitWork& work, std::stop_token stop) const override {
        return render_unit(algorithm_, *scene_, settings_, roulette_, work, stop);
    }

  private:
    std::shared_ptr<const Scene> scene_;
    RenderSettings settings_;
    RouletteRule roulette_;
    A algorithm_;
};

}  // namespace

Result<std::unique_ptr<Renderer>> Renderer::create(std::shared_ptr<const Scene> scene, const RenderSettings& settings) {
    Result<const AlgorithmInfo*> info = find_algorithm(settings.algorithm);
    if (!info.ok()) return info.status();
    Result<AlgorithmParameters> parameters = parse_parameters(**info, settings.parameters);
    if (!parameters.ok()) return parameters.status();
    if (settings.max_depth < 0 || settings.max_depth + 1 > kMaxEdges)
        return invalid_argument("max depth must lie between 0 and " + std::to_string(kMaxEdges - 1) + ", not " +
                                std::to_string(settings.max_depth));
    const auto value = [&](std::string_view name) { return parameter_value(**info, *parameters, name); };
    RouletteRule roulette;
    roulette.first_vertex = int(value("rr-start"));
    roulette.min_survival = float(value("rr-min"));
    roulette.max_survival = std::max(roulette.max_survival, roulette.min_survival);  // rr-min=1 switches roulette off
    const auto make = [&](auto algorithm) {
        return std::unique_ptr<Renderer>(
            new UnitRenderer<decltype(algorithm)>(std::move(scene), settings, roulette, std::move(algorithm)));
    };
    if (settings.algorithm == "path") return make(PathAlgorithm{Heuristic(int(value("heuristic")))});
    if (settings.algorithm == "light") return make(LightAlgorithm{});
    BdptAlgorithm<> bdpt;
    bdpt.heuristic = Heuristic(int(value("heuristic")));
    bdpt.selection.light_paths_per_iteration = double(scene->frame().crop.area());
    return make(bdpt);
}

}  // namespace lightloom
