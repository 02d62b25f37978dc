#pragma once
// What the store keeps of a job. Specs, labels, decisions and the like are bytes to it: it does not look inside.

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "common/core/digest.h"
#include "common/work/service.h"
#include "server/store/segment_log.h"

namespace lightloom {

/// A job as it was submitted.
struct NewJob {
    std::string id, request_id;
    std::string created_at;  ///< UTC.
    std::string submitted;   ///< The spec, bytes.
    std::string label;       ///< Bytes.
    std::string scene;       ///< Path of the scene file in its file list, as far as it is known.
    JobState state = JobState::kPreparing;
};

/// What of a job is to be changed.
struct JobUpdate {
    std::optional<JobState> state;
    std::optional<std::string> message, scene;
    std::optional<std::string> spec;  ///< The spec as completed from the scene, bytes.
};

/// The result of a unit of the image or of the training set.
struct NewResult {
    UnitKey unit;
    Digest digest;             ///< By which a repeated result is recognised.
    uint32_t worker = 0;       ///< Index of the worker in the job.
    std::string_view who;      ///< Bytes that describe this worker; kept once for each index.
    double seconds = 0;        ///< That the worker took.
    std::string_view header;   ///< What is needed to read the payload, bytes; at most 4 GiB.
    std::string_view payload;  ///< Bytes.
};

/// A result on disk.
struct StoredResult {
    UnitKey unit;
    Digest digest;
    uint32_t worker = 0;
    double seconds = 0;
    /// Where header and payload lie; none once a checkpoint holds the result, see JobStore::read_payload().
    std::optional<PayloadPlace> place;
};

struct StoredPayload {
    std::string bytes;
    size_t header_size = 0;
    std::string_view header() const { return std::string_view(bytes).substr(kPrefix, header_size); }
    std::string_view payload() const { return std::string_view(bytes).substr(kPrefix + header_size); }
    /// Bytes before the header: its size.
    static constexpr size_t kPrefix = 4;
};

struct StoredEvent {
    std::string kind, bytes;
};

struct StoredWorker {
    uint32_t index = 0;
    std::string who;  ///< Bytes.
};

struct StoredCheckpoint {
    uint32_t groups = 0;  ///< Complete groups of the image that are in it.
    std::string file;     ///< Name in the folder of checkpoints.
    Digest digest;
    uint64_t size = 0;  ///< Bytes.
};

/// All that is on disk of a job.
struct StoredJob {
    NewJob job;  ///< With the present state.
    std::string message;
    std::optional<std::string> spec;  ///< As completed from the scene, bytes.
    std::optional<std::string> info;  ///< Of a job that has ended: what is told of it, bytes.
    std::vector<StoredEvent> events;  ///< In their order.
    std::vector<StoredWorker> workers;
    std::vector<StoredResult> results;  ///< By kind, round, group and tile.
    std::optional<StoredCheckpoint> checkpoint;
};

}  // namespace lightloom
