#include "server/local_ports.h"

#include "common/core/atomic_file.h"

namespace lightloom {

Result<JobInfo> LocalJobPort::submit_job(const std::string& request_id, const JobSpec& spec, const JobLabel& label, Reuse reuse) {
    return coordinator_.submit_job(request_id, spec, label, reuse);
}
Result<JobInfo> LocalJobPort::get_job(const std::string& job_id) { return coordinator_.get_job(job_id); }
Result<std::vector<JobInfo>> LocalJobPort::list_jobs() { return coordinator_.list_jobs(); }
Result<std::vector<WorkerStatus>> LocalJobPort::list_workers(double gone_within_seconds) {
    return gone_within_seconds > 0 ? coordinator_.workers(gone_within_seconds) : coordinator_.workers();
}
Result<JobInfo> LocalJobPort::cancel_job(const std::string& job_id, OnCancel what) { return coordinator_.cancel_job(job_id, what); }
Result<JobInfo> LocalJobPort::finish_job(const std::string& job_id) { return coordinator_.finish_job(job_id); }

Status LocalJobPort::watch_job(const std::string& job_id, const std::function<void(const JobInfo&)>& on_change,
                               std::stop_token stop) {
    uint64_t seen = 0;
    while (!stop.stop_requested()) {
        const auto info = coordinator_.wait_job(job_id, seen, 0.1);
        if (!info.ok()) return info.status();
        if (info->revision > seen) on_change(*info);
        seen = info->revision;
        if (is_terminal(info->state)) return {};
    }
    return {StatusCode::kCancelled, "interrupted"};
}

Result<std::string> LocalJobPort::image(const std::string& job_id, ImageKind kind) { return coordinator_.image(job_id, kind); }
Result<Preview> LocalJobPort::preview(const std::string& job_id, PreviewFormat format, double exposure) {
    return coordinator_.preview(job_id, format, exposure);
}
Result<std::string> LocalJobPort::manifest(const std::string& job_id, ManifestKind kind) {
    return coordinator_.manifest(job_id, kind);
}

Result<std::vector<Digest>> LocalJobPort::find_missing(const std::vector<Digest>& digests) {
    std::vector<Digest> missing;
    for (const Digest& digest : digests) {
        if (!coordinator_.assets().contains(digest)) missing.push_back(digest);
    }
    return missing;
}

Status LocalJobPort::upload(const Digest& digest, const std::filesystem::path& path) {
    const auto bytes = read_file(path.string());
    return bytes.ok() ? upload_bytes(digest, *bytes) : bytes.status();
}

Status LocalJobPort::upload_bytes(const Digest& digest, std::string_view bytes) { return coordinator_.assets().put(digest, bytes); }

Result<WorkerGrant> LocalWorkerPort::register_worker(const WorkerHello& hello) { return coordinator_.register_worker(hello); }

Result<std::vector<UnitLease>> LocalWorkerPort::lease_units(const std::string& worker_id, double wait_seconds,
                                                            std::stop_token stop) {
    const std::stop_callback wake(stop, [this] { coordinator_.wake_leases(); });
    return coordinator_.lease_units(worker_id, wait_seconds, [stop] { return stop.stop_requested(); });
}

Result<std::vector<UnitReference>> LocalWorkerPort::heartbeat(const std::string& worker_id,
                                                              const std::vector<RunningUnit>& running) {
    return coordinator_.heartbeat(worker_id, running);
}

Result<SubmitAck> LocalWorkerPort::submit_result(const std::string& worker_id, const UnitLease& lease, Partial partial,
                                                 double render_seconds) {
    // Decoding it again would only cost time.
    const auto encoded = encode_partial(partial, lease.spec.frame);
    if (!encoded.ok()) return encoded.status();
    return coordinator_.submit_partial(worker_id, lease.reference(), *encoded, std::move(partial), render_seconds);
}

Result<SubmitAck> LocalWorkerPort::submit_training(const std::string& worker_id, const UnitLease& lease, std::string_view payload,
                                                   double trace_seconds) {
    return coordinator_.submit_training(worker_id, lease.reference(), sha256(payload), payload, trace_seconds);
}

Status LocalWorkerPort::release_unit(const std::string& worker_id, const UnitReference& unit, const Status& why) {
    return coordinator_.release_unit(worker_id, unit, why);
}

Status LocalWorkerPort::goodbye(const std::string& worker_id) { return coordinator_.goodbye(worker_id); }

Status LocalWorkerPort::read_asset(const Digest& digest, uint64_t offset, const std::function<Status(std::string_view)>& sink) {
    const auto bytes = coordinator_.assets().read(digest);
    if (!bytes.ok()) return bytes.status();
    return sink(std::string_view(*bytes).substr(std::min<size_t>(offset, bytes->size())));
}

}  // namespace lightloom
