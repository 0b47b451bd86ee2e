// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/calibration/two_sensor/plan.h"

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <algorithm>
#include <array>
#include <cmath>

#include "assembly_cell/base/input_error.h"
#include "assembly_cell/base/text.h"
#include "assembly_cell/calibration/two_sensor/displacement.h"
#include "assembly_cell/sensor/bridge.h"
#include "force_system.h"

namespace assembly_cell {

namespace {

constexpr double kHalfCube = 0.030;     // reference point to a mating face [m]
constexpr double kSpread = 0.020;       // of contact points on a face [m]
constexpr double kMatingShift = 0.010;  // of one mating against another [m]
constexpr double kMass = 3.0;           // [kg]
constexpr double kStrainRange = 4.0;    // [V]
constexpr double kPriorSd = 10.0;  // prior sd of an unknown coefficient, relative to the nominal

// 24 orientations of a cube
std::vector<Eigen::Matrix3d> cubeTurns() {
  std::vector<Eigen::Matrix3d> out;
  for (int x = 0; x < 3; ++x) {
    for (int y = 0; y < 3; ++y) {
      if (x == y) continue;
      for (const double sx : {1.0, -1.0}) {
        for (const double sy : {1.0, -1.0}) {
          Eigen::Matrix3d R;
          R.col(0) = sx * Eigen::Vector3d::Unit(x);
          R.col(1) = sy * Eigen::Vector3d::Unit(y);
          R.col(2) = R.col(0).cross(R.col(1));
          out.push_back(R);
        }
      }
    }
  }
  return out;
}

class Draw {
 public:
  explicit Draw(std::uint64_t seed) : normal_(seed) {}
  double uniform(double low, double high) {
    return low + (high - low) * 0.5 * (1.0 + std::erf(normal_() / std::sqrt(2.0)));
  }
  Eigen::Vector3d direction() {
    const double z = normal_(), y = normal_(), x = normal_();
    return Eigen::Vector3d(x, y, z).normalized();
  }
  Eigen::Vector3d box(double half) {
    return {uniform(-half, half), uniform(-half, half), uniform(-half, half)};
  }

