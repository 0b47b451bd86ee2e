// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <functional>
#include <optional>
#include <vector>

#include "assembly_cell/align/align.h"
#include "assembly_cell/cell/simulated_plant.h"
#include "assembly_cell/identification/mechanism_record.h"

namespace assembly_cell {

/// Records the ground truth of a simulated plant at the end of every block; commands and blocks
/// pass through unchanged.
class TruthRecorder : public Plant {
 public:
  explicit TruthRecorder(SimulatedPlant& plant) : plant_(plant) {}
  PlantBlock next(const PlantCommand& command) override;
  TwinForceSensing* twinForce() override { return plant_.twinForce(); }

  /// Largest true contact force at the end of a block so far, all points together [N].
  double force() const { return force_; }
  /// Frame `peg` in `hole` at the result's reference time: what its estimates refer to.
  Pose startPose(const AlignResult& result) const;
  /// Measured less true direction [rad]. The contact rolls to and fro with the exciter: the true
  /// direction is the constant of a least-squares fit with the exciter's harmonic to the blocks'
  /// ends in the window. Nothing if fewer than 4 of them have exactly one contact.
  std::optional<double> directionError(const DirectionReading& reading) const;

 private:
  struct Record {
    double time;  // [s]
    Pose X_HP;
    double direction;  // of the contact that carries most, peg axes [rad]
    double angle;      // of the exciter [rad]
    int contacts;      // that carry force
  };
  SimulatedPlant& plant_;
  double frequency_ = 0.0, since_ = 0.0, force_ = 0.0;
  std::vector<Record> records_;
};

/// One simulated alignment with its evaluation by the ground truth.
struct AlignTrial {
  AlignResult result;
  std::string status;  ///< name of how it ended: of the failure, or of what stopped the simulation
  bool success = false;        ///< the strategy reports it and the edge is inside the hole
  bool false_success = false;  ///< the strategy reports it, and it isn't
  Eigen::Vector2d true_offset, true_tilt;  ///< as AlignResult's offset [m] and tilt [rad]
  Pose X_HP;                               ///< frame `peg` in `hole` at the end
  double force = 0.0;                      ///< largest, see TruthRecorder::force() [N]
  double depth = 0.0;                      ///< of its bottom centre below the plane then [m]
  std::vector<double> direction_errors;  ///< absolute, of the readings that can be evaluated [rad]
  double identification_time = 0.0;      ///< of cell time, where the run identified first [s]
};

/// Evaluates the end of a trial: success; false success if the edge is outside though the strategy
/// reported aligned, or the peg isn't where the strategy reported it seated.
void evaluateEnd(const Scenario& truth, const InsertParameters& insert, AlignTrial& trial);

/// Aligns in simulation from `start`; the strategy has `known` alone. An identified mechanism is
/// checked on the hanging peg first: one that contradicts it is refused (`wrong_mechanism`) before
/// any press, and its exciter's gain and delay are compensated. A simulation that
/// stops is a failure with its reason. Throws InputError.
AlignTrial tryAlignment(const Scenario& start, const KnownMechanism& known,
                        const CellParameters& cell, const AlignParameters& parameters,
                        const std::function<void(const AlignProgress&)>& progress = {});
/// The same after an identification that begins with `nominal` as the drawing, in the same run. One
/// that is refused leaves the drawing.
AlignTrial identifyAndAlign(const Scenario& start, const Mechanism& nominal,
                            const CellParameters& cell, const AlignParameters& parameters,
                            const std::function<void(const AlignProgress&)>& progress = {});
/// The same with a mechanism as drawn, which is not checked. `before`: what happens to the cell
/// first.
AlignTrial tryAlignment(const Scenario& start, const Mechanism& mechanism,
                        const CellParameters& cell, const AlignParameters& parameters,
                        const std::function<void(const AlignProgress&)>& progress = {},
                        const std::function<void(Plant&)>& before = {});

}  // namespace assembly_cell
