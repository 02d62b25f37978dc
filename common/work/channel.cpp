#include "common/work/channel.h"

#include <grpcpp/create_channel.h>

namespace lightloom {

std::shared_ptr<grpc::Channel> open_channel(const std::string& server) {
    grpc::ChannelArguments arguments;
    set_keepalive([&](const char* name, int value) { arguments.SetInt(name, value); });
    arguments.SetInt(GRPC_ARG_MAX_RECONNECT_BACKOFF_MS, 2000);
    return grpc::CreateCustomChannel(server, grpc::InsecureChannelCredentials(), arguments);
}

}  // namespace lightloom