 private:
  NormalSource normal_;
};

// Cube B on a face of cube A; contact at a random point of the common face.
LoadRequest reacting(Draw& draw, const Pose& X_AB, const RatedLoad& rated) {
  LoadRequest request;
  request.target.kind = ObservationKind::kReacting;
  request.target.X_AB = X_AB;
  // middle of the common face, and a point on it
  const Eigen::Vector3d middle = 0.5 * X_AB.p;
  Eigen::Index across = 0;
  X_AB.p.cwiseAbs().maxCoeff(&across);
  Eigen::Vector3d offset = draw.box(kSpread);
  offset[across] = 0.0;
  const Eigen::Vector3d direction = draw.direction();
  const Eigen::Vector3d F = draw.uniform(0.3, 1.0) * rated.force * direction;
  request.wrench << F, (middle + offset).cross(F);
  return request;
}

// Load of sensors that are bolted together: any wrench within the rated load of both.
LoadRequest bolted(Draw& draw, const Pose& X_AB, const RatedLoad& rated) {
  LoadRequest request;
  request.target.kind = ObservationKind::kReacting;
  request.target.X_AB = X_AB;
  Vector6 w_b;
  do {
    request.wrench << draw.box(rated.force), draw.box(rated.torque);
    w_b = transformWrench(inverse(X_AB), request.wrench);
  } while (w_b.tail<3>().cwiseAbs().maxCoeff() > rated.torque);
  return request;
}

Pose mating(Draw& draw, const Eigen::Matrix3d& R, std::size_t face) {
  Eigen::Vector3d p = draw.box(kMatingShift);
  const auto axis = static_cast<Eigen::Index>(face % 3);
  p[axis] = (face % 2 == 0 ? 2.0 : -2.0) * kHalfCube;
  return {R, p};
}

LoadRequest weight(Draw& draw, Side side, std::size_t k, double mass) {
  LoadRequest request;
  Observation& o = request.target;
  o.kind = ObservationKind::kWeight;
  o.side = side;
  o.mass = mass;
  const auto axis = static_cast<Eigen::Index>(k % 3);
  o.direction = (k % 6 < 3 ? 1.0 : -1.0) * Eigen::Vector3d::Unit(axis);
  o.point = draw.box(kSpread);
  o.point[axis] = (k % 6 < 3 ? 1.0 : -1.0) * kHalfCube;
  return request;
}

LoadRequest indentation(Draw& draw, Side side, std::size_t k, const RatedLoad& rated) {
  LoadRequest request;
  Observation& o = request.target;
  o.kind = ObservationKind::kIndentation;
  o.side = side;
  // indentations on the faces near the corners
  o.point = kHalfCube * Eigen::Vector3d((k & 1) != 0 ? 0.9 : -0.9, (k & 2) != 0 ? 0.9 : -0.9,
                                        (k & 4) != 0 ? 0.9 : -0.9);
  o.point[static_cast<Eigen::Index>(k % 3)] *= draw.uniform(0.2, 1.0);
  const Eigen::Vector3d F = draw.box(rated.force);
  request.wrench << F, o.point.cross(F);
  return request;
}

LoadRequest unloaded() {
  LoadRequest request;
  request.target.kind = ObservationKind::kUnloaded;
  return request;
}

// strain of the last unloaded reading; zero without one
Vector6 lastZero(const ObservationSet& set, Side side) {
  Vector6 zero = Vector6::Zero();
  for (const Observation& o : set.observations) {
    const auto& reading = o.reading[side];
    if (o.kind == ObservationKind::kUnloaded && reading) zero = reading->volts;
  }
  return zero;
}

std::string triple(const char* pattern, const Eigen::Vector3d& v) {
  return text(pattern, v.x(), v.y(), v.z());
}

// the readings that the nominal sensors would give, free of noise
Observation predictReadings(const LoadRequest& request, const ObservationSet& set) {
  Observation o = request.target;
  o.point_at_rest = false;
  PerSide<Vector6> wrench = {Vector6::Zero(), Vector6::Zero()};
  Vector6& w = wrench[o.side];
  if (o.kind == ObservationKind::kReacting) {
    wrench.a = request.wrench;
    wrench.b = -transformWrench(inverse(o.X_AB), wrench.a);
  } else if (o.kind == ObservationKind::kWeight) {
    const Eigen::Vector3d F = o.mass * set.gravity * o.direction;
    w << F, o.point.cross(F);
  } else if (o.kind == ObservationKind::kIndentation) {
    const Eigen::Vector3d F = request.wrench.head<3>();
    w << F, o.point.cross(F);
  } else if (o.kind == ObservationKind::kDisplacement) {
    w = set.sensor[o.side].nominal * (kStrainRange * request.strain);
  } else if (o.kind == ObservationKind::kLinearity) {
    w = request.wrench;
  }
  for (const Side side : kSides) {
    if (!o.concerns(side)) continue;
    const SensorDescription& sensor = set.sensor[side];
    Reading& r = o.reading[side].emplace();
    r.volts = lastZero(set, side) + sensor.nominal.inverse() * wrench[side];
    r.covariance.diagonal().setConstant(sensor.variance(sensor.noise));
    // zeros are averaged until they no longer count
    if (o.kind == ObservationKind::kUnloaded) r.covariance *= 0.01;
  }
  if (o.kind == ObservationKind::kDisplacement && o.gauges.empty() && !o.displacement) {
    o.displacement = Vector6::Zero();
  }
  return o;
}

}  // namespace

std::string describe(const LoadRequest& request) {
  const Observation& o = request.target;
  const std::string sensor = std::string("sensor ") + toString(o.side);
  const Eigen::Vector3d force = request.wrench.head<3>(), torque = request.wrench.tail<3>();
  switch (o.kind) {
    case ObservationKind::kUnloaded:
      return "unload both sensors and read their zero";
    case ObservationKind::kReacting: {
      const Eigen::Vector3d turn = vectorFromRotation(o.X_AB.R).value * 180.0 / M_PI;
      return triple("sensor b in a at (%.0f, %.0f, %.0f) mm", 1e3 * o.X_AB.p) +
             triple(", turned by (%.0f, %.0f, %.0f) deg", turn) +
             triple("; press on a with about (%.0f, %.0f, %.0f) N", force) +
             triple(" and (%.2f, %.2f, %.2f) N m", torque);
    }
    case ObservationKind::kWeight:
      return sensor + text(": hang %.3f kg", o.mass) +
             triple(" at (%.1f, %.1f, %.1f) mm", 1e3 * o.point) +
             triple(", gravity along (%.2f, %.2f, %.2f)", o.direction);
    case ObservationKind::kIndentation:
      return sensor + triple(": press at (%.1f, %.1f, %.1f) mm", 1e3 * o.point) +
             triple(" with about (%.0f, %.0f, %.0f) N", force);
    case ObservationKind::kDisplacement:
      return sensor +
             triple(": move the carrier until the strains are about %.1f %.1f %.1f",
                    kStrainRange * request.strain.head<3>()) +
             triple(" %.1f %.1f %.1f V and read the gauges",
                    kStrainRange * request.strain.tail<3>());
    case ObservationKind::kLinearity:
      return sensor + text(": channel %d, load %.4g", o.channel, o.load);
  }
  return "";
}

std::optional<PlanName> planName(const std::string& name) {
  const std::array<const char*, 5> names = {"recommended", "quadratic", "displacement",
                                            "thesis_fixed", "thesis_shifted"};
  for (std::size_t k = 0; k < names.size(); ++k) {
    if (name == names[k]) return static_cast<PlanName>(k);
  }
  return std::nullopt;
}

std::vector<LoadRequest> makePlan(PlanName name, const ObservationSet& set, const RatedLoad& rated,
                                  std::uint64_t seed, int zero_every) {
  if (!(rated.force > 0.0) || !(rated.torque > 0.0)) {
    throw InputError("plan: the rated load is not positive: give N and N m");
  }
  if (zero_every < 1) throw InputError("plan: zero_every is below 1: give a number of tests");
  Draw draw(seed);
  std::vector<LoadRequest> tests;
  const std::vector<Eigen::Matrix3d> turns = cubeTurns();
  const auto add = [&](int reacting_tests, int weights, int indentations, std::size_t turned) {
    std::vector<Pose> poses;
    for (std::size_t k = 0; k < turned; ++k) {
      // every fifth of 24: all axes within the first eight
      poses.push_back(mating(draw, turns[k * 5 % turns.size()], k));
    }
    for (std::size_t k = 0; k < static_cast<std::size_t>(reacting_tests); ++k) {
      const Pose& X = poses[k % turned];
      tests.push_back(indentations > 0 ? bolted(draw, X, rated) : reacting(draw, X, rated));
    }
    for (const Side side : {Side::kA, Side::kB}) {
      for (std::size_t k = 0; k < static_cast<std::size_t>(weights); ++k) {
        const double mass = weights <= 6 ? kMass : kMass * draw.uniform(0.4, 1.5);
        tests.push_back(weight(draw, side, k, mass));
      }
      for (std::size_t k = 0; k < static_cast<std::size_t>(indentations); ++k) {
        tests.push_back(indentation(draw, side, k, rated));
      }
    }
  };
  switch (name) {
    case PlanName::kRecommended:
      add(32, 6, 0, 8);
      break;
    case PlanName::kQuadratic:
      add(120, 24, 30, 24);
      break;
    case PlanName::kThesisFixed:
    case PlanName::kThesisShifted: {
      const Pose fixed{Eigen::Matrix3d::Identity(), {0, 0, 2 * kHalfCube}};
      for (int k = 0; k < 11; ++k) {
        Pose X = fixed;
        if (name == PlanName::kThesisShifted) X.p += draw.box(kSpread);
        tests.push_back(reacting(draw, X, rated));
      }
      tests.push_back(weight(draw, Side::kA, 2, kMass));
      break;
    }
    case PlanName::kDisplacement:
      for (const Side side : {Side::kA, Side::kB}) {
        for (const Vector6& strain : centralComposite()) {
          LoadRequest request;
          request.target.kind = ObservationKind::kDisplacement;
          request.target.side = side;
          request.target.gauges.assign(set.gauges[side].gauges.size(), 0.0);
          request.strain = strain;
          tests.push_back(request);
        }
      }
      break;
  }
  std::vector<LoadRequest> plan;
  for (std::size_t k = 0; k < tests.size(); ++k) {
    if (k % static_cast<std::size_t>(zero_every) == 0) plan.push_back(unloaded());
    plan.push_back(tests[k]);
    plan.back().target.id = "test " + std::to_string(k + 1);
  }
  plan.push_back(unloaded());
  return plan;
}

ObservationSet predictPlan(const std::vector<LoadRequest>& plan, const ObservationSet& set) {
  ObservationSet out = set;
  for (const Side side : {Side::kA, Side::kB}) {
    const bool zeroed =
        std::any_of(out.observations.begin(), out.observations.end(), [&](const Observation& o) {
          return o.kind == ObservationKind::kUnloaded && o.reading[side];
        });
    if (!zeroed) {
      out.observations.insert(out.observations.begin(), predictReadings(unloaded(), set));
      break;
    }
  }
  double stamp = 0.0;
  for (const Observation& o : out.observations) stamp = std::max(stamp, o.stamp);
  for (const LoadRequest& request : plan) {
    out.observations.push_back(predictReadings(request, set));
    out.observations.back().stamp = stamp += 60.0;
  }
  return out;
}

NextTests nextTests(const ObservationSet& set, const std::vector<LoadRequest>& candidates,
                    std::size_t count, const ForceSettings& settings) {
  const int rows = settings.procedure == ForceProcedure::kAllRows ? 6 : 3;
  const int terms = settings.model == StrainModel::kQuadratic ? 27 : 6;
  const PerSide<Eigen::MatrixXd> S = nominalMatrices(set, rows, terms);

  // prior of a coefficient: ten times the largest nominal one of its row
  Eigen::VectorXd sd(2 * rows * terms);
  for (int r = 0; r < 2 * rows; ++r) {
    const auto row = r < rows ? S.a.row(r) : S.b.row(r - rows);
    sd.segment(r * terms, terms).setConstant(kPriorSd * row.cwiseAbs().maxCoeff());
  }
  Eigen::MatrixXd P = sd.cwiseAbs2().asDiagonal();
  const auto absorb = [&](const Eigen::MatrixXd& A) {
    const Eigen::MatrixXd PA = P * A.transpose();
    const Eigen::MatrixXd C = A * PA + Eigen::MatrixXd::Identity(A.rows(), A.rows());
    P -= PA * C.llt().solve(PA.transpose());
    P = (0.5 * (P + P.transpose())).eval();
  };
  NextTests out;
  out.weak_direction_before = "everything";
  const ForceSystem present = noiseFree(buildSystem(set, settings, rows), set);
  for (const ForceTest& test : present.tests) absorb(whitenedRows(test, S));
  if (!present.tests.empty()) {
    out.weak_direction_before =
        describeWeak(rankOf(present, terms).weakest, set, rows, terms, settings.rated);
  }

  std::vector<Eigen::MatrixXd> design(candidates.size());
  for (std::size_t k = 0; k < candidates.size(); ++k) {
    ObservationSet one = set;
    one.observations.clear();
    const ForceSystem system = buildSystem(predictPlan({candidates[k]}, one), settings, rows);
    if (!system.tests.empty()) design[k] = whitenedRows(system.tests[0], S);
  }
  std::vector<LoadRequest> chosen;
  while (out.chosen.size() < std::min(count, candidates.size())) {
    double best = -1.0;
    std::size_t which = candidates.size();
    for (std::size_t k = 0; k < candidates.size(); ++k) {
      if (design[k].size() == 0) continue;
      const Eigen::MatrixXd C = design[k] * P * design[k].transpose() +
                                Eigen::MatrixXd::Identity(design[k].rows(), design[k].rows());
      const Eigen::MatrixXd L = C.llt().matrixL();
      const double gain = 2.0 * L.diagonal().array().log().sum();
      if (gain > best) {
        best = gain;
        which = k;
      }
    }
    if (which == candidates.size()) break;
    absorb(design[which]);
    design[which].resize(0, 0);
    out.chosen.push_back(which);
    out.gain.push_back(best);
    chosen.push_back(candidates[which]);
  }
  out.after = evaluateDesign(predictPlan(chosen, set), settings);
  out.weak_direction_after = out.after.weak_direction;
  return out;
}

std::vector<LoadRequest> standardCandidates(const RatedLoad& rated, std::uint64_t seed) {
  Draw draw(seed);
  std::vector<LoadRequest> out;
  const std::vector<Eigen::Matrix3d> turns = cubeTurns();
  for (std::size_t k = 0; k < turns.size(); ++k) {
    const Pose X = mating(draw, turns[k], k);
    for (int i = 0; i < 4; ++i) out.push_back(reacting(draw, X, rated));
  }
  for (const Side side : {Side::kA, Side::kB}) {
    for (std::size_t k = 0; k < 12; ++k) out.push_back(weight(draw, side, k, kMass));
    for (std::size_t k = 0; k < 16; ++k) out.push_back(indentation(draw, side, k, rated));
  }
  return out;
}

}  // namespace assembly_cell
