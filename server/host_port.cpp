#include "server/host_port.h"

#include <boost/asio/ip/address.hpp>
#include <charconv>

namespace lightloom {

Result<HostPort> parse_host_port(std::string_view text, std::string_view option) {
    const auto wrong = [&] {
        return invalid_argument(std::string(option) +
                                " takes HOST:PORT with a port from 0 to 65535 and [] around an IPv6 address, not \"" +
                                std::string(text) + "\"");
    };
    const size_t colon = text.rfind(':');
    if (colon == std::string_view::npos) return wrong();
    HostPort out;
    out.host = text.substr(0, colon);
    const char* const end = text.data() + text.size();
    const auto [stop, error] = std::from_chars(text.data() + colon + 1, end, out.port);
    if (error != std::errc() || stop != end) return wrong();
    const bool brackets = out.host.size() > 2 && out.host.front() == '[' && out.host.back() == ']';
    if (brackets) out.host = out.host.substr(1, out.host.size() - 2);
    boost::system::error_code name;
    const auto address = boost::asio::ip::make_address(out.host, name);
    if (out.host.empty() || (name ? brackets || out.host.find(':') != std::string::npos : address.is_v6() != brackets))
        return wrong();
    return out;
}

bool is_loopback(const HostPort& address) {
    boost::system::error_code unknown;
    const auto literal = boost::asio::ip::make_address(address.host, unknown);
    return address.host == "localhost" || (!unknown && literal.is_loopback());
}

}  // namespace lightloom
