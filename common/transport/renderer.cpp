#include "common/transport/renderer.h"

#include "common/transport/bdpt.h"
#include "common/transport/light.h"
#include "common/transport/lvcbpt.h"
#include "common/transport/parameters.h"
#include "common/transport/path.h"
#include "common/transport/spcbpt.h"
#include "common/transport/unit_loop.h"

namespace lightloom {
namespace {

template <class A>
class UnitRenderer final : public Renderer {
  public:
    UnitRenderer(std::shared_ptr<const Scene> scene, RenderSettings settings, RouletteRule roulette, A algorithm)
        : scene_(std::move(scene)),
          settings_(std::move(settings)),
          roulette_(roulette),
          algorithm_(std::move(algorithm)) {}

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

Result<std::unique_ptr<Renderer>> Renderer::create(std::shared_ptr<const Scene> scene, const RenderSettings& settings,
                                                   std::shared_ptr<const SubspaceTables> tables) {
    const Result<TransportParameters> read = TransportParameters::read(settings);
    if (!read.ok()) return read.status();
    const TransportParameters& p = *read;
    if (p.needs_tables) {
        if (!tables) return failed_precondition("algorithm '" + settings.algorithm + "' needs its tables");
        LL_RETURN_IF_ERROR(tables->validate(scene->emitters()));
    }
    const double light_paths_per_iteration = p.light_paths * double(scene->frame().crop.area());
    const auto make = [&](auto algorithm) {
        return std::unique_ptr<Renderer>(
            new UnitRenderer<decltype(algorithm)>(std::move(scene), settings, p.roulette, std::move(algorithm)));
    };
    if (settings.algorithm == "path") return make(PathAlgorithm{p.heuristic});
    if (settings.algorithm == "light") return make(LightAlgorithm{});
    if (settings.algorithm == "bdpt") return make(BdptAlgorithm<>{{light_paths_per_iteration}, p.heuristic});
    if (settings.algorithm == "lvcbpt")
        return make(LvcbptAlgorithm<>{
            {{light_paths_per_iteration, double(p.connections) / tables->vertices_per_path, TypicalSurvival(p.roulette)},
             p.connections},
            p.heuristic,
            p.minimum_paths});
    return make(make_spcbpt(p, std::make_shared<const PreparedTables>(*tables), light_paths_per_iteration));
}

}  // namespace lightloom
