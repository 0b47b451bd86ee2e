// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/sensor/emulators.h"

#include <arpa/inet.h>
#include <fcntl.h>
#include <netinet/in.h>
#include <poll.h>
#include <stdlib.h>
#include <sys/eventfd.h>
#include <sys/socket.h>
#include <termios.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <cmath>
#include <cstring>
#include <filesystem>
#include <limits>

#include "assembly_cell/base/yaml_text.h"
#include "assembly_cell/sensor/descriptor.h"
#include "assembly_cell/sensor/reception.h"
#include "assembly_cell/sensor/source_parameters.h"
#include "byte_order.h"

namespace assembly_cell {

namespace {

using Clock = std::chrono::steady_clock;

constexpr auto kTick = std::chrono::milliseconds(1);
constexpr std::size_t kLongestRequest = 4096;
constexpr std::size_t kMostReordered = 4;
constexpr double kTicksPerSecond = 1e6;  // of Bota's time stamps

double chance(std::mt19937_64& random) {
  return std::generate_canonical<double, std::numeric_limits<double>::digits>(random);
}

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

double emulatedValue(std::uint64_t n, std::size_t channel) {
  const auto code = static_cast<double>((n * 7919 + channel * 1013) % 4001) - 2000.0;
  return code / (channel < 3 ? 100.0 : 1000.0);
}

std::string makeTemporaryFolder() {
  std::string path = (std::filesystem::temp_directory_path() / "assembly_cell_XXXXXX").string();
  if (mkdtemp(path.data()) == nullptr) {
    throw SourceError("emulator: no temporary folder '" + path + "': " + strerror(errno));
  }
  return path;
}

// ---- Net F/T box ----

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
  if (options.rate > 0.0) streaming_thread_ = std::thread([this] { stream(); });
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
        bias_ = counts(options_.load);
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
    std::string response;
    {
      const std::lock_guard<std::mutex> lock(mutex_);
      response = http_response_;
    }
    if (dead_) continue;
    std::size_t sent = 0;
    while (sent < response.size()) {
      const ssize_t n =
          ::send(connection.get(), response.data() + sent, response.size() - sent, MSG_NOSIGNAL);
      if (n <= 0) break;
      sent += static_cast<std::size_t>(n);
    }
  }
}

