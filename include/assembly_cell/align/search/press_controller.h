// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <limits>

#include "assembly_cell/align/search/guarded_carrier.h"

namespace assembly_cell {

/// Lowers the peg to a contact and controls the pressing force, at block rate. Needs a tare (see
/// GuardedCarrier). Leaves the peg in contact.
class PressController {
 public:
  explicit PressController(GuardedCarrier& carrier);

  /// Lowers the peg until it touches. False when the rest height `floor` [m] was reached without a
  /// touch. Throws AlignError `no_contact` the descent limit below the lowest height that an
  /// approach began at, since retreats raise the later ones. Throws `wrong_mechanism` if the delay
  /// in the first descent contradicts the file of the mechanism. `faster`: factor of the speed. It
  /// is 1 with an arm or a carrier that answers late, and falls to 1 with the stiffness of the
  /// coupling.
  bool approach(double floor, double faster = 1.0);
  double touchZ() const { return touch_z_; }  ///< rest height at the last touch of approach() [m]

  /// Smallest force that holdStill() can hold, by the noise at the tare. A smaller one is within
  /// the scatter of a block, or is lost in the steps of a press. [N]
  double minForce(double tolerance) const;
  /// Adjusts the height of a peg in contact until the mean force along z is `force` [N] to within
  /// tolerance·force. `settled`: the force is constant already, as after a light touch. Throws
  /// AlignError `gave_way` or `press_not_held`.
  void hold(double force, double tolerance, bool settled = false);
  /// As hold(), until the force is also within tolerance·force 0.2 s later and at rest, when all
  /// commands have had their effect, even with an arm and a busy computer. Throws AlignError
  /// `press_not_held` after five attempts, and `gave_way` as hold() for their whole travel.
  void holdStill(double force, double tolerance);

 private:
  void limitTravel(double down, double force) const;
  void measureDelay();

  GuardedCarrier& carrier_;
  double touch_z_ = 0.0;
  double lowest_start_ = std::numeric_limits<double>::infinity();  // of approaches so far [m]
  double stiffness_;  // of the contact along z, by the last two forces [N/m]
  DelayMeter delay_;
  bool delay_checked_ = false;
};

}  // namespace assembly_cell
