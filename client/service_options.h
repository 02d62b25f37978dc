#pragma once
// The options, connection and errors that the commands which talk to a service have in common.

#include <string>

#include "client/grpc_job_port.h"
#include "client/job_options.h"
#include "common/cli/command_line.h"

namespace lightloom::client {

struct ServiceOptions {
    std::string server = "127.0.0.1:50051";
    JobOptions job;
    std::string job_id, name;
    bool detach = false, json = false, all = false, again = false, partial = false, keep = false;
};

void add_server_option(cli::App command, ServiceOptions& options);
/// Adds the argument JOB.
void add_job_argument(cli::App command, ServiceOptions& options);
GrpcJobPort connect(const ServiceOptions& options);

/// Prints an error and gives the exit code, as report_error(); says clearly when a service does not answer.
int service_error(const ServiceOptions& options, const Status& status);
/// Does the same with report_job_error().
int job_error(const ServiceOptions& options, const Status& status);

// Commands that have files of their own. Each returns the exit code.
int list_jobs(const ServiceOptions& options);
int list_workers(const ServiceOptions& options);
int preview_job(const ServiceOptions& options);
int fetch_job(const ServiceOptions& options);
int cancel_job(const ServiceOptions& options);
int finish_job(const ServiceOptions& options);

}  // namespace lightloom::client
