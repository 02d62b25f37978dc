#pragma once
// The desk at which a job's tables are learned: learn_tables() runs on a thread of the job's own. Through a TracingPort it reaches
// what only the coordinator has: units that workers trace, other jobs with the same tables, and the book.

#include "server/office.h"

namespace lightloom {

/// Starts to learn; the first round of the job is open and its first unit was leased. Learning takes a thread and a built scene
/// only from then on; both are made while paths are traced.
void start_learning(Office& office, OpenBook& book, const JobPtr& file);

}  // namespace lightloom
