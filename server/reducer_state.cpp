#include "server/reducer_state.h"

#include <cstring>

#include "common/core/digest.h"
#include "common/core/state_bytes.h"

namespace lightloom {
namespace {

constexpr uint32_t kStateMagic = 0x5253'4c4c;  // "LLSR"
constexpr uint8_t kStateVersion = 1;
constexpr size_t kDigestBytes = sizeof(Digest::bytes);

template <class Visit>
void each_counter(UnitCounters& counters, const Visit& visit) {
    for (uint64_t* const n :
         {&counters.camera_samples, &counters.light_paths, &counters.rays, &counters.vertices, &counters.connections})
        visit(*n);
}

void write_rare_light(StateWriter& out, const RareLight& rare) {
    for (const Rgb& c : {rare.by_chance, rare.unreachable})
        for (const float v : {c.r, c.g, c.b}) out.put(v);
    out.put(rare.second_moment);
    out.put(rare.merges);
}

RareLight read_rare_light(StateReader& in) {
    RareLight rare;
    for (Rgb* const c : {&rare.by_chance, &rare.unreachable})
        for (float* const v : {&c->r, &c->g, &c->b}) *v = in.get<float>();
    rare.second_moment = in.get<double>();
    rare.merges = in.get<uint32_t>();
    return rare;
}

void write_noise(StateWriter& out, const std::optional<NoiseReport>& noise) {
    out.put(uint8_t(noise.has_value()));
    if (!noise) return;
    out.put(noise->estimate.relmse);
    out.put(noise->estimate.error);
    out.put(noise->estimate.groups);
    out.put(noise->estimate.iterations);
    out.put(uint8_t(noise->reached));
    out.put(uint8_t(noise->light_missing));
}

std::optional<NoiseReport> read_noise(StateReader& in) {
    if (in.get<uint8_t>() == 0) return std::nullopt;
    NoiseReport noise;
    noise.estimate.relmse = in.get<double>();
    noise.estimate.error = in.get<double>();
    noise.estimate.groups = in.get<uint32_t>();
    noise.estimate.iterations = in.get<uint64_t>();
    noise.reached = in.get<uint8_t>() != 0;
    noise.light_missing = in.get<uint8_t>() != 0;
    return noise;
}

void write_dropped(StateWriter& out, const DroppedOfUnit& dropped) {
    out.put(dropped.unit.group);
    out.put(dropped.unit.tile);
    out.put(dropped.sample.iteration);
    out.put(dropped.sample.pixel);
    out.put(uint8_t(dropped.sample.splat));
}

DroppedOfUnit read_dropped(StateReader& in) {
    DroppedOfUnit dropped;
    dropped.unit.group = in.get<uint32_t>();
    dropped.unit.tile = in.get<uint32_t>();
    dropped.sample.iteration = in.get<uint64_t>();
    dropped.sample.pixel = in.get<uint32_t>();
    dropped.sample.splat = in.get<uint8_t>() != 0;
    return dropped;
}

}  // namespace

std::string encode_reducer_state(const ReducerState& state, const Accumulation& complete) {
    std::string bytes;
    StateWriter out(bytes);
    out.put(kStateMagic);
    out.put(kStateVersion);
    out.put(state.tile_count);
    out.put(state.noise_target);
    UnitCounters counters = state.counters;
    each_counter(counters, [&](uint64_t n) { out.put(n); });
    write_rare_light(out, state.rare_light);
    write_noise(out, state.noise);
    out.put(uint64_t(state.dropped.size()));
    for (const DroppedOfUnit& dropped : state.dropped) write_dropped(out, dropped);
    complete.write_state(bytes);
    return bytes;
}

void seal_state(std::string& bytes) {
    const Digest digest = sha256(bytes);
    bytes.append(reinterpret_cast<const char*>(digest.bytes.data()), kDigestBytes);
}

Result<ReducerState> decode_reducer_state(std::string_view bytes, Accumulation& complete) {
    const Status damaged = data_loss("the saved sums of the job are damaged; it has to be rendered again");
    if (bytes.size() < kDigestBytes) return damaged;
    const std::string_view body = bytes.substr(0, bytes.size() - kDigestBytes);
    if (std::memcmp(sha256(body).bytes.data(), bytes.data() + body.size(), kDigestBytes) != 0) return damaged;
    StateReader in(body);
    if (in.get<uint32_t>() != kStateMagic) return damaged;
    if (const uint8_t version = in.get<uint8_t>(); version != kStateVersion)
        return failed_precondition("the saved sums of the job have version " + std::to_string(version) + ", not " +
                                   std::to_string(kStateVersion) + "; they were written by another build");
    ReducerState state;
    state.tile_count = in.get<uint32_t>();
    state.noise_target = in.get<double>();
    each_counter(state.counters, [&](uint64_t& n) { n = in.get<uint64_t>(); });
    state.rare_light = read_rare_light(in);
    state.noise = read_noise(in);
    const uint64_t dropped = in.get<uint64_t>();
    for (uint64_t i = 0; i < dropped && in.ok(); ++i) state.dropped.push_back(read_dropped(in));
    complete.read_state(in);
    // The digest was right: what does not fit was written for another job.
    if (!in.ok() || !in.at_end()) return failed_precondition("the saved sums are those of another job or frame");
    return state;
}

}  // namespace lightloom
