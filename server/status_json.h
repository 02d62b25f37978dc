#pragma once
// Jobs and workers as JSON: the same objects on the status endpoint and from `lightloom list`, `workers` and `watch`.

#include <nlohmann/json_fwd.hpp>
#include <string>

#include "common/work/service.h"

namespace lightloom {

/// Tells what a job is called, what it renders, and how far it is. Null stands for what is not known (yet).
nlohmann::ordered_json status_json(const JobInfo& job);
/// Tells who a worker is, and what it does.
nlohmann::ordered_json status_json(const WorkerStatus& worker);

/// Prints any of these as JSON, in one line for an `indent` of -1. U+FFFD replaces bytes of texts that are not UTF-8.
std::string status_text(const nlohmann::ordered_json& status, int indent = -1);

}  // namespace lightloom
