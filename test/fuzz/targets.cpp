// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "targets.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <istream>
#include <memory>
#include <streambuf>
#include <string>
#include <string_view>
#include <vector>

#include "../emulators/device_codecs.h"
#include "assembly_cell/base/input_error.h"
#include "assembly_cell/guard/message_check.h"
#include "assembly_cell/guard/plant_guard.h"
#include "assembly_cell/sensor/devices/iio_text.h"
#include "assembly_cell/sensor/devices/netft_configuration.h"
#include "assembly_cell/sensor/devices/rdt.h"
#include "assembly_cell/sensor/devices/replay.h"
#include "assembly_cell/sensor/devices/serial_frame.h"

namespace assembly_cell {

namespace {

void require(bool holds, const char* what) {
  if (holds) return;
  std::fprintf(stderr, "broken: %s\n", what);
  std::abort();
}

// Frames from bytes in pieces with sizes from the first byte.
void fuzzFrames(const FrameFormat& format, const std::uint8_t* data, std::size_t size) {
  static const auto kept = std::make_unique<FrameDecoder>(format);
  FrameDecoder& decoder = *kept;
  decoder.reset();
  if (size == 0) return;
  const std::size_t piece = 1 + data[0] % 64;
  SourceCounters counters;
  std::size_t frames = 0;
  for (std::size_t at = 1; at < size;) {
    require(decoder.freeBytes() > 0, "room for the next bytes");
    const std::size_t n = std::min({piece, size - at, decoder.freeBytes()});
    std::copy(data + at, data + at + n, decoder.space());
    decoder.added(n);
    at += n;
    SerialFrame frame;
    while (decoder.next(frame, counters)) {
      ++frames;
      for (const double value : frame.values) require(std::isfinite(value), "finite values");
    }
  }
  require(frames * format.size + counters.garbage <= size, "each byte counts once");
}

}  // namespace

// Records one after another, through the stream, with a take now and then.
void fuzzRdtRecord(const std::uint8_t* data, std::size_t size) {
  RdtRequest request;
  if (unpackRdtRequest(data, size, request)) {
    const auto packed = packRdtRequest(request);
    require(std::equal(packed.begin(), packed.end(), data), "a request packs to its bytes");
  }
  static const auto stream = std::make_unique<RdtStream>();
  static const auto block = std::make_unique<SourceBlock>();
  RdtPolicy policy;
  policy.scale.fill(1e-6);
  stream->setPolicy(policy);
  // what was left by the input before
  SourceCounters counters;
  while (stream->take(*block, kBlockCapacity, true, counters) != ReadResult::kTimeout) {
  }
  stream->begin();
  counters = SourceCounters();

  std::uint64_t last = 0, delivered = 0;
  const auto take = [&](bool flush) {
    if (stream->take(*block, kBlockCapacity, flush, counters) != ReadResult::kSamples) return false;
    require(block->count > 0 && block->count <= kBlockCapacity, "a block within its capacity");
    require(delivered == 0 || block->sequence > last, "sequences grow");
    last = block->sequence + block->count - 1;
    delivered += block->count;
    return true;
  };
  std::size_t records = 0;
  for (std::size_t at = 0; at < size; at += kRdtRecordSize) {
    RdtRecord record;
    const std::size_t n = std::min(kRdtRecordSize, size - at);
    if (!unpackRdtRecord(data + at, n, record)) {
      require(n != kRdtRecordSize, "a record of the right size is one");
      break;
    }
    const auto packed = packRdtRecord(record);
    require(std::equal(packed.begin(), packed.end(), data + at), "a record packs to its bytes");
    ++records;
    for (int tries = 0; !stream->push(record, Reception(), counters); ++tries) {
      require(tries < 4096, "room after taking");
      take(true);
    }
    if ((record.counts[5] & 7) == 0) take((record.counts[5] & 8) == 0);
  }
  while (stream->pending() > 0) take(true);
  require(counters.samples == delivered, "samples are those delivered");
  require(delivered + counters.duplicates + counters.late + counters.faulty + counters.stale +
                  counters.unnumbered ==
              records,
          "each record counts once");
}

void fuzzNetftConfiguration(const std::uint8_t* data, std::size_t size) {
  const std::string_view text(reinterpret_cast<const char*>(data), size);
  try {
    httpComplete(text);
    const bool http = text.substr(0, 5) == "HTTP/";
    const NetftConfiguration c = parseNetftConfiguration(http ? httpBody(text) : text);
    const NetftScale scale = netftScale(c);
    require(scale.force > 0.0 && std::isfinite(scale.force), "a scale of forces");
    require(scale.torque > 0.0 && std::isfinite(scale.torque), "a scale of torques");
  } catch (const SourceError& error) {
    const std::string_view line = error.what();
    require(line.size() < 400 && line.find('\n') == line.npos, "an error is one short line");
  }
}

void fuzzBotaFrames(const std::uint8_t* data, std::size_t size) {
  fuzzFrames(kBotaFormat, data, size);
}

void fuzzRobotiqFrames(const std::uint8_t* data, std::size_t size) {
  fuzzFrames(kRobotiqFormat, data, size);
}

void fuzzReplay(const std::uint8_t* data, std::size_t size) {
  if (size == 0) return;
  struct Bytes : std::streambuf {
    Bytes(const std::uint8_t* from, std::size_t count) {
      // a streambuf that only reads
      char* start = const_cast<char*>(reinterpret_cast<const char*>(from));
      setg(start, start, start + count);
    }
  } bytes(data + 1, size - 1);
  std::istream stream(&bytes);
  ReplayFormat format;
  format.quantity = static_cast<SampleQuantity>(data[0] % 3);
  if ((data[0] & 4) != 0) {
    format.columns =
        format.quantity == SampleQuantity::kWrench
            ? std::vector<std::string>{"t", "fx", "fy", "fz", "tx", "ty", "tz"}
            : std::vector<std::string>{"x", "ch6", "ch5", "ch4", "ch3", "ch2", "ch1", "t"};
  }
  try {
    const Recording recording = readRecording(stream, "fuzz.csv", format);
    require(recording.time.size() >= 2 && recording.period > 0.0, "two rows and a period");
    for (const Vector6& value : recording.values) require(value.allFinite(), "finite values");
    Replay replay(recording, 7, false);
    ReplayBlock block;
    std::size_t samples = 0;
    while (replay.next(block)) samples += block.size;
    require(samples == recording.time.size(), "each row is played once");
  } catch (const InputError& error) {
    require(std::string_view(error.what()).find('\n') == std::string_view::npos,
            "an error is one line");
  }
}

void fuzzIioText(const std::uint8_t* data, std::size_t size) {
  const std::string_view text(reinterpret_cast<const char*>(data), size);
  double number = 0.0;
  if (parseIioNumber(text, number)) require(std::isfinite(number), "a finite number");
  std::int64_t integer = 0;
  parseIioInteger(text, integer);
  IioType type;
  if (!parseIioType(text.substr(0, text.find('\n')), type)) return;
  require(type.bits >= 1 && type.bits + type.shift <= type.storage, "bits within the storage");
  isIioEndCode(integer, type);
}

// Numbers as they come in messages: what passes is finite, of whole samples, and can be added to.
void fuzzMessageCheck(const std::uint8_t* data, std::size_t size) {
  std::vector<double> numbers(size / sizeof(double));
  if (numbers.size() < 6) return;
  std::memcpy(numbers.data(), data, numbers.size() * sizeof(double));
  const double stamp = numbers[0], period = numbers[1];
  const double* const values = numbers.data() + 2;
  const std::size_t count = numbers.size() - 2;
  MessageCheck check;
  check.block("wrench", count, 6).number("period", period, kPeriodField);
  check.stamp("header.stamp", stamp);
  check.quaternion("orientation", values[0], values[1], values[2], values[3]);
  const bool shape = check.good();
  check.sixes("wrench", values, check.good() ? count : 0, kForceField, kTorqueField);
  require(check.good() == check.text().empty(), "a fault has a text");
  require(check.text().find('\n') == std::string::npos, "a fault is one line");
  if (check.good()) {
    const double end = stamp + period * static_cast<double>(count / 6);
    require(end < 2147483647.0, "the end of a block fits in 31 bits");
    for (std::size_t k = 0; k < count; ++k) require(std::abs(values[k]) <= 1e5, "values in range");
  } else if (shape) {
    require(!std::all_of(values, values + count, [](double v) { return std::abs(v) <= 1e4; }),
            "small values pass");
  }
  StampWindow window;
  for (const double number : numbers) {
    if (number >= 0.0 && number <= kLastStamp) window.accept(number);
  }
  require(window.last() >= 0.0 && window.last() <= kLastStamp, "the window keeps stamps");
  require(window.accept(100.0) || window.accept(100.0), "no publisher is rejected twice in a row");
}

// Leases, moves, exciter commands and loads of three nodes in any order: accepted commands are
// within the limits and from the owner, and the watchdog stops in time.
void fuzzPlantGuard(const std::uint8_t* data, std::size_t size) {
  struct Event {
    std::uint8_t kind, node, session, flags;
    float age;  // of the sender's last state [s]
    double a, b;
  };
  if (size == 0) return;
  PlantGuard guard = plantGuard({}, static_cast<LeaseMode>(data[0] % 3), (data[0] & 4) != 0);
  guard.braking.stiffness.diagonal().setConstant(5e4);
  const GuardLimits& limits = guard.limits;
  const auto accepted = [](const GuardVerdict& verdict) {
    require(verdict.good() == verdict.text.empty(), "a refusal has a text");
    require(verdict.text.find('\n') == std::string::npos, "a refusal is one line");
    return verdict.good();
  };
  double now = 1.0;
  for (std::size_t at = 1; at + sizeof(Event) <= size; at += sizeof(Event)) {
    Event event;
    std::memcpy(&event, data + at, sizeof event);
    const std::string node = std::string("/") + static_cast<char>('a' + event.node % 3);
    const Sender sender{node, now - static_cast<double>(event.age), (event.flags & 1) != 0,
                        (event.flags & 2) != 0};
    const std::string owner = guard.owner;
    bool commanded = false;
    switch (event.kind % 4) {
      case 0: {
        GuardAction action;
        accepted(renewLease(guard, sender, event.session % 3, now, action));
        require(owner == guard.owner || action.exciter_off || !guard.shaking,
                "another owner begins with the exciter off");
        require(guard.owner.empty() || guard.mode != LeaseMode::kNone, "no sessions");
        break;
      }
      case 1: {
        Pose X;
        X.p = {event.a, event.b, event.a - event.b};
        commanded = accepted(checkMove(guard, sender, X, now));
        if (!commanded) break;
        require((X.p.array() >= limits.box_min.array()).all() &&
                    (X.p.array() <= limits.box_max.array()).all(),
                "moves stay in the workspace");
        break;
      }
      case 2: {
        const ExciterCommand drive{event.a, event.b, event.a, event.flags & 4 ? 1 : -1};
        const bool good = accepted(checkExciter(guard, sender, drive, now));
        commanded = good && drive.amplitude > 0.0;
        require(!good || (drive.amplitude <= limits.amplitude && drive.frequency >= 0.0 &&
                          drive.frequency <= limits.frequency),
                "the exciter keeps its limits");
        break;
      }
      default: {
        now += 0.02;
        const Vector6 load = Vector6::Constant(event.a);
        if (exceeds(load, guard.allowed)) {
          require(!accepted(overload(guard, load, Vector6::Zero())), "an overload is reported");
        }
        watch(guard, load, event.b, now);
        const Vector6 way = Vector6::Constant(event.b);
        if (std::isfinite(event.a) && std::abs(event.b) < 1.0) {
          require(speedLimit(guard, load, way) >= 1e-3, "what is slow may always move");
        }
        require(!std::isnan(guard.allowed.force) && !std::isnan(guard.allowed.torque),
                "limits are numbers");
      }
    }
    require(
        !commanded || guard.mode == LeaseMode::kNone || guard.owner.empty() || guard.owner == node,
        "only the owner commands");
    require(!commanded || guard.mode != LeaseMode::kRequired || guard.owner == node,
            "no command without a lease where one is required");
    require(guard.seen <= now, "no message is from the future");
    require(guard.owner.empty() || guard.expired || now - guard.seen < limits.lease_time + 0.02,
            "the watchdog stops in time");
    require(!(guard.expired && guard.shaking), "nothing shakes without a lease");
  }
}

}  // namespace assembly_cell
