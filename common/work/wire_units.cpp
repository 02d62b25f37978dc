// What coordinator and workers say to each other: units, leases, results.

#include <cmath>

#include "common/core/utf8.h"
#include "common/work/wire.h"
#include "common/work/wire_parts.h"

namespace lightloom::wire {

void put(const WorkUnit& in, v1::WorkUnit* out) {
    put_key(in.key, out->mutable_key());
    out->set_first_iteration(in.render.first_iteration);
    out->set_iteration_count(in.render.iteration_count);
    put_rect(in.render.tile, out->mutable_tile());
    out->set_first_light_path(in.render.first_light_path);
    out->set_light_path_count(in.render.light_path_count);
    out->set_splats_only(in.render.splats_only);
    out->set_first_training_sample(in.training.first_sample);
    out->set_training_sample_count(in.training.sample_count);
    out->set_training_sample_total_count(in.training.total_samples);
}

Result<WorkUnit> get(const v1::WorkUnit& in) {
    const auto key = get_key(in.key());
    if (!key.ok()) return key.status();
    return WorkUnit{.key = *key,
                    .render = {.first_iteration = in.first_iteration(),
                               .iteration_count = in.iteration_count(),
                               .group_first_iteration = in.first_iteration(),
                               .tile = get_rect(in.tile()),
                               .first_light_path = in.first_light_path(),
                               .light_path_count = in.light_path_count(),
                               .splats_only = in.splats_only()},
                    .training = {in.first_training_sample(), in.training_sample_count(), in.training_sample_total_count()}};
}

void put(const UnitReference& in, v1::UnitReference* out) {
    out->set_job_id(in.job_id);
    put_key(in.key, out->mutable_key());
}

Result<UnitReference> get(const v1::UnitReference& in) {
    const auto key = get_key(in.key());
    if (!key.ok()) return key.status();
    return UnitReference{in.job_id(), *key};
}

void put(const UnitLease& in, v1::UnitLease* out) {
    out->set_job_id(in.job_id);
    put(in.spec, out->mutable_spec());
    put(in.unit, out->mutable_unit());
    if (in.tables.size_bytes > 0) put_asset(in.tables, out->mutable_tables());
}

Result<UnitLease> get(const v1::UnitLease& in) {
    auto spec = get(in.spec());
    if (!spec.ok()) return spec.status();
    const auto unit = get(in.unit());
    if (!unit.ok()) return unit.status();
    UnitLease lease{in.job_id(), *std::move(spec), *unit, {}};
    if (!in.has_tables()) return lease;
    const auto tables = get_asset(in.tables());
    if (!tables.ok()) return tables.status();
    lease.tables = *tables;
    return lease;
}

void put(const WorkerHello& in, v1::WorkerHello* out) {
    out->set_build_id(in.identity.build_id);
    out->set_math_profile(in.identity.math_profile);
    put(in.identity.golden_digest, out->mutable_golden_digest());
    out->set_thread_count(in.thread_count);
    out->set_host(in.host);
    out->set_process_id(in.process_id);
}

Result<WorkerHello> get(const v1::WorkerHello& in) {
    auto digest = get(in.golden_digest());
    if (!digest.ok()) return digest.status();
    if (in.build_id().size() > 256 || in.math_profile().size() > 1024 || in.host().size() > 256)
        return invalid_argument("a worker's build id, math profile or host name is too long");
    return WorkerHello{.identity = {in.build_id(), in.math_profile(), *digest},
                       .thread_count = in.thread_count(),
                       .host = in.host(),
                       .process_id = in.process_id()};
}

void put(const WorkerGrant& in, v1::WorkerGrant* out) {
    out->set_worker_id(in.worker_id);
    out->set_heartbeat_seconds(in.heartbeat_seconds);
    out->set_lease_seconds(in.lease_seconds);
}

WorkerGrant get(const v1::WorkerGrant& in) { return {in.worker_id(), in.heartbeat_seconds(), in.lease_seconds()}; }

void put(const SubmitAck& in, v1::SubmitResultResponse* out) {
    out->set_outcome(v1::SubmitOutcome(int(in.outcome) + 1));
    out->set_reason(clipped_utf8(in.reason, kMaxMessageBytes));
}

Result<SubmitAck> get(const v1::SubmitResultResponse& in) {
    if (in.outcome() < v1::SUBMIT_OUTCOME_ACCEPTED || in.outcome() > v1::SUBMIT_OUTCOME_REJECTED)
        return invalid_argument("the coordinator answered with an unknown outcome");
    return SubmitAck{SubmitOutcome(int(in.outcome()) - 1), in.reason()};
}

namespace {

void put(const RareLight& in, v1::RareLight* out) {
    for (int c = 0; c < 3; ++c) {
        out->add_by_chance(in.by_chance[c]);
        out->add_unreachable(in.unreachable[c]);
    }
    out->set_second_moment(in.second_moment);
    out->set_merge_count(in.merges);
}

Result<RareLight> get(const v1::RareLight& in) {
    if (in.by_chance_size() != 3 || in.unreachable_size() != 3)
        return invalid_argument("colours of rare light have three channels");
    return RareLight{{in.by_chance(0), in.by_chance(1), in.by_chance(2)},
                     {in.unreachable(0), in.unreachable(1), in.unreachable(2)},
                     in.second_moment(),
                     in.merge_count()};
}

}  // namespace

void put(const PartialDescriptor& in, v1::SubmitResultHeader* out) {
    put(in.payload_digest, out->mutable_payload_digest());
    out->set_payload_size_bytes(in.payload_size);
    out->set_splat_count(in.splat_count);
    out->set_samples_per_pixel(in.samples_per_pixel);
    out->set_light_path_count(in.light_paths);
    out->set_dropped_sample_count(in.dropped_count);
    for (const DroppedSample& sample : in.dropped) {
        v1::DroppedSample* item = out->add_dropped_samples();
        item->set_iteration(sample.iteration);
        item->set_pixel(sample.pixel);
        item->set_splat(sample.splat);
    }
    out->set_counted_camera_sample_count(in.counters.camera_samples);
    out->set_counted_light_path_count(in.counters.light_paths);
    out->set_ray_count(in.counters.rays);
    out->set_vertex_count(in.counters.vertices);
    out->set_connection_count(in.counters.connections);
    if (in.rare_light != RareLight{}) put(in.rare_light, out->mutable_rare_light());
}

Result<PartialDescriptor> get(const v1::SubmitResultHeader& in) {
    auto digest = get(in.payload_digest());
    if (!digest.ok()) return digest.status();
    PartialDescriptor out;
    out.payload_digest = *digest;
    out.payload_size = in.payload_size_bytes();
    out.splat_count = in.splat_count();
    out.samples_per_pixel = in.samples_per_pixel();
    out.light_paths = in.light_path_count();
    out.dropped_count = in.dropped_sample_count();
    if (size_t(in.dropped_samples_size()) > Partial::kMaxDroppedRecords)
        return invalid_argument("more than 16 records of dropped samples");
    for (const v1::DroppedSample& sample : in.dropped_samples())
        out.dropped.push_back({sample.iteration(), sample.pixel(), sample.splat()});
    out.counters = {.camera_samples = in.counted_camera_sample_count(),
                    .light_paths = in.counted_light_path_count(),
                    .rays = in.ray_count(),
                    .vertices = in.vertex_count(),
                    .connections = in.connection_count()};
    if (in.has_rare_light()) {
        const auto rare_light = get(in.rare_light());
        if (!rare_light.ok()) return rare_light.status();
        out.rare_light = *rare_light;
    }
    return out;
}

}  // namespace lightloom::wire
