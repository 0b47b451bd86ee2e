// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <complex>

#include "assembly_cell/identification/unknowns.h"

namespace assembly_cell {

// What an exact sensor_b would read of a mechanism that is shaken: phasors U of its wrench, force
// before torque, sensor axes about its origin, Re(U e^{ia}) with a the angle that the exciter was
// asked for. [N], [N·m]

using WrenchPhasor = Eigen::Matrix<std::complex<double>, 6, 1>;

/// The peg hanging free. lean: rotation vector x, y of the sensor's axis from upright [rad].
WrenchPhasor hangingResponse(const MechanismModel& model, const ExciterParameters& exciter,
                             const Eigen::Vector2d& lean);

/// How the peg is pressed on the face.
struct PressedState {
  Eigen::Matrix3d R_HS = Eigen::Matrix3d::Identity();  ///< sensor axes in the face's, z its normal
  /// Static wrench of the contact on the peg, as sensor_b tells it: the reading less that of the
  /// free peg, sensor axes about its origin [N], [N·m].
  Vector6 contact = Vector6::Zero();
  double aside = 0.0;  ///< of the contact from the lowest point of the edge, along it [rad]
};

/// One point of the peg's edge held by friction.
WrenchPhasor pressedResponse(const MechanismModel& model, const ExciterParameters& exciter,
                             const PressedState& state);

}  // namespace assembly_cell
