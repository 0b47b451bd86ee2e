// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/sensor/strain_source.h"

#include <poll.h>
#include <sys/eventfd.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <ctime>
#include <functional>
#include <utility>

#include "assembly_cell/base/input_error.h"
#include "assembly_cell/base/text.h"
#include "assembly_cell/sensor/devices/iio_source.h"
#include "assembly_cell/sensor/devices/netft_source.h"
#include "assembly_cell/sensor/devices/replay_source.h"
#include "assembly_cell/sensor/devices/serial_source.h"
#include "assembly_cell/sensor/devices/simulated_source.h"
#include "assembly_cell/sensor/source_parameters.h"

namespace assembly_cell {

const char* toText(SampleQuantity quantity) {
  switch (quantity) {
    case SampleQuantity::kCounts:
      return "counts";
    case SampleQuantity::kVolts:
      return "volts";
    case SampleQuantity::kWrench:
      return "wrench";
  }
  return "";
}

StrainSource::StrainSource() : wake_(eventfd(0, EFD_NONBLOCK | EFD_CLOEXEC)) {
  if (wake_ < 0) throw SourceError(std::string("source: no descriptor left: ") + strerror(errno));
}

StrainSource::~StrainSource() { ::close(wake_); }

void StrainSource::configure(const YAML::Node& parameters) {
  const std::lock_guard<std::mutex> lock(use_);
  if (open_) throw InputError("source " + info_.type + ": it's open: close it, then configure it");
  configured_ = false;
  doConfigure(parameters);
  configured_ = true;
}

void StrainSource::open() {
  const std::lock_guard<std::mutex> lock(use_);
  if (open_) throw std::logic_error("source " + info_.type + ": open already: close it first");
  if (!configured_) throw std::logic_error("source " + info_.type + ": configure it first");
  stopping_ = false;
  bias_requested_ = false;
  std::uint64_t wakes = 0;
  while (::read(wake_, &wakes, sizeof wakes) > 0) {
  }
  doOpen();
  open_ = true;
}

ReadResult StrainSource::read(SourceBlock& block, std::chrono::nanoseconds timeout) {
  block.count = 0;
  if (stopping()) return ReadResult::kClosed;
  const std::lock_guard<std::mutex> lock(use_);
  if (!open_ || stopping()) return ReadResult::kClosed;
  block.period = 0.0;
  block.device_time = block.temperature = std::numeric_limits<double>::quiet_NaN();
  block.fault = 0;
  // a long time limit must not overflow the clock
  const auto longest = std::chrono::hours(24);
  const auto limit = std::clamp<std::chrono::nanoseconds>(timeout, {}, longest);
  const ReadResult result = doRead(block, Clock::now() + limit);
  const std::lock_guard<std::mutex> state_lock(state_);
  published_ = counts_;
  return result;
}

void StrainSource::close() noexcept {
  stopping_ = true;
  const std::uint64_t one = 1;
  while (::write(wake_, &one, sizeof one) < 0 && errno == EINTR) {
  }
  const std::lock_guard<std::mutex> lock(use_);
  if (!open_) return;
  doClose();
  open_ = false;
  const std::lock_guard<std::mutex> state_lock(state_);
  if (bias_requested_.exchange(false)) device_bias_.state = DeviceBias::State::kFailed;
  published_ = counts_;
}

SourceCounters StrainSource::counters() const {
  const std::lock_guard<std::mutex> lock(state_);
  return published_;
}

std::string StrainSource::faultText(std::uint32_t fault) const {
  return text("fault 0x%08x", fault);
}

std::string StrainSource::lostReason() const {
  const std::lock_guard<std::mutex> lock(state_);
  return lost_reason_;
}

ReadResult StrainSource::lost(const std::string& reason) {
  const std::lock_guard<std::mutex> lock(state_);
  lost_reason_ = "source " + info_.type + ": " + reason;
  return ReadResult::kLost;
}

void StrainSource::requestDeviceBias() {
  if (!hasDeviceBias()) {
    throw SourceError("source " + info_.type +
                      ": the device has no bias of its own: use the node's");
  }
  if (!isOpen()) throw SourceError("source " + info_.type + ": not open: wait for the device");
  const std::lock_guard<std::mutex> lock(state_);
  device_bias_ = DeviceBias();
  device_bias_.state = DeviceBias::State::kPending;
  bias_requested_ = true;
}

DeviceBias StrainSource::deviceBias() const {
  const std::lock_guard<std::mutex> lock(state_);
  return device_bias_;
}

bool StrainSource::takeBiasRequest() { return bias_requested_.exchange(false); }

void StrainSource::setDeviceBias(const DeviceBias& bias) {
  const std::lock_guard<std::mutex> lock(state_);
  device_bias_ = bias;
}

StrainSource::Wait StrainSource::wait(int descriptor, Clock::time_point deadline,
                                      bool for_writing) const {
  pollfd descriptors[2] = {{wake_, POLLIN, 0},
                           {descriptor, static_cast<short>(for_writing ? POLLOUT : POLLIN), 0}};
  while (!stopping()) {
    const auto left = std::max<std::chrono::nanoseconds>(deadline - Clock::now(), {});
    const timespec limit{static_cast<time_t>(left.count() / 1000000000),
                         static_cast<long>(left.count() % 1000000000)};
    const int ready = ppoll(descriptors, descriptor < 0 ? 1 : 2, &limit, nullptr);
    if (descriptors[0].revents != 0) break;
    if (ready > 0) return Wait::kReady;
    if (ready == 0) return Wait::kTimeout;
    if (errno != EINTR) break;
  }
  return Wait::kStopped;
}

namespace {

template <typename Source>
std::unique_ptr<StrainSource> make() {
  return std::make_unique<Source>();
}

struct Type {
  const char* name;
  std::unique_ptr<StrainSource> (*make)();
};

constexpr Type kTypes[] = {
    {"simulated", make<SimulatedSource>},
    {"replay", make<ReplaySource>},
    {"netft", make<NetftSource>},
    {"serial", make<SerialSource>},
    {"iio", make<IioSource>},
};

}  // namespace

const std::vector<std::string>& sourceTypes() {
  static const std::vector<std::string> names = [] {
    std::vector<std::string> list;
    for (const Type& type : kTypes) list.emplace_back(type.name);
    return list;
  }();
  return names;
}

std::unique_ptr<StrainSource> makeSource(const std::string& type) {
  std::string names;
  for (const Type& known : kTypes) {
    if (type == known.name) return known.make();
    names += (names.empty() ? "" : ", ") + std::string(known.name);
  }
  throw InputError("source: type is '" + printable(type) + "': give one of " + names);
}

}  // namespace assembly_cell
