#pragma once
// Works a suite off: scenes one after the other; of a scene one seed after the other; of a seed all algorithms in turns of a few
// seconds, so that what else the machine does meets them alike.

#include <map>
#include <vector>

#include "client/bench/results_file.h"
#include "client/bench/scene_bench.h"
#include "client/bench/suite.h"

namespace lightloom::client {

struct SuiteResults {
    std::vector<Json> lines;           ///< All of the file but those of runs that the suite does not ask for.
    std::vector<std::string> skipped;  ///< Optional scenes that are not there.
};

/// Measures what the results file does not hold yet. Errors name the scene; what was finished is in the file. kCancelled after a
/// stop request.
Result<SuiteResults> run_suite(const Suite& suite, const SuiteOptions& options, std::stop_token stop);

/// One clear line for what cannot be measured at all, before anything is rendered: scenes and references that are not there.
Status check_files(const Suite& suite);

}  // namespace lightloom::client
