// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include "assembly_cell/align/search/guarded_carrier.h"

namespace assembly_cell {

/// Lowers the peg to a contact and presses it there, at block rate. Needs a tare (see
/// GuardedCarrier); leaves the carrier in contact.
class PressController {
 public:
  explicit PressController(GuardedCarrier& carrier);

  /// Lowers until the first touch. False when the rest height `floor` [m] was reached without one.
  /// Throws AlignError `no_contact` after the descent limit, and `wrong_mechanism` where the delay
  /// of the first descent isn't the one on file.
  /// `faster`: than with approach_step, of a carrier that follows at once, and in a coupling no
  /// stiffer than the default one.
  bool approach(double floor, double faster = 1.0);
  double touchZ() const { return touch_z_; }  ///< rest height at the last first touch [m]

  /// Smallest force that holdStill() can hold, as of the tare: less is within the scatter of a
  /// block, or lost in the steps of a press. [N]
  double minForce(double tolerance) const;
  /// In contact: adjusts the height until the mean force along z is within tolerance·force. [N]
  /// `settled`: the force is settled, as after a light touch, and isn't waited for. Throws
  /// AlignError `gave_way` or `press_not_held`.
  void hold(double force, double tolerance, bool settled = false);
  /// The same, and the force is still within tolerance·force 0.2 s later with the peg at rest: all
  /// commands have had their effect, also with an arm beside a busy machine. Throws AlignError
  /// `press_not_held` where it goes on five times, `gave_way` as hold() over all.
  void holdStill(double force, double tolerance);

 private:
  void limitTravel(double down, double force) const;
  void measureDelay();

  GuardedCarrier& carrier_;
  double touch_z_ = 0.0;
  double stiffness_;  // of the contact along z, from the last secant [N/m]
  DelayMeter delay_;
  bool delay_checked_ = false;
};

}  // namespace assembly_cell
