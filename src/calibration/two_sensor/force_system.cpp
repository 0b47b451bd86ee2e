// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "force_system.h"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>

#include "assembly_cell/base/text.h"
#include "assembly_cell/sensor/bridge.h"

namespace assembly_cell {

namespace {

constexpr std::size_t kSharedZeros = 24;  // above this number their correlation is neglected

// ---- zeros ----

struct Zero {
  double stamp = 0.0;
  std::size_t order = 0;  // index of the observation
  Vector6 volts = Vector6::Zero();
  Matrix6 covariance = Matrix6::Zero();
};

struct Zeros {
  std::vector<Zero> list;
  bool merged = false;    // the converter hides drift and noise: one zero for all
  std::size_t first = 0;  // index of the first among the unknowns
  bool shared = true;
};

Zeros zerosOf(const ObservationSet& set, Side side) {
  const SensorDescription& sensor = set.sensor[side];
  Zeros zeros;
  for (std::size_t i = 0; i < set.observations.size(); ++i) {
    const Observation& o = set.observations[i];
    const auto& reading = o.reading[side];
    if (o.kind != ObservationKind::kUnloaded || !reading || unusable(*reading, sensor)) {
      continue;
    }
    zeros.list.push_back({o.stamp, i, reading->volts, reading->covariance});
  }
  if (zeros.list.empty()) return zeros;

  // the same offset gives the same code: repetition adds no information
  Vector6 low = zeros.list[0].volts, high = low, sum = Vector6::Zero();
  for (const Zero& zero : zeros.list) {
    low = low.cwiseMin(zero.volts);
    high = high.cwiseMax(zero.volts);
    sum += zero.volts;
  }
  if (sensor.noise < 0.5 * sensor.lsb() && (high - low).maxCoeff() <= 1.001 * sensor.lsb()) {
    zeros.merged = true;
    const auto count = static_cast<double>(zeros.list.size());
    zeros.list.resize(1);
    zeros.list[0].volts = sum / count;
  }
  return zeros;
}

// Strain of a test's reading against the zero at its time; refused where the zero has drifted.
CalibrationRefusal strainOf(const ObservationSet& set, std::size_t order, Side side,
                            const Zeros& zeros, SensorPart& part) {
  const SensorDescription& sensor = set.sensor[side];
  const Observation& o = set.observations[order];
  const Reading& reading = *o.reading[side];
  const std::string name = std::string("sensor ") + toString(side) + ": ";
  if (const CalibrationRefusal why = unusable(reading, sensor)) return {why.code, name + why.text};
  if (zeros.list.empty()) {
    return {CalibrationFailure::kNoZero, name + "no unloaded reading: add one before the test"};
  }
  std::size_t after = 0;
  while (after < zeros.list.size() && zeros.list[after].order < order) ++after;
  const std::size_t before = after > 0 ? after - 1 : 0;
  if (after == zeros.list.size() || zeros.merged) after = before;
  const Zero &z0 = zeros.list[before], &z1 = zeros.list[after];
  double weight = 0.0;
  if (after != before) {
    // drift between the unloaded readings around the test
    const double limit = std::max(3.0 * std::sqrt(sensor.variance(sensor.noise)), sensor.lsb());
    const double drift = (z1.volts - z0.volts).cwiseAbs().maxCoeff();
    if (drift > limit) {
      return {CalibrationFailure::kZeroDrifted,
              name + text("zero drifted by %.3g V (limit %.3g V): tare more often", drift, limit)};
    }
    if (z1.stamp > z0.stamp) {
      weight = std::clamp((o.stamp - z0.stamp) / (z1.stamp - z0.stamp), 0.0, 1.0);
    }
  }
  part.present = true;
  part.strain = reading.volts - (1.0 - weight) * z0.volts - weight * z1.volts;
  part.covariance = reading.covariance;
  if (zeros.shared) {
    part.zeros[0] = {static_cast<int>(zeros.first + before), 1.0 - weight};
    if (weight > 0.0) part.zeros[1] = {static_cast<int>(zeros.first + after), weight};
  } else {
    part.covariance +=
        (1.0 - weight) * (1.0 - weight) * z0.covariance + weight * weight * z1.covariance;
  }
  return {};
}

// loaded position of a point that moves with the carrier
Eigen::Vector3d loadedPoint(const Eigen::Vector3d& point, const Calibration& c,
                            const Vector6& strain, const Eigen::Vector3d& reference) {
  const Vector6 d = displacementFromVolts(c, c.zero_volts + strain);
  const Eigen::Vector3d corner = kCarrierAtRest - reference;  // O_C at rest in the sensor frame
  return corner + d.head<3>() + rotationFromVector({d.tail<3>()}) * (point - corner);
}

// Reference of a test: the other sensor, a weight, or no moment about a point.
void compareWithOther(const Observation& o, const ReferenceAccuracy* accuracy, int rows,
                      ForceTest& test) {
  test.X_AB = o.X_AB;
  test.part.a.K = Small::Identity(rows, rows);
  test.part.b.K = rows == 6 ? Small(wrenchTransform(o.X_AB)) : Small(o.X_AB.R);
  if (accuracy == nullptr) return;
  if (o.X_covariance) {
    test.pose_covariance = *o.X_covariance;
  } else {
    test.pose_covariance.diagonal()
        << Eigen::Vector3d::Constant(accuracy->position * accuracy->position),
        Eigen::Vector3d::Constant(accuracy->rotation * accuracy->rotation);
  }
}

void compareWithWeight(const Observation& o, double gravity, const ReferenceAccuracy* accuracy,
                       int rows, ForceTest& test) {
  test.part[o.side].K = Small::Identity(rows, rows);
  Vector6 w;
  const Eigen::Vector3d F = o.mass * gravity * o.direction;
  w << F, test.point.cross(F);
  test.known = w.head(rows);
  if (accuracy == nullptr) return;
  // (turn of the direction, relative mass, point)
  Eigen::Matrix<double, 6, 7> J = Eigen::Matrix<double, 6, 7>::Zero();
  J.topLeftCorner<3, 3>() = -skew(F);
  J.block<3, 1>(0, 3) = F;
  J.bottomLeftCorner<3, 4>() = skew(test.point) * J.topLeftCorner<3, 4>();
  J.bottomRightCorner<3, 3>() = -skew(F);
  Eigen::Matrix<double, 7, 1> variance;
  variance << Eigen::Vector3d::Constant(accuracy->direction * accuracy->direction),
      accuracy->mass * accuracy->mass, Eigen::Vector3d::Constant(test.point_variance);
  const Matrix6 C = J * variance.asDiagonal() * J.transpose();
  test.reference = C.topLeftCorner(rows, rows);
}

void compareMoments(const Observation& o, ForceTest& test) {
  Small& K = test.part[o.side].K;
  K = Small::Zero(3, 6);
  K.leftCols(3) = -skew(test.point);
  K.rightCols(3).setIdentity();
}

// Strains of all sensors that the observation concerns, and its point under load; or a refusal.
CalibrationRefusal readTest(const ObservationSet& set, const ForceSettings& settings,
                            const PerSide<Zeros>& zeros, ForceTest& test) {
  const Observation& o = set.observations[test.observation];
  for (const Side side : kSides) {
    if (!o.concerns(side)) continue;
    if (auto why = strainOf(set, test.observation, side, zeros[side], test.part[side])) return why;
  }
  test.point = o.point;
  if (!isOneSided(o.kind) || !o.point_at_rest) return {};
  if (settings.displacement[o.side] == nullptr) {
    return {CalibrationFailure::kNoDisplacement,
            std::string("sensor ") + toString(o.side) +
                ": the point is that at rest but no displacement calibration is given: identify "
                "the displacement first"};
  }
  test.point = loadedPoint(o.point, *settings.displacement[o.side], test.part[o.side].strain,
                           Bridge{}.reference_point);
  return {};
}

}  // namespace

void designRows(const ForceTest& test, int rows, int terms, const PerSide<Vector6>& strain,
                Eigen::Ref<Eigen::MatrixXd> A) {
  A.setZero();
  for (const Side side : kSides) {
    const SensorPart& part = test.part[side];
    if (!part.present) continue;
    const Eigen::Index first = side == Side::kA ? 0 : rows * terms;
    const Eigen::RowVectorXd x = strainTerms(strain[side], terms).transpose();
    for (int i = 0; i < test.equations; ++i) {
      for (int r = 0; r < rows; ++r) {
        A.block(i, first + r * terms, 1, terms) = part.K(i, r) * x;
      }
    }
  }
}

Eigen::MatrixXd designOf(const ForceSystem& system, int terms) {
  Eigen::MatrixXd A(equationsOf(system), 2 * system.rows * terms);
  Eigen::Index row = 0;
  for (const ForceTest& test : system.tests) {
    if (!test.used) continue;
    designRows(test, system.rows, terms, {test.part.a.strain, test.part.b.strain},
               A.middleRows(row, test.equations));
    row += test.equations;
  }
  return A;
}

int equationsOf(const ForceSystem& system) {
  int equations = 0;
  for (const ForceTest& test : system.tests) equations += test.used ? test.equations : 0;
  return equations;
}

Eigen::VectorXd strainTerms(const Vector6& strain, int terms) {
  Eigen::VectorXd x(terms);
  x.head<6>() = strain;
  if (terms == 27) x.tail<kStrainProducts>() = strainProducts(strain);
  return x;
}

PerSide<Eigen::MatrixXd> matricesOf(const Eigen::VectorXd& theta, int rows, int terms) {
  PerSide<Eigen::MatrixXd> S;
  for (const Side side : kSides) {
    S[side].resize(rows, terms);
    const int first = side == Side::kA ? 0 : rows;
    for (int r = 0; r < rows; ++r) {
      S[side].row(r) = theta.segment((first + r) * terms, terms).transpose();
    }
  }
  return S;
}

PerSide<Eigen::MatrixXd> nominalMatrices(const ObservationSet& set, int rows, int terms) {
  PerSide<Eigen::MatrixXd> S;
  for (const Side side : kSides) {
    S[side] = Eigen::MatrixXd::Zero(rows, terms);
    S[side].leftCols(6) = set.sensor[side].nominal.topRows(rows);
  }
  return S;
}

ForceSystem buildSystem(const ObservationSet& set, const ForceSettings& settings, int rows) {
  ForceSystem system;
  system.rows = rows;
  PerSide<Zeros> zeros = {zerosOf(set, Side::kA), zerosOf(set, Side::kB)};
  const bool shared = zeros.a.list.size() + zeros.b.list.size() <= kSharedZeros;
  for (const Side side : kSides) {
    zeros[side].shared = shared;
    zeros[side].first = system.zero_covariance.size();
    if (!shared) continue;
    for (const Zero& zero : zeros[side].list) system.zero_covariance.push_back(zero.covariance);
  }
  const ReferenceAccuracy* accuracy = settings.use_reference_covariance ? &set.accuracy : nullptr;
  for (std::size_t i = 0; i < set.observations.size(); ++i) {
    const Observation& o = set.observations[i];
    const bool indentation = o.kind == ObservationKind::kIndentation;
    if (!isForceTest(o.kind) || (indentation && rows != 6)) continue;
    ForceTest test;
    test.observation = i;
    test.kind = o.kind;
    test.equations = indentation ? 3 : rows;
    test.known = SmallVector::Zero(test.equations);
    test.reference = Small::Zero(test.equations, test.equations);
    if (accuracy != nullptr) test.point_variance = accuracy->point * accuracy->point;
    if (const CalibrationRefusal why = readTest(set, settings, zeros, test)) {
      system.dropped.emplace_back();
      system.dropped.back().observation = i;
      system.dropped.back().dropped = why;
      continue;
    }
    if (o.kind == ObservationKind::kReacting) {
      compareWithOther(o, accuracy, rows, test);
    } else if (indentation) {
      compareMoments(o, test);
    } else {
      compareWithWeight(o, set.gravity, accuracy, rows, test);
    }
    system.tests.push_back(test);
  }
  return system;
}

ForceSystem noiseFree(const ForceSystem& system, const ObservationSet& set) {
  ForceSystem out = system;
  PerSide<Matrix6> C;
  for (const Side side : kSides) C[side] = set.sensor[side].nominal.inverse();
  for (ForceTest& test : out.tests) {
    if (test.kind == ObservationKind::kReacting) {
      const Vector6 w = set.sensor.a.nominal * test.part.a.strain;
      test.part.b.strain = -C.b * transformWrench(inverse(test.X_AB), w);
      continue;
    }
    const Side side = test.part.a.present ? Side::kA : Side::kB;
    Vector6 w = set.sensor[side].nominal * test.part[side].strain;
    if (test.kind == ObservationKind::kWeight) w.head(system.rows) = test.known;
    if (test.kind == ObservationKind::kIndentation || system.rows == 3) {
      w.tail<3>() = test.point.cross(w.head<3>());
    }
    test.part[side].strain = C[side] * w;
  }
  return out;
}

}  // namespace assembly_cell