void NetftEmulator::stream() {
  const Clock::time_point start = Clock::now();
  std::uint64_t done = 0;
  for (Clock::time_point next = start; !stopping_;) {
    next += kTick;
    std::this_thread::sleep_until(next);
    const double elapsed = std::chrono::duration<double>(Clock::now() - start).count();
    const auto due = static_cast<std::uint64_t>(elapsed * options_.rate);
    const std::lock_guard<std::mutex> lock(mutex_);
    emitLocked(due - done);
    done = due;
  }
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
    RdtRecord next = record(rdt_sequence_++, sample_++);
    next.ft_sequence = stalled_ ? ft_sequence_ : ++ft_sequence_;
    for (std::size_t k = 0; k < 6; ++k) next.counts[k] -= bias_[k];
    const auto data = packRdtRecord(next);
    ++sent_;
    if (faults.loss > 0.0 && chance(random_) < faults.loss) {
      ++lost_;
      continue;
    }
    const bool twice = faults.duplication > 0.0 && chance(random_) < faults.duplication;
    if (faults.reordering > 0.0 && chance(random_) < faults.reordering) {
      ++reordered_;
      held_.push_back({data, 1 + static_cast<int>(random_() % kMostReordered)});
    } else {
      send(data);
      for (Held& held : held_) --held.pass;
    }
    if (twice) {
      ++duplicated_;
      held_.push_back({data, static_cast<int>(random_() % kMostReordered)});
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

// ---- serial sensor ----

SerialEmulator::SerialEmulator(const Options& options)
    : options_(options), link_(options.link), random_(options.seed) {
  if (link_.empty()) {
    folder_ = makeTemporaryFolder();
    link_ = folder_ + "/sensor";
  }
  setStalled(false);
  plug();
  listener_ = std::thread([this] { listen(); });
  if (options.rate > 0.0) streaming_thread_ = std::thread([this] { stream(); });
}

SerialEmulator::~SerialEmulator() {
  stopping_ = true;
  listener_.join();
  if (streaming_thread_.joinable()) streaming_thread_.join();
  unplug();
  std::error_code error;
  if (!folder_.empty()) std::filesystem::remove_all(folder_, error);
}

void SerialEmulator::plug() {
  const std::lock_guard<std::mutex> lock(mutex_);
  if (terminal_ >= 0) return;
  Descriptor made(posix_openpt(O_RDWR | O_NOCTTY | O_NONBLOCK | O_CLOEXEC));
  std::array<char, 128> name;
  termios settings{};
  if (!made || grantpt(made.get()) != 0 || unlockpt(made.get()) != 0 ||
      ptsname_r(made.get(), name.data(), name.size()) != 0 ||
      tcgetattr(made.get(), &settings) != 0) {
    throw SourceError(std::string("emulator: no pseudo-terminal: ") + strerror(errno));
  }
  // no echo before someone opens it
  cfmakeraw(&settings);
  tcsetattr(made.get(), TCSANOW, &settings);
  std::error_code error;
  std::filesystem::remove(link_, error);
  std::filesystem::create_symlink(name.data(), link_, error);
  if (error) {
    throw SourceError("emulator: link '" + printable(link_) + "': " + error.message() +
                      ": give another");
  }
  terminal_ = dup(made.get());
  streaming_ = !options_.robotiq;
}

void SerialEmulator::unplug() {
  const std::lock_guard<std::mutex> lock(mutex_);
  if (terminal_ < 0) return;
  std::error_code error;
  std::filesystem::remove(link_, error);
  ::close(terminal_);
  terminal_ = -1;
}

// Hears Robotiq's requests; takes whatever else is said.
void SerialEmulator::listen() {
  constexpr std::array<std::uint8_t, 11> kStart = {9, 16, 0x01, 0x9a, 0, 1, 2, 0x02, 0x00, 0, 0};
  std::array<std::uint8_t, 11> start = kStart;
  putLittle16(&start[9], crcModbus(start.data(), 9));
  while (!stopping_) {
    std::array<std::uint8_t, 256> data;
    ssize_t n = -1;
    {
      const std::lock_guard<std::mutex> lock(mutex_);
      if (terminal_ >= 0) n = ::read(terminal_, data.data(), data.size());
      for (ssize_t i = 0; i < n && options_.robotiq && !dead_; ++i) {
        heard_.push_back(data[static_cast<std::size_t>(i)]);
        // a burst of jam characters ends the stream, the request starts it
        if (heard_.size() >= 8 &&
            std::all_of(heard_.end() - 8, heard_.end(), [](auto c) { return c == 0xff; })) {
          if (streaming_.exchange(false)) ++stops_;
          heard_.clear();
        }
        if (heard_.size() >= start.size() &&
            std::equal(start.begin(), start.end(), heard_.end() - start.size())) {
          ++starts_;
          std::vector<std::uint8_t> answer(start.begin(), start.begin() + 6);
          answer.resize(8);
          putLittle16(&answer[6], crcModbus(answer.data(), 6));
          sendLocked(answer);
          streaming_ = true;
          heard_.clear();
        }
        if (heard_.size() > kLongestRequest) heard_.clear();
      }
    }
    if (n <= 0) std::this_thread::sleep_for(kTick);
  }
}

void SerialEmulator::stream() {
  const Clock::time_point start = Clock::now();
  std::uint64_t done = 0;
  for (Clock::time_point next = start; !stopping_;) {
    next += kTick;
    std::this_thread::sleep_until(next);
    const double elapsed = std::chrono::duration<double>(Clock::now() - start).count();
    const auto due = static_cast<std::uint64_t>(elapsed * options_.rate);
    emit(due - done);
    done = due;
  }
}

std::vector<std::uint8_t> SerialEmulator::frame(std::uint64_t sample) const {
  SerialFrame made;
  for (std::size_t k = 0; k < 6; ++k) made.values[k] = emulatedValue(sample, k);
  made.status = status_;
  made.temperature = 25.0;
  const auto stamped = std::min<std::uint64_t>(sample, latest_stamp_);
  const double ticks = static_cast<double>(stamped + 1) * kTicksPerSecond / options_.device_rate;
  made.timestamp = static_cast<std::uint32_t>(std::llround(ticks));
  if (options_.robotiq) {
    const auto data = packRobotiqFrame(made);
    return {data.begin(), data.end()};
  }
  const auto data = packBotaFrame(made);
  return {data.begin(), data.end()};
}

bool SerialEmulator::sendLocked(const std::vector<std::uint8_t>& bytes) {
  // a terminal that nobody reads is full after a while
  for (std::size_t sent = 0; sent < bytes.size();) {
    const ssize_t n =
        terminal_ < 0 ? -1 : ::write(terminal_, bytes.data() + sent, bytes.size() - sent);
    if (n > 0) {
      sent += static_cast<std::size_t>(n);
      continue;
    }
    if (terminal_ < 0 || (errno != EAGAIN && errno != EINTR)) return false;
    pollfd state{terminal_, POLLOUT, 0};
    if (options_.rate > 0.0 || poll(&state, 1, 1000) <= 0) return false;
  }
  return true;
}

bool SerialEmulator::emit(std::size_t count) {
  const std::lock_guard<std::mutex> lock(mutex_);
  if (terminal_ < 0 || dead_ || !streaming_) return false;
  for (std::size_t i = 0; i < count; ++i) {
    const bool passes = options_.faults.loss <= 0.0 || chance(random_) >= options_.faults.loss;
    if (passes) sendLocked(frame(sample_));
    ++sample_;
  }
  return true;
}

bool SerialEmulator::sendRaw(const std::vector<std::uint8_t>& bytes) {
  const std::lock_guard<std::mutex> lock(mutex_);
  return sendLocked(bytes);
}

void SerialEmulator::setStalled(bool stalled) {
  const std::lock_guard<std::mutex> lock(mutex_);
  latest_stamp_ = stalled ? std::max<std::uint64_t>(sample_, 1) - 1
                          : std::numeric_limits<std::uint64_t>::max() - 1;
}

void SerialEmulator::skip(std::uint64_t samples) {
  const std::lock_guard<std::mutex> lock(mutex_);
  sample_ += samples;
}

std::uint64_t SerialEmulator::sample() const {
  const std::lock_guard<std::mutex> lock(mutex_);
  return sample_;
}

// ---- converter in sysfs ----

IioEmulator::IioEmulator(const Options& options) : options_(options), root_(options.root) {
  own_ = root_.empty();
  if (own_) root_ = makeTemporaryFolder();
  texts_.fill("8388608");
  plug();
}

IioEmulator::~IioEmulator() {
  std::error_code error;
  if (own_) {
    std::filesystem::remove_all(root_, error);
  } else {
    unplug();
  }
}

// One write of one length, so that a reader sees the old text or the new one.
void IioEmulator::write(const std::string& name, const std::string& text) const {
  constexpr std::size_t kLength = 32;
  const std::string path = root_ + "/" + device() + "/" + name;
  const Descriptor file(::open(path.c_str(), O_WRONLY | O_CREAT | O_CLOEXEC, 0644));
  std::string padded = text;
  if (text.size() < kLength) padded += '\n';
  padded.resize(std::max(kLength, padded.size()), ' ');
  [[maybe_unused]] const ssize_t n = pwrite(file.get(), padded.data(), padded.size(), 0);
  [[maybe_unused]] const int cut = ftruncate(file.get(), static_cast<off_t>(padded.size()));
}

void IioEmulator::set(const std::array<std::int64_t, 6>& codes) {
  for (std::size_t k = 0; k < 6; ++k) setText(k, std::to_string(codes[k]));
}

void IioEmulator::setText(std::size_t channel, const std::string& text) {
  texts_[channel] = text;
  write("in_voltage" + std::to_string(channel) + "_raw", text);
}

void IioEmulator::unplug() {
  std::error_code error;
  std::filesystem::remove_all(root_ + "/" + device(), error);
}

void IioEmulator::plug() {
  std::error_code error;
  std::filesystem::create_directories(root_ + "/" + device() + "/scan_elements", error);
  if (error) {
    throw SourceError("emulator: folder '" + printable(root_) + "': " + error.message() +
                      ": give another");
  }
  for (std::size_t k = 0; k < 6; ++k) {
    const std::string channel = "in_voltage" + std::to_string(k);
    setText(k, texts_[k]);
    write("scan_elements/" + channel + "_type", "le:u24/32>>0");
  }
  write("in_voltage_scale", yamlNumber(options_.scale));
  write("in_voltage_offset", yamlNumber(options_.offset));
  write("in_temp_raw", "25000");
  write("name", options_.name);
}

}  // namespace assembly_cell
