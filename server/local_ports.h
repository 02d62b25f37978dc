#pragma once
// The ports of a coordinator in the same process.

#include "server/coordinator.h"

namespace lightloom {

class LocalJobPort final : public JobPort {
  public:
    explicit LocalJobPort(Coordinator& coordinator) : coordinator_(coordinator) {}
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
    Coordinator& coordinator_;
};

class LocalWorkerPort final : public WorkerPort {
  public:
    explicit LocalWorkerPort(Coordinator& coordinator) : coordinator_(coordinator) {}
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

  private:
    Coordinator& coordinator_;
};

}  // namespace lightloom
