// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <cstdint>
#include <functional>
#include <limits>
#include <memory>
#include <optional>
#include <vector>

#include "assembly_cell/cell/block_means.h"
#include "assembly_cell/cell/measured_wrench.h"
#include "assembly_cell/cell/true_carrier.h"
#include "assembly_cell/cell/world_choice.h"
#include "assembly_cell/mechanism/sensors.h"
#include "assembly_cell/mismatch/truth.h"
#include "assembly_cell/sensor/bridge.h"
#include "assembly_cell/sensor/calibration.h"

namespace assembly_cell {

struct ArmSetup;

/// Calibration of a bridge by its design: S = C^-1, offsets removed. With a coupling, the
/// displacement map of the sensor that is this coupling: its static compliance times the wrench.
/// Throws InputError for a coupling without a static map (singular stiffness).
Calibration designCalibration(const Bridge& bridge);
Calibration designCalibration(const Bridge& bridge, const CouplingParameters& coupling);

/// What the simulated cell is made of besides the mechanism.
struct CellParameters {
  int bits = 16;                     ///< converter: 10, 16 or 24
  double noise = 0.5e-3;             ///< of every channel, rms [V]
  double sample_period = 2e-4;       ///< [s]
  int block_size = 100;              ///< samples a block
  Sensors sensors = Sensors::kBoth;  ///< without sensor_a its samples are 0
  std::uint64_t seed = 1;            ///< of the sensors' noise
  Pose X_AH{Eigen::Matrix3d::Identity(), Eigen::Vector3d(0, 0, 0.06)};  ///< hole in sensor_a
  double hole_block_mass = 2.0;                    ///< carried by sensor_a [kg]
  Eigen::Vector3d hole_block_center{0, 0, -0.02};  ///< its centre of mass in `hole` [m]
  double accelerometer_noise = 0.02;  ///< of either accelerometer on the peg, white, rms [m/s²]
  double accelerometer_height = 0.0;  ///< above the peg's centre of mass, on its axis [m]
  CellTruth truth;                    ///< of sensors and carrier, exact by default
  double bridge_nonlinearity = 0.0;   ///< of both bridges, see Bridge: 0 linear to 1 as built
  double bridge_drift = 0.0;          ///< of their temperature, from Bridge's own on [K/h]
  WorldChoice world;                  ///< what simulates the mechanism
  /// SimulatedPlant only: calibrations of the drivers; none: designCalibration(). One
  /// of sensor_b without a displacement map gets the coupling's.
  std::optional<Calibration> calibration_a, calibration_b;
  /// SimulatedPlant only: an arm carries the carrier, see CarrierArm; null: it goes as commanded.
  std::shared_ptr<const ArmSetup> arm;
};

/// A block of samples of both bridges. Sample k is at time + k·period.
struct StrainBlock {
  double time = 0.0;    ///< of sample 0, simulation clock [s]
  double period = 0.0;  ///< [s]
  std::uint32_t sequence = 0;
  std::vector<double> volts_a, volts_b;                ///< 6 × n, sample after sample [V]
  std::vector<std::uint8_t> saturated_a, saturated_b;  ///< bit per channel, per sample
  double temperature = 0.0;                            ///< of both bridges at the last sample [°C]
  std::vector<double>
      accelerations;  ///< 2 × n, along the peg's x and y [m/s²]; empty unless requested
};

/// Moments of a block of samples of both bridges, and the samples that are requested. [V]
struct StrainMeans {
  BlockMoments a, b;
  bool saturated = false;       ///< any channel in any sample
  double end = 0.0;             ///< time of the last sample [s]
  std::vector<double> volts_b;  ///< of sensor_b, 6 × all that were requested, or the last one alone
};
/// All of a block.
void meansOf(const StrainBlock& block, StrainMeans& means);

/// The mechanism with both strain bridges: the plant behind the simulator node and behind align().
class SimulatedCell {
 public:
  /// The carrier's base is where the scenario starts, or at X_HB in `hole`.
  SimulatedCell(const Scenario& scenario, const CellParameters& parameters);
  SimulatedCell(const Scenario& scenario, const CellParameters& parameters, const Pose& X_HB);

  /// Advances by one block and fills it (no allocation once `block` has its size). The first sample
  /// is one period after the present time, the last at the block's end. Returns the world's
  /// stop reason; after anything but kOk the block is not valid. accelerations: the two
  /// accelerometers of the peg, too; the bridges' samples are the same either way. watch: receives
  /// the coupling's load at every sample, and may command the world.
  StopReason next(StrainBlock& block, bool accelerations = false,
                  const std::function<void(const Vector6& load)>& watch = nullptr);

  /// When that block will end, in the world's time [s].
  double nextEnd() const {
    return static_cast<double>(samples_ + static_cast<std::uint64_t>(parameters_.block_size)) *
           parameters_.sample_period;
  }

  /// The same without the samples that are not read. The wrench is found at every millisecond, and
  /// often enough for a motion at `fastest` [rad/s]; means and covariances are as those of a block,
  /// see BlockMeans. At rest they are those of the samples; of a vibration of 2 N sensor_b has 1.5
  /// mN left, sensor_a, where friction jumps between slip and stick, up to 0.4 N. Where samples
  /// depend on each other, or the converter's codes show, all are made. samples_b: sensor_b's are,
  /// in any case.
  StopReason average(StrainMeans& means, double fastest, bool samples_b);

  /// Moves the rest pose to `pose`, commanded in the carrier's base frame, within the carrier's
  /// limits and no faster than `max_speed` [m/s].
  void command(const Pose& pose, double max_speed = std::numeric_limits<double>::infinity()) {
    carrier_.command(*world_, pose, max_speed);
  }
  /// Stops the rest pose at once within the carrier's maximum acceleration.
  void stop() { carrier_.stop(*world_); }
  /// The carrier as its encoders report it at the end of the last block, in its base frame.
  const Pose& reported() const { return reported_; }
  const TrueCarrier& carrier() const { return carrier_; }

  SimulatorBackend& world() { return *world_; }
  const CellParameters& parameters() const { return parameters_; }

 private:
  Eigen::Vector2d accelerometers();
  /// Six voltages of a bridge under wrench w.
  Vector6 voltsOf(const Bridge& bridge, const Matrix6& strain_matrix, const Vector6& w) const;
  /// Strain volts of either bridge at `time`, the world's: also sets the bridges' temperature.
  Vector6 voltsA(double time);
  Vector6 voltsB(const Vector6& load, double time);
  void warm(double time);
  void meetBurr();

  CellParameters parameters_;
  std::unique_ptr<SimulatorBackend> world_;
  TrueCarrier carrier_;
  Pose reported_;
  MeasuredWrench measured_a_, measured_b_;
  Bridge bridge_a_, bridge_b_;
  Matrix6 strain_matrix_a_, strain_matrix_b_;
  NormalSource normal_a_, normal_b_, normal_accelerometers_;
  Vector6 block_weight_;         ///< of the hole block on sensor_a, in sensor_a
  FrictionParameters friction_;  ///< outside of the burr
  bool in_burr_ = false;
  std::uint32_t sequence_ = 0;
  std::uint64_t samples_ = 0;
  StrainBlock whole_;  // where average() makes all samples
};

}  // namespace assembly_cell
