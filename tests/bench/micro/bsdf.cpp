// Every kind of BSDF: its value with both densities, a sample, and its construction.

#include "common/scene/bsdf.h"

#include <string>
#include <vector>

#include "common/core/rng.h"
#include "tests/bench/micro/count.h"

namespace lightloom::bench {
namespace {

constexpr int kCount = 1 << 12;

struct Directions {
    Vec3 wo, wi;
    float lobe;
    Vec2 u;
};

std::vector<Directions> make_directions(bool transmit) {
    std::vector<Directions> out;
    Rng rng({1});
    for (int n = 0; n < kCount; ++n) {
        Directions d{sample_cosine_hemisphere(rng.uniform2()), sample_cosine_hemisphere(rng.uniform2()), rng.uniform(),
                     rng.uniform2()};
        if (rng.uniform() < 0.5f) d.wo.z = -d.wo.z, d.wi.z = -d.wi.z;
        if (transmit && rng.uniform() < 0.5f) d.wi.z = -d.wi.z;
        out.push_back(d);
    }
    return out;
}

const Rgb kEta{0.2f, 0.9f, 1.1f}, kK{3.9f, 2.5f, 2.1f};
using Make = Bsdf (*)();
const struct {
    const char* name;
    Make make;
} kKinds[] = {
    {"diffuse", [] { return make_diffuse(Rgb(0.5f)); }},
    {"diffuse transmission", [] { return make_diffuse_transmission(Rgb(0.3f), Rgb(0.5f)); }},
    {"mirror", [] { return make_conductor(kEta, kK, 0, 0); }},
    {"rough conductor", [] { return make_conductor(kEta, kK, 0.2f, 0.2f); }},
    {"smooth dielectric", [] { return make_dielectric(1.5f, 0, 0); }},
    {"rough dielectric", [] { return make_dielectric(1.5f, 0.2f, 0.2f); }},
    {"thin dielectric", [] { return make_thin_dielectric(1.5f); }},
    {"smooth coat on diffuse", [] { return make_coated_diffuse(Rgb(0.5f), 1.5f, 0.01f, 0, 0); }},
    {"rough coat on diffuse", [] { return make_coated_diffuse(Rgb(0.5f), 1.5f, 0.01f, 0.2f, 0.2f); }},
    {"smooth coat on conductor", [] { return make_coated_conductor(kEta, kK, 0.2f, 0.2f, 1.5f, 0.01f, 0, 0); }},
    {"rough coat on conductor", [] { return make_coated_conductor(kEta, kK, 0.2f, 0.2f, 1.5f, 0.01f, 0.1f, 0.1f); }},
};

std::vector<Directions> directions_of(const Bsdf& b) {
    return make_directions(b.kind == BsdfKind::kDielectric || b.kind == BsdfKind::kDiffuseTransmission);
}

void eval(benchmark::State& state, Make make) {
    const Bsdf b = make();
    const std::vector<Directions> directions = directions_of(b);
    for (auto _ : state)
        for (const Directions& d : directions) benchmark::DoNotOptimize(b.eval(d.wo, d.wi, TransportMode::kRadiance));
    count_items(state, kCount, "values");
}

void sample(benchmark::State& state, Make make) {
    const Bsdf b = make();
    const std::vector<Directions> directions = directions_of(b);
    for (auto _ : state)
        for (const Directions& d : directions) {
            BsdfSample s;
            benchmark::DoNotOptimize(b.sample(d.wo, d.lobe, d.u, TransportMode::kRadiance, &s));
            benchmark::DoNotOptimize(s);
        }
    count_items(state, kCount, "samples");
}

void construct(benchmark::State& state, Make make) {
    for (auto _ : state)
        for (int n = 0; n < kCount; ++n) benchmark::DoNotOptimize(make());
    count_items(state, kCount, "BSDFs");
}

const bool registered = [] {
    for (const auto& kind : kKinds) {
        const std::string name = "bsdf/" + std::string(kind.name);
        const auto add = [&](const char* verb, void (*run)(benchmark::State&, Make)) {
            benchmark::RegisterBenchmark((name + verb).c_str(), run, kind.make)->Unit(benchmark::kMicrosecond);
        };
        add("/eval", eval);
        add("/sample", sample);
        add("/make", construct);
    }
    return true;
}();

}  // namespace
}  // namespace lightloom::bench
