// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <array>
#include <atomic>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <memory>
#include <mutex>
#include <stdexcept>
#include <string>
#include <vector>

namespace YAML {
class Node;
}

namespace assembly_cell {

/// What six numbers of a device or a recording are.
enum class SampleQuantity {
  kCounts,  ///< codes of a converter; a source makes volts of them
  kVolts,   ///< strain channels [V]
  kWrench,  ///< fx fy fz [N] tx ty tz [N·m]
};

/// counts, volts or wrench.
const char* toText(SampleQuantity quantity);

/// A device that is missing, doesn't answer or sends invalid data: what() is one line that names
/// the source, the device and what to do. Unlike InputError it may pass: try again later.
struct SourceError : std::runtime_error {
  using std::runtime_error::runtime_error;
};

/// What a source reports of itself once it's open. Texts of a device are printable and short.
struct SourceInfo {
  std::string type;           ///< simulated, replay, netft, serial, iio or a plug-in's
  std::string device;         ///< for people: address, port or file
  std::string serial_number;  ///< empty if the device doesn't report it
  std::string firmware;       ///< empty if the device doesn't report it
  std::string note;           ///< for people: calibration in the device, its units, …
  SampleQuantity quantity = SampleQuantity::kVolts;  ///< of the blocks: kVolts or kWrench
  double rate = 0.0;                                 ///< nominal [Hz], 0 if unknown
  int bits = 0;                                      ///< of the converter, 0 if unknown
  double full_scale = 0.0;                           ///< ± [V], 0 if unknown
  bool recorded = false;  ///< a recording: stamps follow from device_time, not from reception
  bool paced = true;      ///< false: as fast as it's read (recording, simulation)
};

/// When the last sample of a block reached this computer.
struct Reception {
  std::chrono::steady_clock::time_point steady{};  ///< for ages and time limits
  std::chrono::system_clock::time_point system{};  ///< for stamps; may step
};

constexpr std::size_t kBlockCapacity = 512;  ///< samples

/// Samples that follow one another without a gap. Large: make one and read into it again and again.
struct SourceBlock {
  std::size_t count = 0;  ///< samples
  /// 6 × count, sample after sample: [V], or [N] and [N·m], see info().quantity.
  std::array<double, 6 * kBlockCapacity> values{};
  std::array<std::uint8_t, kBlockCapacity>
      saturated{};  ///< bit k: channel k at an end of its range
  /// Number of the first sample; sample k has sequence + k. It grows as long as the object exists.
  /// Numbers that it skips were not delivered (lost, late, faulty, stale).
  std::uint64_t sequence = 0;
  /// Changes whenever the device's numbering restarts (open, restart): the time between two
  /// blocks then doesn't follow from their sequence.
  std::uint32_t stream = 0;
  double period = 0.0;  ///< nominal [s], 0 if unknown
  Reception received;   ///< of the last sample
  double device_time =
      std::numeric_limits<double>::quiet_NaN();  ///< of the first sample [s], or NaN
  double temperature = std::numeric_limits<double>::quiet_NaN();  ///< [°C], or NaN
  std::uint32_t fault = 0;  ///< the device's status word, 0: healthy; its last one if several
};

/// How a read ended.
enum class ReadResult {
  kSamples,  ///< the block has 1 … kBlockCapacity samples
  kTimeout,  ///< none; the device may resume by itself
  kFault,    ///< records arrived, but their fault word forbids their use; see block.fault
  kLost,     ///< the device was lost: close, wait, open again; see lostReason()
  kEnd,      ///< a recording is over
  kClosed,   ///< close() was called
};

/// Totals since the object was made. samples + lost + late + faulty + stale + unnumbered =
/// numbers that passed.
struct SourceCounters {
  std::uint64_t samples = 0;     ///< delivered
  std::uint64_t lost = 0;        ///< never arrived
  std::uint64_t late = 0;        ///< arrived once later ones had been delivered: dropped
  std::uint64_t duplicates = 0;  ///< arrived again: dropped
  std::uint64_t reordered = 0;   ///< arrived out of order, put in order and delivered
  std::uint64_t faulty = 0;      ///< dropped for their fault word
  std::uint64_t stale = 0;       ///< dropped: the device repeats an old measurement as new
  std::uint64_t unnumbered = 0;  ///< dropped: new readings under an old measurement's number
  std::uint64_t crc_errors = 0;  ///< frames with a wrong checksum
  std::uint64_t garbage = 0;     ///< bytes that belong to no frame
  std::uint64_t malformed = 0;   ///< datagrams, frames or entries of a wrong size or with no number
  std::uint64_t foreign = 0;     ///< datagrams from others than the configured peer: dropped
  std::uint64_t restarts = 0;    ///< the device's numbering restarted while open
  std::uint64_t takeovers = 0;   ///< another client took the stream, which was requested again
  std::uint64_t unread = 0;      ///< failed attempts to read the device's configuration again
  std::uint32_t fault = 0;       ///< the latest fault word
};

/// What came of a bias in the device, for which no protocol sends an acknowledgement.
struct DeviceBias {
  enum class State {
    kNone,      ///< not requested
    kPending,   ///< requested or sent; samples are being awaited
    kVerified,  ///< fresh samples lie around zero
    kFailed,    ///< they don't
  };
  State state = State::kNone;
  std::array<double, 6> residual{};  ///< mean of the fresh samples [N, N·m or V]
  std::array<double, 6> noise{};     ///< standard deviation of one of them
  std::size_t samples = 0;           ///< the mean's
};

/// A six-axis sensor, without ROS. Derived classes implement the protected part; a class in another
/// package becomes a source by exporting it through pluginlib with this base class.
///
/// Life: configure() once, then open(), read() …, close(), and open() again at will. One thread
/// calls configure, open, read and info; close(), counters(), deviceBias(), requestDeviceBias() and
/// lostReason() may come from any. read() doesn't allocate.
class StrainSource {
 public:
  StrainSource();
  virtual ~StrainSource();
  StrainSource(const StrainSource&) = delete;
  StrainSource& operator=(const StrainSource&) = delete;

