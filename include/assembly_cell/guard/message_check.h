// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>

#include "assembly_cell/base/range.h"

namespace assembly_cell {

// What no part of a cell reaches. Wide on purpose: they keep nonsense out, they don't set a machine
// up.
constexpr Range kVoltsField{-12.0, 12.0, "V"};       // a converter of ±10 V and its offset
constexpr Range kForceField{-1e5, 1e5, "N"};         // ten tonnes
constexpr Range kTorqueField{-1e4, 1e4, "N m"};      // the same on a lever of 0.1 m
constexpr Range kDisplacementField{-0.1, 0.1, "m"};  // of a coupling: some mm
constexpr Range kRotationField{-0.2, 0.2, "rad"};    // of a coupling: some hundredths
constexpr Range kPositionField{-100.0, 100.0, "m"};  // of a carrier in its base
constexpr Range kAmplitudeField{0.0, 1e4, "N"};      // exciter
constexpr Range kFrequencyField{0.0, 1e5, "rad/s"};  // exciter: 16 kHz
constexpr Range kPhaseField{-1e6, 1e6, "rad"};
constexpr Range kAccelerationField{-1e6, 1e6, "m/s2"};
constexpr Range kCoefficientField{-1e9, 1e9, ""};  // of a calibration, in SI units
constexpr Range kPeriodField{1e-6, 1.0, "s"};      // of samples: 1 MHz to 1 Hz
/// Stamps end in July 2036: differences of two fit in the 31 bits of a ROS duration, whatever is
/// added to them.
constexpr double kLastStamp = 2.1e9;  // [s]
constexpr std::size_t kMaxValues =
    6 * 1000000;                             // in a block: a sample a microsecond, a second long
constexpr std::size_t kMaxNameLength = 200;  // of ids and frames [bytes]

/// What is wrong with a message.
enum class MessageFault : std::uint8_t {
  kNone,
  kNotFinite,
  kRange,
  kSize,       // no samples, incomplete ones, or too many
  kUnlike,     // two lengths that must be equal are not
  kStamp,      // out of range, or far from those of its stream
  kName,       // longer than kMaxNameLength
  kControl,    // a name with a control character
  kDirection,  // neither 1 nor -1
  kQuaternion  // norm is not 1
};

/// Checks the fields of a message, one call a field; keeps the first fault. Only text() allocates.
/// Names of fields must outlive the check: literals.
class MessageCheck {
 public:
  MessageCheck& number(const char* field, double value, const Range& range);
  MessageCheck& numbers(const char* field, const double* values, std::size_t count,
                        const Range& range);
  /// 6 × n numbers, sample after sample: the first three of a sample within `force`, the others
  /// within `torque`. Wrenches, and displacements with their ranges.
  MessageCheck& sixes(const char* field, const double* values, std::size_t count,
                      const Range& first, const Range& last);
  /// n samples of `each` values, n > 0 and at most kMaxValues values.
  MessageCheck& block(const char* field, std::size_t values, std::size_t each);
  /// Values in `field`: none or `wanted`.
  MessageCheck& noneOr(const char* field, std::size_t size, std::size_t wanted);
  /// One entry a sample.
  MessageCheck& same(const char* field, std::size_t size, std::size_t samples);
  /// [s] since 1970, or of a simulation. 0 is no stamp and passes.
  MessageCheck& stamp(const char* field, double seconds);
  MessageCheck& name(const char* field, const std::string& value);
  MessageCheck& direction(const char* field, int value);
  /// Norm within 1e-3 of 1.
  MessageCheck& quaternion(const char* field, double x, double y, double z, double w);

  bool good() const { return fault_ == MessageFault::kNone; }
  MessageFault fault() const { return fault_; }
  /// "volts[7] is 100 V: give -12 to 12"; empty when nothing is wrong.
  std::string text() const;

 private:
  MessageCheck& fail(MessageFault fault, const char* field, double value, double low, double high);

  MessageFault fault_ = MessageFault::kNone;
  const char* field_ = "";
  const char* unit_ = "";
  std::ptrdiff_t index_ = -1;
  double value_ = 0.0, low_ = 0.0, high_ = 0.0;
};

/// Stamps of one stream. A stamp more than `window` ahead of all before is rejected; a second one
/// near it is taken as a clock jump. An earlier stamp (the clock was set back, a simulation was
/// restarted) is accepted at once, and so is the return to the stream's previous time.
class StampWindow {
 public:
  explicit StampWindow(double window = 86400.0) : window_(window) {}
  /// [s]; 0 is accepted and ignored.
  bool accept(double stamp);
  double last() const { return last_; }  ///< accepted [s], 0: none yet

 private:
  double window_;
  double last_ = 0.0, before_ = 0.0, candidate_ = 0.0;  // 0: none
};

}  // namespace assembly_cell
