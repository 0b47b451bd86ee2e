// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/sensor/devices/rdt.h"

#include <algorithm>
#include <limits>

#include "byte_order.h"
#include "status_bits.h"

namespace assembly_cell {

namespace {

// bit 31 is set with each error and has no meaning of its own
constexpr std::array<StatusBit, 29> kStatusBits = {
    {{1u << 30, "CPU or RAM error"},
     {1u << 29, "digital board error"},
     {1u << 28, "analog board error"},
     {1u << 27, "serial link to the analog board disturbed"},
     {1u << 26, "program memory fails its check"},
     {1u << 25, "halted by errors of its configuration"},
     {1u << 24, "a setting is invalid"},
     {1u << 23, "configuration does not fit the calibration"},
     {1u << 22, "network communication failure"},
     {1u << 21, "CAN communication error"},
     {1u << 20, "RDT communication error"},
     {1u << 19, "EtherNet/IP failure"},
     {1u << 18, "DeviceNet failure"},
     {1u << 17, "transducer saturated or A/D converter fails"},
     {1u << 16, "monitor condition latched"},
     {1u << 14, "watchdog timeout"},
     {1u << 13, "stack check error"},
     {1u << 12, "serial EEPROM (I2C) failure"},
     {1u << 11, "serial flash (SPI) failure"},
     {1u << 10, "watchdog timeout of the analog board"},
     {1u << 9, "strain gauge excitation current too high"},
     {1u << 8, "strain gauge excitation current too low"},
     {1u << 7, "analog ground out of range"},
     {1u << 6, "supply of the analog board too high"},
     {1u << 5, "supply of the analog board too low"},
     {1u << 4, "no data on the serial link"},
     {1u << 3, "reference voltage or power monitor error"},
     {1u << 2, "internal temperature error"},
     {1u << 1, "HTTP failure"}}};

}  // namespace

std::string rdtStatusText(std::uint32_t status) {
  return statusText(status, kStatusBits.data(), kStatusBits.size());
}

std::array<std::uint8_t, kRdtRequestSize> packRdtRequest(const RdtRequest& request) {
  std::array<std::uint8_t, kRdtRequestSize> data;
  putBig16(&data[0], kRdtHeader);
  putBig16(&data[2], request.command);
  putBig32(&data[4], request.sample_count);
  return data;
}

bool unpackRdtRecord(const std::uint8_t* data, std::size_t size, RdtRecord& record) {
  if (size != kRdtRecordSize) return false;
  record.rdt_sequence = big32(data);
  record.ft_sequence = big32(data + 4);
  record.status = big32(data + 8);
  for (std::size_t k = 0; k < 6; ++k) {
    record.counts[k] = static_cast<std::int32_t>(big32(data + 12 + 4 * k));
  }
  return true;
}

void RdtStream::begin() {
  // old records of the new stream must not fall among those of the stream before
  if (started_) next_ = newest_ + 1 + kWindow;
  started_ = false;
}

// Older than the newest, or implausibly far ahead: an old record, or numbers that restarted?
bool RdtStream::restarts(const RdtRecord& record, std::int64_t step) const {
  if (step > 0) return step > kLargestGap;
  if (restart_expected_) return true;
  const auto behind = static_cast<std::uint64_t>(-step);
  const auto measured = static_cast<std::int32_t>(record.ft_sequence - newest_ft_);
  if (behind >= kWindow) return true;
  const std::uint64_t sequence = newest_ - behind;
  const Kind known = kind(sequence);
  // the same number for another measurement
  if (known == Kind::kFilled || known == Kind::kDone) {
    return slot(sequence).record.ft_sequence != record.ft_sequence;
  }
  // an old number for a new measurement
  return measured > 0;
}

void RdtStream::markMissing(std::uint64_t sequence, SourceCounters& counters) {
  slot(sequence).sequence = sequence;
  slot(sequence).kind = Kind::kMissing;
  ++counters.lost;
}

bool RdtStream::push(const RdtRecord& record, const Reception& received, SourceCounters& counters) {
  const std::int64_t step =
      started_ ? static_cast<std::int32_t>(record.rdt_sequence - newest_rdt_) : 1;
  const bool restarted = !started_ || restarts(record, step);
  std::uint64_t sequence = next_;
  if (restarted) {
    if (pending() > 0) return false;
    if (started_) {
      begin();
      ++counters.restarts;
    }
    sequence = next_;
    ++stream_;
    started_ = true;
    newest_ = sequence;
  } else {
    sequence = newest_ + static_cast<std::uint64_t>(step);
    const Kind known = kind(sequence);
    if (known == Kind::kFilled || known == Kind::kDone) {
      ++counters.duplicates;
      return true;
    }
    if (sequence < next_) {
      // it isn't lost after all, but what follows it has gone out
      if (known == Kind::kMissing) --counters.lost;
      ++counters.late;
      slot(sequence) = {sequence, Kind::kDone, record, received};
      return true;
    }
    if (sequence - next_ >= kWindow) {
      if (pending() > 0) return false;
      // remember the latest of the missing, count all
      const std::uint64_t first = sequence - (kWindow - 1);
      counters.lost += first - next_;
      for (std::uint64_t missing = first; missing < sequence; ++missing) {
        markMissing(missing, counters);
      }
      next_ = sequence;
    }
    if (step < 0) ++counters.reordered;
  }
  slot(sequence) = {sequence, Kind::kFilled, record, received};
  restart_expected_ = false;
  if (restarted || step > 0) {
    newest_ = sequence;
    newest_rdt_ = record.rdt_sequence;
    newest_ft_ = record.ft_sequence;
  }
  return true;
}

const Reception& RdtStream::oldest() const {
  std::uint64_t sequence = next_;
  while (sequence < newest_ && kind(sequence) != Kind::kFilled) ++sequence;
  return slot(sequence).received;
}

ReadResult RdtStream::take(SourceBlock& block, std::size_t max_count, bool flush,
                           SourceCounters& counters) {
  block.count = 0;
  bool faults = false;
  while (pending() > 0 && block.count < std::min(max_count, kBlockCapacity)) {
    Slot& entry = slot(next_);
    if (kind(next_) != Kind::kFilled) {
      if (block.count > 0 || !(flush || newest_ - next_ >= kDepth)) break;
      markMissing(next_++, counters);
      continue;
    }
    const RdtRecord& record = entry.record;
    const bool stale = policy_.drop_stale && delivered_ && record.ft_sequence == last_ft_;
    const bool faulty = !policy_.deliver_faulty && (record.status & ~kRdtMonitorCondition) != 0;
    if (stale || faulty) {
      if (block.count > 0) break;
      const bool repeated = stale && record.counts == last_counts_;
      ++(repeated ? counters.stale : stale ? counters.unnumbered : counters.faulty);
    } else {
      if (block.count == 0) block.sequence = next_;
      std::uint8_t saturated = 0;
      for (std::size_t k = 0; k < 6; ++k) {
        const std::int32_t counts = record.counts[k];
        block.values[6 * block.count + k] = policy_.scale[k] * counts;
        const bool end = counts == std::numeric_limits<std::int32_t>::max() ||
                         counts == std::numeric_limits<std::int32_t>::min();
        saturated = static_cast<std::uint8_t>(saturated | (end ? 1u << k : 0u));
      }
      block.saturated[block.count++] = saturated;
      block.received = entry.received;
      ++counters.samples;
    }
    if (record.status != 0) {
      block.fault = counters.fault = record.status;
      faults = faults || faulty;
    }
    last_ft_ = record.ft_sequence;
    last_counts_ = record.counts;
    delivered_ = true;
    entry.kind = Kind::kDone;
    ++next_;
  }
  block.stream = stream_;
  if (block.count > 0) return ReadResult::kSamples;
  return faults ? ReadResult::kFault : ReadResult::kTimeout;
}

}  // namespace assembly_cell
