#pragma once
// JobPort over gRPC.

#include <grpcpp/channel.h>

#include <chrono>
#include <functional>
#include <stop_token>
#include <type_traits>

#include "common/work/service.h"
#include "lightloom/v1/asset_service.grpc.pb.h"
#include "lightloom/v1/job_service.grpc.pb.h"

namespace lightloom {

struct GrpcJobPortOptions {
    /// Of uploads and of the files of a job: kCancelled soon after a request. Of the latter, one that begins after it goes on, as
    /// does any other call that follows one, such as a cancellation.
    std::stop_token stop;
    double silence_seconds = 120;        ///< In which nothing more of an image arrives.
    double upload_silence_seconds = 60;  ///< In which nothing more of a file arrives that another client is sending.
    double reconnect_seconds = 30;       ///< In which a coordinator that answered before is back.
    std::function<void()> on_lost;       ///< Called when it stops answering and is waited for. May be empty.
};

/// For one thread at a time.
class GrpcJobPort final : public JobPort {
  public:
    explicit GrpcJobPort(std::shared_ptr<grpc::Channel> channel, GrpcJobPortOptions options = {});
    Result<JobInfo> submit_job(const std::string& request_id, const JobSpec& spec, const JobLabel& label,
                               Reuse reuse = Reuse::kAnew) override;
    Result<JobInfo> get_job(const std::string& job_id) override;
    Result<std::vector<JobInfo>> list_jobs() override;
    Result<std::vector<WorkerStatus>> list_workers(double gone_within_seconds) override;
    Result<JobInfo> cancel_job(const std::string& job_id, OnCancel what = OnCancel::kThrowAway) override;
    Result<JobInfo> finish_job(const std::string& job_id) override;
    Status watch_job(const std::string& job_id, const std::function<void(const JobInfo&)>& on_change,
                     std::stop_token stop) override;
    Result<std::string> image(const std::string& job_id, ImageKind kind) override;
    Result<Preview> preview(const std::string& job_id, PreviewFormat format, double exposure) override;
    Result<std::string> manifest(const std::string& job_id, ManifestKind kind = ManifestKind::kFinal) override;
    Result<std::vector<Digest>> find_missing(const std::vector<Digest>& digests) override;
    Status upload(const Digest& digest, const std::filesystem::path& path) override;
    Status upload_bytes(const Digest& digest, std::string_view bytes) override;

  private:
    using Source = std::function<Result<std::string_view>(uint64_t offset)>;
    /// Sends what is not there yet, however often it takes. `name` is for people.
    Status send(const Digest& digest, uint64_t size, const std::string& name, const Source& source);
    Result<v1::QueryWriteResponse> query_write(const Digest& digest);
    /// One attempt, from `offset`.
    Status write(const Digest& digest, uint64_t size, uint64_t offset, const Source& source);

    /// Makes a call, which may be made twice, until it is answered. Only of a coordinator that has answered before an answer is
    /// waited for: a client that finds none should say so at once.
    template <class Call>
    std::invoke_result_t<Call> insist(const Call& make);
    /// Waits for a connection until `end`, and tells of that once for every time that it is lost.
    bool connected_before(std::chrono::steady_clock::time_point end, const std::stop_token& stop);

    std::shared_ptr<grpc::Channel> channel_;
    GrpcJobPortOptions options_;
    std::unique_ptr<v1::JobService::Stub> jobs_;
    std::unique_ptr<v1::AssetService::Stub> assets_;
    bool answered_ = false;  ///< The coordinator has answered something.
    bool told_ = false;      ///< on_lost() was called since the last answer.
};

}  // namespace lightloom
