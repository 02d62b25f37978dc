#include "server/grpc_services.h"

#include <grpcpp/ext/proto_server_reflection_plugin.h>
#include <grpcpp/health_check_service_interface.h>
#include <grpcpp/impl/server_builder_option.h>
#include <grpcpp/server_builder.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include "common/work/channel.h"
#include "server/asset_service.h"
#include "server/job_service.h"
#include "server/worker_service.h"

namespace lightloom {

struct GrpcServer::Services {
    explicit Services(Coordinator& c) : coordinator(c), job(c, closing), asset(c, closing), worker(c, closing) {}
    Coordinator& coordinator;
    std::atomic<bool> closing{false};
    JobServiceImpl job;
    AssetServiceImpl asset;
    WorkerServiceImpl worker;
};

namespace {

/// Whether a server listens on the socket; gRPC would take the socket away from it.
bool socket_is_served(const std::string& path) {
    sockaddr_un name{};
    if (path.empty() || path.size() >= sizeof name.sun_path) return false;
    name.sun_family = AF_UNIX;
    path.copy(name.sun_path, path.size());
    const int probe = ::socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0);
    if (probe < 0) return false;
    const bool answered = ::connect(probe, reinterpret_cast<const sockaddr*>(&name), sizeof name) == 0;
    ::close(probe);
    return answered;
}

/// Takes reflection away again: the plugin adds itself to every server of a program that it is linked to.
class WithoutReflection final : public grpc::ServerBuilderOption {
  public:
    void UpdateArguments(grpc::ChannelArguments*) override {}
    void UpdatePlugins(std::vector<std::unique_ptr<grpc::ServerBuilderPlugin>>* plugins) override {
        const std::string reflection = grpc::reflection::ProtoServerReflectionPlugin().name();
        std::erase_if(*plugins, [&](const auto& plugin) { return plugin->name() == reflection; });
    }
};

}  // namespace

GrpcServer::GrpcServer() = default;

Result<std::unique_ptr<GrpcServer>> GrpcServer::start(Coordinator& coordinator, const std::string& address,
                                                      const GrpcServerOptions& options) {
    const Status taken(StatusCode::kUnavailable, "cannot listen on " + address + "; is another coordinator running there?");
    constexpr std::string_view kUnix = "unix:";
    if (address.starts_with(kUnix) && socket_is_served(address.substr(kUnix.size()))) return taken;
    grpc::EnableDefaultHealthCheckService(true);
    std::unique_ptr<GrpcServer> server(new GrpcServer);
    server->services_ = std::make_unique<Services>(coordinator);
    grpc::ServerBuilder builder;
    if (!options.reflection) builder.SetOption(std::make_unique<WithoutReflection>());
    // One coordinator per port: without this a second one would share it silently.
    builder.AddChannelArgument(GRPC_ARG_ALLOW_REUSEPORT, 0);
    set_keepalive([&](const char* name, int value) { builder.AddChannelArgument(name, value); });
    // Clients and workers that send pings more often than this are disconnected.
    builder.AddChannelArgument(GRPC_ARG_HTTP2_MIN_RECV_PING_INTERVAL_WITHOUT_DATA_MS, kKeepaliveMilliseconds / 4);
    builder.AddChannelArgument(GRPC_ARG_MAX_CONCURRENT_STREAMS, 64);
    builder.AddListeningPort(address, grpc::InsecureServerCredentials(), &server->port_);
    builder.RegisterService(&server->services_->job);
    builder.RegisterService(&server->services_->asset);
    builder.RegisterService(&server->services_->worker);
    server->server_ = builder.BuildAndStart();
    if (!server->server_ || server->port_ == 0) return taken;
    server->health_ =
        std::jthread([service = server->server_->GetHealthCheckService(), ready = options.ready](std::stop_token stop) {
            follow_health(
                ready, [&](bool healthy) { service->SetServingStatus(healthy); }, stop);
        });
    return server;
}

GrpcServer::~GrpcServer() {
    if (!server_) return;
    health_ = {};
    services_->closing = true;
    services_->coordinator.wake_leases();
    // Handlers that wait for something else check `closing` once a second at least; calls that do not end by themselves are
    // cancelled.
    server_->Shutdown(std::chrono::system_clock::now() + std::chrono::seconds(3));
}

}  // namespace lightloom
