#pragma once
// WorkerService over a Coordinator.

#include <atomic>

#include "lightloom/v1/worker_service.grpc.pb.h"
#include "server/coordinator.h"

namespace lightloom {

class WorkerServiceImpl final : public v1::WorkerService::Service {
  public:
    WorkerServiceImpl(Coordinator& coordinator, const std::atomic<bool>& closing) : coordinator_(coordinator), closing_(closing) {}

    grpc::Status Register(grpc::ServerContext*, const v1::WorkerHello* request, v1::WorkerGrant* response) override;
    grpc::Status LeaseUnits(grpc::ServerContext* context, const v1::LeaseUnitsRequest* request,
                            v1::LeaseUnitsResponse* response) override;
    grpc::Status Heartbeat(grpc::ServerContext*, const v1::HeartbeatRequest* request, v1::HeartbeatResponse* response) override;
    grpc::Status SubmitResult(grpc::ServerContext*, grpc::ServerReader<v1::SubmitResultRequest>* reader,
                              v1::SubmitResultResponse* response) override;
    grpc::Status SubmitTraining(grpc::ServerContext*, grpc::ServerReader<v1::SubmitTrainingRequest>* reader,
                                v1::SubmitResultResponse* response) override;
    grpc::Status ReleaseUnit(grpc::ServerContext*, const v1::ReleaseUnitRequest* request, v1::ReleaseUnitResponse*) override;
    grpc::Status Goodbye(grpc::ServerContext*, const v1::GoodbyeRequest* request, v1::GoodbyeResponse*) override;

  private:
    /// Receives the chunks that follow a header, `size` bytes in all, and answers with the result of submit(payload).
    template <class Request, class Submit>
    grpc::Status take_payload(grpc::ServerReader<Request>* reader, uint64_t size, v1::SubmitResultResponse* response,
                              const Submit& submit) const;

    Coordinator& coordinator_;
    const std::atomic<bool>& closing_;
};

}  // namespace lightloom
