// Nanoseconds per Bsdf::eval (value and both densities), per Bsdf::sample and per construction, for each kind. It uses
// one thread and reports the smallest of several repetitions, because other programs can only add time.
//
//     build/release/bin/bsdf_bench

#include <algorithm>
#include <chrono>
#include <cstdio>
#include <functional>
#include <vector>

#include "common/core/rng.h"
#include "common/scene/bsdf.h"

namespace lightloom {
namespace {

constexpr int kCount = 1 << 12, kRounds = 16, kRepetitions = 15;

struct Inputs {
    Vec3 wo, wi;
    float lobe;
    Vec2 u;
};

template <typename Work>
double nanoseconds(const std::vector<Inputs>& inputs, Work work) {
    double best = 1e30;
    for (int repetition = 0; repetition < kRepetitions; ++repetition) {
        float sink = 0;
        const auto start = std::chrono::steady_clock::now();
        for (int round = 0; round < kRounds; ++round)
            for (const Inputs& in : inputs) sink += work(in);
        const double seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
        // The sum must be used, because otherwise the compiler may leave the work out.
        if (sink == 1.2345f) std::puts("");
        best = std::min(best, seconds * 1e9 / (double(kRounds) * double(inputs.size())));
    }
    return best;
}

std::vector<Inputs> make_inputs(bool transmit) {
    std::vector<Inputs> inputs;
    Rng rng({1});
    for (int n = 0; n < kCount; ++n) {
        Inputs in{sample_cosine_hemisphere(rng.uniform2()), sample_cosine_hemisphere(rng.uniform2()), rng.uniform(),
                  rng.uniform2()};
        if (rng.uniform() < 0.5f) in.wo.z = -in.wo.z, in.wi.z = -in.wi.z;
        if (transmit && rng.uniform() < 0.5f) in.wi.z = -in.wi.z;
        inputs.push_back(in);
    }
    return inputs;
}

void run() {
    const Rgb eta{0.2f, 0.9f, 1.1f}, k{3.9f, 2.5f, 2.1f};
    const struct {
        const char* name;
        std::function<Bsdf()> make;
    } rows[] = {
        {"diffuse", [] { return make_diffuse(Rgb(0.5f)); }},
        {"diffuse transmission", [] { return make_diffuse_transmission(Rgb(0.3f), Rgb(0.5f)); }},
        {"mirror", [&] { return make_conductor(eta, k, 0, 0); }},
        {"rough conductor", [&] { return make_conductor(eta, k, 0.2f, 0.2f); }},
        {"smooth dielectric", [] { return make_dielectric(1.5f, 0, 0); }},
        {"rough dielectric", [] { return make_dielectric(1.5f, 0.2f, 0.2f); }},
        {"thin dielectric", [] { return make_thin_dielectric(1.5f); }},
        {"smooth coat, diffuse", [] { return make_coated_diffuse(Rgb(0.5f), 1.5f, 0.01f, 0, 0); }},
        {"rough coat, diffuse", [] { return make_coated_diffuse(Rgb(0.5f), 1.5f, 0.01f, 0.2f, 0.2f); }},
        {"smooth coat, conductor", [&] { return make_coated_conductor(eta, k, 0.2f, 0.2f, 1.5f, 0.01f, 0, 0); }},
        {"rough coat, conductor", [&] { return make_coated_conductor(eta, k, 0.2f, 0.2f, 1.5f, 0.01f, 0.1f, 0.1f); }},
    };
    std::printf("%-26s %9s %9s %9s   (ns)\n", "kind", "eval", "sample", "make");
    for (const auto& row : rows) {
        const Bsdf b = row.make();
        const std::vector<Inputs> inputs = make_inputs(b.kind == BsdfKind::kDielectric || b.kind == BsdfKind::kDiffuseTransmission);
        const double eval = nanoseconds(inputs, [&](const Inputs& in) {
            const BsdfEval e = b.eval(in.wo, in.wi, TransportMode::kRadiance);
            return e.f.r + e.pdf_fwd + e.pdf_rev;
        });
        const double sample = nanoseconds(inputs, [&](const Inputs& in) {
            BsdfSample s;
            return b.sample(in.wo, in.lobe, in.u, TransportMode::kRadiance, &s) ? s.weight.r + s.wi.x : 0.0f;
        });
        const double make = nanoseconds(inputs, [&](const Inputs&) { return row.make().base_weight; });
        std::printf("%-26s %9.1f %9.1f %9.1f\n", row.name, eval, sample, make);
    }
}

}  // namespace
}  // namespace lightloom

int main() { lightloom::run(); }
