// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

namespace assembly_cell {

/// Largest age of a block that may lead to a command, cell time [s].
inline constexpr double kFreshAge = 0.06;

/// Cell time, estimated from the arrival times of the plant's stamps, once a block. Messages may be
/// late or arrive in bursts, as after a process was frozen. A message with a shorter delay than all
/// before sets the delay; messages of a burst (closer together than their stamps) never raise it;
/// messages at the distance of their stamps do, so that a paused or slow cell isn't taken for a
/// queue: six blocks after a pause they are fresh again.
class CellClock {
 public:
  /// follows_wall: cell time advances between two messages; false (lockstep): it doesn't.
  explicit CellClock(bool follows_wall) : follows_wall_(follows_wall) {}

  /// A message with a `stamp` of cell time was received at `wall`, monotonic clock. [s]
  void observe(double wall, double stamp);

  /// Cell time at `wall` [s], at least the newest stamp; 0 before the first one.
  double now(double wall) const;
  double newest() const { return stamp_; }  ///< stamp [s]
  bool known() const { return known_; }

 private:
  bool follows_wall_;
  bool known_ = false;
  int steady_ = 0;  // intervals so far
  double wall_ = 0.0, stamp_ = 0.0, passed_ = 0.0;
  double delay_ = 0.0;  // wall minus stamp of a message that isn't late
};

/// May a block that ended at `end` lead to a command at `now`? Cell time [s].
inline bool isFresh(double end, double now) { return now - end <= kFreshAge; }

}  // namespace assembly_cell
