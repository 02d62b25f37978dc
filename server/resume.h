#pragma once
// A restart: the jobs of an earlier coordinator go on where the archive has them.

#include "server/office.h"

namespace lightloom {

/// Puts all jobs of the archive into the book, and starts to prepare those that have not ended. Called once, before anybody else
/// uses the office.
Status restore_jobs(Office& office);

/// Enters the results that an earlier coordinator has taken into a plan that has none yet. A result that cannot be read is made
/// again.
Status replay_results(Office& office, const ArchivedJob& archived, Job::RenderPlan& plan);
/// The same for the open training round of the job, on a thread of its own.
void start_replaying_training(Office& office, OpenBook& book, const JobPtr& file);

}  // namespace lightloom
