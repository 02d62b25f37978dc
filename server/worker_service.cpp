#include "server/worker_service.h"

#include "common/core/utf8.h"
#include "server/grpc_answers.h"

namespace lightloom {

grpc::Status WorkerServiceImpl::Register(grpc::ServerContext*, const v1::WorkerHello* request, v1::WorkerGrant* response) {
    const auto hello = wire::get(*request);
    if (!hello.ok()) return wire::to_grpc(hello.status());
    return answer(coordinator_.register_worker(*hello), response);
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

template <class Request, class Submit>
grpc::Status WorkerServiceImpl::take_payload(grpc::ServerReader<Request>* reader, uint64_t size, v1::SubmitResultResponse* response,
                                             const Submit& submit) const {
    std::string payload;
    payload.reserve(size);
    const grpc::Status taken = read_chunks(reader, closing_, [&](const v1::Chunk& chunk) {
        if (chunk.offset_bytes() != payload.size() || chunk.data().size() > size - payload.size())
            return invalid("chunks are not in order or exceed the announced size");
        payload += chunk.data();
        return grpc::Status::OK;
    });
    if (!taken.ok()) return taken;
    if (payload.size() != size) return invalid("the result ended before its announced size");
    return answer(submit(payload), response);
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
    // Nothing is received before the unit is known and the size is the expected one.
    const auto expected = coordinator_.expected_partial(unit);
    if (!expected.ok()) return answer(Result<SubmitAck>(unexpected_result(expected.status())), response);
    if (descriptor->splat_count > uint64_t(expected->frame.crop.area()))
        return invalid("more splat sums than the frame has pixels");
    const uint64_t size = partial_payload_size(*expected, descriptor->splat_count);
    if (descriptor->payload_size != size)
        return invalid("the payload of this unit has " + std::to_string(size) + " bytes, but the announced size is " +
                       std::to_string(descriptor->payload_size));
    return take_payload(reader, size, response, [&](std::string_view payload) {
        return coordinator_.submit_payload(header.worker_id(), unit, *descriptor, payload, header.render_seconds());
    });
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
    if (!limit.ok()) return answer(Result<SubmitAck>(unexpected_result(limit.status())), response);
    if (header.payload_size_bytes() > *limit)
        return invalid("the training data of this unit have at most " + std::to_string(*limit) +
                       " bytes, but the announced size is " + std::to_string(header.payload_size_bytes()));
    return take_payload(reader, header.payload_size_bytes(), response, [&](std::string_view payload) {
        return coordinator_.submit_training(header.worker_id(), *unit, *digest, payload, header.trace_seconds());
    });
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
