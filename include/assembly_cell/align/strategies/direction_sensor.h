// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include "assembly_cell/align/estimation/vibration_point.h"
#include "assembly_cell/align/search/search_state.h"
#include "assembly_cell/locus/reading.h"

namespace assembly_cell {

/// A contact of the vibrated peg, and its direction from the locus.
struct DirectionMeasurement {
  LocusReading seen;
  VibrationPoint vibration;  ///< during the measurement
  bool usable = false;       ///< a single contact explains it
  bool straddles = false;    ///< both edges carried at the touch; not pressed, the rest isn't set
  Pose X_SC;                 ///< carrier
  Eigen::Vector3d force = Eigen::Vector3d::Zero();  ///< mean contact force, sensor axes [N]
  double start = 0.0, end = 0.0;                    ///< plant clock [s]
  HoleReading reading;
};

/// Presses and vibrates the peg in contact, and measures the direction of the contact on its edge.
/// Needs a contact and, for directions, the normal of the hole's plane.
class DirectionSensor {
 public:
  explicit DirectionSensor(SearchState& state) : s_(state) {}

  /// The operating point of the exciter, from the noise of the latest tare. Throws AlignError
  /// `too_uncertain`.
  void choosePoint();
  /// One measurement, repeated once by the advice of the locus; the exciter runs only meanwhile.
  /// `full_window`: whether both edges carry takes a longer window than which one does.
  DirectionMeasurement measure(const char* state, bool full_window);
  /// From the locus to a direction on the peg's edge, with the tilts against the plane as known
  /// now. Throws AlignError `no_plane_reading`.
  void invert(DirectionMeasurement& measured) const;

  VibrationPoint point;

 private:
  VibrationPoint pointFor(double friction) const;
  void shake(const VibrationPoint& vibration);
  double window() const;
  void read(double window, DirectionMeasurement& measured);
  void readAgain(const char* state, DirectionMeasurement& measured);
  void exciterNext(double amplitude);

  SearchState& s_;
};

}  // namespace assembly_cell
