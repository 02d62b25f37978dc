#pragma once
// Converts between the protocol's messages and the C++ types, and checks the limits of the protocol.

#include <grpcpp/support/status.h>

#include "common/film/partial_exr.h"
#include "common/work/service.h"
#include "lightloom/v1/job_service.pb.h"
#include "lightloom/v1/types.pb.h"
#include "lightloom/v1/worker_service.pb.h"

namespace lightloom::wire {

/// Most bytes of an error message; a longer one is cut.
inline constexpr size_t kMaxMessageBytes = 2000;

grpc::Status to_grpc(const Status& status);
Status from_grpc(const grpc::Status& status);

void put(const Digest& in, v1::Digest* out);
void put(const JobSpec& in, v1::JobSpec* out);
void put(const JobLabel& in, v1::JobLabel* out);
void put(const JobInfo& in, v1::Job* out);
void put(const WorkerStatus& in, v1::Worker* out);
void put(const WorkUnit& in, v1::WorkUnit* out);
void put(const UnitReference& in, v1::UnitReference* out);
void put(const UnitLease& in, v1::UnitLease* out);
void put(const WorkerHello& in, v1::WorkerHello* out);
void put(const WorkerGrant& in, v1::WorkerGrant* out);
void put(const SubmitAck& in, v1::SubmitResultResponse* out);
/// Fills in everything but worker, unit and render time.
void put(const PartialDescriptor& in, v1::SubmitResultHeader* out);

// Each fails with kInvalidArgument on what the protocol forbids (a digest of another length, an UNSPECIFIED enum).
Result<Digest> get(const v1::Digest& in);
Result<JobSpec> get(const v1::JobSpec& in);
JobLabel get(const v1::JobLabel& in);
Result<JobInfo> get(const v1::Job& in);
Result<WorkerStatus> get(const v1::Worker& in);
Result<WorkUnit> get(const v1::WorkUnit& in);
Result<UnitReference> get(const v1::UnitReference& in);
Result<UnitLease> get(const v1::UnitLease& in);
Result<WorkerHello> get(const v1::WorkerHello& in);
WorkerGrant get(const v1::WorkerGrant& in);
Result<SubmitAck> get(const v1::SubmitResultResponse& in);
Result<PartialDescriptor> get(const v1::SubmitResultHeader& in);

}  // namespace lightloom::wire
