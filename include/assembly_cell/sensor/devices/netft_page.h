// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <netinet/in.h>

#include <chrono>
#include <functional>
#include <string>

namespace assembly_cell {

/// Address of an IPv4 socket; address as isAddress() of the source accepts it.
sockaddr_in endpoint(const std::string& address, int port);
inline const sockaddr* generic(const sockaddr_in& end) {
  return reinterpret_cast<const sockaddr*>(&end);
}

/// Throws SourceError for errno of a bind to an address that isn't this computer's.
[[noreturn]] void failBind(const std::string& bind_address);

/// A box's HTTP server, and this computer's address in its network.
struct NetftServer {
  std::string address;
  int port = 80;
  std::string bind_address;
};

/// Waits until a descriptor can be read (or written), or a point in time: then false. May throw.
using DescriptorWait = std::function<bool(
    int descriptor, std::chrono::steady_clock::time_point deadline, bool for_writing)>;

/// GET /netftapi2.xml: the whole response, at most kLargestHttpResponse bytes. It is complete with
/// its declared length, with the end tag of netft, or when the box closes. A slow box has 3 s
/// for each part and 10 s in all. Throws SourceError, which distinguishes a box that doesn't
/// answer, one that accepts the connection and sends nothing, and one that stops in the middle.
std::string readNetftPage(const NetftServer& server, const DescriptorWait& wait);

}  // namespace assembly_cell
