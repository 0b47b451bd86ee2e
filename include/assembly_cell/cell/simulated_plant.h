// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <memory>
#include <vector>

#include "assembly_cell/align/estimation/twin_contacts.h"
#include "assembly_cell/align/plant.h"
#include "assembly_cell/cell/carrier_arm.h"
#include "assembly_cell/cell/simulated_cell.h"
#include "assembly_cell/identification/mechanism_record.h"
#include "assembly_cell/sensor/calibration.h"

namespace assembly_cell {

/// The cell without ROS: mechanism, bridges, converters, calibrations and locus fit in one process.
/// Rest poses go in and out in the carrier's base frame, see carrierBase(). With an arm (see
/// CellParameters) commands go through its bridge, poses are those of its encoders, and a bridge
/// that refuses or holds is a PlantError.
class SimulatedPlant : public Plant {
 public:
  /// Simulates `scenario`; displacements and loci are computed from the nominal mechanism, as the
  /// driver and the estimator of a real cell do.
  /// X_AH: where twin-force sensing believes the hole in sensor_a; parameters have where it is.
  SimulatedPlant(const Scenario& scenario, const Mechanism& nominal,
                 const CellParameters& parameters, const Pose& X_AH = CellParameters().X_AH);

  /// A step, see nextStep().
  PlantBlock next(const PlantCommand& command) override;
  TwinForceSensing* twinForce() override { return &twin_force_; }

  /// From now on computes displacements and loci from what is known, and asks the exciter for what
  /// makes the force come as commanded.
  void know(const KnownMechanism& known);

  /// For the judge of a run only: no strategy sees it.
  SimulatorBackend& truth() { return cell_.world(); }

 private:
  // Samples in a requested window: exciter's angle, and 6 × n displacements or wrenches.
  struct Window {
    std::optional<LocusRequest> request;
    std::vector<double> angles, signals;

    void begin(const LocusRequest& wanted);
    bool endsBefore(double time) const;
    // the plant's samples up to then may lie in it
    bool beginsBy(double time) const;
  };
  PlantBlock nextBlock(const PlantCommand& command);
  // one block of the cell; throws PlantError when its simulation stops
  void advance(const PlantCommand& command);
  // the arm feels the block
  void tellArm();
  PlantBlock means() const;
  // the samples at hand that lie in the window
  void collect(Window& window, bool wrench);

  Mechanism nominal_;
  Pose X_AH_;
  SimulatedCell cell_;
  Calibration calibration_a_, calibration_b_;
  Matrix6 rounding_a_, rounding_b_;
  TwinForceContacts twin_force_;
  std::unique_ptr<CarrierArm> arm_;          // null: none
  std::array<std::vector<double>, 2> felt_;  // by its sensors, 6 × n
  StrainBlock block_;                        // of an arm, which feels every sample
  StrainMeans means_;
  ExciterParameters exciter_;
  double exciter_reference_ = 0.0;
  DriveErrors drive_;
  Window locus_, vibration_;
};

}  // namespace assembly_cell
