#include "server/asset_service.h"

#include "server/grpc_answers.h"

namespace lightloom {
namespace {

constexpr int kMaxDigestsPerCall = 10000;

}  // namespace

grpc::Status AssetServiceImpl::FindMissing(grpc::ServerContext*, const v1::FindMissingRequest* request,
                                           v1::FindMissingResponse* response) {
    if (request->digests_size() > kMaxDigestsPerCall) return invalid("at most 10000 digests per call");
    for (const v1::Digest& item : request->digests()) {
        const auto digest = wire::get(item);
        if (!digest.ok()) return wire::to_grpc(digest.status());
        if (store_.contains(*digest))
            store_.touch(*digest);  // a submission follows, and until then nobody knows that it is needed
        else
            wire::put(*digest, response->add_missing());
    }
    return grpc::Status::OK;
}

grpc::Status AssetServiceImpl::Write(grpc::ServerContext* context, grpc::ServerReader<v1::WriteRequest>* reader,
                                     v1::WriteResponse* response) {
    v1::WriteRequest message;
    if (!reader->Read(&message) || !message.has_header()) return invalid("an upload begins with a header");
    const auto digest = wire::get(message.header().digest());
    if (!digest.ok()) return wire::to_grpc(digest.status());
    const uint64_t size = message.header().size_bytes();
    if (store_.contains(*digest)) {
        response->set_committed_size_bytes(size);
        return grpc::Status::OK;
    }
    auto upload = store_.begin_upload(*digest, size);
    if (!upload.ok()) return wire::to_grpc(upload.status());
    const grpc::Status taken = read_chunks(reader, closing_, [&](const v1::Chunk& chunk) -> grpc::Status {
        if (chunk.offset_bytes() != upload->offset())
            return {grpc::StatusCode::OUT_OF_RANGE, "continue at offset " + std::to_string(upload->offset())};
        return wire::to_grpc(upload->append(chunk.data()));
    });
    if (!taken.ok()) return taken;
    if (context->IsCancelled()) return {grpc::StatusCode::CANCELLED, "the upload was broken off; resume it"};
    const Status status = upload->finish();
    response->set_committed_size_bytes(upload->offset());
    return wire::to_grpc(status);
}

grpc::Status AssetServiceImpl::QueryWrite(grpc::ServerContext*, const v1::QueryWriteRequest* request,
                                          v1::QueryWriteResponse* response) {
    const auto digest = wire::get(request->digest());
    if (!digest.ok()) return wire::to_grpc(digest.status());
    response->set_committed_size_bytes(store_.committed_size(*digest));
    response->set_complete(store_.contains(*digest));
    return grpc::Status::OK;
}

grpc::Status AssetServiceImpl::Read(grpc::ServerContext* context, const v1::ReadRequest* request,
                                    grpc::ServerWriter<v1::Chunk>* writer) {
    const auto digest = wire::get(request->digest());
    if (!digest.ok()) return wire::to_grpc(digest.status());
    v1::Chunk chunk;
    return wire::to_grpc(store_.stream(*digest, request->offset_bytes(), [&](uint64_t offset, std::string_view bytes) -> Status {
        chunk.set_offset_bytes(offset);
        chunk.set_data(bytes.data(), bytes.size());
        if (!closing_ && !context->IsCancelled() && writer->Write(chunk)) return {};
        return {StatusCode::kUnavailable, "the asset was not sent to its end; continue from there"};
    }));
}

}  // namespace lightloom
