// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <complex>

#include "assembly_cell/identification/unknowns.h"

namespace assembly_cell {

// Wrench phasors U of an exact sensor_b on an excited mechanism, force before torque, sensor axes
// about its origin, Re(U e^{ia}) with a the commanded angle of the exciter. [N], [N·m]

using WrenchPhasor = Eigen::Matrix<std::complex<double>, 6, 1>;

/// The peg hanging free. lean: rotation vector x, y of the sensor's axis from upright [rad].
WrenchPhasor hangingResponse(const MechanismModel& model, const ExciterParameters& exciter,
                             const Eigen::Vector2d& lean);

/// State of the peg pressed on the face.
struct PressedState {
  Eigen::Matrix3d R_HS = Eigen::Matrix3d::Identity();  ///< sensor axes in the face's, z its normal
  /// Static wrench of the contact on the peg by sensor_b: reading minus that of the free peg,
  /// sensor axes about its origin [N], [N·m].
  Vector6 contact = Vector6::Zero();
  double aside = 0.0;  ///< angle along the edge from its lowest point to the contact [rad]
};

/// One point of the peg's edge held by friction.
WrenchPhasor pressedResponse(const MechanismModel& model, const ExciterParameters& exciter,
                             const PressedState& state);

}  // namespace assembly_cell
