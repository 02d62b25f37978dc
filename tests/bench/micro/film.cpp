// What happens to pixels: partials on the wire, their merging into a group and of groups into the image, and EXR files.

#include "common/core/rng.h"
#include "common/film/accumulation.h"
#include "common/film/exr_io.h"
#include "common/film/partial_exr.h"
#include "common/metrics/metrics.h"
#include "tests/bench/bench_scene.h"
#include "tests/bench/micro/count.h"

namespace lightloom::bench {
namespace {

constexpr FrameLayout kFrame{256, 256, {0, 0, 256, 256}};
constexpr uint64_t kPixels = 256 * 256;

void succeed(const Status& status) {
    if (status.ok()) return;
    std::fprintf(stderr, "micro: %s\n", status.message().c_str());
    std::exit(1);
}

/// One camera sample in every pixel and a splat in one of `splat_every`.
Partial make_partial(uint32_t splat_every) {
    Rng rng({1});
    Partial p;
    p.tile = kFrame.crop;
    p.samples_per_pixel = 1;
    p.light_paths = kPixels;
    p.camera.resize(kPixels * 3);
    for (double& v : p.camera) v = rng.uniform_double();
    for (uint32_t i = 0; i < kPixels; i += splat_every)
        p.splats.push_back({i, {rng.uniform_double(), rng.uniform_double(), 0.1 + rng.uniform_double()}});
    return p;
}

RgbImage make_image() {
    GroupSum group(kFrame);
    succeed(group.add(make_partial(1)));
    Accumulation total(kFrame);
    succeed(total.fold(group, 1));
    return total.develop();
}

void encode_partials(benchmark::State& state, uint32_t splat_every) {
    const Partial partial = make_partial(splat_every);
    uint64_t bytes = 0;
    for (auto _ : state) bytes = value_or_exit(encode_partial(partial, kFrame)).payload.size();
    count_items(state, kPixels, "pixels");
    state.SetBytesProcessed(int64_t(state.iterations()) * int64_t(bytes));
}
BENCHMARK_CAPTURE(encode_partials, dense, 1)->Name("exr/encode partial/dense splats")->Unit(benchmark::kMicrosecond);
BENCHMARK_CAPTURE(encode_partials, sparse, 8)->Name("exr/encode partial/sparse splats")->Unit(benchmark::kMicrosecond);

void decode_partials(benchmark::State& state, uint32_t splat_every) {
    const Partial partial = make_partial(splat_every);
    const EncodedPartial encoded = value_or_exit(encode_partial(partial, kFrame));
    const PartialExpectation expected{kFrame, partial.tile, partial.samples_per_pixel, partial.light_paths};
    for (auto _ : state) value_or_exit(decode_partial(expected, encoded.descriptor, encoded.payload));
    count_items(state, kPixels, "pixels");
    state.SetBytesProcessed(int64_t(state.iterations()) * int64_t(encoded.payload.size()));
}
BENCHMARK_CAPTURE(decode_partials, dense, 1)->Name("exr/decode partial/dense splats")->Unit(benchmark::kMicrosecond);
BENCHMARK_CAPTURE(decode_partials, sparse, 8)->Name("exr/decode partial/sparse splats")->Unit(benchmark::kMicrosecond);

/// The part of the above that a partial's digest takes.
void digests(benchmark::State& state) {
    const std::string payload = value_or_exit(encode_partial(make_partial(1), kFrame)).payload;
    for (auto _ : state) benchmark::DoNotOptimize(sha256(payload));
    count_items(state, kPixels, "pixels");
    state.SetBytesProcessed(int64_t(state.iterations()) * int64_t(payload.size()));
}
BENCHMARK(digests)->Name("exr/digest of a partial")->Unit(benchmark::kMicrosecond);

void merge_partials(benchmark::State& state, uint32_t splat_every) {
    const Partial partial = make_partial(splat_every);
    GroupSum group(kFrame);
    for (auto _ : state) succeed(group.add(partial));
    count_items(state, kPixels, "pixels");
}
BENCHMARK_CAPTURE(merge_partials, dense, 1)->Name("merge/partial into group/dense splats")->Unit(benchmark::kMicrosecond);
BENCHMARK_CAPTURE(merge_partials, sparse, 8)->Name("merge/partial into group/sparse splats")->Unit(benchmark::kMicrosecond);

void fold(benchmark::State& state) {
    GroupSum group(kFrame);
    succeed(group.add(make_partial(1)));
    Accumulation total(kFrame);
    for (auto _ : state) succeed(total.fold(group, 1));
    count_items(state, kPixels, "pixels");
}
BENCHMARK(fold)->Name("merge/group into image")->Unit(benchmark::kMicrosecond);

void develop(benchmark::State& state) {
    GroupSum group(kFrame);
    succeed(group.add(make_partial(1)));
    Accumulation total(kFrame);
    succeed(total.fold(group, 1));
    for (auto _ : state) benchmark::DoNotOptimize(total.develop());
    count_items(state, kPixels, "pixels");
}
BENCHMARK(develop)->Name("film/develop")->Unit(benchmark::kMicrosecond);

/// The image's error as its groups show it.
void noise(benchmark::State& state) {
    Accumulation total(kFrame);
    for (const uint32_t splat_every : {1u, 2u}) {
        GroupSum group(kFrame);
        succeed(group.add(make_partial(splat_every)));
        succeed(total.fold(group, 1));
    }
    for (auto _ : state) benchmark::DoNotOptimize(total.noise());
    count_items(state, kPixels, "pixels");
}
BENCHMARK(noise)->Name("film/noise estimate")->Unit(benchmark::kMicrosecond);

void encode_images(benchmark::State& state) {
    const ExrImage image{.frame = kFrame, .color = make_image(), .layers = {}, .attributes = {}};
    for (auto _ : state) value_or_exit(encode_exr(image));
    count_items(state, kPixels, "pixels");
}
BENCHMARK(encode_images)->Name("exr/encode image")->Unit(benchmark::kMicrosecond);

void decode_images(benchmark::State& state) {
    const ExrImage image{.frame = kFrame, .color = make_image(), .layers = {}, .attributes = {}};
    const std::string bytes = value_or_exit(encode_exr(image));
    for (auto _ : state) value_or_exit(decode_exr(bytes, "image"));
    count_items(state, kPixels, "pixels");
}
BENCHMARK(decode_images)->Name("exr/decode image")->Unit(benchmark::kMicrosecond);

void errors(benchmark::State& state) {
    const RgbImage reference = make_image();
    RgbImage noisy = reference;
    Rng rng({2});
    for (float& v : noisy.pixels) v *= 0.9f + 0.2f * rng.uniform();
    for (auto _ : state) value_or_exit(compute_metrics(noisy, reference));
    count_items(state, kPixels, "pixels");
}
BENCHMARK(errors)->Name("film/errors against a reference")->Unit(benchmark::kMicrosecond);

}  // namespace
}  // namespace lightloom::bench
