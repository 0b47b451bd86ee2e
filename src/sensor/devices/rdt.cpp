// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/sensor/devices/rdt.h"

#include <algorithm>
#include <limits>

#include "byte_order.h"

namespace assembly_cell {

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
      ++(stale ? counters.stale : counters.faulty);
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
    delivered_ = true;
    entry.kind = Kind::kDone;
    ++next_;
  }
  block.stream = stream_;
  if (block.count > 0) return ReadResult::kSamples;
  return faults ? ReadResult::kFault : ReadResult::kTimeout;
}

}  // namespace assembly_cell
