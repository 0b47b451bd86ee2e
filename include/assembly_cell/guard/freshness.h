// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

namespace assembly_cell {

/// A block that is older than this when a decision is made never leads to a command, cell time [s].
inline constexpr double kFreshAge = 0.06;

/// What time it is in a cell whose messages come in late or in a heap: a process that was frozen
/// finds a queue of old ones. Cell time is estimated from the arrival of stamps that come straight
/// from the plant, once a block. A message that comes sooner after its stamp than any before tells
/// the least delay; a heap (messages closer together than their stamps) never tells more of it;
/// messages that keep their distance do, so that a cell that was paused or runs slowly is not
/// taken for a queue: six blocks after
/// a pause they are fresh again.
class CellClock {
 public:
  /// follows_wall: cell time goes on between two messages; false (lockstep): it stands.
  explicit CellClock(bool follows_wall) : follows_wall_(follows_wall) {}

  /// A message with a `stamp` of cell time has come in at `wall`, monotonic clock. [s]
  void observe(double wall, double stamp);

  /// Cell time at `wall` [s]; the newest stamp when that is later. Nothing seen yet: 0.
  double now(double wall) const;
  double newest() const { return stamp_; }  ///< stamp [s]
  bool known() const { return known_; }

 private:
  bool follows_wall_;
  bool known_ = false;
  int steady_ = 0;  // intervals so far
  double wall_ = 0.0, stamp_ = 0.0, passed_ = 0.0;
  double delay_ = 0.0;  // wall less stamp of a message that is not late
};

/// May a block that ended at `end` lead to a command at `now`? Cell time [s].
inline bool isFresh(double end, double now) { return now - end <= kFreshAge; }

}  // namespace assembly_cell
