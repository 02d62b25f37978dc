// Throughput of the film's most frequent operations on a dense 512 x 512 unit. Prints one line per operation; nothing
// passes or fails.

#include <algorithm>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <functional>

#include "common/core/rng.h"
#include "common/film/accumulation.h"
#include "common/film/exr_io.h"
#include "common/film/partial_exr.h"
#include "common/metrics/metrics.h"

namespace {

using namespace lightloom;

/// Shortest of several runs, in milliseconds: the speed of the machine when nothing else disturbs it.
double best_milliseconds(const std::function<void()>& run) {
    double best = 1e30;
    for (int i = 0; i < 15; ++i) {
        const auto start = std::chrono::steady_clock::now();
        run();
        best = std::min(best, std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - start).count());
    }
    return best;
}

void report(const char* name, double bytes, const std::function<void()>& run) {
    const double ms = best_milliseconds(run);
    std::printf("%-34s %9.3f ms %10.1f MiB/s\n", name, ms, bytes / (1 << 20) / (ms / 1000));
}

template <typename T>
T require(Result<T> result) {
    if (result.ok()) return std::move(result).value();
    std::fprintf(stderr, "film_bench: %s\n", result.status().message().c_str());
    std::exit(1);
}

void require(const Status& status) {
    if (status.ok()) return;
    std::fprintf(stderr, "film_bench: %s\n", status.message().c_str());
    std::exit(1);
}

Partial make_partial(const FrameLayout& frame, uint32_t splat_every) {
    Rng rng({1});
    Partial p;
    p.tile = frame.crop;
    p.samples_per_pixel = 1;
    p.light_paths = uint64_t(frame.crop.area());
    p.camera.resize(size_t(frame.crop.area()) * 3);
    for (double& v : p.camera) v = rng.uniform_double();
    for (uint32_t i = 0; i < frame.crop.area(); i += splat_every) {
        p.splats.push_back({i, {rng.uniform_double(), rng.uniform_double(), 0.1 + rng.uniform_double()}});
    }
    return p;
}

}  // namespace

int main() {
    const FrameLayout frame{512, 512, {0, 0, 512, 512}};
    for (const uint32_t every : {1u, 8u}) {
        const Partial partial = make_partial(frame, every);
        const PartialExpectation expected{frame, partial.tile, partial.samples_per_pixel, partial.light_paths};
        const EncodedPartial encoded = require(encode_partial(partial, frame));
        const double bytes = double(encoded.payload.size());
        std::printf("%s splats, payload of %.2f MiB\n", every == 1 ? "dense" : "sparse", bytes / (1 << 20));
        report("  encode_partial", bytes, [&] { require(encode_partial(partial, frame)); });
        report("  decode_partial", bytes, [&] { require(decode_partial(expected, encoded.descriptor, encoded.payload)); });
        report("  of which SHA-256", bytes, [&] { sha256(encoded.payload); });
        GroupSum group(frame);
        report("  GroupSum::add", bytes, [&] { require(group.add(partial)); });
    }
    GroupSum group(frame);
    const Partial partial = make_partial(frame, 1);
    require(group.add(partial));
    Accumulation total(frame);
    const double image_bytes = 512.0 * 512 * 12;
    report("Accumulation::fold", image_bytes, [&] { require(total.fold(group, 1)); });
    report("Accumulation::develop", image_bytes, [&] { total.develop(); });
    report("Accumulation::noise", image_bytes, [&] { total.noise(); });
    ExrImage image;
    image.frame = frame;
    image.color = total.develop();
    report("encode_exr (float, ZIP)", image_bytes, [&] { require(encode_exr(image)); });
    RgbImage noisy = image.color;
    Rng rng({2});
    for (float& v : noisy.pixels) v *= 0.9f + 0.2f * rng.uniform();
    report("compute_metrics", image_bytes, [&] { require(compute_metrics(noisy, image.color)); });
    return 0;
}
