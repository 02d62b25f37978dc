#include "client/service_options.h"

#include <cstdio>

#include "client/commands.h"
#include "client/run_job.h"
#include "common/cli/command_line.h"
#include "common/work/channel.h"

namespace lightloom::client {

void add_server_option(cli::App command, ServiceOptions& options) {
    command.add_option("--server", options.server, "HOST:PORT of the coordinator")
        ->envname("LIGHTLOOM_SERVER")
        ->capture_default_str();
}

void add_job_argument(cli::App command, ServiceOptions& options) {
    command.add_option("JOB", options.job_id, "Id from `submit --detach` or `list`")->required();
}

GrpcJobPort connect(const ServiceOptions& options) {
    (void)interrupt_token();  // before gRPC makes threads
    const auto tell = [server = options.server] {
        std::fprintf(stderr, "lightloom: no answer from %s any more; waiting for it to come back\n", server.c_str());
    };
    return GrpcJobPort(open_channel(options.server), {.stop = interrupt_token(), .on_lost = tell});
}

namespace {

/// What came of a call, as a person at the command line understands it.
Status explained(const ServiceOptions& options, const Status& status) {
    if (status.code() == StatusCode::kUnimplemented)
        return failed_precondition("the coordinator at " + options.server +
                                   " is older than this client and does not know the request; install the same build there");
    if (status.code() != StatusCode::kUnavailable && status.code() != StatusCode::kDeadlineExceeded) return status;
    return {status.code(), "no answer from " + options.server + " (" + status.message() + "); is lightloom-server running there?"};
}

}  // namespace

int service_error(const ServiceOptions& options, const Status& status) { return report_error(explained(options, status)); }

int job_error(const ServiceOptions& options, const Status& status) { return report_job_error(explained(options, status)); }

}  // namespace lightloom::client
