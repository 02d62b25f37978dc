#pragma once
// HTTP by hand, so that a test can send nonsense, too.

#include <arpa/inet.h>
#include <sys/socket.h>
#include <unistd.h>

#include <string>

namespace lightloom::testing {

/// Sends `request` to a loopback port and returns all that comes back before the connection ends.
inline std::string http(int port, const std::string& request) {
    const int client = ::socket(AF_INET, SOCK_STREAM, 0);
    sockaddr_in address{};
    address.sin_family = AF_INET;
    address.sin_port = htons(uint16_t(port));
    address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    std::string answer;
    if (::connect(client, reinterpret_cast<sockaddr*>(&address), sizeof address) == 0) {
        (void)!::send(client, request.data(), request.size(), MSG_NOSIGNAL);
        char buffer[4096];
        for (ssize_t n; (n = ::recv(client, buffer, sizeof buffer, 0)) > 0;) answer.append(buffer, size_t(n));
    }
    ::close(client);
    return answer;
}

}  // namespace lightloom::testing
