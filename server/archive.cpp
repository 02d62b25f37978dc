#include "server/archive.h"

#include <cstdio>
#include <cstdlib>
#include <ctime>
#include <utility>

#include "common/work/wire.h"
#include "server/results.h"

namespace lightloom {
namespace {

// Kinds of events.
constexpr const char* kBuild = "build";               ///< Text. What came before it is of no use.
constexpr const char* kPlanned = "planned";           ///< v1::Job
constexpr const char* kSettled = "settled";           ///< v1::JobSpec
constexpr const char* kSpent = "spent";               ///< Two numbers as text: seconds of learning and of rendering.
constexpr const char* kFinish = "finish";             ///< A number of groups as text.
constexpr const char* kCancelled = "cancelled-kept";  ///< Nothing.

template <class Message, class Value>
std::string to_bytes(const Value& value) {
    Message message;
    wire::put(value, &message);
    return message.SerializeAsString();
}

template <class Message>
auto from_bytes(std::string_view bytes) -> decltype(wire::get(Message())) {
    Message message;
    if (!message.ParseFromArray(bytes.data(), int(bytes.size()))) return data_loss("its record is damaged");
    return wire::get(message);
}

double seconds_since(const std::string& utc) {
    std::tm time{};
    if (!::strptime(utc.c_str(), "%Y-%m-%dT%H:%M:%SZ", &time)) return 0;
    return std::max(0.0, std::difftime(std::time(nullptr), ::timegm(&time)));
}

}  // namespace

std::string name_of(const BuildIdentity& identity) {
    return identity.build_id + " " + identity.math_profile + " " + identity.golden_digest.hex();
}

Status Archive::accept(const Job::Submission& submission, const BuildIdentity& by) {
    if (!store_) return {};
    return store_
        ->put_job({.id = submission.id,
                   .request_id = submission.request_id,
                   .created_at = submission.created_at,
                   .submitted = to_bytes<v1::JobSpec>(submission.submitted),
                   .label = to_bytes<v1::JobLabel>(submission.label),
                   .scene = submission.scene},
                  {{kBuild, name_of(by)}})
        .get();
}

Status Archive::begin_anew(const std::string& job_id, const BuildIdentity& by) {
    if (!store_) return {};
    // First the results: were they there still, they would be taken for those of the build that is put down after them.
    LL_RETURN_IF_ERROR(store_->drop_results(job_id).get());
    return store_->append_event(job_id, kBuild, name_of(by)).get();
}

Status Archive::plan(const JobInfo& info) {
    if (!store_) return {};
    LL_RETURN_IF_ERROR(store_->append_event(info.job_id, kPlanned, to_bytes<v1::Job>(info)).get());
    return store_->update_job(info.job_id, {.state = JobState::kRunning, .message = {}, .scene = {}, .spec = {}}).get();
}

Status Archive::settle(const std::string& job_id, const JobSpec& spec) {
    if (!store_) return {};
    return store_->append_event(job_id, kSettled, to_bytes<v1::JobSpec>(spec)).get();
}

Status Archive::finish(const std::string& job_id, uint32_t groups) {
    return store_ ? store_->append_event(job_id, kFinish, std::to_string(groups)).get() : Status();
}

Status Archive::cancel_and_keep(const std::string& job_id) {
    return store_ ? store_->append_event(job_id, kCancelled, {}).get() : Status();
}

Status Archive::keep_partial(const std::string& job_id, const UnitKey& unit, const WorkerRecord& worker, double seconds,
                             const PartialDescriptor& descriptor, std::string_view payload) {
    if (!store_) return {};
    LL_RETURN_IF_ERROR(repay_drops(job_id));
    const std::string header = to_bytes<v1::SubmitResultHeader>(descriptor), who = to_bytes<v1::WorkerHello>(worker.hello);
    return store_->put_result(job_id, {.unit = unit,
                                       .digest = descriptor.payload_digest,
                                       .worker = worker.index,
                                       .who = who,
                                       .seconds = seconds,
                                       .header = header,
                                       .payload = payload});
}

Status Archive::keep_training(const std::string& job_id, const UnitKey& unit, const WorkerRecord& worker, double seconds,
                              const Digest& digest, std::string_view payload) {
    if (!store_) return {};
    LL_RETURN_IF_ERROR(repay_drops(job_id));
    const std::string who = to_bytes<v1::WorkerHello>(worker.hello);
    return store_->put_result(
        job_id,
        {.unit = unit, .digest = digest, .worker = worker.index, .who = who, .seconds = seconds, .header = {}, .payload = payload});
}

Status Archive::checkpoint(const std::string& job_id, const Reducer::Saved& saved) {
    return store_ ? store_->put_checkpoint(job_id, saved.groups, saved.bytes) : Status();
}

Status Archive::end(const JobInfo& info) {
    if (!store_) return {};
    return store_->end_job(info.job_id, info.state, info.message, to_bytes<v1::Job>(info)).get();
}

void Archive::owe(const std::string& job_id, bool drops, std::function<JobStore::Done()> change) {
    const std::lock_guard lock(owed_mutex_);
    Owed& owed = owed_.emplace_back(Owed{job_id, drops, std::move(change), {}});
    owed.done = owed.change();
}

Status Archive::repay_if(const std::function<bool(const Owed&)>& due) {
    std::vector<std::list<Owed>::iterator> found;
    const auto find = [&] {
        const std::lock_guard lock(owed_mutex_);
        found.clear();
        for (auto owed = owed_.begin(); owed != owed_.end(); ++owed)
            if (due(*owed)) found.push_back(owed);
        return !found.empty();
    };
    // What is owed stays in the list until it is on disk: whoever finds nothing has nothing to wait for.
    if (!find()) return {};
    const std::lock_guard one_at_a_time(repaying_);
    if (!find()) return {};
    // All that was refused is handed over before any of it is waited for, so that it shares a flush.
    std::vector<Status> statuses;
    for (const auto owed : found) statuses.push_back(owed->done.get());
    std::vector<size_t> refused;
    for (size_t i = 0; i < found.size(); ++i)
        if (statuses[i].code() == StatusCode::kResourceExhausted) refused.push_back(i);
    for (const size_t i : refused) found[i]->done = found[i]->change();
    for (const size_t i : refused) statuses[i] = found[i]->done.get();
    Status first;
    for (size_t i = 0; i < found.size(); ++i) {
        const auto owed = found[i];
        const Status& status = statuses[i];
        if (status.code() == StatusCode::kResourceExhausted) {
            std::promise<Status> again;  // for the next time
            again.set_value(status);
            owed->done = again.get_future();
            if (first.ok()) first = status;
            continue;
        }
        // A job that is not there any more owes nothing; what else may go wrong will not go away.
        if (!status.ok() && status.code() != StatusCode::kNotFound)
            log_error("{}: a change of it could not be written down: {}", owed->job_id, status.message());
        const std::lock_guard lock(owed_mutex_);
        owed_.erase(owed);
    }
    return first;
}

Status Archive::repay() {
    return repay_if([](const Owed&) { return true; });
}

Status Archive::repay_drops(const std::string& job_id) {
    return repay_if([&](const Owed& owed) { return owed.drops && owed.job_id == job_id; });
}

void Archive::end_soon(const JobInfo& info) {
    if (!store_) return;
    owe(info.job_id, false, [this, id = info.job_id, state = info.state, message = info.message, bytes = to_bytes<v1::Job>(info)] {
        return store_->end_job(id, state, message, bytes);
    });
}

void Archive::forget_soon(const std::string& job_id) {
    if (store_) owe(job_id, false, [this, job_id] { return store_->forget_job(job_id); });
}

void Archive::spent_soon(const std::string& job_id, double learning_seconds, double rendering_seconds) {
    if (!store_) return;
    char text[64];
    std::snprintf(text, sizeof text, "%.17g %.17g", learning_seconds, rendering_seconds);
    (void)store_->append_event(job_id, kSpent, text);
}

void Archive::drop_soon(const std::string& job_id, const UnitKey& unit) {
    if (store_) owe(job_id, true, [this, job_id, unit] { return store_->drop_result(job_id, unit); });
}

void Archive::drop_all_soon(const std::string& job_id) {
    if (store_) owe(job_id, true, [this, job_id] { return store_->drop_results(job_id); });
}

Result<ArchivedJob> Archive::read(const StoredJob& stored, const std::filesystem::path& jobs_directory) const {
    ArchivedJob out;
    const NewJob& job = stored.job;
    auto submitted = from_bytes<v1::JobSpec>(job.submitted);
    // Of a job that has ended what is told of it is enough, where this build does not know its parameters any more.
    if (!submitted.ok() && is_terminal(job.state) && stored.info)
        if (auto last = from_bytes<v1::Job>(*stored.info); last.ok()) submitted = std::move(last->spec);
    if (!submitted.ok()) return submitted.status();
    v1::JobLabel label;
    if (!label.ParseFromString(job.label)) return data_loss("its label is damaged");
    out.submission = {.id = job.id,
                      .request_id = job.request_id,
                      .submitted = *std::move(submitted),
                      .label = wire::get(label),
                      .scene = job.scene,
                      .created_at = job.created_at,
                      .directory = jobs_directory / job.id};
    out.age_seconds = seconds_since(job.created_at);
    for (const StoredEvent& event : stored.events)
        if (event.kind == kBuild) out.build = event.bytes;
    if (is_terminal(job.state)) {
        if (!stored.info) return data_loss("nothing says how it ended");
        auto last = from_bytes<v1::Job>(*stored.info);
        if (!last.ok()) return last.status();
        out.last = *std::move(last);
        return out;
    }
    for (const StoredEvent& event : stored.events) {
        if (event.kind == kBuild) {  // what another build did is of no use
            out.planned.reset();
            out.settled.reset();
            out.learning_seconds = out.rendering_seconds = 0;
        }
        if (event.kind == kFinish) out.finish_with = uint32_t(std::strtoul(event.bytes.c_str(), nullptr, 10));
        if (event.kind == kCancelled) out.cancelled = true;
        if (event.kind == kSpent) (void)std::sscanf(event.bytes.c_str(), "%lg %lg", &out.learning_seconds, &out.rendering_seconds);
        if (event.kind == kPlanned) {
            auto planned = from_bytes<v1::Job>(event.bytes);
            if (!planned.ok()) return planned.status();
            out.planned = *std::move(planned);
        }
        if (event.kind == kSettled) {
            auto spec = from_bytes<v1::JobSpec>(event.bytes);
            if (!spec.ok()) return spec.status();
            out.settled = *std::move(spec);
        }
    }
    out.results = stored.results;
    out.checkpoint = stored.checkpoint;
    return out;
}

Result<std::vector<ArchivedJob>> Archive::load(const std::filesystem::path& jobs_directory,
                                               std::map<uint32_t, WorkerHello>& workers, std::vector<std::string>& unreadable) {
    std::vector<ArchivedJob> out;
    if (!store_) return out;
    const auto jobs = store_->load();
    if (!jobs.ok()) return jobs.status();
    for (const StoredJob& stored : *jobs) {
        for (const StoredWorker& worker : stored.workers)
            if (auto hello = from_bytes<v1::WorkerHello>(worker.who); hello.ok()) workers[worker.index] = *std::move(hello);
        if (auto job = read(stored, jobs_directory); job.ok()) {
            out.push_back(*std::move(job));
        } else {
            unreadable.push_back(stored.job.id + ": " + job.status().message());
        }
    }
    return out;
}

Result<Partial> Archive::read_partial(const StoredResult& result, const PartialExpectation& expected) const {
    const auto bytes = store_->read_payload(result);
    if (!bytes.ok()) return bytes.status();
    const auto descriptor = from_bytes<v1::SubmitResultHeader>(bytes->header());
    if (!descriptor.ok()) return descriptor.status();
    return decode_partial(expected, *descriptor, bytes->payload());
}

Result<TrainingRound::Part> Archive::read_training(const StoredResult& result) const {
    const auto bytes = store_->read_payload(result);
    if (!bytes.ok()) return bytes.status();
    if (sha256(bytes->payload()) != result.digest) return data_loss("the training data differ from their digest");
    auto data = parse_training_data(bytes->payload());
    if (!data.ok()) return data.status();
    return TrainingRound::Part{*std::move(data), bytes->payload().size(), result.seconds};
}

}  // namespace lightloom
