// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/sensor/devices/netft_page.h"

#include <arpa/inet.h>
#include <sys/socket.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>

#include "assembly_cell/sensor/descriptor.h"
#include "assembly_cell/sensor/devices/netft_configuration.h"
#include "assembly_cell/sensor/strain_source.h"

namespace assembly_cell {

namespace {

using Clock = std::chrono::steady_clock;

// A box's web server is a small program beside its measurement: answers of 1 s are usual. Half of
// it refuses boxes that work; twice of it delays the message about one that hangs.
constexpr auto kSilence = std::chrono::seconds(3);
constexpr auto kPatience = std::chrono::seconds(10);  // for the whole page

constexpr const char* kRemedy =
    ": close browsers that have its page open, restart the box, or set configuration: parameters";

class Page {
 public:
  Page(const NetftServer& server, const DescriptorWait& wait)
      : server_(server),
        wait_(wait),
        where_("source netft: " + server.address + ":" + std::to_string(server.port)),
        limit_(Clock::now() + kPatience) {}

  std::string read() {
    connect();
    send("GET /netftapi2.xml HTTP/1.0\r\nHost: " + server_.address + "\r\n\r\n");
    std::string response;
    std::array<char, 4096> buffer;
    while (!httpComplete(response)) {
      const ssize_t n = recv(connection_.get(), buffer.data(), buffer.size(), 0);
      if (n == 0) break;
      if (n > 0) {
        response.append(buffer.data(), static_cast<std::size_t>(n));
      } else if (errno == EAGAIN) {
        if (!ready(false)) failSilent(response.size());
      } else if (errno != EINTR) {
        fail(errno);
      }
      if (response.size() > kLargestHttpResponse) {
        throw SourceError(where_ + " answers with more than " +
                          std::to_string(kLargestHttpResponse) + " bytes: is it a Net F/T box?");
      }
      if (Clock::now() >= limit_) failSilent(response.size());
    }
    return response;
  }

 private:
  bool ready(bool for_writing) const {
    return wait_(connection_.get(), std::min(limit_, Clock::now() + kSilence), for_writing);
  }
  [[noreturn]] void fail(int error) const {
    throw SourceError(where_ + ": " + strerror(error) + ": check power, cable and http_port");
  }
  [[noreturn]] void failAbsent() const {
    throw SourceError(where_ + " doesn't answer to HTTP: check power, cable and address");
  }
  [[noreturn]] void failSilent(std::size_t bytes) const {
    if (bytes == 0) {
      throw SourceError(where_ + " accepts the connection but sends no page" + kRemedy);
    }
    if (Clock::now() >= limit_) {
      throw SourceError(where_ + " sent only " + std::to_string(bytes) +
                        " bytes of its page in 10 s" + kRemedy);
    }
    throw SourceError(where_ + " stops after " + std::to_string(bytes) + " bytes of its page" +
                      kRemedy);
  }

  void connect() {
    connection_ = Descriptor(socket(AF_INET, SOCK_STREAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0));
    const sockaddr_in local = endpoint(server_.bind_address, 0);
    const sockaddr_in box = endpoint(server_.address, server_.port);
    if (!connection_) fail(errno);
    if (bind(connection_.get(), generic(local), sizeof local) != 0) failBind(server_.bind_address);
    if (::connect(connection_.get(), generic(box), sizeof box) == 0) return;
    if (errno != EINPROGRESS) fail(errno);
    if (!ready(true)) failAbsent();
    int error = 0;
    socklen_t size = sizeof error;
    getsockopt(connection_.get(), SOL_SOCKET, SO_ERROR, &error, &size);
    if (error != 0) fail(error);
  }

  void send(const std::string& request) {
    for (std::size_t sent = 0; sent < request.size();) {
      const ssize_t n =
          ::send(connection_.get(), request.data() + sent, request.size() - sent, MSG_NOSIGNAL);
      if (n > 0) {
        sent += static_cast<std::size_t>(n);
      } else if (errno == EAGAIN) {
        if (!ready(true)) failAbsent();
      } else if (errno != EINTR) {
        fail(errno);
      }
    }
  }

  const NetftServer& server_;
  const DescriptorWait& wait_;
  const std::string where_;
  const Clock::time_point limit_;
  Descriptor connection_;
};

}  // namespace

sockaddr_in endpoint(const std::string& address, int port) {
  sockaddr_in end{};
  end.sin_family = AF_INET;
  end.sin_port = htons(static_cast<std::uint16_t>(port));
  inet_pton(AF_INET, address.c_str(), &end.sin_addr);
  return end;
}

void failBind(const std::string& bind_address) {
  throw SourceError("source netft: bind_address (bind:= of the launch file) " + bind_address +
                    ": " + strerror(errno) + ": give an address of this computer");
}

std::string readNetftPage(const NetftServer& server, const DescriptorWait& wait) {
  return Page(server, wait).read();
}

}  // namespace assembly_cell
