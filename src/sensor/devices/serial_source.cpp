// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/sensor/devices/serial_source.h"

#include <fcntl.h>
#include <poll.h>
#include <sys/ioctl.h>
#include <termios.h>
#include <yaml-cpp/yaml.h>

#include <algorithm>
#include <cerrno>
#include <cmath>
#include <cstring>

#include "assembly_cell/base/input_error.h"
#include "assembly_cell/sensor/reception.h"
#include "assembly_cell/sensor/source_parameters.h"
#include "byte_order.h"

namespace assembly_cell {

namespace {

constexpr double kTick = 1e-6;               // of Bota's time stamps [s]
constexpr double kLongestStep = 60.0;        // of time stamps; more: the device restarted [s]
constexpr double kShortestRestart = 1.0;     // back by more: the device restarted [s]
constexpr std::uint64_t kMaxLost = 1 << 20;  // in one gap
constexpr int kJamLength = 50;               // characters that end Robotiq's stream

struct Baud {
  int rate;
  speed_t code;
};
constexpr Baud kBauds[] = {{9600, B9600},       {19200, B19200},    {38400, B38400},
                           {57600, B57600},     {115200, B115200},  {230400, B230400},
                           {460800, B460800},   {500000, B500000},  {921600, B921600},
                           {1000000, B1000000}, {2000000, B2000000}};

}  // namespace

SerialSource::SerialSource() {
  info_.type = "serial";
  info_.quantity = SampleQuantity::kWrench;
}

SerialSource::~SerialSource() { close(); }

// only Bota's frames have a status
std::string SerialSource::faultText(std::uint32_t fault) const { return botaStatusText(fault); }

void SerialSource::doConfigure(const YAML::Node& map) {
  SourceParameters parameters(map, "source " + info_.type);
  path_ = parameters.text("port");
  const std::string protocol = parameters.choice("protocol", {"bota", "robotiq"});
  const bool bota = protocol == "bota";
  format_ = bota ? &kBotaFormat : &kRobotiqFormat;
  baud_ = parameters.integer("baud", 1, 2000000, bota ? 460800 : 19200);
  rate_ = parameters.number("rate", 0.1, 1e5, bota ? 400.0 : 100.0);
  block_period_ = nanoseconds(parameters.number("block_period", 0.0, 0.2, bota ? 0.005 : 0.01));
  receive_timeout_ = nanoseconds(parameters.number("receive_timeout", 0.01, 10.0, 0.25));
  start_retries_ = parameters.integer("start_retries", 1, 100, 4);
  deliver_faulty_ = parameters.flag("publish_on_error", false);
  parameters.refuseUnknown();
  const auto known = std::find_if(std::begin(kBauds), std::end(kBauds),
                                  [&](const Baud& baud) { return baud.rate == baud_; });
  if (known == std::end(kBauds)) {
    throw InputError("source serial: baud is " + std::to_string(baud_) +
                     ": give a usual one, for example 19200, 115200, 460800 or 921600");
  }
  info_.device = path_;
  info_.rate = rate_;
  info_.note = format_->name;
}

void SerialSource::openPort() {
  const std::string where = "source serial: port '" + printable(path_) + "': ";
  port_ = Descriptor(::open(path_.c_str(), O_RDWR | O_NOCTTY | O_NONBLOCK | O_CLOEXEC));
  if (!port_) {
    const int error = errno;
    throw SourceError(where + strerror(error) +
                      (error == EACCES ? ": join the group dialout and log in again"
                                       : ": plug the device in, or set port"));
  }
  termios settings{};
  if (tcgetattr(port_.get(), &settings) != 0) {
    port_.reset();
    throw SourceError(where + "it's no serial port: set port");
  }
  if (ioctl(port_.get(), TIOCEXCL) != 0) {
    port_.reset();
    throw SourceError(where + "it can't be had alone: stop who else has it");
  }
  // raw, 8N1, no flow control
  cfmakeraw(&settings);
  settings.c_cflag |= static_cast<tcflag_t>(CLOCAL | CREAD);
  settings.c_cflag &= ~static_cast<tcflag_t>(CSTOPB | CRTSCTS | HUPCL);
  settings.c_cc[VMIN] = 0;
  settings.c_cc[VTIME] = 0;
  const auto baud = std::find_if(std::begin(kBauds), std::end(kBauds),
                                 [&](const Baud& known) { return known.rate == baud_; });
  cfsetispeed(&settings, baud->code);
  cfsetospeed(&settings, baud->code);
  if (tcsetattr(port_.get(), TCSANOW, &settings) != 0) {
    port_.reset();
    throw SourceError(where + "it refuses " + std::to_string(baud_) + " baud: set baud");
  }
  tcflush(port_.get(), TCIOFLUSH);
}

void SerialSource::refuseOpen(const std::string& why) {
  doClose();
  throw SourceError("source serial: " + why);
}

void SerialSource::doOpen() {
  openPort();
  decoder_ = FrameDecoder(*format_);
  first_ = count_ = 0;
  faulty_ = false;
  hangup_.clear();
  ++stream_;
  ++sequence_;
  numbered_ = false;
  seen_count_ = 0;

  // until the first frame
  for (starts_ = 0; count_ == 0 && starts_ < start_retries_; ++starts_) {
    startStream();
    last_start_ = Clock::now();
    while (count_ == 0) {
      const Wait waited = wait(port_.get(), last_start_ + receive_timeout_);
      if (waited == Wait::kStopped) refuseOpen("closed while it was being opened");
      if (waited == Wait::kTimeout) break;
      if (!receive()) refuseOpen(hangup_ + ": plug the device in");
    }
  }
  if (count_ == 0) {
    refuseOpen("no " + std::string(format_->name) + " frame from " + printable(path_) + " at " +
               std::to_string(baud_) + " baud: check power, protocol and baud");
  }
  starts_ = 0;
}

void SerialSource::doClose() noexcept {
  if (port_) {
    stopStream();
    ioctl(port_.get(), TIOCNXCL);
  }
  port_.reset();
}

// Robotiq streams once 0x0200 is written to register 410 of slave 9 (Modbus function 16).
void SerialSource::startStream() const {
  if (format_ != &kRobotiqFormat) return;
  stopStream();
  std::array<std::uint8_t, 11> request = {9, 16, 0x01, 0x9a, 0, 1, 2, 0x02, 0x00, 0, 0};
  putLittle16(&request[9], crcModbus(request.data(), 9));
  [[maybe_unused]] const ssize_t n = ::write(port_.get(), request.data(), request.size());
}

void SerialSource::stopStream() const {
  if (format_ != &kRobotiqFormat) return;
  std::array<std::uint8_t, kJamLength> jam;
  jam.fill(0xff);
  [[maybe_unused]] const ssize_t n = ::write(port_.get(), jam.data(), jam.size());
}

// Every byte that waits, until frames are full. False: the port is gone.
bool SerialSource::receive() {
  Reception now = clocksNow();
  while (true) {
    SerialFrame frame;
    while (count_ < waiting_.size() && decoder_.next(frame, counts_)) accept(frame, now);
    if (count_ == waiting_.size()) return true;
    const ssize_t n = ::read(port_.get(), decoder_.space(), decoder_.freeBytes());
    const int error = errno;
    if (n > 0) {
      decoder_.added(static_cast<std::size_t>(n));
      now = clocksNow();
      continue;
    }
    if (n < 0 && error == EINTR) continue;
    if (n < 0 && error == EAGAIN) return true;
    // a terminal whose other end is gone gives nothing, or EIO
    pollfd state{port_.get(), POLLIN, 0};
    const bool gone = n < 0 || (poll(&state, 1, 0) > 0 && (state.revents & (POLLHUP | POLLERR)));
    if (gone) hangup_ = path_ + ": " + (n < 0 ? strerror(error) : "hung up");
    return !gone;
  }
}

// Gives the frame its place; false: it isn't new.
bool SerialSource::number(const SerialFrame& frame) {
  if (!format_->has_timestamp) {
    // whole frames' worth of bytes that were none
    const std::uint64_t missing =
        numbered_ ? (frame.skipped + format_->size / 2) / format_->size : 0;
    counts_.lost += missing;
    sequence_ += 1 + missing;
    numbered_ = true;
    return true;
  }

  const std::size_t newest = (seen_count_ + seen_.size() - 1) % seen_.size();
  const std::int64_t step =
      numbered_ ? static_cast<std::int32_t>(frame.timestamp - seen_[newest]) : 0;
  const double seconds = kTick * static_cast<double>(step);
  if (numbered_ && step == 0) {
    ++counts_.stale;
    return false;
  }
  if (numbered_ && step < 0 && seconds > -kShortestRestart) {
    const std::size_t known = std::min(seen_count_, seen_.size());
    const auto end = seen_.begin() + static_cast<std::ptrdiff_t>(known);
    if (std::find(seen_.begin(), end, frame.timestamp) != end) {
      ++counts_.duplicates;
    } else {
      ++counts_.late;
      if (counts_.lost > 0) --counts_.lost;
    }
    return false;
  }
  if (numbered_ && (step < 0 || seconds > kLongestStep)) {
    ++counts_.restarts;
    ++stream_;
    numbered_ = false;
    seen_count_ = 0;
  }
  const auto missing =
      numbered_ ? static_cast<std::uint64_t>(std::max(0ll, std::llround(seconds * rate_) - 1)) : 1;
  if (numbered_) counts_.lost += std::min(missing, kMaxLost);
  sequence_ += 1 + missing;
  numbered_ = true;
  seen_[seen_count_++ % seen_.size()] = frame.timestamp;
  return true;
}

void SerialSource::accept(const SerialFrame& frame, const Reception& received) {
  last_frame_ = received.steady;
  starts_ = 0;
  if (!number(frame)) return;
  if (frame.status != 0) counts_.fault = frame.status;
  if (!frame.usable && !deliver_faulty_) {
    ++counts_.faulty;
    faulty_ = true;
    return;
  }
  waiting_[(first_ + count_++) % waiting_.size()] = {sequence_, stream_, frame, received};
}

// The oldest frames without a gap.
ReadResult SerialSource::take(SourceBlock& block) {
  block.sequence = waiting_[first_].sequence;
  block.stream = waiting_[first_].stream;
  if (format_->has_timestamp) block.device_time = kTick * waiting_[first_].frame.timestamp;
  for (; count_ > 0; first_ = (first_ + 1) % waiting_.size(), --count_) {
    const Entry& entry = waiting_[first_];
    if (entry.sequence != block.sequence + block.count || entry.stream != block.stream) break;
    std::copy(entry.frame.values.begin(), entry.frame.values.end(), &block.values[6 * block.count]);
    block.saturated[block.count++] = entry.frame.saturated;
    block.received = entry.received;
    block.temperature = entry.frame.temperature;
    if (entry.frame.status != 0) block.fault = entry.frame.status;
  }
  block.period = 1.0 / rate_;
  counts_.samples += block.count;
  return ReadResult::kSamples;
}

ReadResult SerialSource::doRead(SourceBlock& block, Clock::time_point deadline) {
  while (true) {
    const Clock::time_point before = Clock::now();
    const bool there = receive();
    const Clock::time_point now = Clock::now();
    if (count_ > 0) {
      const Entry& newest = waiting_[(first_ + count_ - 1) % waiting_.size()];
      const bool gap = newest.sequence - waiting_[first_].sequence != count_ - 1;
      const auto due = waiting_[first_].received.steady + block_period_;
      if (!there || gap || now >= due || now >= deadline || count_ == waiting_.size()) {
        return take(block);
      }
    }
    if (!there) return lost(hangup_ + ": plug the device in");
    if (faulty_ && count_ == 0) {
      faulty_ = false;
      block.fault = counts_.fault;
      return ReadResult::kFault;
    }
    // requests are repeated to a silent device; it may have restarted. Silent until it was looked
    // at: this thread may have stood still since
    const Clock::time_point alive = std::max(last_frame_, last_start_);
    if (before - alive >= receive_timeout_) {
      if (starts_ == start_retries_) {
        return lost(path_ + " is silent: check power and cable");
      }
      startStream();
      last_start_ = now;
      ++starts_;
    }
    if (now >= deadline) return ReadResult::kTimeout;
    auto until = std::min(deadline, std::max(last_frame_, last_start_) + receive_timeout_);
    if (count_ > 0) until = std::min(until, waiting_[first_].received.steady + block_period_);
    if (wait(port_.get(), until) == Wait::kStopped) return ReadResult::kClosed;
  }
}

}  // namespace assembly_cell
