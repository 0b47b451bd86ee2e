// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "problem.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>

#include "assembly_cell/align/estimation/contact_window.h"

namespace assembly_cell {

using Eigen::MatrixXd;
using Eigen::Vector3d;
using Eigen::VectorXd;

namespace {

constexpr double kLever = 0.03;   // lever of torques against forces [m]
constexpr double kFlat = 30.0;    // sd of an unknown zero [N]
constexpr double kMinute = 60.0;  // [s]
constexpr double kHeld = 10.0;  // from a position's zero to its readings, about: its zero walks [s]
constexpr double kDifference = 1e-5;         // of derivatives, in deviations of the prior
constexpr double kContactDifference = 1e-3;  // and by a static contact force [N]

// of three forces and three torques: the same, torques at the lever
Vector6 perAxis(double force) {
  Vector6 size;
  size << force, force, force, kLever * force, kLever * force, kLever * force;
  return size;
}

// A: covariance; whitens y and its derivative
void whiten(const MatrixXd& covariance, identification::Rows& rows) {
  const Eigen::LLT<MatrixXd> root(covariance);
  rows.residual = root.matrixL().solve(rows.residual);
  if (rows.jacobian.size() > 0) rows.jacobian = root.matrixL().solve(rows.jacobian);
}

// Prior sd of drift and random walk of the contact's zero since it was taken.
Vector6 driftOf(const IdentificationPrior& prior, const VibrationReading& reading) {
  return perAxis(prior.sensor_drift * reading.since_zero / kMinute);
}
Vector6 walkOf(const IdentificationPrior& prior) {
  return perAxis(prior.sensor_walk * std::sqrt(kHeld / kMinute));
}

// one below the other
identification::Rows joined(const std::vector<identification::Rows>& parts) {
  Eigen::Index count = 0, derivatives = 0, unknowns = 0;
  for (const identification::Rows& part : parts) {
    count += part.residual.size();
    derivatives += part.jacobian.rows();
    unknowns = part.jacobian.cols();
  }
  identification::Rows all{VectorXd(count), MatrixXd(derivatives, unknowns)};
  Eigen::Index row = 0;
  for (const identification::Rows& part : parts) {
    all.residual.segment(row, part.residual.size()) = part.residual;
    if (derivatives > 0) all.jacobian.middleRows(row, part.residual.size()) = part.jacobian;
    row += part.residual.size();
  }
  return all;
}

}  // namespace

MatrixXd sensorMapCovariance(const IdentificationPrior& prior) {
  MatrixXd covariance = MatrixXd::Zero(36, 36);
  // E: torque rows by forces times the lever, force rows by torques over it
  for (int column = 0; column < 6; ++column) {
    for (int row = 0; row < 6; ++row) {
      const double scale = (row < 3 ? 1.0 : kLever) / (column < 3 ? 1.0 : kLever);
      covariance(6 * column + row, 6 * column + row) = std::pow(prior.sensor_matrix * scale, 2);
    }
  }
  const auto add = [&covariance](const Matrix6& change, double sd) {
    const Eigen::Map<const VectorXd> direction(change.data(), 36);
    covariance += sd * sd * direction * direction.transpose();
  };
  for (int axis = 0; axis < 3; ++axis) {
    const Eigen::Matrix3d turn = skew(Vector3d::Unit(axis));
    Matrix6 change = Matrix6::Zero();
    change.topLeftCorner<3, 3>() = change.bottomRightCorner<3, 3>() = -turn;
    add(change, prior.sensor_rotation);
    change.setZero();
    change.bottomLeftCorner<3, 3>() = -turn;
    add(change, prior.sensor_offset);
  }
  return covariance;
}

namespace identification {

Problem::Problem(const Mechanism& nominal, const IdentificationData& data,
                 const IdentificationPrior& prior)
    : nominal_(nominal),
      data_(data),
      prior_(prior),
      map_root_(sensorMapCovariance(prior).llt().matrixL()) {
  for (const VibrationReading& reading : data.vibrations) {
    if (reading.place) places_ = std::max(places_, *reading.place + 1);
  }
}

MechanismModel Problem::model(const VectorXd& z) const {
  return modelAt(nominal_, prior_.unknowns, z.head<kUnknowns>());
}

// without drift and walk of the sensor's zero
Vector6 Problem::seenContact(const VectorXd& z, const VibrationReading& reading) const {
  return reading.contact - driftOf(prior_, reading).cwiseProduct(z.segment<6>(kDrift)) -
         walkOf(prior_).cwiseProduct(z.segment<6>(walkAt(*reading.place)));
}

Problem::Wave Problem::exactWave(const VectorXd& z, const VibrationReading& reading) const {
  if (!reading.place) return exactWave(z, reading, Vector6::Zero());
  return exactWave(z, reading, map(z).partialPivLu().solve(seenContact(z, reading)));
}

Problem::Wave Problem::exactWave(const VectorXd& z, const VibrationReading& reading,
                                 const Vector6& contact) const {
  WrenchPhasor phasor;
  const Eigen::Vector2d lean = prior_.upright * z.segment<2>(kFace);
  if (reading.place) {
    PressedState state;
    state.R_HS = rotationFromVector({Vector3d(lean.x(), lean.y(), 0.0)}) * reading.R_BS;
    state.contact = contact;
    state.aside = prior_.aside * z[kAside + *reading.place];
    phasor = pressedResponse(model(z), reading.exciter, state);
  } else {
    phasor = hangingResponse(model(z), reading.exciter, lean);
  }
  Wave wave;
  wave << phasor.real(), phasor.imag();
  return wave;
}

Vector6 Problem::exactWeight(const VectorXd& z, const PoseReading& reading) const {
  const Mechanism mechanism = model(z).mechanism;
  const Vector3d lean(z[kGravity], z[kGravity + 1], 0.0);
  const Vector3d up =
      (rotationFromVector({prior_.upright * lean}) * reading.R_BS).transpose() * mechanism.up;
  const Eigen::PartialPivLU<Matrix6> stiffness(couplingStiffness(mechanism.coupling));
  Vector6 deflection = Vector6::Zero(), weight;
  // the deflection moves the arm by a thousandth: twice is exact to 1e-6
  for (int k = 0; k < 2; ++k) {
    weight = pegWeight(mechanism.peg, mechanism.gravity, up, deflection);
    deflection = stiffness.solve(weight);
  }
  return weight;
}

Matrix6 Problem::map(const VectorXd& z) const {
  const VectorXd entries = map_root_ * z.segment<36>(kMap);
  return Matrix6::Identity() + Matrix6::Map(entries.data());
}

Eigen::Matrix<double, 6, 36> Problem::mapDerivative(const Vector6& wrench) const {
  Eigen::Matrix<double, 6, 36> derivative;
  for (int column = 0; column < 6; ++column) {
    derivative.middleCols<6>(6 * column) = wrench[column] * Matrix6::Identity();
  }
  return derivative * map_root_;
}

void Problem::addContact(const VectorXd& z, const VibrationReading& reading, const Wave& exact,
                         MatrixXd& jacobian) const {
  const Matrix6 seen = map(z);
  const Eigen::PartialPivLU<Matrix6> seen_inverse(seen);
  const Vector6 contact = seen_inverse.solve(seenContact(z, reading));
  const Vector6 step = perAxis(kContactDifference);
  Eigen::Matrix<double, 12, 6> by_contact;
  for (int i = 0; i < 6; ++i) {
    const Vector6 moved = contact + step[i] * Vector6::Unit(i);
    const Wave change = (exactWave(z, reading, moved) - exact) / step[i];
    by_contact.col(i) << seen * change.head<6>(), seen * change.tail<6>();
  }
  const Eigen::Matrix<double, 12, 6> by_seen = by_contact * seen_inverse.inverse();
  jacobian.middleCols<36>(kMap) -= by_seen * mapDerivative(contact);
  jacobian.middleCols<6>(kDrift) -= by_seen * driftOf(prior_, reading).asDiagonal();
  jacobian.middleCols<6>(walkAt(*reading.place)) -= by_seen * walkOf(prior_).asDiagonal();
}

WrenchPhasor Problem::fitted(const VectorXd& z, const VibrationReading& reading) const {
  const Wave exact = exactWave(z, reading);
  WrenchPhasor phasor;
  phasor.real() = map(z) * exact.head<6>();
  phasor.imag() = map(z) * exact.tail<6>();
  return phasor;
}

Rows Problem::rows(const VectorXd& z, const VibrationReading& reading, bool derivatives) const {
  const Matrix6 seen = map(z);
  Eigen::Matrix<double, 12, 12> both = Eigen::Matrix<double, 12, 12>::Zero();
  both.topLeftCorner<6, 6>() = both.bottomRightCorner<6, 6>() = seen;
  const Wave exact = exactWave(z, reading);
  Wave measured;
  measured << reading.phasor.real(), reading.phasor.imag();
  Rows rows;
  rows.residual = measured - both * exact;
  if (derivatives) {
    rows.jacobian = MatrixXd::Zero(12, size());
    const auto move = [&](int i) {
      VectorXd moved = z;
      moved[i] += kDifference;
      rows.jacobian.col(i) = both * (exactWave(moved, reading) - exact) / kDifference;
    };
    for (int i = 0; i < kUnknowns; ++i) move(i);
    rows.jacobian.block<6, 36>(0, kMap) = mapDerivative(exact.head<6>());
    rows.jacobian.block<6, 36>(6, kMap) = mapDerivative(exact.tail<6>());
    move(kFace);
    move(kFace + 1);
    if (reading.place) {
      addContact(z, reading, exact, rows.jacobian);
      move(kAside + *reading.place);
    }
  }
  const double force = reading.phasor.head<3>().cwiseAbs().maxCoeff();
  const Vector6 model_error =
      perAxis(force * (reading.place ? prior_.pressed_model : prior_.hanging_model));
  const Matrix6 noise = reading.covariance + Matrix6(model_error.cwiseAbs2().asDiagonal());
  Eigen::Matrix<double, 12, 12> covariance = Eigen::Matrix<double, 12, 12>::Zero();
  covariance.topLeftCorner<6, 6>() = covariance.bottomRightCorner<6, 6>() = noise;
  whiten(covariance, rows);
  return rows;
}

// not whitened: a zero that walks makes them one
Rows Problem::rows(const VectorXd& z, const PoseReading& reading, bool derivatives) const {
  const Matrix6 seen = map(z);
  const Vector6 zero = perAxis(kFlat), drift = perAxis(prior_.sensor_drift);
  const double minutes = reading.time / kMinute;
  const Vector6 exact = exactWeight(z, reading);
  Rows rows;
  rows.residual = reading.wrench - seen * exact - zero.cwiseProduct(z.segment<6>(kZero)) -
                  minutes * drift.cwiseProduct(z.segment<6>(kDrift));
  if (derivatives) {
    rows.jacobian = MatrixXd::Zero(6, size());
    const auto move = [&](int i) {
      VectorXd moved = z;
      moved[i] += kDifference;
      rows.jacobian.col(i) = seen * (exactWeight(moved, reading) - exact) / kDifference;
    };
    for (int i = 0; i < kUnknowns; ++i) move(i);
    for (const int i : {kGravity, kGravity + 1}) move(i);
    rows.jacobian.block<6, 36>(0, kMap) = mapDerivative(exact);
    rows.jacobian.block<6, 6>(0, kZero) = zero.asDiagonal();
    rows.jacobian.block<6, 6>(0, kDrift) = (minutes * drift).asDiagonal();
  }
  return rows;
}

Rows Problem::rowsOfPoses(const VectorXd& z, bool derivatives) const {
  const std::vector<PoseReading>& poses = data_.poses;
  std::vector<Rows> parts;
  const auto count = static_cast<Eigen::Index>(6 * poses.size());
  MatrixXd covariance = MatrixXd::Zero(count, count);
  const Vector6 walk = perAxis(prior_.sensor_walk).cwiseAbs2() / kMinute;
  for (std::size_t i = 0; i < poses.size(); ++i) {
    parts.push_back(rows(z, poses[i], derivatives));
    for (std::size_t k = 0; k < poses.size(); ++k) {
      covariance.block<6, 6>(6 * i, 6 * k).diagonal() =
          std::min(poses[i].time, poses[k].time) * walk;
    }
    covariance.block<6, 6>(6 * i, 6 * i) += poses[i].covariance;
  }
  Rows all = joined(parts);
  whiten(covariance, all);
  return all;
}

Rows Problem::rowsOfFriction(const VectorXd& z, bool derivatives) const {
  const auto coefficient = [&](const VectorXd& at) {
    return model(at).mechanism.friction.sliding_coefficient;
  };
  const double sd = data_.friction->sd;
  Rows rows;
  rows.residual = VectorXd::Constant(1, (data_.friction->coefficient - coefficient(z)) / sd);
  if (derivatives) {
    VectorXd moved = z;
    moved[kFriction] += kDifference;
    rows.jacobian = MatrixXd::Zero(1, size());
    rows.jacobian(0, kFriction) = (coefficient(moved) - coefficient(z)) / kDifference / sd;
  }
  return rows;
}

Rows Problem::rows(const VectorXd& z, bool held_out, bool derivatives) const {
  std::vector<Rows> parts;
  for (const VibrationReading& reading : data_.vibrations) {
    if (reading.held_out == held_out) parts.push_back(rows(z, reading, derivatives));
  }
  if (!held_out) {
    if (!data_.poses.empty()) parts.push_back(rowsOfPoses(z, derivatives));
    if (data_.friction) parts.push_back(rowsOfFriction(z, derivatives));
  }
  return joined(parts);
}

}  // namespace identification
}  // namespace assembly_cell
