// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <functional>
#include <optional>
#include <vector>

#include "assembly_cell/align/search/search.h"
#include "assembly_cell/align/strategies/direction_sensor.h"

namespace assembly_cell {

/// Locates the hole from contact directions of the vibrated peg: measurements at several tilts,
/// plane and centre from them, recovery. Part of `single_contact` and `double_contact`.
class VibratedSearch {
 public:
  using Measurement = DirectionMeasurement;

  explicit VibratedSearch(Search& search);

  /// Makes up to four attempts; `attempt` returns true when the peg is in. Throws AlignError.
  void run(const std::function<bool()>& attempt);
  void summarise(AlignResult& result) const;

  /// One measurement with the peg tilted by R about its bottom centre. False when the edge went
  /// into the hole instead. Presses both edges only with `press_both`, and never a wedge
  /// (AlignError `wedged`); throws AlignError `edge_in_hole` before the plane is known.
  bool read(const Eigen::Matrix3d& R, const char* state, Measurement& result,
            bool press_both = false);
  /// `bottom` to a place off the trap, another direction each time.
  void goAside();
  /// Tilt against the plane as known now, low side at azimuth `low` [rad].
  Eigen::Matrix3d lowAt(double low) const;
  /// Plane alone from the measurements. False when it isn't determined.
  bool level();
  /// Plane and centre from the measurements, into the hole and the readings; see fitHole().
  FitStatus fit(int min_rim);
  /// As fit(), into the state and the progress. Throws AlignError where it fails.
  void resolve();
  /// An edge that went in on the path down is over the hole.
  void takeEntry();

  DirectionSensor sensor;
  Eigen::Vector3d bottom =
      Eigen::Vector3d::Zero();        ///< where the peg is tilted: its bottom centre in S [m]
  double tilt = 0.0;                  ///< of the sweep [rad]
  std::vector<Measurement> measured;  ///< the usable ones

 private:
  std::optional<Eigen::Vector3d> roughPlane() const;
  double entryHeight(const Eigen::Matrix3d& R) const;
  double touchRange() const;
  bool isCaught();
  double clearance(const Eigen::Matrix3d& R) const;
  void recover(const AlignError& error, int attempt);
  bool planeKnown() const { return level_ || s_.found; }

  Search& search_;
  SearchState& s_;
  // touches since the start or the last failure
  struct {
    int count = 0;
    double highest = 0.0, lowest = 0.0;  // bottom centre, S [m]
  } touches_;
  bool level_ = false;  // the plane is known, the centre may not be
};

}  // namespace assembly_cell
