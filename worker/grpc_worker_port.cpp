#include "worker/grpc_worker_port.h"

#include <grpcpp/client_context.h>

#include <chrono>

#include "common/core/utf8.h"
#include "common/work/wire.h"

namespace lightloom {
namespace {

/// A slower connection than this counts as broken.
constexpr double kSlowestBytesPerSecond = 1e6;

void set_deadline(grpc::ClientContext& context, double seconds) {
    context.set_deadline(std::chrono::system_clock::now() +
                         std::chrono::duration_cast<std::chrono::system_clock::duration>(std::chrono::duration<double>(seconds)));
}

/// `message` holds the header; the payload follows in chunks.
template <class Request>
grpc::Status send(grpc::ClientWriter<Request>& writer, Request& message, std::string_view payload) {
    bool open = writer.Write(message);
    for (size_t offset = 0; open && offset < payload.size(); offset += kMaxChunkBytes) {
        v1::Chunk* chunk = message.mutable_chunk();
        const std::string_view part = payload.substr(offset, kMaxChunkBytes);
        chunk->set_offset_bytes(offset);
        chunk->set_data(part.data(), part.size());
        open = writer.Write(message);
    }
    // A stream that the coordinator closed early has its answer already; Finish() fetches it.
    writer.WritesDone();
    return writer.Finish();
}

}  // namespace

GrpcWorkerPort::GrpcWorkerPort(const std::shared_ptr<grpc::Channel>& channel, double read_seconds)
    : read_seconds_(read_seconds),
      worker_(v1::WorkerService::NewStub(channel)),
      assets_(v1::AssetService::NewStub(channel)) {}

Result<WorkerGrant> GrpcWorkerPort::register_worker(const WorkerHello& hello) {
    grpc::ClientContext context;
    set_deadline(context, 30);
    v1::WorkerHello request;
    wire::put(hello, &request);
    v1::WorkerGrant response;
    const grpc::Status status = worker_->Register(&context, request, &response);
    if (!status.ok()) return wire::from_grpc(status);
    return wire::get(response);
}

Result<std::vector<UnitLease>> GrpcWorkerPort::lease_units(const std::string& worker_id, double wait_seconds,
                                                           std::stop_token stop) {
    grpc::ClientContext context;
    set_deadline(context, wait_seconds + 10);
    const std::stop_callback cancel(stop, [&] { context.TryCancel(); });
    v1::LeaseUnitsRequest request;
    request.set_worker_id(worker_id);
    request.set_wait_seconds(wait_seconds);
    v1::LeaseUnitsResponse response;
    const grpc::Status status = worker_->LeaseUnits(&context, request, &response);
    if (!status.ok()) return wire::from_grpc(status);
    std::vector<UnitLease> leases;
    for (const v1::UnitLease& item : response.leases()) {
        auto lease = wire::get(item);
        if (!lease.ok()) return lease.status();
        leases.push_back(*std::move(lease));
    }
    return leases;
}

Result<std::vector<UnitReference>> GrpcWorkerPort::heartbeat(const std::string& worker_id,
                                                             const std::vector<RunningUnit>& running) {
    grpc::ClientContext context;
    set_deadline(context, 2);
    v1::HeartbeatRequest request;
    request.set_worker_id(worker_id);
    for (const RunningUnit& item : running) {
        v1::RunningUnit* out = request.add_running();
        wire::put(item.unit, out->mutable_unit());
        out->set_rendering(item.rendering);
    }
    v1::HeartbeatResponse response;
    const grpc::Status status = worker_->Heartbeat(&context, request, &response);
    if (!status.ok()) return wire::from_grpc(status);
    std::vector<UnitReference> revoked;
    for (const v1::UnitReference& item : response.revoked()) {
        const auto unit = wire::get(item);
        if (!unit.ok()) return unit.status();
        revoked.push_back(*unit);
    }
    return revoked;
}

Result<SubmitAck> GrpcWorkerPort::submit_result(const std::string& worker_id, const UnitLease& lease, Partial partial,
                                                double render_seconds) {
    const auto encoded = encode_partial(partial, lease.spec.frame);
    if (!encoded.ok()) return encoded.status();
    grpc::ClientContext context;
    set_deadline(context, 120 + double(encoded->payload.size()) / kSlowestBytesPerSecond);
    v1::SubmitResultResponse response;
    const auto writer = worker_->SubmitResult(&context, &response);
    v1::SubmitResultRequest message;
    v1::SubmitResultHeader* header = message.mutable_header();
    header->set_worker_id(worker_id);
    wire::put(lease.reference(), header->mutable_unit());
    wire::put(encoded->descriptor, header);
    header->set_render_seconds(render_seconds);
    const grpc::Status status = send(*writer, message, encoded->payload);
    if (!status.ok()) return wire::from_grpc(status);
    return wire::get(response);
}

Result<SubmitAck> GrpcWorkerPort::submit_training(const std::string& worker_id, const UnitLease& lease, std::string_view payload,
                                                  double trace_seconds) {
    grpc::ClientContext context;
    set_deadline(context, 120 + double(payload.size()) / kSlowestBytesPerSecond);
    v1::SubmitResultResponse response;
    const auto writer = worker_->SubmitTraining(&context, &response);
    v1::SubmitTrainingRequest message;
    v1::SubmitTrainingHeader* header = message.mutable_header();
    header->set_worker_id(worker_id);
    wire::put(lease.reference(), header->mutable_unit());
    wire::put(sha256(payload), header->mutable_payload_digest());
    header->set_payload_size_bytes(payload.size());
    header->set_trace_seconds(trace_seconds);
    const grpc::Status status = send(*writer, message, payload);
    if (!status.ok()) return wire::from_grpc(status);
    return wire::get(response);
}

Status GrpcWorkerPort::release_unit(const std::string& worker_id, const UnitReference& unit, const Status& why) {
    grpc::ClientContext context;
    set_deadline(context, 10);
    v1::ReleaseUnitRequest request;
    request.set_worker_id(worker_id);
    wire::put(unit, request.mutable_unit());
    request.set_status_code(int(why.code()));
    request.set_message(clipped_utf8(why.message(), wire::kMaxMessageBytes));
    v1::ReleaseUnitResponse response;
    return wire::from_grpc(worker_->ReleaseUnit(&context, request, &response));
}

Status GrpcWorkerPort::goodbye(const std::string& worker_id) {
    grpc::ClientContext context;
    set_deadline(context, 5);
    v1::GoodbyeRequest request;
    request.set_worker_id(worker_id);
    v1::GoodbyeResponse response;
    return wire::from_grpc(worker_->Goodbye(&context, request, &response));
}

Status GrpcWorkerPort::read_asset(const Digest& digest, uint64_t offset, const std::function<Status(std::string_view)>& sink) {
    // How long an asset takes is not known before its size is; a call that ran out of time but moved is continued from there.
    for (;;) {
        const uint64_t begin = offset;
        grpc::ClientContext context;
        set_deadline(context, read_seconds_);
        v1::ReadRequest request;
        wire::put(digest, request.mutable_digest());
        request.set_offset_bytes(offset);
        const auto reader = assets_->Read(&context, request);
        v1::Chunk chunk;
        while (reader->Read(&chunk)) {
            Status status =
                chunk.offset_bytes() == offset ? sink(chunk.data()) : data_loss("the coordinator sent a chunk out of order");
            if (!status.ok()) {
                context.TryCancel();
                (void)reader->Finish();
                return status;
            }
            offset += chunk.data().size();
        }
        const Status status = wire::from_grpc(reader->Finish());
        const bool slow = double(offset - begin) < read_seconds_ * kSlowestBytesPerSecond;
        if (status.code() != StatusCode::kDeadlineExceeded || slow) return status;
    }
}

}  // namespace lightloom
