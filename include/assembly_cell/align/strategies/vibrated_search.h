// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <optional>
#include <vector>

#include "assembly_cell/align/estimation/vibration_point.h"
#include "assembly_cell/align/search/search.h"
#include "assembly_cell/locus/reading.h"

namespace assembly_cell {

/// What the strategies of the vibrated peg share: one reading, plane and hole from the readings,
/// recovery. Each attempt of a strategy may fail; four are made.
class VibratedSearch : public Search {
 protected:
  using Search::Search;

  /// One reading as it was felt.
  struct Felt {
    LocusReading seen;
    VibrationPoint vibration;  ///< that it was felt with
    bool usable = false;       ///< a single contact explains it
    bool straddles = false;  ///< both edges carried at the touch; not pressed, nothing else is set
    Pose X_SC;               ///< carrier
    Eigen::Vector3d force = Eigen::Vector3d::Zero();  ///< mean contact force, sensor axes [N]
    double start = 0.0, end = 0.0;                    ///< plant clock [s]
    HoleReading reading;
  };

  /// The strategy's own way to the hole. True when the peg is in.
  virtual bool attempt() = 0;

  void find() final;
  void summarise(AlignResult& result) const final;

  /// One reading with the peg tilted by R about its bottom centre; the exciter runs only meanwhile.
  /// False when the edge went into the hole instead. Presses both edges only if asked to, and never
  /// a wedge (AlignError `wedged`).
  bool read(const Eigen::Matrix3d& R, const char* state, Felt& felt, bool press_both = false);
  /// Over a place off the trap, seen from where the peg was in vain; another direction each time.
  void goAside();
  /// From a locus to a direction on the peg's edge, with the tilts against the plane as known now.
  void invert(Felt& felt) const;
  /// Tilt against the plane as known now, low side at azimuth `low`.
  Eigen::Matrix3d lowAt(double low) const;
  /// Plane alone from what was felt. False when it isn't determined.
  bool level();
  /// Plane and centre from what was felt, into hole_ and the readings; see fitHole().
  FitStatus fit(int least_rim);
  /// The same for good. Throws AlignError.
  void resolve();
  /// An edge that went in on the way says where the hole is.
  void takeEntry();
  /// Hole centre relative to the start's bottom centre, along the hole plane.
  Eigen::Vector2d offset() const;

  VibrationPoint vibration_;
  Eigen::Vector3d bottom_;  ///< where the peg is turned: its bottom centre in S
  double tilt_ = 0.0;       ///< of the sweep [rad]
  std::vector<Felt> felt_;  ///< of use

 private:
  VibrationPoint pointFor(double friction) const;
  void choosePoint();
  void shake(const VibrationPoint& vibration);
  double window() const;
  std::optional<Eigen::Vector3d> roughPlane() const;
  void feel(double window, Felt& felt);
  void feelAgain(const char* state, Felt& felt);
  void exciterNext(double amplitude);
  double entryHeight(const Eigen::Matrix3d& R) const;
  double touchRange() const;
  bool caught();
  double clearance(const Eigen::Matrix3d& R) const;
  void recover(const AlignError& error, int attempt);
  bool planeKnown() const { return level_ || found_; }

  int touches_ = 0;                      // since the start or the last failure
  double highest_ = 0.0, lowest_ = 0.0;  // bottom centre at these touches, S [m]
  bool level_ = false;                   // the plane is known, the centre may not be
};

}  // namespace assembly_cell
