// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/calibration/payload/payload.h"

#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

#include "assembly_cell/base/input_error.h"
#include "assembly_cell/base/median.h"
#include "bias_search.h"
#include "bias_series.h"
#include "payload_parts.h"

namespace assembly_cell {

namespace {

using namespace bias_series;
using Eigen::Matrix3d;
using Eigen::Vector3d;
using Eigen::VectorXd;

constexpr std::size_t kMinPoses = 6;
constexpr std::size_t kMaxPoses = 2000;
constexpr std::size_t kMinForStructure =
    16;                                     // with fewer poses drift can't be separated from noise
constexpr double kMinJump = 5.0;            // of a break, in sd of a reading: less is drift
constexpr double kOutlierTail = 0.01;       // false outliers a clean recording
constexpr double kMaxOutliers = 0.25;       // of the poses
constexpr double kNoiseFloor = 1e-7;        // of the largest reading: rounding, not noise
constexpr double kWeakestDirection = 0.05;  // fraction of the weight that rotation makes visible
constexpr double kMinWeight = 5.0;          // sd
// Ratio of the median held-out errors, force times torque, of both choices of the axes. The
// recording of test/data and four simulated ones are below 0.004 or above 4e4; half of it gives the
// same decisions, from 1 on nothing is undecided.
constexpr double kClearly = 0.7;

void checkInput(const std::vector<StaticPose>& poses, const std::vector<Vector6>& wrenches) {
  if (poses.size() != wrenches.size()) {
    throw InputError("payload: " + std::to_string(poses.size()) + " poses, " +
                     std::to_string(wrenches.size()) + " wrenches: give one wrench a pose");
  }
  if (poses.size() > kMaxPoses) {
    throw InputError("payload: " + std::to_string(poses.size()) + " poses: give at most " +
                     std::to_string(kMaxPoses) + ", averages of standing periods");
  }
  for (std::size_t i = 0; i < poses.size(); ++i) {
    const std::string place = "payload: pose " + std::to_string(i) + ": ";
    if (!poses[i].R.allFinite() || !std::isfinite(poses[i].order) || !wrenches[i].allFinite()) {
      throw InputError(place + "not finite: remove it");
    }
    if (i > 0 && !(poses[i].order > poses[i - 1].order)) {
      throw InputError(place + "order is " + std::to_string(poses[i].order) +
                       ": give values that rise");
    }
  }
}

// Observability of g beside a free constant in sensor axes: smallest root of 1 − R̄ R̄ᵀ, R̄ the mean
// rotation
double weakestDirection(const std::vector<StaticPose>& poses) {
  const auto n = static_cast<double>(poses.size());
  Matrix3d mean = Matrix3d::Zero();
  for (const StaticPose& pose : poses) mean += pose.R / n;
  const Matrix3d information = Matrix3d::Identity() - mean * mean.transpose();
  const Eigen::SelfAdjointEigenSolver<Matrix3d> solver(information);
  return std::sqrt(std::max(solver.eigenvalues()[0], 0.0));
}

using FullGroups = std::array<FullGroup, 2>;

Problem problemOf(const std::vector<StaticPose>& poses, const std::vector<Vector6>& w,
                  const std::vector<std::size_t>& used, double& temperature_mean) {
  Problem out;
  std::array<double, 2> largest{};
  double low = 1e300, high = -1e300, sum = 0.0;
  bool temperatures = true;
  for (const std::size_t i : used) {
    out.R.push_back(poses[i].R);
    out.w.push_back(w[i]);
    out.line.order.push_back(poses[i].order);
    out.line.temperature.push_back(poses[i].temperature);
    temperatures = temperatures && std::isfinite(poses[i].temperature);
    low = std::min(low, poses[i].temperature);
    high = std::max(high, poses[i].temperature);
    sum += poses[i].temperature;
    for (const Kind k : kKinds) {
      largest[k] = std::max(largest[k], w[i].segment<3>(3 * k).norm());
    }
  }
  const auto n = static_cast<double>(used.size());
  temperature_mean = temperatures ? sum / n : std::numeric_limits<double>::quiet_NaN();
  if (temperatures && high > low) {
    for (double& t : out.line.temperature) t -= temperature_mean;
  } else {
    out.line.temperature.clear();
  }
  out.line.step = (out.line.order.back() - out.line.order.front()) / std::max(n - 1.0, 1.0);
  out.floor = {std::max(kNoiseFloor * largest[kForce], 1e-12),
               std::max(kNoiseFloor * largest[kTorque], 1e-13)};
  return out;
}

// force first: the torque's columns follow from the weight
template <typename Fit>
FullGroups fullFits(const Problem& p, const Fit& fitOf, const std::vector<std::size_t>& starts,
                    bool equal_weights = false) {
  FullGroups out;
  Vector3d gravity = Vector3d::Zero();
  for (const Kind k : kKinds) {
    const Triple data = seriesOf(p, k, gravity);
    out[k] = fullFit(data, fitOf(k, data), p.line, starts, p.floor[k], equal_weights);
    if (k == kForce) gravity = out[k].group.effects.head<3>();
  }
  return out;
}

double medianHeldOut(const FullGroup& fit) {
  std::vector<double> sizes;
  for (const Vector3d& e : fit.held_out) sizes.push_back(e.norm());
  return upperMedian(sizes);
}

// How well one choice of the axes fits, with a freely drifting bias.
struct AxesFit {
  double force = 0.0, torque = 0.0;  // median held-out error
  double weight = 0.0;
};

AxesFit tryAxes(const Problem& p, bool drift) {
  const FullGroups fits =
      fullFits(p,
               [&](Kind k, const Triple& data) {
                 return uniformFit(data, p.line, drift ? 0.3 / p.line.step : 0.0, p.floor[k]);
               },
               {0});
  return {std::max(medianHeldOut(fits[kForce]), p.floor[kForce]),
          std::max(medianHeldOut(fits[kTorque]), p.floor[kTorque]),
          fits[kForce].group.effects.head<3>().norm()};
}

// Base, sensor, or auto where neither fits better.
WrenchAxes chooseAxes(const AxesFit& base, const AxesFit& sensor) {
  const double ratio = base.force * base.torque / (sensor.force * sensor.torque);
  if (ratio < kClearly) return WrenchAxes::kBase;
  if (ratio > 1.0 / kClearly) return WrenchAxes::kSensor;
  // a weight without bias and centre of mass reads as a bias without weight in the wrong axes
  if (sensor.weight < 0.2 * base.weight) return WrenchAxes::kBase;
  if (base.weight < 0.2 * sensor.weight) return WrenchAxes::kSensor;
  return WrenchAxes::kAuto;
}

// ---- identification

CalibrationRefusal refusalOf(const std::vector<StaticPose>& poses) {
  if (poses.size() < kMinPoses) {
    return {CalibrationFailure::kTooFewPoses,
            std::to_string(poses.size()) + " poses: give at least " + std::to_string(kMinPoses)};
  }
  if (weakestDirection(poses) < kWeakestDirection) {
    return {
        CalibrationFailure::kOneAxis,
        "the orientations do not separate weight from bias (rank below 6): turn the sensor about "
        "two horizontal axes by tens of degrees"};
  }
  return {};
}

// Refuses a sensor that is stuck or carries nothing.
CalibrationRefusal weightRefusal(const PayloadModel& model, const Problem& problem) {
  const double floor = problem.floor[kForce];
  if (model.weight > kMinWeight * std::max(model.weight_sd, floor)) return {};
  return {CalibrationFailure::kNoWeight,
          "the forces don't follow the orientations: no weight is detected; check that the sensor "
          "carries the payload, that its readings change and that each has its pose"};
}

// the same reading again and again, to the last bit
bool isConstant(const std::vector<Vector6>& wrenches) {
  return std::all_of(wrenches.begin(), wrenches.end(),
                     [&](const Vector6& w) { return w == wrenches.front(); });
}

// The choice of the axes with the smaller error when the bias may drift.
WrenchAxes findAxes(const std::vector<StaticPose>& poses, const std::vector<Vector6>& wrenches,
                    bool drift, PayloadModel& model) {
  std::array<AxesFit, 2> fit;
  std::vector<std::size_t> all(poses.size());
  std::iota(all.begin(), all.end(), std::size_t{0});
  for (const WrenchAxes axes : {WrenchAxes::kBase, WrenchAxes::kSensor}) {
    double mean = 0.0;
    fit[axes == WrenchAxes::kBase ? 0 : 1] =
        tryAxes(problemOf(poses, inSensorAxes(poses, wrenches, axes), all, mean), drift);
  }
  model.base_residual = fit[0].force;
  model.sensor_residual = fit[1].force;
  return chooseAxes(fit[0], fit[1]);
}

// the pose farthest from what the others predict, if that is too far
std::optional<std::size_t> worstPose(const FullGroups& full) {
  const std::size_t poses = full[kForce].held_out.size();
  const auto n = static_cast<double>(poses);
  const double limit = chiSquareQuantile(6, kOutlierTail / n) * (n / (n - 6.0));
  std::vector<double> distance;
  for (std::size_t i = 0; i < poses; ++i) {
    const auto of = [&](const FullGroup& fit) {
      return fit.held_out[i].dot(fit.held_out_covariance[i].inverse() * fit.held_out[i]);
    };
    distance.push_back(of(full[kForce]) + of(full[kTorque]));
  }
  const auto worst = std::max_element(distance.begin(), distance.end());
  if (!(*worst > limit)) return std::nullopt;
  return static_cast<std::size_t>(worst - distance.begin());
}

struct Identified {
  Problem problem;
  Structure structure;
  FullGroups full;
};

// Alternates structure search and removal of the worst outlier until nothing changes.
Identified identify(const std::vector<StaticPose>& poses, const std::vector<Vector6>& w,
                    const PayloadOptions& options, PayloadModel& model) {
  Identified found;
  std::vector<double> no_break;
  const auto max_outliers =
      static_cast<std::size_t>(kMaxOutliers * static_cast<double>(poses.size()));
  while (true) {
    Problem& problem = found.problem;
    problem = problemOf(poses, w, model.used, model.temperature_mean);
    problem.no_break = no_break;
    if (!model.structure_tested) problem.line.temperature.clear();
    found.structure = searchStructure(problem, options.drift && model.structure_tested,
                                      options.breaks && model.structure_tested);
    found.full = fullFits(
        problem, [&](Kind k, const Triple&) { return found.structure.fit[k]; },
        found.structure.starts);
    model.order = problem.line.order;
    model.starts = found.structure.starts;
    model.group = {found.full[kForce].group, found.full[kTorque].group};
    if (const auto place = smallestBreak(model, kMinJump)) {
      // the break and its neighbours are drift
      for (std::size_t i = *place - 2; i <= std::min(*place + 2, model.order.size() - 1); ++i) {
        no_break.push_back(model.order[i]);
      }
      continue;
    }
    if (!options.outliers || model.used.size() <= kMinPoses + 2 ||
        model.rejected.size() >= max_outliers) {
      break;
    }
    const auto worst = worstPose(found.full);
    if (!worst) break;
    model.rejected.push_back(model.used[*worst]);
    model.used.erase(model.used.begin() + static_cast<std::ptrdiff_t>(*worst));
  }
  std::sort(model.rejected.begin(), model.rejected.end());
  return found;
}

void fillPayload(const Identified& found, PayloadModel& model) {
  const BiasGroup &force = found.full[kForce].group, &torque = found.full[kTorque].group;
  model.has_temperature = !found.problem.line.temperature.empty();
  model.gravity = force.effects.head<3>();
  model.gravity_covariance = force.covariance.topLeftCorner<3, 3>();
  model.weight = model.gravity.norm();
  const Vector3d direction = model.gravity / std::max(model.weight, 1e-300);
  model.weight_sd = std::sqrt(direction.dot(model.gravity_covariance * direction));
  model.center_of_mass = torque.effects.head<3>();
  // centre of mass: torque noise, and the weight it was divided by
  Matrix3d by_gravity;
  for (int k = 0; k < 3; ++k) {
    const double step = 1e-4 * std::max(model.weight, 1e-9);
    const Vector3d moved = model.gravity + step * Vector3d::Unit(k);
    const FullGroup other =
        fullFit(seriesOf(found.problem, kTorque, moved), found.structure.fit[kTorque],
                found.problem.line, found.structure.starts, found.problem.floor[kTorque]);
    by_gravity.col(k) = (other.group.effects.head<3>() - model.center_of_mass) / step;
  }
  model.center_covariance = torque.covariance.topLeftCorner<3, 3>() +
                            by_gravity * model.gravity_covariance * by_gravity.transpose();
}

ForceTorque rms(const std::vector<Vector6>& values) {
  double force = 0.0, torque = 0.0;
  for (const Vector6& v : values) {
    force += v.head<3>().squaredNorm();
    torque += v.tail<3>().squaredNorm();
  }
  const double count = 3.0 * static_cast<double>(values.size());
  return {std::sqrt(force / count), std::sqrt(torque / count)};
}

double rms(const FullGroup& fit) {
  double sum = 0.0;
  for (const VectorXd& r : fit.residual) sum += r.squaredNorm();
  return std::sqrt(sum / (3.0 * static_cast<double>(fit.residual[0].size())));
}

std::vector<double> toVector(const VectorXd& v) { return {v.data(), v.data() + v.size()}; }

// residuals, those of a constant bias for comparison, and the tests on both
void fillResiduals(const Identified& found, PayloadModel& model) {
  const FullGroups& full = found.full;
  for (std::size_t i = 0; i < model.used.size(); ++i) {
    Vector6 r, h;
    for (std::size_t axis = 0; axis < 6; ++axis) {
      r[axis] = full[axis / 3].residual[axis % 3][i];
      h[axis] = full[axis / 3].held_out[i][axis % 3];
    }
    model.residual.push_back(r);
    model.held_out.push_back(h);
  }
  model.rms = rms(model.residual);
  model.held_out_rms = rms(model.held_out);
  const FullGroups plain = fullFits(
      found.problem,
      [&](Kind k, const Triple& data) {
        return uniformFit(data, found.problem.line, 0.0, found.problem.floor[k]);
      },
      {0}, true);
  model.plain_rms = {rms(plain[kForce]), rms(plain[kTorque])};
  for (std::size_t axis = 0; axis < 6; ++axis) {
    model.plain_test[axis] = testSequence(toVector(plain[axis / 3].residual[axis % 3]));
    const BiasComponent& b = full[axis / 3].group.component[axis % 3];
    const VectorXd white = b.whitener.transpose().triangularView<Eigen::Upper>().solve(b.weighted);
    model.final_test[axis] = testSequence(toVector(white));
  }
}

// how much likelier a component's drift is than none, other components as they are
double gainOfDrift(const Identified& found, std::size_t axis, const Vector3d& gravity) {
  const Kind kind = kKinds[axis / 3];
  const std::size_t component = axis % 3;
  const GroupFit& chosen = found.structure.fit[kind];
  const Triple data = seriesOf(found.problem, kind, gravity);
  GroupFit without = chosen;
  without.choice[component] =
      candidateOf(data[component], DriftShape::kNone, 0.0, chosen.choice[component].temperature,
                  found.problem.line, found.structure.starts);
  profile(without, static_cast<double>(found.problem.R.size()), found.problem.floor[kind]);
  return (without.criterion - without.choice[component].cost) -
         (chosen.criterion - chosen.choice[component].cost);
}

// bias, drift and breaks with their uncertainty
void fillBias(const std::vector<StaticPose>& poses, const Identified& found, PayloadModel& model) {
  const std::size_t n = model.used.size();
  const PredictedWrench at_last =
      predictBias(model, model.order.back(), poses[model.used.back()].temperature);
  model.last_bias = at_last.wrench;
  model.last_bias_sd = at_last.sd;
  for (std::size_t r = 0; r + 1 < model.starts.size(); ++r) {
    BiasBreak fresh;
    fresh.pose = model.used[model.starts[r + 1]];
    fresh.order = model.order[model.starts[r + 1]];
    fresh.gain = r < found.structure.gains.size() ? found.structure.gains[r] : 0.0;
    model.breaks.push_back(fresh);
  }
  for (std::size_t axis = 0; axis < 6; ++axis) {
    BiasGroup& group = model.group[axis / 3];
    BiasComponent& b = group.component[axis % 3];
    Functional mean;
    mean.row = VectorXd::Zero(group.effects.size());
    mean.kernel = VectorXd::Zero(n);
    for (std::size_t i = 0; i < n; ++i) {
      const Functional f =
          biasFunctional(model, axis, model.order[i], poses[model.used[i]].temperature);
      mean.row += f.row / static_cast<double>(n);
      mean.kernel += f.kernel / static_cast<double>(n);
    }
    mean.variance = mean.kernel.mean();
    const Estimate bias = evaluate(model, axis, mean);
    model.bias[axis] = bias.value;
    model.bias_sd[axis] = std::sqrt(bias.variance);
    for (std::size_t r = 0; r < model.starts.size(); ++r) {
      const std::size_t end = r + 1 < model.starts.size() ? model.starts[r + 1] : n;
      const Estimate change = biasChange(model, axis, model.starts[r], end - 1);
      model.drift[axis].push_back({change.value, std::sqrt(change.variance)});
      if (end == n) break;
      const Estimate jump = biasChange(model, axis, end - 1, end);
      model.breaks[r].jump[axis] = jump.value;
      model.breaks[r].jump_sd[axis] = std::sqrt(jump.variance);
    }
    if (b.temperature) {
      model.temperature_coefficient[axis] = group.effects[b.first_effect];
      model.temperature_sd[axis] = std::sqrt(group.covariance(b.first_effect, b.first_effect));
    }
    if (b.shape != DriftShape::kNone) b.drift_gain = gainOfDrift(found, axis, model.gravity);
  }
}

}  // namespace

const char* toString(WrenchAxes axes) {
  return std::array{"auto", "base", "sensor"}[static_cast<std::size_t>(axes)];
}

const char* toString(DriftShape shape) {
  return std::array{"none", "linear", "random_walk", "smooth"}[static_cast<std::size_t>(shape)];
}

SequenceTest testSequence(const std::vector<double>& residuals) {
  SequenceTest out;
  const std::size_t n = residuals.size();
  if (n < 4) return out;
  const double count = static_cast<double>(n);
  const double mean = std::accumulate(residuals.begin(), residuals.end(), 0.0) / count;
  double squares = 0.0, products = 0.0, plus = 0.0, runs = 1.0;
  for (std::size_t i = 0; i < n; ++i) {
    const double r = residuals[i] - mean;
    squares += r * r;
    plus += r > 0.0;
    if (i == 0) continue;
    const double before = residuals[i - 1] - mean;
    products += r * before;
    runs += (r > 0.0) != (before > 0.0);
  }
  if (!(squares > 0.0)) return out;
  out.lag1 = products / squares;
  out.lag1_p = twoSided((out.lag1 + 1.0 / count) * std::sqrt(count));
  const double minus = count - plus, expected = 1.0 + 2.0 * plus * minus / count;
  const double variance = (expected - 1.0) * (expected - 2.0) / (count - 1.0);
  if (variance > 0.0) out.runs_p = twoSided((runs - expected) / std::sqrt(variance));
  return out;
}

std::vector<Vector6> inSensorAxes(const std::vector<StaticPose>& poses,
                                  const std::vector<Vector6>& wrenches, WrenchAxes axes) {
  std::vector<Vector6> out = wrenches;
  if (axes == WrenchAxes::kSensor) return out;
  for (std::size_t i = 0; i < out.size(); ++i) {
    const Matrix3d Rt = poses[i].R.transpose();
    out[i].head<3>() = Rt * wrenches[i].head<3>();
    out[i].tail<3>() = Rt * wrenches[i].tail<3>();
  }
  return out;
}

PayloadModel identifyPayload(const std::vector<StaticPose>& poses,
                             const std::vector<Vector6>& wrenches, const PayloadOptions& options) {
  checkInput(poses, wrenches);
  PayloadModel model;
  model.refusal = refusalOf(poses);
  if (model.refusal) return model;
  if (isConstant(wrenches)) {
    model.refusal = {CalibrationFailure::kNoWeight,
                     "all poses have the same wrench: check that the sensor's readings change"};
    return model;
  }
  model.structure_tested = poses.size() >= kMinForStructure;
  const WrenchAxes fitting =
      findAxes(poses, wrenches, model.structure_tested && options.drift, model);
  model.axes = options.axes == WrenchAxes::kAuto ? fitting : options.axes;
  if (model.axes == WrenchAxes::kAuto) {
    model.refusal = {CalibrationFailure::kAxesUndecided,
                     "wrenches in base axes and in sensor axes fit alike: say which they are"};
    return model;
  }
  model.used.resize(poses.size());
  std::iota(model.used.begin(), model.used.end(), std::size_t{0});
  const Identified found =
      identify(poses, inSensorAxes(poses, wrenches, model.axes), options, model);
  fillPayload(found, model);
  model.refusal = weightRefusal(model, found.problem);
  if (model.refusal) return model;
  fillResiduals(found, model);
  fillBias(poses, found, model);
  if (options.in_situ) model.in_situ = correctInSitu(model, found.problem, options);
  return model;
}

}  // namespace assembly_cell
