// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <array>
#include <cstdint>
#include <limits>
#include <optional>
#include <string>
#include <vector>

#include "assembly_cell/calibration/common/failure.h"
#include "assembly_cell/calibration/observations/dial_gauge.h"
#include "assembly_cell/geometry/spatial.h"

namespace assembly_cell {

class FieldList;

/// What was done to the sensors while their strain was read.
enum class ObservationKind {
  kUnloaded,      ///< nothing touches: the zero of the loaded readings that follow
  kReacting,      ///< the two sensors press on each other at a known relative pose
  kWeight,        ///< a known mass hangs at a known point of one sensor
  kIndentation,   ///< a force of unknown size and direction through a known point of one sensor
  kDisplacement,  ///< the carrier of one sensor moved, its pose read from dial gauges
  kLinearity,     ///< one step of the linearity test of one sensor (thesis Appendix 2)
};

enum class Side { kA, kB };
constexpr std::array<Side, 2> kSides = {Side::kA, Side::kB};

/// One of each sensor.
template <typename T>
struct PerSide {
  T a{}, b{};
  T& operator[](Side side) { return side == Side::kA ? a : b; }
  const T& operator[](Side side) const { return side == Side::kA ? a : b; }
};

/// unloaded, reacting, weight, indentation, displacement, linearity; a, b.
const char* toString(ObservationKind kind);
const char* toString(Side side);
std::optional<ObservationKind> observationKind(const std::string& name);
constexpr const char* kObservationKinds =
    "unloaded, reacting, weight, indentation, displacement or linearity";
/// "sensor_a", "sensor_b": how topics, folders and messages call it.
std::string sensorName(Side side);

/// Weights, indentations, displacements and linearity tests have a `side`.
inline bool isOneSided(ObservationKind kind) {
  return kind != ObservationKind::kUnloaded && kind != ObservationKind::kReacting;
}
/// Equations of the strain-to-wrench maps follow from it.
inline bool isForceTest(ObservationKind kind) {
  return kind == ObservationKind::kReacting || kind == ObservationKind::kWeight ||
         kind == ObservationKind::kIndentation;
}

/// The settled strain of one sensor: the mean of a window of samples.
struct Reading {
  Vector6 volts = Vector6::Zero();       ///< mean [V]
  Matrix6 covariance = Matrix6::Zero();  ///< of the mean, quantisation included [V²]
  Vector6 noise = Vector6::Zero();       ///< of one sample, from differences of neighbours [V]
  Vector6 spread = Vector6::Zero();      ///< standard deviation of one sample in the window [V]
  int samples = 1;
  std::uint8_t saturated = 0;  ///< bit k: channel k in any sample
  double temperature = std::numeric_limits<double>::quiet_NaN();  ///< [°C], NaN if unknown
};

/// One test. Which fields matter depends on `kind`. Frames: the sensor frames (axes of the datum,
/// origin at the reference point); wrenches act on the part the sensor carries.
struct Observation {
  ObservationKind kind = ObservationKind::kUnloaded;
  std::string id;        ///< free text without control characters, may be empty
  double stamp = 0.0;    ///< of the middle of the window [s]
  Side side = Side::kA;  ///< weight, indentation, displacement, linearity: which sensor
  PerSide<std::optional<Reading>> reading;
  Pose X_AB;                            ///< reacting: pose of sensor B in sensor A
  std::optional<Matrix6> X_covariance;  ///< reacting: (dp, dφ) in axes of A; default: accuracy
  double mass = 0.0;                    ///< weight [kg]
  Eigen::Vector3d direction{0, 0, -1};  ///< weight: of gravity, unit, sensor axes
  Eigen::Vector3d point{0, 0, 0};       ///< weight, indentation: where the load acts [m]
  bool point_at_rest = false;           ///< `point` is that of the unloaded sensor: it moves along
  std::vector<double> gauges;           ///< displacement: readings in the order of the layout [m]
  std::optional<Vector6> displacement;  ///< displacement: instead of gauges, pose rel. to rest
  double load = 0.0;                    ///< linearity: set load in any unit
  int channel = 0;                      ///< linearity: 0 … 5

