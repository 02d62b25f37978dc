#pragma once
// The desk for jobs that end without their image: their complete groups are written, so that no sample is lost.

#include "server/office.h"

namespace lightloom {

/// Told of a job that is cancelled so.
inline constexpr const char* kGroupsAreKept = "its complete groups are kept: `lightloom fetch --partial` writes them";

/// Begins to write what a job has that has ended and asks for it (Effects::keep). On disk the job ends after that: a coordinator
/// that is killed meanwhile goes on with it.
void keep_groups(Office& office, OpenBook& book, const JobPtr& file);

}  // namespace lightloom
