// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/sensor/devices/iio_source.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <yaml-cpp/yaml.h>

#include <algorithm>
#include <cerrno>
#include <cmath>
#include <cstring>
#include <filesystem>
#include <limits>
#include <optional>
#include <set>
#include <string_view>

#include "assembly_cell/base/csv_text.h"
#include "assembly_cell/base/input_error.h"
#include "assembly_cell/sensor/reception.h"
#include "assembly_cell/sensor/source_parameters.h"

namespace assembly_cell {

namespace {

constexpr double kMilli = 1e-3;

// an attribute's text; none if it can't be read
std::optional<std::string> attribute(const std::string& path) {
  const Descriptor file(::open(path.c_str(), O_RDONLY | O_CLOEXEC | O_NONBLOCK));
  std::array<char, kLongestIioText> text;
  const ssize_t n = file ? ::read(file.get(), text.data(), text.size()) : -1;
  if (n < 0) return std::nullopt;
  return std::string(text.data(), static_cast<std::size_t>(n));
}

// the first of the attributes that is there; throws when it holds no number
double number(const std::string& folder, const std::vector<std::string>& names, double fallback) {
  for (const std::string& name : names) {
    const auto text = attribute(folder + "/" + name);
    if (!text) continue;
    double value = 0.0;
    if (!parseIioNumber(*text, value)) {
      throw SourceError("source iio: " + folder + "/" + name + " is '" + printable(*text) +
                        "': it must be a number");
    }
    return value;
  }
  return fallback;
}

// names of attributes that all channels of a kind share: voltage0-voltage1 → voltage-voltage
std::string withoutNumbers(std::string name) {
  name.erase(std::remove_if(name.begin(), name.end(), [](char c) { return c >= '0' && c <= '9'; }),
             name.end());
  return name;
}

}  // namespace

IioSource::IioSource() {
  info_.type = "iio";
  info_.quantity = SampleQuantity::kVolts;
}

void IioSource::doConfigure(const YAML::Node& map) {
  SourceParameters parameters(map, "source " + info_.type);
  root_ = parameters.text("iio_root", "/sys/bus/iio/devices");
  device_ = parameters.text("device");
  channel_names_ =
      parameters.texts("channels", std::vector<std::string>{"voltage0", "voltage1", "voltage2",
                                                            "voltage3", "voltage4", "voltage5"});
  rate_ = parameters.number("rate", 0.1, 1e4, 100.0);
  block_period_ = nanoseconds(parameters.number("block_period", 0.0, 0.2, 0.005));
  parameters.refuseUnknown();
  const auto plain = [](const std::string& name) {
    return !name.empty() && name.find('/') == std::string::npos && name != "." && name != "..";
  };
  if (!plain(device_)) {
    throw InputError("source iio: device is '" + printable(device_) +
                     "': give its folder below iio_root, for example iio:device0, or its name");
  }
  const std::set<std::string> distinct(channel_names_.begin(), channel_names_.end());
  if (channel_names_.size() != 6 || distinct.size() != 6 ||
      !std::all_of(channel_names_.begin(), channel_names_.end(), plain)) {
    throw InputError("source iio: channels are " + std::to_string(distinct.size()) +
                     " different ones: give six, for example voltage0 or voltage0-voltage1");
  }
  info_.device = root_ + "/" + device_;
  info_.rate = rate_;
}

// A folder of that name, or the one with that attribute `name`.
std::string IioSource::findDevice() const {
  std::error_code error;
  const std::string folder = root_ + "/" + device_;
  if (std::filesystem::is_directory(folder, error)) return folder;
  std::string names;
  for (std::filesystem::directory_iterator entry(root_, error), end; !error && entry != end;
       entry.increment(error)) {
    const auto text = attribute(entry->path().string() + "/name");
    if (!text) continue;
    const std::string name(trimmed(*text, " \t\r\n"));
    if (name == device_) return entry->path().string();
    if (names.size() < 200) names += (names.empty() ? "" : ", ") + printable(name);
  }
  throw SourceError("source iio: no device '" + printable(device_) + "' in " + root_ +
                    (names.empty() ? ": load its driver" : ": there are " + names));
}

IioSource::Channel IioSource::openChannel(const std::string& folder,
                                          const std::string& name) const {
  Channel channel;
  const std::string prefix = "in_" + name, shared = "in_" + withoutNumbers(name);
  const std::string raw = folder + "/" + prefix + "_raw";
  channel.raw = Descriptor(::open(raw.c_str(), O_RDONLY | O_CLOEXEC | O_NONBLOCK));
  if (!channel.raw) {
    const int error = errno;
    throw SourceError("source iio: " + raw + ": " + strerror(error) +
                      (error == EACCES ? ": allow reading it by a udev rule" : ": set channels"));
  }
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const double millivolts =
      number(folder, {prefix + "_scale", shared + "_scale", "in_voltage_scale"}, nan);
  if (std::isnan(millivolts) || millivolts == 0.0) {
    throw SourceError("source iio: " + folder + "/" + prefix + "_scale is " +
                      (std::isnan(millivolts) ? "missing" : "0") +
                      ": a converter without a scale can't give volts");
  }
  channel.scale = kMilli * millivolts;
  channel.offset =
      number(folder, {prefix + "_offset", shared + "_offset", "in_voltage_offset"}, 0.0);
  // the ends of the range follow from the buffer's type
  for (const std::string& type : {prefix + "_type", shared + "_type"}) {
    const auto text = attribute(folder + "/scan_elements/" + type);
    if (text && parseIioType(*text, channel.type)) break;
  }
  return channel;
}

void IioSource::doOpen() {
  const std::string folder = findDevice();
  std::array<Channel, 6> channels;
  for (std::size_t k = 0; k < 6; ++k) channels[k] = openChannel(folder, channel_names_[k]);
  channels_ = std::move(channels);
  temperature_ =
      Descriptor(::open((folder + "/in_temp_raw").c_str(), O_RDONLY | O_CLOEXEC | O_NONBLOCK));
  temperature_scale_ = number(folder, {"in_temp_scale"}, 1.0);
  temperature_offset_ = number(folder, {"in_temp_offset"}, 0.0);
  const auto name = attribute(folder + "/name");
  info_.device = folder;
  info_.serial_number =
      printable(std::string(trimmed(attribute(folder + "/serialnumber").value_or(""), " \r\n")));
  info_.note = printable(std::string(trimmed(name.value_or(""), " \t\r\n")));
  info_.bits = static_cast<int>(channels_[0].type.bits);
  info_.full_scale = info_.bits > 0 ? std::ldexp(channels_[0].scale, info_.bits - 1) : 0.0;
  base_ += tick_ + 1;
  tick_ = 0;
  ++stream_;
  gone_.clear();
  std::array<double, 6> volts;
  std::uint8_t saturated = 0;
  if (poll(volts, saturated) == Poll::kGone) {
    doClose();
    throw SourceError("source iio: " + gone_ + ": plug the device in");
  }
  start_ = Clock::now();
}

void IioSource::doClose() noexcept {
  for (Channel& channel : channels_) channel.raw.reset();
  temperature_.reset();
}

// One conversion of each channel.
IioSource::Poll IioSource::poll(std::array<double, 6>& volts, std::uint8_t& saturated) {
  saturated = 0;
  for (std::size_t k = 0; k < 6; ++k) {
    const Channel& channel = channels_[k];
    std::array<char, kLongestIioText> text;
    const ssize_t n = pread(channel.raw.get(), text.data(), text.size(), 0);
    if (n < 0 && (errno == EINTR || errno == EAGAIN || errno == EBUSY || errno == ETIMEDOUT)) {
      return Poll::kMalformed;
    }
    struct stat state {};
    if (n < 0 || (k == 0 && fstat(channel.raw.get(), &state) == 0 && state.st_nlink == 0)) {
      gone_ = info_.device + ": " + (n < 0 ? strerror(errno) : "gone");
      return Poll::kGone;
    }
    std::int64_t code = 0;
    if (!parseIioInteger({text.data(), static_cast<std::size_t>(n)}, code)) {
      return Poll::kMalformed;
    }
    volts[k] = (static_cast<double>(code) + channel.offset) * channel.scale;
    if (isIioEndCode(code, channel.type))
      saturated = static_cast<std::uint8_t>(saturated | 1u << k);
  }
  return Poll::kSample;
}

double IioSource::readTemperature() const {
  double value = 0.0;
  std::array<char, kLongestIioText> text;
  const ssize_t n = temperature_ ? pread(temperature_.get(), text.data(), text.size(), 0) : -1;
  if (n < 0 || !parseIioNumber({text.data(), static_cast<std::size_t>(n)}, value)) {
    return std::numeric_limits<double>::quiet_NaN();
  }
  return kMilli * (value + temperature_offset_) * temperature_scale_;
}

ReadResult IioSource::doRead(SourceBlock& block, Clock::time_point deadline) {
  Clock::time_point started;  // the block's first sample
  while (true) {
    // polls keep to their own times
    const Clock::time_point due = start_ + nanoseconds(static_cast<double>(tick_) / rate_);
    const bool complete = block.count > 0 && (due >= started + block_period_ || due > deadline ||
                                              block.count == kBlockCapacity);
    if (complete) break;
    const Wait waited = wait(-1, std::min(due, deadline));
    if (waited == Wait::kStopped) return ReadResult::kClosed;
    const Clock::time_point now = Clock::now();
    if (now < due) return ReadResult::kTimeout;

    // too late for some
    const auto late =
        static_cast<std::uint64_t>(std::chrono::duration<double>(now - due).count() * rate_);
    if (late > 0) {
      counts_.lost += late;
      tick_ += late;
      if (block.count > 0) break;
    }
    std::array<double, 6> volts;
    std::uint8_t saturated = 0;
    const Poll polled = poll(volts, saturated);
    if (polled == Poll::kGone) {
      if (block.count > 0) break;
      return lost(gone_ + ": plug the device in");
    }
    const std::uint64_t tick = tick_++;
    if (polled == Poll::kMalformed) {
      ++counts_.malformed;
      ++counts_.lost;
      if (block.count > 0) break;
      continue;
    }
    if (block.count == 0) {
      block.sequence = base_ + tick;
      started = now;
    }
    std::copy(volts.begin(), volts.end(), &block.values[6 * block.count]);
    block.saturated[block.count++] = saturated;
    block.received = clocksNow();
  }
  block.stream = stream_;
  block.period = 1.0 / rate_;
  block.temperature = readTemperature();
  counts_.samples += block.count;
  return ReadResult::kSamples;
}

}  // namespace assembly_cell