  /// Its readings are of this sensor (an unloaded reading may lack one).
  bool concerns(Side s) const { return !isOneSided(kind) || side == s; }
};

/// The converter and the rough size of a sensor, as its maker states them.
struct SensorDescription {
  std::string serial_number;
  int bits = 16;            ///< of the converter: 10, 16 or 24
  double full_scale = 5.0;  ///< ± of the converter [V]
  double noise = 0.5e-3;    ///< of one sample, rms [V]
  Matrix6 nominal;          ///< S by the drawing: volts to wrench in the sensor frame, from which
                            ///< designs are evaluated before the first measurement

  SensorDescription();  ///< nominal: nominalBridge()

  double lsb() const;           ///< [V]
  double quantisation() const;  ///< variance of the converter's steps [V²]
  /// Variance of the mean of samples with this standard deviation: noise² + q²/12, divided by their
  /// number only where the noise dithers the converter (noise ≥ q/2) [V²].
  double variance(double sd, int samples = 1) const;
};
/// All but the nominal matrix.
void fields(FieldList& f, SensorDescription& sensor);

/// One standard deviation of what the tests are compared with.
struct ReferenceAccuracy {
  double direction = 0.3e-3;  ///< of a weight [rad]
  double mass = 3e-5;         ///< of a weight, relative
  double point = 5e-6;        ///< of a weight or indentation, per axis [m]
  double position = 20e-6;    ///< of a relative pose, per axis [m]
  double rotation = 0.3e-3;   ///< of a relative pose, per axis [rad]
  double gauge = 1e-6;        ///< of a dial gauge [m]
};
void fields(FieldList& f, ReferenceAccuracy& accuracy);

/// All that was measured, in the order of time.
struct ObservationSet {
  PerSide<SensorDescription> sensor;
  double gravity = 9.80665;  ///< [m/s²]
  ReferenceAccuracy accuracy;
  PerSide<GaugeLayout> gauges;  ///< of displacement tests
  std::vector<Observation> observations;
};

/// Mean of a settled window with its covariance (SensorDescription::variance). Noise is that of
/// neighbouring differences for 30 samples and more, the sensor's stated one below. Throws
/// InputError for an empty window or different sizes.
Reading averageReading(const std::vector<Vector6>& volts,
                       const std::vector<std::uint8_t>& saturated, const SensorDescription& sensor);

/// Saturated or unsettled (spread > 5 times the noise of one sample), or nothing when usable.
CalibrationRefusal unusable(const Reading& reading, const SensorDescription& sensor);

/// Throws InputError, one line beginning with `source`: what makes this observation unusable as
/// such (readings missing, not finite, mass not positive, direction no unit vector, rotation no
/// rotation, too few gauges …). Saturated readings pass: the solver drops and reports them.
void checkObservation(const Observation& observation, const ObservationSet& set,
                      const std::string& source);

/// One line of the observation file, without the end of line; reads back to the same bits, but
/// for the rounding of a rotation to its quaternion.
std::string observationLine(const Observation& observation);

/// The file up to and with `observations:`.
std::string observationHeader(const ObservationSet& set);

/// The whole observation file.
std::string observationsText(const ObservationSet& set);

/// Reads an observation file: YAML with one observation a line (docs/how_to/calibration.md), CSV by
/// named columns (path ends in .csv), or the last message of a server's ~observations (a .bag).
/// Throws InputError naming file and line or key.
ObservationSet readObservations(const std::string& path);

/// Writes the whole file atomically (temporary file, fsync, rename). Throws InputError.
void writeObservations(const ObservationSet& set, const std::string& path);

/// One record as observationLine() writes it. Throws InputError beginning with `source`.
Observation parseObservation(const std::string& line, const ObservationSet& set,
                             const std::string& source);

/// "crc32:" and eight digits over header and observations: what a calibration was made from.
std::string observationsDigest(const ObservationSet& set);

}  // namespace assembly_cell
