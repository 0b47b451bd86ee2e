// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <functional>
#include <optional>
#include <vector>

#include "assembly_cell/align/align.h"
#include "assembly_cell/cell/simulated_plant.h"
#include "assembly_cell/identification/mechanism_record.h"

namespace assembly_cell {

/// A simulated plant with somebody who looks on: passes all commands and blocks on unchanged and
/// remembers the truth at the end of every block.
class Judge : public Plant {
 public:
  explicit Judge(SimulatedPlant& plant) : plant_(plant) {}
  PlantBlock next(const PlantCommand& command) override;
  TwinForceSensing* twinForce() override { return plant_.twinForce(); }

  /// The greatest true contact force at the end of a block so far: all points together [N]
  double force() const { return force_; }
  /// Frame `peg` in `hole` at the result's reference time: what its estimates refer to.
  Pose startPose(const AlignResult& result) const;
  /// Direction felt less the true one [rad]. The contact rolls to and fro with the exciter: the
  /// truth is the constant of a least-squares fit with the exciter's harmonic to the blocks' ends
  /// in the window. Nothing where fewer than 4 of them see one and the same contact.
  std::optional<double> directionError(const DirectionReading& reading) const;

 private:
  struct Look {
    double time;  // [s]
    Pose X_HP;
    double direction;  // of the contact that carries most, peg axes [rad]
    double angle;      // of the exciter [rad]
    int contacts;      // that carry force
  };
  SimulatedPlant& plant_;
  double frequency_ = 0.0, since_ = 0.0, force_ = 0.0;
  std::vector<Look> looks_;
};

/// One simulated alignment and what the truth says of it.
struct AlignTrial {
  AlignResult result;
  std::string status;  ///< name of how it ended: of the failure, or of what stopped the simulation
  bool success = false;                    ///< the strategy says so and the edge is inside the hole
  bool false_success = false;              ///< the strategy says so, and it isn't
  Eigen::Vector2d true_offset, true_tilt;  ///< as AlignResult's offset [m] and tilt [rad]
  Pose X_HP;                               ///< frame `peg` in `hole` at the end
  double force = 0.0;                      ///< the greatest on the way, see Judge::force() [N]
  double depth = 0.0;                      ///< of its bottom centre below the plane then [m]
  std::vector<double> direction_errors;    ///< of the readings that can be judged, absolute [rad]
  double identification_time = 0.0;        ///< of cell time, where the run identified first [s]
};

/// What the end says of the trial: success, and an edge outside though the strategy said aligned,
/// or a peg that isn't where the strategy said it is seated.
void judgeEnd(const Scenario& truth, const InsertParameters& insert, AlignTrial& trial);

/// Aligns in simulation from `start`; the strategy knows `known` alone. What was identified is
/// checked on the hanging peg first: a mechanism that it contradicts is refused (`wrong_mechanism`)
/// before anything is pressed, and its exciter's gain and delay are made up for. A simulation that
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
