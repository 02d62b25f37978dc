#pragma once
// The step from a scene, and tables where the algorithm needs them, to units that can be rendered; and the files of tables.

#include "server/office.h"

namespace lightloom {

/// Lets the job render, if it still prepares. `spec` is complete.
Status plan_units(Office& office, const JobPtr& file, JobSpec spec, SceneFacts facts, TablesInfo tables);

/// Stores tables where workers fetch them; what is there already and sound stays.
Status store_tables(Office& office, const Digest& digest, std::string_view bytes);
/// Stores the tables and lets the job render with them.
Status adopt_tables(Office& office, const JobPtr& file, const JobSpec& spec, const SceneFacts& facts, std::string_view bytes,
                    TablesInfo tables);
/// The same with tables of an earlier job, if there are any for this spec; false if not.
bool adopt_cached_tables(Office& office, const JobPtr& file, const JobSpec& spec, const SceneFacts& facts);
/// A worker cannot get the tables of the job, or they are damaged. True if they were, and are whole again. If they cannot be
/// restored, the job fails.
bool repair_tables(Office& office, const std::string& job_id);

}  // namespace lightloom
