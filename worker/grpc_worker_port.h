#pragma once
// WorkerPort over gRPC.

#include <grpcpp/channel.h>

#include "common/work/service.h"
#include "lightloom/v1/asset_service.grpc.pb.h"
#include "lightloom/v1/worker_service.grpc.pb.h"

namespace lightloom {

class GrpcWorkerPort final : public WorkerPort {
  public:
    /// `read_seconds`: an asset that comes at less than 1 MB/s over this time is given up with kDeadlineExceeded.
    explicit GrpcWorkerPort(std::shared_ptr<grpc::Channel> channel, double read_seconds = 60);
    Result<WorkerGrant> register_worker(const WorkerHello& hello) override;
    Result<std::vector<UnitLease>> lease_units(const std::string& worker_id, double wait_seconds, std::stop_token stop) override;
    Result<std::vector<UnitReference>> heartbeat(const std::string& worker_id, const std::vector<RunningUnit>& running) override;
    Result<SubmitAck> submit_result(const std::string& worker_id, const UnitLease& lease, Partial partial,
                                    double render_seconds) override;
    Result<SubmitAck> submit_training(const std::string& worker_id, const UnitLease& lease, std::string_view payload,
                                      double trace_seconds) override;
    Status release_unit(const std::string& worker_id, const UnitReference& unit, const Status& why) override;
    Status goodbye(const std::string& worker_id) override;
    Status read_asset(const Digest& digest, uint64_t offset, const std::function<Status(std::string_view)>& sink) override;
    bool wait_connected(double seconds) override;

  private:
    const double read_seconds_;
    const std::shared_ptr<grpc::Channel> channel_;
    std::unique_ptr<v1::WorkerService::Stub> worker_;
    std::unique_ptr<v1::AssetService::Stub> assets_;
};

}  // namespace lightloom
