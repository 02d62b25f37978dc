#include "server/worker_service.h"

#include "common/core/utf8.h"
#include "common/work/wire.h"

namespace lightloom {
namespace {

grpc::Status invalid(const std::string& what) { return {grpc::StatusCode::INVALID_ARGUMENT, what}; }

}  // namespace

grpc::Status WorkerServiceImpl::Register(grpc::ServerContext*, const v1::WorkerHello* request, v1::WorkerGrant* response) {
    const auto hello = wire::get(*request);
    if (!hello.ok()) return wire::to_grpc(hello.status());
    const auto grant = coordinator_.register_worker(*hello);
    if (!grant.ok()) return wire::to_grpc(grant.status());
    wire::put(*grant, response);
    return grpc::Status::OK;
}

grpc::Status WorkerServiceImpl::LeaseUnits(grpc::ServerContext* context, const v1::LeaseUnitsRequest* request,
                                           v1::LeaseUnitsResponse* response) {
    const auto leases =
        coordinator_.lease_units(request->worker_id(), request->wait_seconds(), [&] { return closing_ || context->IsCancelled(); });
    if (!leases.ok()) return wire::to_grpc(leases.status());
    for (const UnitLease& lease : *leases) wire::put(lease, response->add_leases());
    return grpc::Status::OK;
}

grpc::Status WorkerServiceImpl::Heartbeat(grpc::ServerContext*, const v1::HeartbeatRequest* request,
                                          v1::HeartbeatResponse* response) {
    std::vector<RunningUnit> running;
    for (const v1::RunningUnit& item : request->running()) {
        const auto unit = wire::get(item.unit());
        if (!unit.ok()) return wire::to_grpc(unit.status());
        running.push_back({*unit, item.rendering()});
    }
    const auto revoked = coordinator_.heartbeat(request->worker_id(), running);
    if (!revoked.ok()) return wire::to_grpc(revoked.status());
    for (const UnitReference& unit : *revoked) wire::put(unit, response->add_revoked());
    return grpc::Status::OK;
}

template <class Request>
grpc::Status WorkerServiceImpl::read_payload(grpc::ServerReader<Request>* reader, uint64_t size, std::string* payload) const {
    payload->reserve(size);
    Request message;
    while (reader->Read(&message)) {
        if (closing_) return {grpc::StatusCode::UNAVAILABLE, "the coordinator is going down"};
        if (!message.has_chunk()) return invalid("only the first message is a header");
        const v1::Chunk& chunk = message.chunk();
        if (chunk.data().size() > kMaxChunkBytes) return invalid("a chunk holds at most 1 MiB");
        if (chunk.offset_bytes() != payload->size() || chunk.data().size() > size - payload->size())
            return invalid("chunks are not in order or exceed the announced size");
        *payload += chunk.data();
    }
    if (payload->size() != size) return invalid("the result ended before its announced size");
    return grpc::Status::OK;
}

grpc::Status WorkerServiceImpl::SubmitResult(grpc::ServerContext*, grpc::ServerReader<v1::SubmitResultRequest>* reader,
                                             v1::SubmitResultResponse* response) {
    v1::SubmitResultRequest message;
    if (!reader->Read(&message) || !message.has_header()) return invalid("a result begins with a header");
    const v1::SubmitResultHeader header = message.header();
    const auto descriptor = wire::get(header);
    if (!descriptor.ok()) return wire::to_grpc(descriptor.status());
    const auto reference = wire::get(header.unit());
    if (!reference.ok()) return wire::to_grpc(reference.status());
    const UnitReference& unit = *reference;
    // Nothing is taken in before the unit is known and the size is the one that follows from it.
    const auto expected = coordinator_.expected_partial(unit);
    if (!expected.ok()) {
        const bool stale = expected.status().code() == StatusCode::kNotFound;
        wire::put(SubmitAck{stale ? SubmitOutcome::kStale : SubmitOutcome::kRejected, expected.status().message()}, response);
        return grpc::Status::OK;
    }
    if (descriptor->splat_count > uint64_t(expected->frame.crop.area()))
        return invalid("more splat sums than the frame has pixels");
    const uint64_t size = partial_payload_size(expected->frame, expected->tile, descriptor->splat_count);
    if (descriptor->payload_size != size)
        return invalid("the payload of this unit has " + std::to_string(size) + " bytes, announced were " +
                       std::to_string(descriptor->payload_size));
    std::string payload;
    if (const grpc::Status status = read_payload(reader, size, &payload); !status.ok()) return status;
    const auto ack = coordinator_.submit_payload(header.worker_id(), unit, *descriptor, payload);
    if (!ack.ok()) return wire::to_grpc(ack.status());
    wire::put(*ack, response);
    return grpc::Status::OK;
}

grpc::Status WorkerServiceImpl::SubmitTraining(grpc::ServerContext*, grpc::ServerReader<v1::SubmitTrainingRequest>* reader,
                                               v1::SubmitResultResponse* response) {
    v1::SubmitTrainingRequest message;
    if (!reader->Read(&message) || !message.has_header()) return invalid("a result begins with a header");
    const v1::SubmitTrainingHeader header = message.header();
    const auto unit = wire::get(header.unit());
    if (!unit.ok()) return wire::to_grpc(unit.status());
    const auto digest = wire::get(header.payload_digest());
    if (!digest.ok()) return wire::to_grpc(digest.status());
    const auto limit = coordinator_.expected_training_bytes(*unit);
    if (!limit.ok()) {
        const bool stale = limit.status().code() == StatusCode::kNotFound;
        wire::put(SubmitAck{stale ? SubmitOutcome::kStale : SubmitOutcome::kRejected, limit.status().message()}, response);
        return grpc::Status::OK;
    }
    if (header.payload_size_bytes() > *limit)
        return invalid("the training data of this unit have at most " + std::to_string(*limit) + " bytes, announced were " +
                       std::to_string(header.payload_size_bytes()));
    std::string payload;
    if (const grpc::Status status = read_payload(reader, header.payload_size_bytes(), &payload); !status.ok()) return status;
    const auto ack = coordinator_.submit_training(header.worker_id(), *unit, *digest, payload, header.trace_seconds());
    if (!ack.ok()) return wire::to_grpc(ack.status());
    wire::put(*ack, response);
    return grpc::Status::OK;
}

grpc::Status WorkerServiceImpl::ReleaseUnit(grpc::ServerContext*, const v1::ReleaseUnitRequest* request, v1::ReleaseUnitResponse*) {
    int code = request->status_code();
    if (code < 0 || code > int(StatusCode::kDataLoss)) code = int(StatusCode::kUnknown);
    const auto unit = wire::get(request->unit());
    if (!unit.ok()) return wire::to_grpc(unit.status());
    return wire::to_grpc(coordinator_.release_unit(request->worker_id(), *unit,
                                                   {StatusCode(code), clipped_utf8(request->message(), wire::kMaxMessageBytes)}));
}

grpc::Status WorkerServiceImpl::Goodbye(grpc::ServerContext*, const v1::GoodbyeRequest* request, v1::GoodbyeResponse*) {
    return wire::to_grpc(coordinator_.goodbye(request->worker_id()));
}

}  // namespace lightloom
