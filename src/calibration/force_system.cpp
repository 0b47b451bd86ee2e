// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "force_system.h"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <cstdio>

#include "assembly_cell/sensor/bridge.h"

namespace assembly_cell {

namespace {

const Matrix6& nominalOf(const ObservationSet& set, Side side) {
  return side == Side::kA ? set.a.nominal : set.b.nominal;
}

constexpr std::size_t kSharedZeros = 24;  // beyond that their correlation is left out

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
  const SensorDescription& sensor = side == Side::kA ? set.a : set.b;
  Zeros zeros;
  for (std::size_t i = 0; i < set.observations.size(); ++i) {
    const Observation& o = set.observations[i];
    const auto& reading = side == Side::kA ? o.a : o.b;
    if (o.kind != ObservationKind::kUnloaded || !reading || !unusable(*reading, sensor).empty()) {
      continue;
    }
    zeros.list.push_back({o.stamp, i, reading->volts, reading->covariance});
  }
  if (zeros.list.empty()) return zeros;

  // the same offset falls on the same code: repetition teaches nothing
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

// strain of a reading: zero of its time, drift judged; returns why not
std::string strainOf(const Observation& o, std::size_t order, Side side, const ObservationSet& set,
                     const Zeros& zeros, Part& part) {
  const SensorDescription& sensor = side == Side::kA ? set.a : set.b;
  const Reading& reading = side == Side::kA ? *o.a : *o.b;
  const std::string name = std::string("sensor ") + toString(side) + ": ";
  const std::string why = unusable(reading, sensor);
  if (!why.empty()) return name + why;
  if (zeros.list.empty()) return name + "no unloaded reading: add one before the test";
  std::size_t after = 0;
  while (after < zeros.list.size() && zeros.list[after].order < order) ++after;
  const std::size_t before = after > 0 ? after - 1 : 0;
  if (after == zeros.list.size() || zeros.merged) after = before;
  const Zero &z0 = zeros.list[before], &z1 = zeros.list[after];
  double weight = 0.0;
  if (after != before) {
    // drift between the unloaded readings around the test
    const double one = std::sqrt(sensor.noise * sensor.noise + sensor.lsb() * sensor.lsb() / 12.0);
    const double limit = std::max(3.0 * one, sensor.lsb());
    const double drift = (z1.volts - z0.volts).cwiseAbs().maxCoeff();
    if (drift > limit) {
      char text[120];
      std::snprintf(text, sizeof text, "zero drifted by %.3g V (limit %.3g V): tare more often",
                    drift, limit);
      return name + text;
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
  return "";
}

// loaded position of a point that moves with the carrier
Eigen::Vector3d loadedPoint(const Eigen::Vector3d& point, const Calibration& c,
                            const Vector6& strain, const Eigen::Vector3d& reference) {
  const Vector6 d = displacementFromVolts(c, c.zero_volts + strain);
  const Eigen::Vector3d corner = kCarrierAtRest - reference;  // O_C at rest in the sensor frame
  return corner + d.head<3>() + rotationFromVector({d.tail<3>()}) * (point - corner);
}

}  // namespace

// rows of the design matrix of one test
void designRows(const ForceTest& test, int rows, int terms, const Vector6& a, const Vector6& b,
                Eigen::Ref<Eigen::MatrixXd> A) {
  A.setZero();
  const auto fill = [&](const Part& part, const Vector6& strain, Eigen::Index first) {
    if (!part.present) return;
    const Eigen::RowVectorXd x = strainTerms(strain, terms).transpose();
    for (int i = 0; i < test.equations; ++i) {
      for (int r = 0; r < rows; ++r) {
        A.block(i, first + r * terms, 1, terms) = part.K(i, r) * x;
      }
    }
  };
  fill(test.a, a, 0);
  fill(test.b, b, rows * terms);
}

Eigen::VectorXd strainTerms(const Vector6& strain, int terms) {
  Eigen::VectorXd x(terms);
  x.head<6>() = strain;
  if (terms == 27) x.tail<kStrainProducts>() = strainProducts(strain);
  return x;
}

ForceSystem buildSystem(const ObservationSet& set, const ForceSettings& settings, int rows) {
  ForceSystem system;
  system.rows = rows;
  std::array<Zeros, 2> zeros = {zerosOf(set, Side::kA), zerosOf(set, Side::kB)};
  for (Zeros& side : zeros) {
    side.shared = zeros[0].list.size() + zeros[1].list.size() <= kSharedZeros;
    side.first = system.zero_covariance.size();
    if (!side.shared) continue;
    for (const Zero& zero : side.list) system.zero_covariance.push_back(zero.covariance);
  }
  const ReferenceAccuracy& accuracy = set.accuracy;
  const Eigen::Vector3d reference = Bridge{}.reference_point;

  for (std::size_t i = 0; i < set.observations.size(); ++i) {
    const Observation& o = set.observations[i];
    const bool indentation = o.kind == ObservationKind::kIndentation;
    if (o.kind != ObservationKind::kReacting && o.kind != ObservationKind::kWeight &&
        !(indentation && rows == 6)) {
      continue;
    }
    ForceTest test;
    test.observation = i;
    test.kind = o.kind;
    test.equations = indentation ? 3 : rows;
    test.known = SmallVector::Zero(test.equations);
    test.reference = Small::Zero(test.equations, test.equations);
    const bool reacting = o.kind == ObservationKind::kReacting;
    std::string why;
    if (reacting || o.side == Side::kA) why = strainOf(o, i, Side::kA, set, zeros[0], test.a);
    if (why.empty() && (reacting || o.side == Side::kB)) {
      why = strainOf(o, i, Side::kB, set, zeros[1], test.b);
    }
    Part& part = o.side == Side::kA ? test.a : test.b;
    test.point = o.point;
    test.point_variance = settings.use_reference_covariance ? accuracy.point * accuracy.point : 0.0;
    if (why.empty() && !reacting && o.point_at_rest) {
      const Calibration* c = o.side == Side::kA ? settings.displacement_a : settings.displacement_b;
      if (c == nullptr) {
        why = std::string("sensor ") + toString(o.side) +
              ": the point is that at rest but no displacement calibration is given: identify the "
              "displacement first";
      } else {
        test.point = loadedPoint(o.point, *c, part.strain, reference);
      }
    }
    if (!why.empty()) {
      TestResult dropped;
      dropped.observation = i;
      dropped.dropped = why;
      system.dropped.push_back(dropped);
      continue;
    }
    if (reacting) {
      test.X_AB = o.X_AB;
      test.a.K = Small::Identity(rows, rows);
      test.b.K = rows == 6 ? Small(wrenchTransform(o.X_AB)) : Small(o.X_AB.R);
      if (settings.use_reference_covariance) {
        if (o.X_covariance) {
          test.pose_covariance = *o.X_covariance;
        } else {
          test.pose_covariance.diagonal()
              << Eigen::Vector3d::Constant(accuracy.position * accuracy.position),
              Eigen::Vector3d::Constant(accuracy.rotation * accuracy.rotation);
        }
      }
    } else if (indentation) {
      part.K = Small::Zero(3, 6);
      part.K.leftCols(3) = -skew(test.point);
      part.K.rightCols(3).setIdentity();
    } else {
      part.K = Small::Identity(rows, rows);
      Vector6 w;
      const Eigen::Vector3d F = o.mass * set.gravity * o.direction;
      w << F, test.point.cross(F);
      test.known = w.head(rows);
      if (settings.use_reference_covariance) {
        // (turn of the direction, relative mass, point)
        Eigen::Matrix<double, 6, 7> J = Eigen::Matrix<double, 6, 7>::Zero();
        J.topLeftCorner<3, 3>() = -skew(F);
        J.block<3, 1>(0, 3) = F;
        J.bottomLeftCorner<3, 4>() = skew(test.point) * J.topLeftCorner<3, 4>();
        J.bottomRightCorner<3, 3>() = -skew(F);
        Eigen::Matrix<double, 7, 1> variance;
        variance << Eigen::Vector3d::Constant(accuracy.direction * accuracy.direction),
            accuracy.mass * accuracy.mass, Eigen::Vector3d::Constant(test.point_variance);
        const Matrix6 C = J * variance.asDiagonal() * J.transpose();
        test.reference = C.topLeftCorner(rows, rows);
      }
    }
    system.tests.push_back(test);
  }
  return system;
}

ForceSystem noiseFree(const ForceSystem& system, const ObservationSet& set) {
  ForceSystem out = system;
  const Matrix6 C_a = nominalOf(set, Side::kA).inverse(), C_b = nominalOf(set, Side::kB).inverse();
  for (ForceTest& test : out.tests) {
    if (test.kind == ObservationKind::kReacting) {
      const Vector6 w = nominalOf(set, Side::kA) * test.a.strain;
      test.b.strain = -C_b * transformWrench(inverse(test.X_AB), w);
      continue;
    }
    const bool on_a = test.a.present;
    Part& part = on_a ? test.a : test.b;
    Vector6 w = nominalOf(set, on_a ? Side::kA : Side::kB) * part.strain;
    if (test.kind == ObservationKind::kWeight) w.head(system.rows) = test.known;
    if (test.kind == ObservationKind::kIndentation || system.rows == 3) {
      w.tail<3>() = test.point.cross(w.head<3>());
    }
    part.strain = (on_a ? C_a : C_b) * w;
  }
  return out;
}

}  // namespace assembly_cell
