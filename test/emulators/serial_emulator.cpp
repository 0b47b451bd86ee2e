// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include <fcntl.h>
#include <poll.h>
#include <stdlib.h>
#include <termios.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cmath>
#include <cstring>
#include <filesystem>
#include <limits>

#include "assembly_cell/sensor/descriptor.h"
#include "assembly_cell/sensor/source_parameters.h"
#include "devices/byte_order.h"
#include "emulators.h"

namespace assembly_cell {

namespace {

constexpr auto kPause = std::chrono::milliseconds(1);
constexpr std::size_t kLongestRequest = 4096;
constexpr double kTicksPerSecond = 1e6;  // of Bota's time stamps

}  // namespace

SerialEmulator::SerialEmulator(const Options& options)
    : options_(options), link_(options.link), random_(options.seed) {
  if (link_.empty()) {
    folder_ = makeTemporaryFolder();
    link_ = folder_ + "/sensor";
  }
  setStalled(false);
  plug();
  listener_ = std::thread([this] { listen(); });
  if (options.rate > 0.0) {
    streaming_thread_ =
        std::thread([this] { emitAtRate(options_.rate, stopping_, [this](auto n) { emit(n); }); });
  }
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

// Receives Robotiq's requests; ignores other bytes.
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
        received_.push_back(data[static_cast<std::size_t>(i)]);
        // a burst of jam characters ends the stream, the request starts it
        if (received_.size() >= 8 &&
            std::all_of(received_.end() - 8, received_.end(), [](auto c) { return c == 0xff; })) {
          if (streaming_.exchange(false)) ++stops_;
          received_.clear();
        }
        if (received_.size() >= start.size() &&
            std::equal(start.begin(), start.end(), received_.end() - start.size())) {
          ++starts_;
          std::vector<std::uint8_t> answer(start.begin(), start.begin() + 6);
          answer.resize(8);
          putLittle16(&answer[6], crcModbus(answer.data(), 6));
          sendLocked(answer);
          streaming_ = true;
          received_.clear();
        }
        if (received_.size() > kLongestRequest) received_.clear();
      }
    }
    if (n <= 0) std::this_thread::sleep_for(kPause);
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
  // a terminal without a reader is full after a while
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

}  // namespace assembly_cell
