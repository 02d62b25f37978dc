#pragma once
// Addresses of the command line: HOST:PORT, with [::1] for IPv6.

#include <cstdint>
#include <string>
#include <string_view>

#include "common/core/result.h"

namespace lightloom {

struct HostPort {
    std::string host;   ///< A literal address, "localhost", or another name; without brackets.
    uint16_t port = 0;  ///< 0: any free one.
};

/// kInvalidArgument for any other text; the message names `option`.
Result<HostPort> parse_host_port(std::string_view text, std::string_view option);

/// Whether only processes on this host can reach the address.
bool is_loopback(const HostPort& address);

}  // namespace lightloom
