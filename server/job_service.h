#pragma once
// JobService over a Coordinator.

#include <atomic>

#include "lightloom/v1/job_service.grpc.pb.h"
#include "server/coordinator.h"

namespace lightloom {

class JobServiceImpl final : public v1::JobService::Service {
  public:
    JobServiceImpl(Coordinator& coordinator, const std::atomic<bool>& closing) : coordinator_(coordinator), closing_(closing) {}

    grpc::Status SubmitJob(grpc::ServerContext*, const v1::SubmitJobRequest* request, v1::Job* response) override;
    grpc::Status GetJob(grpc::ServerContext*, const v1::GetJobRequest* request, v1::Job* response) override;
    grpc::Status ListJobs(grpc::ServerContext*, const v1::ListJobsRequest*, v1::ListJobsResponse* response) override;
    grpc::Status ListWorkers(grpc::ServerContext*, const v1::ListWorkersRequest* request,
                             v1::ListWorkersResponse* response) override;
    grpc::Status CancelJob(grpc::ServerContext*, const v1::CancelJobRequest* request, v1::Job* response) override;
    grpc::Status FinishJob(grpc::ServerContext*, const v1::FinishJobRequest* request, v1::Job* response) override;
    grpc::Status WatchJob(grpc::ServerContext* context, const v1::WatchJobRequest* request,
                          grpc::ServerWriter<v1::Job>* writer) override;
    grpc::Status GetImage(grpc::ServerContext*, const v1::GetImageRequest* request, grpc::ServerWriter<v1::Chunk>* writer) override;
    grpc::Status GetPreview(grpc::ServerContext*, const v1::GetPreviewRequest* request,
                            grpc::ServerWriter<v1::GetPreviewResponse>* writer) override;
    grpc::Status GetManifest(grpc::ServerContext*, const v1::GetManifestRequest* request,
                             grpc::ServerWriter<v1::Chunk>* writer) override;

  private:
    Coordinator& coordinator_;
    const std::atomic<bool>& closing_;
};

}  // namespace lightloom
