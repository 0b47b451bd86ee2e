// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <string>

#include "assembly_cell/sensor/strain_source.h"

namespace assembly_cell {

/// Raw data transfer of ATI's Net F/T boxes: byte layouts of its requests and records, big-endian,
/// and the order of a stream. No sockets.

constexpr std::size_t kRdtRequestSize = 8;
constexpr std::size_t kRdtRecordSize = 36;
constexpr std::uint16_t kRdtHeader = 0x1234;

enum class RdtCommand : std::uint16_t {
  kStop = 0x0000,
  kStart = 0x0002,  ///< high speed, real time
  kStartBuffered = 0x0003,
  kStartMultiUnit = 0x0004,
  kResetLatch = 0x0041,  ///< of the threshold conditions
  kBias = 0x0042,        ///< software bias, for every client; not acknowledged
};

/// sample_count of kBias: ATI's boxes pass over it; OnRobot's HEX boxes take the bias with 255 and
/// remove it with 0.
constexpr std::uint32_t kRdtBiasOn = 255;

struct RdtRequest {
  std::uint16_t command = 0;
  std::uint32_t sample_count = 0;  ///< 0: endless
};

struct RdtRecord {
  std::uint32_t rdt_sequence = 0;        ///< counts the records of a start request
  std::uint32_t ft_sequence = 0;         ///< counts the device's measurements
  std::uint32_t status = 0;              ///< 0: healthy
  std::array<std::int32_t, 6> counts{};  ///< fx fy fz tx ty tz
};

std::array<std::uint8_t, kRdtRequestSize> packRdtRequest(const RdtRequest& request);

/// False for a wrong size.
bool unpackRdtRecord(const std::uint8_t* data, std::size_t size, RdtRecord& record);

/// A condition of the monitor was met: the measurement is valid.
constexpr std::uint32_t kRdtMonitorCondition = 0x80010000;

/// Bits of a status word by name (Net F/T manual, system status code), in one line.
std::string rdtStatusText(std::uint32_t status);

/// What becomes of a stream's records.
struct RdtPolicy {
  std::array<double, 6> scale{};  ///< [N], [N·m] or [V] per count
  bool deliver_faulty = false;    ///< status bits beyond the monitor's
  bool drop_stale = true;         ///< ft_sequence that doesn't change
};

/// Puts records in order and counts what is missing, exactly: sequence numbers modulo 2³² are
/// unwrapped; a record up to 8 behind still finds its place, a later one is counted as late and no
/// more as lost; one that came before is a duplicate. Numbers that restart (a new start request,
/// a device that started again) begin a new stream. No allocation.
class RdtStream {
 public:
  static constexpr std::size_t kWindow = 1024;          ///< numbers remembered
  static constexpr std::size_t kDepth = 8;              ///< numbers to wait for one missing
  static constexpr std::int64_t kLargestGap = 1 << 20;  ///< beyond, the numbers restarted

  void setPolicy(const RdtPolicy& policy) { policy_ = policy; }

  /// The next record opens a new stream. What wasn't taken is dropped.
  void begin();

  /// A start was requested again after a silence: an old number is now the first of a new stream,
  /// though a device that lost power repeats its numbers.
  void expectRestart() { restart_expected_ = true; }

  /// False: full until more is taken; then push the same record again.
  bool push(const RdtRecord& record, const Reception& received, SourceCounters& counters);

  /// The next samples without a gap, at most `max_count`: kSamples; kFault with count 0 if only
  /// dropped records came by; kTimeout if nothing is there. flush: don't wait for what is missing.
  ReadResult take(SourceBlock& block, std::size_t max_count, bool flush, SourceCounters& counters);

  /// Numbers from the next to take to the newest that arrived.
  std::size_t pending() const {
    return started_ ? static_cast<std::size_t>(newest_ + 1 - next_) : 0;
  }
  /// Reception of the oldest record that waits; pending() > 0.
  const Reception& oldest() const;
  const Reception& newest() const { return slot(newest_).received; }

 private:
  enum class Kind : std::uint8_t { kEmpty, kFilled, kMissing, kDone };
  struct Slot {
    std::uint64_t sequence = 0;
    Kind kind = Kind::kEmpty;
    RdtRecord record;
    Reception received;
  };
  Slot& slot(std::uint64_t sequence) { return slots_[sequence % kWindow]; }
  const Slot& slot(std::uint64_t sequence) const { return slots_[sequence % kWindow]; }
  /// Kind of a number: kEmpty when it's forgotten or never was.
  Kind kind(std::uint64_t sequence) const {
    return slot(sequence).sequence == sequence ? slot(sequence).kind : Kind::kEmpty;
  }
  bool restarts(const RdtRecord& record, std::int64_t step) const;
  void markMissing(std::uint64_t sequence, SourceCounters& counters);

  RdtPolicy policy_;
  std::array<Slot, kWindow> slots_;
  bool started_ = false;
  bool restart_expected_ = false;
  bool delivered_ = false;        // last_ft_ holds
  std::uint64_t next_ = kWindow;  // to take
  std::uint64_t newest_ = 0;      // that arrived
  std::uint32_t newest_rdt_ = 0;  // its number in the device
  std::uint32_t newest_ft_ = 0;
  std::uint32_t last_ft_ = 0;  // of the record taken last
  std::array<std::int32_t, 6> last_counts_{};
  std::uint32_t stream_ = 0;
};

}  // namespace assembly_cell
