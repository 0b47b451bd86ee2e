// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/guard/message_check.h"

#include <algorithm>
#include <cmath>

#include "assembly_cell/base/text.h"

namespace assembly_cell {

namespace {

constexpr double kQuaternionTolerance = 1e-3;  // farther from unit is a mistake, not rounding

MessageFault faultOf(double value) {
  return std::isfinite(value) ? MessageFault::kRange : MessageFault::kNotFinite;
}

// Most blocks are good: one pass without branches, and only for bad ones a second to find the
// fault.
bool allWithin(const double* values, std::size_t count, const Range& range) {
  bool good = true;
  for (std::size_t k = 0; k < count; ++k) good &= range.contains(values[k]);
  return good;
}

}  // namespace

MessageCheck& MessageCheck::fail(MessageFault fault, const char* field, double value, double low,
                                 double high) {
  fault_ = fault;
  field_ = field;
  value_ = std::isnan(value) ? std::abs(value) : value;  // a NaN is printed without a sign
  low_ = low;
  high_ = high;
  return *this;
}

MessageCheck& MessageCheck::number(const char* field, double value, const Range& range) {
  if (!good() || range.contains(value)) return *this;
  unit_ = range.unit;
  return fail(faultOf(value), field, value, range.low, range.high);
}

MessageCheck& MessageCheck::numbers(const char* field, const double* values, std::size_t count,
                                    const Range& range) {
  if (!good() || allWithin(values, count, range)) return *this;
  std::size_t k = 0;
  while (range.contains(values[k])) ++k;
  index_ = static_cast<std::ptrdiff_t>(k);
  return number(field, values[k], range);
}

MessageCheck& MessageCheck::sixes(const char* field, const double* values, std::size_t count,
                                  const Range& first, const Range& last) {
  if (!good()) return *this;
  bool sound = true;
  for (std::size_t k = 0; k + 6 <= count; k += 6) {
    sound &= allWithin(values + k, 3, first) && allWithin(values + k + 3, 3, last);
  }
  for (std::size_t k = 0; !sound && good(); ++k) {
    index_ = static_cast<std::ptrdiff_t>(k);
    number(field, values[k], k % 6 < 3 ? first : last);
  }
  return *this;
}

MessageCheck& MessageCheck::block(const char* field, std::size_t values, std::size_t each) {
  if (!good() || (values > 0 && values % each == 0 && values <= kMaxValues)) return *this;
  return fail(MessageFault::kSize, field, static_cast<double>(values), static_cast<double>(each),
              static_cast<double>(kMaxValues));
}

MessageCheck& MessageCheck::noneOr(const char* field, std::size_t size, std::size_t wanted) {
  return size == 0 ? *this : same(field, size, wanted);
}

MessageCheck& MessageCheck::same(const char* field, std::size_t size, std::size_t samples) {
  if (!good() || size == samples) return *this;
  return fail(MessageFault::kUnlike, field, static_cast<double>(size), static_cast<double>(samples),
              0.0);
}

MessageCheck& MessageCheck::stamp(const char* field, double seconds) {
  if (!good() || (seconds >= 0.0 && seconds <= kLastStamp)) return *this;
  return fail(MessageFault::kStamp, field, seconds, 0.0, kLastStamp);
}

MessageCheck& MessageCheck::name(const char* field, const std::string& value) {
  if (!good()) return *this;
  if (value.size() > kMaxNameLength) {
    return fail(MessageFault::kName, field, static_cast<double>(value.size()), 0.0,
                static_cast<double>(kMaxNameLength));
  }
  const auto control = std::find_if(value.begin(), value.end(),
                                    [](unsigned char c) { return c < 0x20 || c == 0x7f; });
  if (control == value.end()) return *this;
  return fail(MessageFault::kControl, field, static_cast<double>(control - value.begin() + 1), 0.0,
              0.0);
}

MessageCheck& MessageCheck::direction(const char* field, int value) {
  if (!good() || value == 1 || value == -1) return *this;
  return fail(MessageFault::kDirection, field, value, -1.0, 1.0);
}

MessageCheck& MessageCheck::quaternion(const char* field, double x, double y, double z, double w) {
  // squares of very large numbers overflow to infinity, which is refused too
  const double norm = std::sqrt(x * x + y * y + z * z + w * w);
  if (!good() || std::abs(norm - 1.0) <= kQuaternionTolerance) return *this;
  return fail(MessageFault::kQuaternion, field, norm, 1.0, 1.0);
}

std::string MessageCheck::text() const {
  if (good()) return {};
  std::string where = field_;
  if (index_ >= 0) where += "[" + std::to_string(index_) + "]";
  const char* const gap = *unit_ == '\0' ? "" : " ";
  switch (fault_) {
    case MessageFault::kNotFinite:
    case MessageFault::kRange:
      return where +
             assembly_cell::text(" is %g%s%s: give %g to %g", value_, gap, unit_, low_, high_);
    case MessageFault::kSize:
      return assembly_cell::text("%.0f %s are no multiple of %.0f, or more than %.0f", value_,
                                 field_, low_, high_);
    case MessageFault::kUnlike:
      return where + assembly_cell::text(" has %.0f entries: give %.0f", value_, low_);
    case MessageFault::kStamp:
      return where + assembly_cell::text(" is %.17g s: give at most %.0f s", value_, high_);
    case MessageFault::kName:
      return where + assembly_cell::text(" has %.0f characters: give at most %.0f", value_, high_);
    case MessageFault::kControl:
      return where + assembly_cell::text(
                         " has a control character at position %.0f: give printable ones", value_);
    case MessageFault::kDirection:
      return where + assembly_cell::text(" is %.0f: give 1 or -1", value_);
    case MessageFault::kQuaternion:
      return where + assembly_cell::text(" has norm %g: give a unit quaternion x, y, z, w", value_);
    case MessageFault::kNone:
      break;
  }
  return {};
}

bool StampWindow::accept(double stamp) {
  if (stamp == 0.0) return true;
  const auto near = [&](double other) { return other > 0.0 && std::abs(stamp - other) <= window_; };
  if (last_ == 0.0 || near(last_)) {
    last_ = stamp;
    return true;
  }
  if (stamp < last_ || near(before_) || near(candidate_)) {
    before_ = last_;
    last_ = stamp;
    candidate_ = 0.0;
    return true;
  }
  candidate_ = stamp;
  return false;
}

}  // namespace assembly_cell
