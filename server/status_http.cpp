#include "server/status_http.h"

#include <boost/asio/dispatch.hpp>
#include <boost/asio/ip/tcp.hpp>
#include <boost/asio/steady_timer.hpp>
#include <boost/beast/core.hpp>
#include <boost/beast/http.hpp>
#include <nlohmann/json.hpp>
#include <thread>

#include "server/host_port.h"
#include "server/status_json.h"

namespace lightloom {
namespace {

namespace asio = boost::asio;
namespace beast = boost::beast;
namespace http = beast::http;
using tcp = asio::ip::tcp;
using Json = nlohmann::ordered_json;

constexpr int kMaxConnections = 64;
constexpr uint32_t kMaxHeaderBytes = 8 * 1024;
constexpr auto kTimeout = std::chrono::seconds(5);
constexpr auto kPause = std::chrono::milliseconds(100);

std::string status_json(const Coordinator& coordinator) {
    Json jobs = Json::array();
    for (const JobInfo& job : coordinator.list_jobs()) jobs.push_back(status_json(job));
    Json workers = Json::array();
    for (const WorkerStatus& worker : coordinator.workers()) workers.push_back(status_json(worker));
    return status_text({{"jobs", std::move(jobs)}, {"workers", std::move(workers)}}, 1) + "\n";
}

/// What requests are about.
struct Watched {
    const Coordinator& coordinator;
    HealthChecks health;
};

void respond_health(const std::function<Status()>& check, http::response<http::string_body>& response) {
    const Status status = check ? check() : Status();
    if (!status.ok()) response.result(http::status::service_unavailable);
    response.body() = (status.ok() ? "ok" : status.message()) + "\n";
}

http::response<http::string_body> respond(const Watched& watched, const http::request<http::empty_body>& request) {
    http::response<http::string_body> response;
    response.version(request.version());
    response.keep_alive(false);
    response.set(http::field::cache_control, "no-store");
    response.set(http::field::content_type, "text/plain; charset=utf-8");
    const beast::string_view target = request.target();
    if (request.method() != http::verb::get) {
        response.result(http::status::method_not_allowed);
        response.set(http::field::allow, "GET");
        response.body() = "GET only\n";
    } else if (target == "/healthz") {
        respond_health(watched.health.live, response);
    } else if (target == "/readyz") {
        respond_health(watched.health.ready, response);
    } else if (target == "/api/v1/status") {
        response.set(http::field::content_type, "application/json");
        response.body() = status_json(watched.coordinator);
    } else {
        response.result(http::status::not_found);
        response.body() = "not found; there are /healthz, /readyz and /api/v1/status\n";
    }
    response.prepare_payload();
    return response;
}

/// A connection has one request and one answer.
class Session : public std::enable_shared_from_this<Session> {
  public:
    Session(tcp::socket socket, const Watched& watched, int& connections)
        : stream_(std::move(socket)),
          watched_(watched),
          connections_(connections) {
        ++connections_;
        parser_.header_limit(kMaxHeaderBytes);
        parser_.body_limit(0);
    }
    ~Session() { --connections_; }

    void start() {
        stream_.expires_after(kTimeout);
        http::async_read(stream_, buffer_, parser_, [self = shared_from_this()](beast::error_code error, size_t) {
            if (!error) self->answer();
        });
    }

  private:
    void answer() {
        response_ = respond(watched_, parser_.get());
        stream_.expires_after(kTimeout);
        http::async_write(stream_, response_, [self = shared_from_this()](beast::error_code, size_t) {
            beast::error_code ignored;
            self->stream_.socket().shutdown(tcp::socket::shutdown_send, ignored);
        });
    }

    beast::tcp_stream stream_;
    beast::flat_buffer buffer_{kMaxHeaderBytes + 1024};
    http::request_parser<http::empty_body> parser_;
    http::response<http::string_body> response_;
    const Watched& watched_;
    int& connections_;
};

}  // namespace

struct StatusHttp::Impl {
    Impl(const Coordinator& coordinator, HealthChecks health) : watched{coordinator, std::move(health)}, acceptor(context) {}

    void accept() {
        acceptor.async_accept([this](beast::error_code error, tcp::socket socket) {
            if (error == asio::error::operation_aborted) return;
            // Above the limit a connection is closed without an answer, so that this endpoint never starves the
            // renderer.
            if (!error && connections < kMaxConnections)
                std::make_shared<Session>(std::move(socket), watched, connections)->start();
            if (!error) return accept();
            // A lasting error (no descriptor is left) must not turn this into a busy loop.
            pause.expires_after(kPause);
            pause.async_wait([this](beast::error_code cancelled) {
                if (!cancelled) accept();
            });
        });
    }

    const Watched watched;
    int connections = 0;  // for the one thread; outlives `context`, whose end destroys sessions
    asio::io_context context{1};
    tcp::acceptor acceptor;
    asio::steady_timer pause{context};
    std::thread thread;
};

StatusHttp::StatusHttp(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}

StatusHttp::~StatusHttp() {
    impl_->context.stop();
    if (impl_->thread.joinable()) impl_->thread.join();
}

int StatusHttp::port() const { return impl_->acceptor.local_endpoint().port(); }

Result<std::unique_ptr<StatusHttp>> StatusHttp::start(const Coordinator& coordinator, const std::string& address,
                                                      HealthChecks health) {
    const auto parsed = parse_host_port(address, "--status");
    if (!parsed.ok()) return parsed.status();
    auto impl = std::make_unique<Impl>(coordinator, std::move(health));
    beast::error_code error;
    const auto literal = asio::ip::make_address(parsed->host == "localhost" ? "127.0.0.1" : parsed->host, error);
    if (error) return invalid_argument("--status takes a literal address or localhost, not \"" + parsed->host + "\"");
    const tcp::endpoint endpoint(literal, parsed->port);
    impl->acceptor.open(endpoint.protocol(), error);
    if (!error) impl->acceptor.set_option(asio::socket_base::reuse_address(true), error);
    if (!error) impl->acceptor.bind(endpoint, error);
    if (!error) impl->acceptor.listen(kMaxConnections, error);
    if (error)
        return Status(StatusCode::kUnavailable, "the status page cannot listen on " + address + ": " + error.message() +
                                                    "; choose another with --status, or off");
    impl->accept();
    impl->thread = std::thread([raw = impl.get()] { raw->context.run(); });
    return std::unique_ptr<StatusHttp>(new StatusHttp(std::move(impl)));
}

}  // namespace lightloom
