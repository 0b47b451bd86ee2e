// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include <arpa/inet.h>
#include <netinet/in.h>
#include <poll.h>
#include <sys/eventfd.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cmath>
#include <cstring>

#include "assembly_cell/base/yaml_text.h"
#include "assembly_cell/sensor/descriptor.h"
#include "assembly_cell/sensor/source_parameters.h"
#include "emulators.h"

namespace assembly_cell {

namespace {

constexpr std::size_t kLongestRequest = 4096;
constexpr std::size_t kMaxReordered = 4;

// waits for bytes; false when `stop` was signalled
bool readable(int descriptor, int stop, int milliseconds = -1) {
  pollfd descriptors[2] = {{stop, POLLIN, 0}, {descriptor, POLLIN, 0}};
  while (poll(descriptors, 2, milliseconds) < 0 && errno == EINTR) {
  }
  return descriptors[0].revents == 0;
}

void signal(int event) {
  const std::uint64_t one = 1;
  [[maybe_unused]] const ssize_t n = ::write(event, &one, sizeof one);
}

Descriptor boundSocket(int type, const std::string& address, int& port) {
  Descriptor made(socket(AF_INET, type | SOCK_CLOEXEC, 0));
  sockaddr_in end{};
  end.sin_family = AF_INET;
  end.sin_port = htons(static_cast<std::uint16_t>(port));
  const bool valid = inet_pton(AF_INET, address.c_str(), &end.sin_addr) == 1;
  const int on = 1;
  if (type == SOCK_STREAM) setsockopt(made.get(), SOL_SOCKET, SO_REUSEADDR, &on, sizeof on);
  socklen_t size = sizeof end;
  if (!valid || bind(made.get(), reinterpret_cast<const sockaddr*>(&end), sizeof end) != 0 ||
      getsockname(made.get(), reinterpret_cast<sockaddr*>(&end), &size) != 0) {
    throw SourceError("emulator: " + printable(address) + ":" + std::to_string(port) + ": " +
                      (valid ? strerror(errno) : "not an IPv4 address") + ": give another");
  }
  port = ntohs(end.sin_port);
  return made;
}

std::string configurationDocument(const NetftConfiguration& c) {
  const auto tag = [](const std::string& name, const std::string& value) {
    return "<" + name + ">" + value + "</" + name + ">\r\n";
  };
  return "<?xml version=\"1.0\" encoding=\"ISO-8859-1\"?>\r\n<netft>\r\n" +
         tag("runstat", "0x00000000") + tag("cfgcpf", yamlNumber(c.counts_per_force)) +
         tag("cfgcpt", yamlNumber(c.counts_per_torque)) + tag("scfgfu", c.force_unit) +
         tag("scfgtu", c.torque_unit) + tag("comrdte", c.rdt_enabled ? "1" : "0") +
         tag("comrdtrate", std::to_string(std::llround(c.rate))) + tag("comrdtbsiz", "40") +
         tag("calsn", c.serial_number) + tag("mfgdigver", c.firmware) + "</netft>\r\n";
}

std::string httpResponse(const std::string& body) {
  return "HTTP/1.0 200 OK\r\nContent-Type: text/xml\r\nContent-Length: " +
         std::to_string(body.size()) + "\r\n\r\n" + body;
}

}  // namespace

struct NetftEmulator::Sockets {
  Descriptor udp, tcp, stop;
  sockaddr_in client{};
};

NetftEmulator::NetftEmulator(const Options& options)
    : options_(options), sockets_(std::make_unique<Sockets>()), random_(options.seed) {
  port_ = options.port;
  sockets_->udp = boundSocket(SOCK_DGRAM, options.bind_address, port_);
  sockets_->stop = Descriptor(eventfd(0, EFD_CLOEXEC));
  http_response_ = httpResponse(configurationDocument(options.configuration));
  held_.reserve(64);
  if (options.http_port >= 0) {
    http_port_ = options.http_port;
    sockets_->tcp = boundSocket(SOCK_STREAM, options.bind_address, http_port_);
    if (listen(sockets_->tcp.get(), 4) != 0) {
      throw SourceError(std::string("emulator: ") + strerror(errno));
    }
    http_ = std::thread([this] { serveHttp(); });
  }
  requests_ = std::thread([this] { serveRequests(); });
  if (options.rate > 0.0) {
    streaming_thread_ =
        std::thread([this] { emitAtRate(options_.rate, stopping_, [this](auto n) { emit(n); }); });
  }
}

NetftEmulator::~NetftEmulator() {
  stopping_ = true;
  signal(sockets_->stop.get());
  requests_.join();
  if (http_.joinable()) http_.join();
  if (streaming_thread_.joinable()) streaming_thread_.join();
}

void NetftEmulator::serveRequests() {
  std::array<std::uint8_t, 64> data;
  while (readable(sockets_->udp.get(), sockets_->stop.get())) {
    sockaddr_in sender{};
    socklen_t size = sizeof sender;
    const ssize_t n = recvfrom(sockets_->udp.get(), data.data(), data.size(), MSG_DONTWAIT,
                               reinterpret_cast<sockaddr*>(&sender), &size);
    RdtRequest request;
    if (n < 0 || dead_ || !unpackRdtRequest(data.data(), static_cast<std::size_t>(n), request)) {
      continue;
    }
    const std::lock_guard<std::mutex> lock(mutex_);
    switch (static_cast<RdtCommand>(request.command)) {
      case RdtCommand::kStart:
        ++starts_;
        if (ignored_starts_ > 0) {
          --ignored_starts_;
          break;
        }
        // one client at a time: the stream goes to the latest
        sockets_->client = sender;
        streaming_ = true;
        rdt_sequence_ = options_.first_sequence;
        held_.clear();
        break;
      case RdtCommand::kStop:
        ++stops_;
        streaming_ = false;
        break;
      case RdtCommand::kBias:
        ++biases_;
        if (ignored_biases_ > 0) {
          --ignored_biases_;
          break;
        }
        bias_ = options_.onrobot && request.sample_count != 255 ? decltype(bias_){}
                                                                : counts(options_.load);
        break;
      default:
        break;
    }
  }
}

void NetftEmulator::serveHttp() {
  while (readable(sockets_->tcp.get(), sockets_->stop.get())) {
    const Descriptor connection(accept4(sockets_->tcp.get(), nullptr, nullptr, SOCK_CLOEXEC));
    if (!connection) continue;
    std::string request;
    std::array<char, 1024> buffer;
    while (request.find("\r\n\r\n") == std::string::npos && request.size() < kLongestRequest) {
      if (!readable(connection.get(), sockets_->stop.get(), 1000)) return;
      const ssize_t n = recv(connection.get(), buffer.data(), buffer.size(), MSG_DONTWAIT);
      if (n <= 0) break;
      request.append(buffer.data(), static_cast<std::size_t>(n));
    }
    if (!dead_ && !sendPage(connection.get())) return;
  }
}

// false when the emulator is stopped
bool NetftEmulator::sendPage(int connection) {
  std::unique_lock<std::mutex> lock(mutex_);
  const std::string response = http_response_;
  const std::size_t part = http_part_ > 0 ? http_part_ : std::max<std::size_t>(response.size(), 1);
  const auto pause = static_cast<int>(http_pause_.count());
  const bool keep_open = http_keep_open_;
  lock.unlock();
  // a pause ends early when the emulator stops
  const auto stopped = [&](int milliseconds) {
    return milliseconds > 0 && !readable(-1, sockets_->stop.get(), milliseconds);
  };
  for (std::size_t sent = 0; sent < response.size();) {
    if (stopped(pause)) return false;
    const ssize_t n = ::send(connection, response.data() + sent,
                             std::min(part, response.size() - sent), MSG_NOSIGNAL);
    if (n <= 0) break;
    sent += static_cast<std::size_t>(n);
  }
  return !(keep_open && stopped(20 * pause));
}

std::array<std::int32_t, 6> NetftEmulator::counts(const std::array<double, 6>& values) const {
  const NetftScale scale = netftScale(options_.configuration);
  std::array<std::int32_t, 6> made;
  for (std::size_t k = 0; k < 6; ++k) {
    const double exact = values[k] / (k < 3 ? scale.force : scale.torque);
    made[k] =
        static_cast<std::int32_t>(std::llround(std::clamp(exact, -2147483648.0, 2147483647.0)));
  }
  return made;
}

RdtRecord NetftEmulator::record(std::uint32_t rdt_sequence, std::uint64_t sample) const {
  std::array<double, 6> values;
  for (std::size_t k = 0; k < 6; ++k) {
    values[k] = options_.load[k] + options_.amplitude * emulatedValue(sample, k);
  }
  RdtRecord made;
  made.rdt_sequence = rdt_sequence;
  made.status = status_;
  made.counts = counts(values);
  return made;
}

void NetftEmulator::send(const std::array<std::uint8_t, kRdtRecordSize>& data) {
  sendto(sockets_->udp.get(), data.data(), data.size(), MSG_NOSIGNAL,
         reinterpret_cast<const sockaddr*>(&sockets_->client), sizeof sockets_->client);
}

bool NetftEmulator::emitLocked(std::size_t count) {
  if (!streaming_ || dead_) return false;
  const LinkFaults& faults = options_.faults;
  for (std::size_t i = 0; i < count; ++i) {
    if (options_.measure) options_.load = options_.measure();
    RdtRecord next = record(rdt_sequence_++, sample_++);
    next.ft_sequence = stalled_ || unnumbered_ ? ft_sequence_ : ++ft_sequence_;
    for (std::size_t k = 0; k < 6; ++k) next.counts[k] -= bias_[k];
    if (stalled_ || frozen_) next.counts = last_counts_;
    last_counts_ = next.counts;
    const auto data = packRdtRecord(next);
    ++sent_;
    if (faults.loss > 0.0 && chance(random_) < faults.loss) {
      ++lost_;
      continue;
    }
    const bool twice = faults.duplication > 0.0 && chance(random_) < faults.duplication;
    if (faults.reordering > 0.0 && chance(random_) < faults.reordering) {
      ++reordered_;
      held_.push_back({data, 1 + static_cast<int>(random_() % kMaxReordered)});
    } else {
      send(data);
      for (Held& held : held_) --held.pass;
    }
    if (twice) {
      ++duplicated_;
      held_.push_back({data, static_cast<int>(random_() % kMaxReordered)});
    }
    for (const Held& held : held_) {
      if (held.pass <= 0) send(held.data);
    }
    held_.erase(
        std::remove_if(held_.begin(), held_.end(), [](const Held& held) { return held.pass <= 0; }),
        held_.end());
  }
  return true;
}

void NetftEmulator::flushLocked() {
  for (const Held& held : held_) send(held.data);
  held_.clear();
}

bool NetftEmulator::emit(std::size_t count) {
  const std::lock_guard<std::mutex> lock(mutex_);
  return emitLocked(count);
}

void NetftEmulator::flush() {
  const std::lock_guard<std::mutex> lock(mutex_);
  flushLocked();
}

bool NetftEmulator::sendRaw(const std::vector<std::uint8_t>& data) {
  const std::lock_guard<std::mutex> lock(mutex_);
  if (!streaming_) return false;
  return sendto(sockets_->udp.get(), data.data(), data.size(), MSG_NOSIGNAL,
                reinterpret_cast<const sockaddr*>(&sockets_->client),
                sizeof sockets_->client) == static_cast<ssize_t>(data.size());
}

void NetftEmulator::setFaults(const LinkFaults& faults) {
  const std::lock_guard<std::mutex> lock(mutex_);
  options_.faults = faults;
}

void NetftEmulator::setHttpResponse(const std::string& response) {
  const std::lock_guard<std::mutex> lock(mutex_);
  http_response_ = response;
}

void NetftEmulator::setConfiguration(const NetftConfiguration& configuration) {
  const std::lock_guard<std::mutex> lock(mutex_);
  options_.configuration = configuration;
  http_response_ = httpResponse(configurationDocument(configuration));
}

void NetftEmulator::setHttpPace(std::size_t bytes, std::chrono::milliseconds pause,
                                bool keep_open) {
  const std::lock_guard<std::mutex> lock(mutex_);
  http_part_ = bytes;
  http_pause_ = pause;
  http_keep_open_ = keep_open;
}

void NetftEmulator::restart() {
  const std::lock_guard<std::mutex> lock(mutex_);
  streaming_ = false;
  rdt_sequence_ = options_.first_sequence;
  ft_sequence_ = 0;
  bias_ = {};
  held_.clear();
}

bool NetftEmulator::streaming() const {
  const std::lock_guard<std::mutex> lock(mutex_);
  return streaming_;
}

int NetftEmulator::clientPort() const {
  const std::lock_guard<std::mutex> lock(mutex_);
  return ntohs(sockets_->client.sin_port);
}

}  // namespace assembly_cell
