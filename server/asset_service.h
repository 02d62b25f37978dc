#pragma once
// AssetService over a Coordinator's asset store.

#include <atomic>

#include "lightloom/v1/asset_service.grpc.pb.h"
#include "server/coordinator.h"

namespace lightloom {

class AssetServiceImpl final : public v1::AssetService::Service {
  public:
    AssetServiceImpl(Coordinator& coordinator, const std::atomic<bool>& closing)
        : store_(coordinator.assets()),
          closing_(closing) {}

    grpc::Status FindMissing(grpc::ServerContext*, const v1::FindMissingRequest* request,
                             v1::FindMissingResponse* response) override;
    grpc::Status Write(grpc::ServerContext* context, grpc::ServerReader<v1::WriteRequest>* reader,
                       v1::WriteResponse* response) override;
    grpc::Status QueryWrite(grpc::ServerContext*, const v1::QueryWriteRequest* request, v1::QueryWriteResponse* response) override;
    grpc::Status Read(grpc::ServerContext* context, const v1::ReadRequest* request, grpc::ServerWriter<v1::Chunk>* writer) override;

  private:
    AssetStore& store_;
    const std::atomic<bool>& closing_;
};

}  // namespace lightloom
