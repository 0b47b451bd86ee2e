// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/sensor/devices/netft_source.h"

#include <arpa/inet.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <yaml-cpp/yaml.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cmath>
#include <cstring>

#include "assembly_cell/base/input_error.h"
#include "assembly_cell/sensor/descriptor.h"
#include "assembly_cell/sensor/devices/netft_page.h"
#include "assembly_cell/sensor/reception.h"
#include "assembly_cell/sensor/source_parameters.h"

namespace assembly_cell {

namespace {

constexpr std::size_t kDatagrams = 64;    // read at once
constexpr std::size_t kMaxAtOnce = 4096;  // datagrams in one go, of all senders
constexpr int kReceiveBuffer = 4 << 20;   // requested [bytes]
constexpr auto kShortestNap = std::chrono::microseconds(100);
constexpr auto kIdle = std::chrono::microseconds(1500);  // without records a block isn't waited for
constexpr auto kBiasSettling = std::chrono::milliseconds(50);
constexpr std::size_t kBiasSamples = 100;
constexpr int kBiasAttempts = 3;
constexpr auto kTakeovers = std::chrono::seconds(3);  // for three restarts of a stream
constexpr std::uint64_t kUnnumbered = 100;  // records in a row, a seventieth of a second at 7 kHz
constexpr double kBiasNoise = 3.0;          // standard deviations of a sample around zero

bool isAddress(const std::string& text) {
  in_addr address;
  return inet_pton(AF_INET, text.c_str(), &address) == 1;
}

bool isLoopback(const std::string& address) {
  return (ntohl(endpoint(address, 0).sin_addr.s_addr) >> 24) == 127;
}

}  // namespace

struct NetftSource::Socket {
  Descriptor descriptor;
  sockaddr_in peer{};
  // where the kernel puts datagrams, senders and times of arrival
  std::array<mmsghdr, kDatagrams> headers{};
  std::array<iovec, kDatagrams> vectors{};
  std::array<std::array<std::uint8_t, kRdtRecordSize + 1>, kDatagrams> data{};
  std::array<sockaddr_in, kDatagrams> senders{};
  alignas(cmsghdr) std::array<std::array<char, 64>, kDatagrams> controls{};
  // datagrams read but not yet in the stream
  std::size_t position = 0, count = 0;
};

NetftSource::NetftSource() : stream_(std::make_unique<RdtStream>()) {
  info_.type = "netft";
  info_.quantity = SampleQuantity::kWrench;
}

NetftSource::~NetftSource() { close(); }

std::string NetftSource::faultText(std::uint32_t fault) const { return rdtStatusText(fault); }

void NetftSource::doConfigure(const YAML::Node& map) {
  SourceParameters parameters(map, "source " + info_.type);
  address_ = parameters.text("address");
  port_ = parameters.integer("port", 1, 65535, 49152);
  bind_address_ = parameters.text("bind_address", "127.0.0.1");
  over_http_ = parameters.choice("configuration", {"http", "parameters"}, "http") == "http";
  if (over_http_) {
    http_port_ = parameters.integer("http_port", 1, 65535, 80);
    configuration_period_ =
        nanoseconds(parameters.number("configuration_period", 0.0, 3600.0, 2.0));
  } else {
    given_.counts_per_force = parameters.number("counts_per_force", 1e-6, 1e12);
    given_.counts_per_torque = parameters.number("counts_per_torque", 1e-6, 1e12);
    given_.force_unit = parameters.text("force_unit", "N");
    given_.torque_unit = parameters.text("torque_unit", "N-m");
  }
  given_rate_ = parameters.number("rate", 0.0, 1e5, 0.0);
  block_period_ = nanoseconds(parameters.number("block_period", 1e-4, 0.05, 0.005));
  receive_timeout_ = nanoseconds(parameters.number("receive_timeout", 0.01, 10.0, 0.1));
  start_retries_ = parameters.integer("start_retries", 1, 100, 5);
  policy_.deliver_faulty = parameters.flag("publish_on_error", false);
  policy_.drop_stale = parameters.flag("drop_stale", true);
  parameters.refuseUnknown();

  for (const auto& [key, value] :
       {std::pair("address", address_), {"bind_address", bind_address_}}) {
    if (!isAddress(value)) {
      throw InputError("source netft: " + std::string(key) + " is '" + printable(value) +
                       "': give an IPv4 address, for example 192.168.1.1");
    }
  }
  if (isLoopback(bind_address_) && !isLoopback(address_)) {
    throw InputError("source netft: bind_address is " + bind_address_ + ", which can't reach " +
                     address_ + ": give this computer's address in the box's network");
  }
  if (!over_http_) {
    try {
      netftScale(given_);
    } catch (const SourceError&) {
      throw InputError("source netft: force_unit is '" + printable(given_.force_unit) +
                       "' and torque_unit is '" + printable(given_.torque_unit) +
                       "': give N, kN, lbf, klbf, kgf or gf and N-m, N-mm, kN-m, lbf-in, lbf-ft "
                       "or kgf-cm; or V or mV for both");
    }
  }
  info_.device = address_ + ":" + std::to_string(port_);
}

// May be called by the thread that watches the page, too.
NetftConfiguration NetftSource::readConfiguration() const {
  const std::string response = readNetftPage(
      {address_, http_port_, bind_address_}, [this](int descriptor, auto deadline, bool writing) {
        const Wait waited = wait(descriptor, deadline, writing);
        if (waited == Wait::kStopped) {
          throw SourceError("source netft: closed while its page was read");
        }
        return waited == Wait::kReady;
      });
  return parseNetftConfiguration(httpBody(response));
}

// Reads the configuration now and then: who changes the counts on the box's page while it streams
// scales all that follows.
void NetftSource::watchConfiguration(const NetftConfiguration& opened) {
  while (wait(-1, Clock::now() + configuration_period_) == Wait::kTimeout) {
    try {
      const std::string change = describeChange(opened, readConfiguration());
      if (change.empty()) continue;
      const std::lock_guard<std::mutex> lock(watch_mutex_);
      change_ = change;
      changed_ = true;
      return;
    } catch (const SourceError&) {
      if (!stopping()) ++unread_;
    }
  }
}

void NetftSource::doOpen() {
  NetftConfiguration configuration = given_;
  if (over_http_) {
    configuration = readConfiguration();
    if (!configuration.rdt_enabled) {
      throw SourceError("source netft: RDT is off in the box at " + address_ +
                        ": enable it on its page Communications");
    }
  }
  const NetftScale scale = netftScale(configuration);
  policy_.scale = {scale.force, scale.force, scale.force, scale.torque, scale.torque, scale.torque};
  stream_->setPolicy(policy_);
  stream_->begin();
  info_.rate = given_rate_ > 0.0 ? given_rate_ : configuration.rate;
  info_.quantity = scale.volts ? SampleQuantity::kVolts : SampleQuantity::kWrench;
  info_.serial_number = configuration.serial_number;
  info_.firmware = configuration.firmware;
  info_.note = "counts per " + configuration.force_unit + ", " + configuration.torque_unit + ": " +
               std::to_string(std::llround(configuration.counts_per_force)) + ", " +
               std::to_string(std::llround(configuration.counts_per_torque));
  block_samples_ = static_cast<std::size_t>(
      std::llround(std::chrono::duration<double>(block_period_).count() * info_.rate));
  block_samples_ =
      std::min(std::max<std::size_t>(block_samples_, info_.rate > 0.0), kBlockCapacity);

  auto opened = std::make_unique<Socket>();
  opened->peer = endpoint(address_, port_);
  opened->descriptor = Descriptor(socket(AF_INET, SOCK_DGRAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0));
  const sockaddr_in local = endpoint(bind_address_, 0);
  const int fd = opened->descriptor.get();
  if (fd < 0 || bind(fd, generic(local), sizeof local) != 0) failBind(bind_address_);
  // the kernel notes arrivals, so that reading many at once costs no accuracy
  const int on = 1;
  setsockopt(fd, SOL_SOCKET, SO_TIMESTAMPNS, &on, sizeof on);
  if (setsockopt(fd, SOL_SOCKET, SO_RCVBUFFORCE, &kReceiveBuffer, sizeof kReceiveBuffer) != 0) {
    setsockopt(fd, SOL_SOCKET, SO_RCVBUF, &kReceiveBuffer, sizeof kReceiveBuffer);
  }
  for (std::size_t i = 0; i < kDatagrams; ++i) {
    opened->vectors[i] = {opened->data[i].data(), opened->data[i].size()};
    opened->headers[i].msg_hdr.msg_iov = &opened->vectors[i];
    opened->headers[i].msg_hdr.msg_iovlen = 1;
  }
  socket_ = std::move(opened);

  // the start may get lost: again until the first record
  drained_ = Clock::now();
  const auto refuse = [&](const std::string& why) {
    doClose();
    throw SourceError("source netft: " + why);
  };
  for (starts_ = 0; stream_->pending() == 0 && starts_ < start_retries_; ++starts_) {
    send(RdtCommand::kStart);
    last_start_ = Clock::now();
    const Clock::time_point deadline = last_start_ + receive_timeout_;
    while (stream_->pending() == 0) {
      const Wait waited = wait(fd, deadline);
      if (waited == Wait::kStopped) refuse("closed while it was being opened");
      if (waited == Wait::kTimeout) break;
      receive();
    }
  }
  if (stream_->pending() == 0) {
    refuse(info_.device + " sends no records after " + std::to_string(start_retries_) +
           " requests to start: check power, cable, address and bind_address");
  }
  starts_ = 0;
  changed_ = false;
  unnumbered_ = counts_.unnumbered;
  if (over_http_ && configuration_period_.count() > 0) {
    watch_ = std::thread([this, configuration] { watchConfiguration(configuration); });
  }
}

void NetftSource::doClose() noexcept {
  if (watch_.joinable()) watch_.join();
  if (socket_) send(RdtCommand::kStop);
  socket_.reset();
  if (bias_attempts_ > 0) {
    DeviceBias bias;
    bias.state = DeviceBias::State::kFailed;
    setDeviceBias(bias);
  }
  bias_attempts_ = 0;
}

void NetftSource::send(RdtCommand command) const {
  const std::uint32_t count = command == RdtCommand::kBias ? kRdtBiasOn : 0;
  const auto data = packRdtRequest({static_cast<std::uint16_t>(command), count});
  sendto(socket_->descriptor.get(), data.data(), data.size(), MSG_NOSIGNAL, generic(socket_->peer),
         sizeof socket_->peer);
}

// Every datagram that waits goes into the stream, until it is full.
void NetftSource::receive() {
  Socket& s = *socket_;
  for (std::size_t total = 0; total < kMaxAtOnce;) {
    if (s.position == s.count) {
      for (std::size_t i = 0; i < kDatagrams; ++i) {
        msghdr& header = s.headers[i].msg_hdr;
        header.msg_name = &s.senders[i];
        header.msg_namelen = sizeof s.senders[i];
        header.msg_control = s.controls[i].data();
        header.msg_controllen = s.controls[i].size();
      }
      const Clock::time_point before = Clock::now();
      const int n =
          recvmmsg(s.descriptor.get(), s.headers.data(), kDatagrams, MSG_DONTWAIT, nullptr);
      s.position = 0;
      s.count = n > 0 ? static_cast<std::size_t>(n) : 0;
      if (n <= 0) {
        drained_ = before;
        return;
      }
    }

    const Reception now = clocksNow();
    for (; s.position < s.count; ++s.position, ++total) {
      const mmsghdr& message = s.headers[s.position];
      const sockaddr_in& sender = s.senders[s.position];
      if (sender.sin_addr.s_addr != s.peer.sin_addr.s_addr || sender.sin_port != s.peer.sin_port) {
        ++counts_.foreign;
        continue;
      }
      RdtRecord record;
      if (!unpackRdtRecord(s.data[s.position].data(), message.msg_len, record)) {
        ++counts_.malformed;
        continue;
      }
      Reception received = now;
      msghdr header = message.msg_hdr;
      for (cmsghdr* c = CMSG_FIRSTHDR(&header); c != nullptr; c = CMSG_NXTHDR(&header, c)) {
        if (c->cmsg_level != SOL_SOCKET || c->cmsg_type != SCM_TIMESTAMPNS) continue;
        timespec arrival;
        std::memcpy(&arrival, CMSG_DATA(c), sizeof arrival);
        const auto at = std::chrono::system_clock::time_point(
            std::chrono::seconds(arrival.tv_sec) + std::chrono::nanoseconds(arrival.tv_nsec));
        received = arrivalOf(at, now, drained_);
      }
      const std::uint64_t restarts = counts_.restarts;
      if (!stream_->push(record, received, counts_)) return;
      if (counts_.restarts != restarts) noteRestart(now.steady);
      last_record_ = now.steady;
      starts_ = 0;
    }
  }
}

// A device doesn't start again three times in 3 s: another client takes the stream, loses it to the
// next request of this one after receive_timeout, and requests it as well.
void NetftSource::noteRestart(Clock::time_point now) {
  std::rotate(restarts_.begin(), restarts_.begin() + 1, restarts_.end());
  restarts_.back() = now;
  if (now - restarts_.front() <= kTakeovers) ++counts_.takeovers;
}

// Silence after which a block goes out as it is.
std::chrono::nanoseconds NetftSource::idle() const {
  return std::max<std::chrono::nanoseconds>(kIdle, nanoseconds(3.0 / info_.rate));
}

// Time of the next check for the block under way.
StrainSource::Clock::time_point NetftSource::napUntil() const {
  const Clock::time_point latest = stream_->oldest().steady + block_period_ + block_period_ / 2;
  const Clock::time_point soonest = Clock::now() + kShortestNap;
  if (block_samples_ == 0) return std::max(soonest, stream_->oldest().steady + block_period_);
  const std::size_t missing = block_samples_ - std::min(block_samples_, stream_->pending());
  const auto expected =
      stream_->newest().steady + nanoseconds(static_cast<double>(missing) / info_.rate);
  return std::max(soonest, std::min({expected, latest, Clock::now() + idle()}));
}

ReadResult NetftSource::doRead(SourceBlock& block, Clock::time_point deadline) {
  counts_.unread = unread_;
  if (changed_) {
    const std::lock_guard<std::mutex> lock(watch_mutex_);
    return lost(info_.device + ": its configuration was changed while it streamed: " + change_ +
                "; samples since the change were read with the old one, it is opened again with "
                "the new one");
  }
  if (takeBiasRequest()) {
    bias_attempts_ = 1;
    bias_sent_ = Clock::now();
    bias_halves_ = {};
    send(RdtCommand::kBias);
  }
  while (true) {
    const Clock::time_point before = Clock::now();
    receive();
    const Clock::time_point now = Clock::now();
    const bool crowded = socket_->position < socket_->count;
    if (stream_->pending() > 0) {
      const auto age = now - stream_->oldest().steady;
      const bool old = age >= block_period_ + block_period_ / 2 || crowded || now >= deadline;
      const bool full = block_samples_ > 0 && stream_->pending() >= block_samples_;
      const bool timed =
          block_samples_ == 0 ? age >= block_period_ : now - stream_->newest().steady >= idle();
      if (full || timed || old) {
        const std::size_t max_count = block_samples_ > 0 ? block_samples_ : kBlockCapacity;
        const ReadResult result = stream_->take(block, max_count, old, counts_);
        if (result == ReadResult::kSamples) {
          unnumbered_ = counts_.unnumbered;
          block.period = info_.rate > 0.0 ? 1.0 / info_.rate : 0.0;
          if (bias_attempts_ > 0) watchBias(block);
        }
        if (counts_.unnumbered - unnumbered_ >= kUnnumbered) {
          return lost(info_.device +
                      " sends new readings under one and the same measurement number: set "
                      "drop_stale: false for a device that does not number its measurements");
        }
        if (result != ReadResult::kTimeout) return result;
        if (crowded) continue;
      }
    }
    // requests are repeated to a silent box; it may have restarted. Silent until it was looked at:
    // this thread may have stood still since
    if (before - std::max(last_record_, last_start_) >= receive_timeout_) {
      if (starts_ == start_retries_) {
        return lost(info_.device + " is silent in spite of " + std::to_string(starts_) +
                    " requests to start: check power and cable");
      }
      send(RdtCommand::kStart);
      stream_->expectRestart();
      last_start_ = now;
      ++starts_;
    }
    if (now >= deadline) return ReadResult::kTimeout;

    // records come in their own time: sleep until a block's worth should be there
    Wait waited = Wait::kTimeout;
    if (stream_->pending() > 0) {
      waited = wait(-1, std::min(deadline, napUntil()));
    } else {
      const auto silent = std::max(last_record_, last_start_) + receive_timeout_;
      waited = wait(socket_->descriptor.get(), std::min(deadline, silent));
    }
    if (waited == Wait::kStopped) return ReadResult::kClosed;
  }
}

// Fresh samples tell whether the bias was taken.
void NetftSource::watchBias(const SourceBlock& block) {
  if (block.received.steady < bias_sent_ + kBiasSettling + block_period_) return;
  auto& [first, second] = bias_halves_;
  for (std::size_t i = 0; i < block.count && second.count() < kBiasSamples / 2; ++i) {
    Moments& half = first.count() < kBiasSamples / 2 ? first : second;
    half.add(Eigen::Map<const Vector6>(&block.values[6 * i]));
  }
  if (second.count() < kBiasSamples / 2) return;
  DeviceBias bias;
  // the quieter half's: a zero that came late is no noise
  const Vector6 sd = first.sd().cwiseMin(second.sd());
  bool zero = true;
  for (int k = 0; k < 6; ++k) {
    const auto axis = static_cast<std::size_t>(k);
    bias.residual[axis] = 0.5 * (first.mean()[k] + second.mean()[k]);
    bias.noise[axis] = sd[k];
    // a count for the box's rounding
    zero = zero && std::abs(bias.residual[axis]) <= kBiasNoise * sd[k] + policy_.scale[axis];
  }
  bias.samples = first.count() + second.count();
  if (!zero && bias_attempts_ < kBiasAttempts) {
    ++bias_attempts_;
    bias_sent_ = Clock::now();
    bias_halves_ = {};
    send(RdtCommand::kBias);
    return;
  }
  bias.state = zero ? DeviceBias::State::kVerified : DeviceBias::State::kFailed;
  setDeviceBias(bias);
  bias_attempts_ = 0;
}

}  // namespace assembly_cell
