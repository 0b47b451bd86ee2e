// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <memory>
#include <vector>

#include "assembly_cell/align/estimation/block_pipeline.h"
#include "assembly_cell/align/estimation/sample_window.h"
#include "assembly_cell/align/estimation/twin_contacts.h"
#include "assembly_cell/align/plant.h"
#include "assembly_cell/cell/carrier_arm.h"
#include "assembly_cell/cell/simulated_cell.h"
#include "assembly_cell/identification/mechanism_record.h"

namespace assembly_cell {

/// The cell without ROS: mechanism, bridges, converters, calibrations and locus fit in one process.
/// Rest poses are in the carrier's base frame, see carrierBase(). With an arm (see CellParameters)
/// commands pass through its bridge, poses are those of its encoders, and a bridge that refuses or
/// holds is a PlantError.
class SimulatedPlant : public Plant {
 public:
  /// Simulates `scenario`; displacements and loci are computed from the nominal mechanism, as the
  /// driver and the estimator of a real cell do. X_AH: hole in sensor_a as assumed by twin-force
  /// sensing; parameters have the true pose. Throws InputError.
  SimulatedPlant(const Scenario& scenario, const Mechanism& nominal,
                 const CellParameters& parameters, const Pose& X_AH = CellParameters().X_AH);

  /// A step, see nextStep().
  PlantBlock next(const PlantCommand& command) override;
  TwinForceSensing* twinForce() override {
    return cell_.parameters().sensors == Sensors::kBoth ? &twin_force_ : nullptr;
  }

  /// From now on displacements and loci are computed from the identified mechanism, and commands of
  /// the exciter are compensated for its identified errors.
  void setMechanism(const KnownMechanism& identified);

  /// Ground truth, for the evaluation of a run; not for strategies.
  SimulatorBackend& truth() { return cell_.world(); }

 private:
  PlantBlock nextBlock(const PlantCommand& command);
  // one block of the cell; throws PlantError when its simulation stops
  void advance(const PlantCommand& command);
  void command(const PlantCommand& command);
  // passes the block's wrenches to the arm's bridge
  void addWrenchesToArm();
  void updateCoupling();
  // adds the block's samples to the windows that are open
  void collect(SampleWindow& window, bool wrench);

  Mechanism nominal_;
  Pose X_AH_;
  SimulatedCell cell_;
  BlockPipeline pipeline_;
  TwinForceContacts twin_force_;
  std::unique_ptr<CarrierArm> arm_;  // null: none
  std::vector<double> signals_;      // of a block, 6 × n
  StrainBlock block_;                // with an arm, whose bridge receives every sample
  StrainMeans means_;
  ExciterParameters exciter_;
  double exciter_reference_ = 0.0;
  DriveErrors drive_;
  SampleWindow locus_, vibration_;
};

}  // namespace assembly_cell