  /// Takes the parameters, a YAML map (the key `type` is passed over). Throws InputError for a
  /// missing, bad or unknown key, with the keys there are, and when the source is open.
  void configure(const YAML::Node& parameters);

  /// Throws SourceError when the device isn't there or doesn't answer, InputError when what was
  /// configured can't work (a file that can't be read), std::logic_error when open already or never
  /// configured. Afterwards either open, or closed as before.
  void open();

  /// Waits until samples are there, at most `timeout`; then kTimeout. kClosed when not open.
  ReadResult read(SourceBlock& block, std::chrono::nanoseconds timeout);

  /// Stops and closes the device; ends a read or an open under way in another thread and waits
  /// for it. Does nothing when closed.
  void close() noexcept;

  bool isOpen() const { return open_.load(std::memory_order_acquire); }

  /// What the source reported at the latest open().
  const SourceInfo& info() const { return info_; }

  SourceCounters counters() const;

  /// A fault word of the device (SourceBlock::fault) by name, in one line; from any thread.
  virtual std::string faultText(std::uint32_t fault) const;

  /// Why the latest read gave kLost; one line.
  std::string lostReason() const;

  /// Requests a bias in the device itself; it acts on every client of the device, so a bias in the
  /// node is usually better. The reading thread sends it and verifies it from the samples that
  /// follow: see deviceBias(). Throws SourceError when the device has none or isn't open.
  void requestDeviceBias();
  DeviceBias deviceBias() const;

 protected:
  using Clock = std::chrono::steady_clock;

  /// As configure().
  virtual void doConfigure(const YAML::Node& parameters) = 0;
  /// As open(): fills info_. What it opened before it throws, it closes.
  virtual void doOpen() = 0;
  /// As read(), with a point in time instead of a duration. Fills the block, which is empty, with
  /// NaN and zeros, and counts in counts_.
  virtual ReadResult doRead(SourceBlock& block, Clock::time_point deadline) = 0;
  /// Lets everything go; never called while doOpen or doRead runs. A derived class with something
  /// to stop calls close() in its destructor.
  virtual void doClose() noexcept {}
  virtual bool hasDeviceBias() const { return false; }

  /// How a wait ended.
  enum class Wait { kReady, kTimeout, kStopped };
  /// Until `descriptor` can be read (or has failed), the deadline, or close(). −1: only the latter
  /// two.
  Wait wait(int descriptor, Clock::time_point deadline, bool for_writing = false) const;
  bool stopping() const { return stopping_.load(std::memory_order_acquire); }

  /// Sets lostReason() and returns kLost.
  ReadResult lost(const std::string& reason);

  /// True once for each request; the reading thread then sends the command.
  bool takeBiasRequest();
  void setDeviceBias(const DeviceBias& bias);

  SourceInfo info_;
  SourceCounters counts_;  ///< the reading thread's; counters() gives them out after each read

 private:
  std::mutex use_;            // held while open, read or close work
  mutable std::mutex state_;  // of what other threads ask for
  std::atomic<bool> open_{false};
  std::atomic<bool> stopping_{false};
  std::atomic<bool> bias_requested_{false};
  bool configured_ = false;
  int wake_ = -1;  // eventfd that ends a wait
  SourceCounters published_;
  std::string lost_reason_;
  DeviceBias device_bias_;
};

/// simulated, replay, netft, serial, iio.
const std::vector<std::string>& sourceTypes();

/// A source of a built-in type, not yet configured. Throws InputError for any other, with the types
/// there are.
std::unique_ptr<StrainSource> makeSource(const std::string& type);

}  // namespace assembly_cell
