#include "common/work/channel.h"

#include <grpcpp/create_channel.h>

namespace lightloom {

std::shared_ptr<grpc::Channel> open_channel(const std::string& server) {
    grpc::ChannelArguments arguments;
    set_keepalive([&](const char* name, int value) { arguments.SetInt(name, value); });
    // A coordinator that is restarted gets its workers and clients back within a second of opening its port.
    arguments.SetInt(GRPC_ARG_INITIAL_RECONNECT_BACKOFF_MS, 100);
    arguments.SetInt(GRPC_ARG_MAX_RECONNECT_BACKOFF_MS, 500);
    // Not a pause, but the least time that an attempt at connecting is given before the next one.
    arguments.SetInt(GRPC_ARG_MIN_RECONNECT_BACKOFF_MS, 2000);
    // A coordinator knows up to 11 000 jobs, which it lists in one message of up to some kB each; the default is 4 MiB.
    arguments.SetMaxReceiveMessageSize(64 << 20);
    return grpc::CreateCustomChannel(server, grpc::InsecureChannelCredentials(), arguments);
}

}  // namespace lightloom
