// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/calibration/payload.h"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <Eigen/QR>
#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

#include "assembly_cell/base/input_error.h"
#include "bias_series.h"

namespace assembly_cell {

namespace {

using Eigen::Index;
using Eigen::Matrix3d;
using Eigen::MatrixXd;
using Eigen::Vector3d;
using Eigen::VectorXd;

constexpr std::size_t kLeastPoses = 6;
constexpr std::size_t kMostPoses = 2000;
constexpr std::size_t kLeastForStructure = 16;  // fewer poses cannot tell drift from noise
constexpr std::size_t kLeastRecording = 4;      // poses between breaks
constexpr std::size_t kMostBreaks = 6;
constexpr double kAxisCost = 9.0;           // of a drift: −2 log likelihood beyond BIC, see docs
constexpr double kBreakTail = 1e-5;         // false breaks a clean recording, all places together
constexpr double kLeastJump = 5.0;          // of a break, in sd of a reading: less is drift
constexpr double kOutlierTail = 0.01;       // false outliers a clean recording
constexpr double kMostOutliers = 0.25;      // of the poses
constexpr double kNoiseFloor = 1e-7;        // of the largest reading: rounding, not noise
constexpr double kWeakestDirection = 0.05;  // share of the weight that rotation makes visible
constexpr int kScanPlaces = 120;

// ---- one component of one group: readings y = X shared + own effects + drift + noise

struct Series {
  VectorXd y;  // n
  MatrixXd X;  // n × 3
};
using Group = std::array<Series, 3>;

struct Timeline {
  std::vector<double> order;
  std::vector<double> temperature;  // about its mean, empty: unknown or constant
  double step = 1.0;                // mean spacing
};

struct Candidate {
  DriftShape shape;
  double ratio;
  bool temperature;
  double cost;  // criterion
  double log_det;
  Eigen::Matrix4d gram;  // of [X y], own effects projected out
};

struct GroupFit {
  std::array<Candidate, 3> choice;
  Vector3d shared = Vector3d::Zero();
  Vector3d variance = Vector3d::Ones();
  double criterion = 0.0;
};

std::vector<double> ratiosOf(DriftShape shape, double step) {
  std::vector<double> out;
  const bool smooth = shape == DriftShape::kSmooth;
  for (double e = smooth ? -6.0 : -3.0; e <= (smooth ? 0.6 : 1.6); e += 0.5) {
    out.push_back(std::pow(10.0, e) / (smooth ? step * step * step : step));
  }
  return out;
}

Index ownCount(DriftShape shape, std::size_t recordings) {
  return static_cast<Index>(recordings) * (bias_series::hasSlope(shape) ? 2 : 1);
}

MatrixXd ownDesign(DriftShape shape, bool temperature, const Timeline& line,
                   const std::vector<std::size_t>& starts) {
  const Index lead = temperature ? 1 : 0;
  const Index own = ownCount(shape, starts.size());
  MatrixXd out(static_cast<Index>(line.order.size()), lead + own);
  VectorXd row(own);
  std::size_t recording = 0;
  for (std::size_t i = 0; i < line.order.size(); ++i) {
    while (recording + 1 < starts.size() && i >= starts[recording + 1]) ++recording;
    bias_series::fillOwnEffects(shape, line.order, starts, line.order[i], recording, row);
    const auto r = static_cast<Index>(i);
    if (temperature) out(r, 0) = line.temperature[i];
    out.row(r).tail(own) = row.transpose();
  }
  return out;
}

Candidate candidateOf(const Series& series, DriftShape shape, double ratio, bool temperature,
                      const Timeline& line, const std::vector<std::size_t>& starts) {
  const MatrixXd own = ownDesign(shape, temperature, line, starts);
  MatrixXd columns(own.rows(), own.cols() + 4);
  columns << own, series.X, series.y;
  Candidate out;
  out.shape = shape;
  out.ratio = ratio;
  out.temperature = temperature;
  out.log_det = bias_series::whiten(shape, ratio, line.order, starts, columns);
  // project the own effects out (orthonormalised one after the other)
  for (Index c = 0; c < own.cols(); ++c) {
    const double size = columns.col(c).norm();
    if (!(size > 1e-9)) continue;
    columns.col(c) /= size;
    for (Index d = c + 1; d < columns.cols(); ++d) {
      columns.col(d) -= columns.col(c).dot(columns.col(d)) * columns.col(c);
    }
  }
  const MatrixXd rest = columns.rightCols(4);
  out.gram = rest.transpose() * rest;
  const double n = static_cast<double>(line.order.size()), log_n = std::log(n);
  const auto recordings = static_cast<double>(starts.size());
  out.cost = temperature ? kAxisCost + log_n : 0.0;
  if (shape != DriftShape::kNone) out.cost += kAxisCost;
  if (bias_series::hasSlope(shape)) out.cost += recordings * log_n;
  if (ratio > 0.0) out.cost += log_n;
  return out;
}

double residualSquares(const Candidate& c, const Vector3d& shared) {
  Eigen::Vector4d v;
  v << -shared, 1.0;
  return std::max(v.dot(c.gram * v), 0.0);
}

struct SearchLimits {
  bool drift = true;
  double floor = 0.0;  // least sd
};

using Candidates = std::array<std::vector<Candidate>, 3>;

Candidates candidatesOf(const Group& group, const Timeline& line,
                        const std::vector<std::size_t>& starts, const SearchLimits& limits) {
  Candidates out;
  for (int a = 0; a < 3; ++a) {
    auto& list = out[static_cast<std::size_t>(a)];
    const Series& series = group[static_cast<std::size_t>(a)];
    const auto add = [&](DriftShape shape, double ratio) {
      list.push_back(candidateOf(series, shape, ratio, false, line, starts));
      if (!line.temperature.empty()) {
        list.push_back(candidateOf(series, shape, ratio, true, line, starts));
      }
    };
    add(DriftShape::kNone, 0.0);
    if (!limits.drift) continue;
    add(DriftShape::kLinear, 0.0);
    for (const DriftShape shape : {DriftShape::kRandomWalk, DriftShape::kSmooth}) {
      for (const double ratio : ratiosOf(shape, line.step)) add(shape, ratio);
    }
  }
  return out;
}

// shared effects and variances of three chosen candidates, alternately
void profile(GroupFit& fit, double n, double floor) {
  for (int round = 0; round < 6; ++round) {
    Matrix3d N = Matrix3d::Zero();
    Vector3d h = Vector3d::Zero();
    for (int a = 0; a < 3; ++a) {
      const Candidate& c = fit.choice[static_cast<std::size_t>(a)];
      N += c.gram.topLeftCorner<3, 3>() / fit.variance[a];
      h += c.gram.topRightCorner<3, 1>() / fit.variance[a];
    }
    fit.shared = N.colPivHouseholderQr().solve(h);
    Vector3d squares;
    for (int a = 0; a < 3; ++a) {
      squares[a] = residualSquares(fit.choice[static_cast<std::size_t>(a)], fit.shared);
    }
    // two poses' worth of the mean keeps a lucky axis from taking all the weight
    const double mean = squares.sum() / (3.0 * n);
    fit.variance = (squares.array() + 2.0 * mean) / (n + 2.0) + floor * floor;
  }
  fit.criterion = 0.0;
  for (int a = 0; a < 3; ++a) {
    const Candidate& c = fit.choice[static_cast<std::size_t>(a)];
    fit.criterion += n * std::log(fit.variance[a]) +
                     residualSquares(c, fit.shared) / fit.variance[a] + c.log_det + c.cost;
  }
}

GroupFit bestOf(const Candidates& candidates, double n, double floor) {
  GroupFit best;
  best.criterion = std::numeric_limits<double>::infinity();
  // starts: the most flexible shapes (drift cannot hide in the weight), and none
  for (const bool flexible : {true, false}) {
    GroupFit fit;
    for (std::size_t a = 0; a < 3; ++a) {
      fit.choice[a] = candidates[a].front();
      for (const Candidate& c : candidates[a]) {
        if (flexible && c.shape == DriftShape::kRandomWalk && !c.temperature) fit.choice[a] = c;
      }
    }
    profile(fit, n, floor);
    double last = std::numeric_limits<double>::infinity();
    for (int round = 0; round < 8 && (round < 2 || fit.criterion < last - 1e-9); ++round) {
      last = fit.criterion;
      for (std::size_t a = 0; a < 3; ++a) {
        double least = std::numeric_limits<double>::infinity();
        for (const Candidate& c : candidates[a]) {
          const double s2 = residualSquares(c, fit.shared) / n + floor * floor;
          const double value = n * std::log(s2) + c.log_det + c.cost;
          if (value < least) {
            least = value;
            fit.choice[a] = c;
          }
        }
      }
      profile(fit, n, floor);
    }
    if (fit.criterion < best.criterion) best = fit;
  }
  return best;
}

// ---- data → groups

Group forceGroup(const std::vector<Matrix3d>& R, const std::vector<Vector6>& w) {
  Group group;
  const auto n = static_cast<Index>(R.size());
  for (int a = 0; a < 3; ++a) {
    Series& s = group[static_cast<std::size_t>(a)];
    s.y.resize(n);
    s.X.resize(n, 3);
    for (Index i = 0; i < n; ++i) {
      s.y[i] = w[static_cast<std::size_t>(i)][a];
      s.X.row(i) = R[static_cast<std::size_t>(i)].col(a).transpose();  // row a of Rᵀ
    }
  }
  return group;
}

Group torqueGroup(const std::vector<Matrix3d>& R, const std::vector<Vector6>& w,
                  const Vector3d& gravity) {
  Group group;
  const auto n = static_cast<Index>(R.size());
  for (int a = 0; a < 3; ++a) {
    Series& s = group[static_cast<std::size_t>(a)];
    s.y.resize(n);
    s.X.resize(n, 3);
    for (Index i = 0; i < n; ++i) {
      const auto k = static_cast<std::size_t>(i);
      s.y[i] = w[k][3 + a];
      s.X.row(i) = -skew(R[k].transpose() * gravity).row(a);
    }
  }
  return group;
}

struct Structure {
  std::vector<std::size_t> starts{0};
  GroupFit force, torque;
  double criterion = 0.0;
  std::vector<double> gains;  // of the breaks
};

struct Problem {
  std::vector<Matrix3d> R;
  std::vector<Vector6> w;  // sensor axes
  Timeline line;
  double force_floor = 0.0, torque_floor = 0.0;
  std::vector<double> no_break;  // orders at which a break was looked at and found too small
};

Structure fitWith(const Problem& problem, const Group& force, const Group& torque,
                  const std::vector<std::size_t>& starts, bool drift) {
  Structure out;
  out.starts = starts;
  const auto n = static_cast<double>(problem.R.size());
  const SearchLimits f{drift, problem.force_floor}, t{drift, problem.torque_floor};
  out.force = bestOf(candidatesOf(force, problem.line, starts, f), n, f.floor);
  out.torque = bestOf(candidatesOf(torque, problem.line, starts, t), n, t.floor);
  const double per_break =
      bias_series::chiSquareQuantile(6, kBreakTail / std::max(n, 2.0)) * n / (n - 6.0);
  out.criterion = out.force.criterion + out.torque.criterion +
                  per_break * static_cast<double>(starts.size() - 1);
  return out;
}

bool roomFor(const std::vector<std::size_t>& starts, std::size_t place, std::size_t n) {
  if (place < kLeastRecording || place + kLeastRecording > n) return false;
  return std::all_of(starts.begin(), starts.end(), [&](std::size_t s) {
    return s == 0 || (place > s ? place - s : s - place) >= kLeastRecording;
  });
}

Structure searchStructure(const Problem& problem, bool drift, bool breaks) {
  const std::size_t n = problem.R.size();
  const Group force = forceGroup(problem.R, problem.w);
  // gravity for the torques: from forces whose bias may do what it likes
  Vector3d gravity = Vector3d::Zero();
  {
    Timeline plain = problem.line;
    plain.temperature.clear();
    GroupFit fit;
    for (std::size_t a = 0; a < 3; ++a) {
      fit.choice[a] = candidateOf(force[a], drift ? DriftShape::kRandomWalk : DriftShape::kNone,
                                  drift ? 1.0 / plain.step : 0.0, false, plain, {0});
    }
    profile(fit, static_cast<double>(n), problem.force_floor);
    gravity = fit.shared;
  }
  Structure best;
  for (int pass = 0; pass < 2; ++pass) {
    const Group torque = torqueGroup(problem.R, problem.w, gravity);
    best = fitWith(problem, force, torque, pass == 0 ? std::vector<std::size_t>{0} : best.starts,
                   drift);
    while (breaks && best.starts.size() <= kMostBreaks) {
      // coarse scan of places for long recordings, then neighbours of the best
      const std::size_t stride = std::max<std::size_t>(1, n / kScanPlaces);
      Structure found;
      std::size_t centre = 0;
      found.criterion = std::numeric_limits<double>::infinity();
      const auto look = [&](std::size_t place) {
        const bool small = std::find(problem.no_break.begin(), problem.no_break.end(),
                                     problem.line.order[place]) != problem.no_break.end();
        if (small || !roomFor(best.starts, place, n)) return;
        std::vector<std::size_t> starts = best.starts;
        starts.insert(std::upper_bound(starts.begin(), starts.end(), place), place);
        Structure trial = fitWith(problem, force, torque, starts, drift);
        if (trial.criterion < found.criterion) {
          found = std::move(trial);
          centre = place;
        }
      };
      for (std::size_t place = kLeastRecording; place < n; place += stride) look(place);
      if (stride > 1 && centre > 0) {
        const std::size_t low = centre - std::min(centre, stride), high = centre + stride;
        for (std::size_t place = low; place <= high; ++place) look(place);
      }
      if (!(found.criterion < best.criterion)) break;
      best = std::move(found);
    }
    // a break that the final shapes make needless goes; the others keep their gain
    for (std::size_t b = 1; b < best.starts.size();) {
      std::vector<std::size_t> starts = best.starts;
      starts.erase(starts.begin() + static_cast<std::ptrdiff_t>(b));
      Structure trial = fitWith(problem, force, torque, starts, drift);
      if (trial.criterion <= best.criterion) {
        best = std::move(trial);
        b = 1;
      } else {
        ++b;
      }
    }
    best.gains.clear();
    for (std::size_t b = 1; b < best.starts.size(); ++b) {
      std::vector<std::size_t> starts = best.starts;
      starts.erase(starts.begin() + static_cast<std::ptrdiff_t>(b));
      best.gains.push_back(fitWith(problem, force, torque, starts, drift).criterion -
                           best.criterion);
    }
    gravity = best.force.shared;
  }
  return best;
}

// ---- full fit of a chosen structure: effects, covariance, what prediction and hold-out need

struct FullGroup {
  BiasGroup group;
  std::array<VectorXd, 3> residual;  // from effects and best drift
  std::vector<Vector3d> held_out;
  std::vector<Matrix3d> held_out_covariance;
};

FullGroup fullFit(const Group& data, const GroupFit& fit, const Timeline& line,
                  const std::vector<std::size_t>& starts, double floor,
                  bool equal_weights = false) {
  const auto n = static_cast<Index>(line.order.size());
  FullGroup out;
  Index effects = 3;
  for (std::size_t a = 0; a < 3; ++a) {
    const Candidate& c = fit.choice[a];
    BiasComponent& b = out.group.component[a];
    b.shape = c.shape;
    b.ratio = c.ratio;
    b.temperature = c.temperature;
    b.first_effect = static_cast<int>(effects);
    b.own_effects = static_cast<int>(ownCount(c.shape, starts.size()) + (c.temperature ? 1 : 0));
    effects += b.own_effects;
  }
  std::array<MatrixXd, 3> X;  // whitened
  std::array<VectorXd, 3> y;
  for (std::size_t a = 0; a < 3; ++a) {
    BiasComponent& b = out.group.component[a];
    b.design = MatrixXd::Zero(n, effects);
    b.design.leftCols(3) = data[a].X;
    b.design.middleCols(b.first_effect, b.own_effects) =
        ownDesign(b.shape, b.temperature, line, starts);
    b.whitener = MatrixXd::Identity(n, n);
    bias_series::whiten(b.shape, b.ratio, line.order, starts, b.whitener);
    X[a] = b.whitener * b.design;
    y[a] = b.whitener * data[a].y;
  }
  // generalised least squares; variances with the effects' degrees of freedom
  Vector3d variance = fit.variance;
  if (equal_weights) variance.setConstant(variance.mean());
  MatrixXd N(effects, effects);
  for (int round = 0; round < 4; ++round) {
    N.setZero();
    VectorXd h = VectorXd::Zero(effects);
    for (std::size_t a = 0; a < 3; ++a) {
      const double s2 = variance[static_cast<Index>(a)];
      N += X[a].transpose() * X[a] / s2;
      h += X[a].transpose() * y[a] / s2;
    }
    const VectorXd scale = N.diagonal().cwiseMax(1e-300).cwiseSqrt().cwiseInverse();
    const MatrixXd scaled = scale.asDiagonal() * N * scale.asDiagonal();
    const MatrixXd inverse = scaled.completeOrthogonalDecomposition().pseudoInverse();
    out.group.covariance = scale.asDiagonal() * inverse * scale.asDiagonal();
    out.group.effects = out.group.covariance * h;
    Vector3d squares;
    Vector3d dof;
    for (std::size_t a = 0; a < 3; ++a) {
      const auto k = static_cast<Index>(a);
      squares[k] = (y[a] - X[a] * out.group.effects).squaredNorm();
      const double leverage = (X[a] * out.group.covariance).cwiseProduct(X[a]).sum() / variance[k];
      dof[k] = std::max(static_cast<double>(n) - leverage, 1.0);
    }
    const double mean = squares.sum() / dof.sum();
    variance = ((squares.array() + 2.0 * mean) / (dof.array() + 2.0)).max(floor * floor);
    if (equal_weights) variance.setConstant(variance.mean());
  }

  std::array<VectorXd, 3> own_inverse;  // diagonal of V⁻¹
  std::array<MatrixXd, 3> VX;
  for (std::size_t a = 0; a < 3; ++a) {
    BiasComponent& b = out.group.component[a];
    b.noise = std::sqrt(variance[static_cast<Index>(a)]);
    b.weighted = b.whitener.transpose() * (y[a] - X[a] * out.group.effects);
    VX[a] = b.whitener.transpose() * X[a] / variance[static_cast<Index>(a)];
    own_inverse[a] =
        b.whitener.colwise().squaredNorm().transpose() / variance[static_cast<Index>(a)];
    out.residual[a] = b.weighted;  // noise² V⁻¹ r is the estimated white part
  }
  // leave one pose out: (Q_ii)⁻¹ (Q y)_i, Q = V⁻¹ − V⁻¹X(XᵀV⁻¹X)⁻¹XᵀV⁻¹
  for (Index i = 0; i < n; ++i) {
    Matrix3d Q;
    Vector3d q;
    for (Index a = 0; a < 3; ++a) {
      const auto ka = static_cast<std::size_t>(a);
      q[a] = out.group.component[ka].weighted[i] / variance[a];
      for (Index b = 0; b < 3; ++b) {
        const auto kb = static_cast<std::size_t>(b);
        Q(a, b) = -(VX[ka].row(i) * out.group.covariance).dot(VX[kb].row(i));
      }
      Q(a, a) += own_inverse[ka][i];
    }
    const Matrix3d C = (Q + 1e-12 * Q.trace() * Matrix3d::Identity()).inverse();
    out.held_out.push_back(C * q);
    out.held_out_covariance.push_back(0.5 * (C + C.transpose()));
  }
  return out;
}

// ---- refusals

// what a free constant in sensor axes leaves of g: least root of 1 − R̄ R̄ᵀ, R̄ the mean rotation
double weakestDirection(const std::vector<Matrix3d>& R) {
  const auto n = static_cast<double>(R.size());
  Matrix3d mean = Matrix3d::Zero();
  for (const Matrix3d& r : R) mean += r / n;
  const Matrix3d information = Matrix3d::Identity() - mean * mean.transpose();
  const Eigen::SelfAdjointEigenSolver<Matrix3d> solver(information);
  return std::sqrt(std::max(solver.eigenvalues()[0], 0.0));
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

Problem problemOf(const std::vector<StaticPose>& poses, const std::vector<Vector6>& w,
                  const std::vector<std::size_t>& used, double& temperature_mean) {
  Problem out;
  double force = 0.0, torque = 0.0, low = 1e300, high = -1e300, sum = 0.0;
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
    force = std::max(force, w[i].head<3>().norm());
    torque = std::max(torque, w[i].tail<3>().norm());
  }
  const auto n = static_cast<double>(used.size());
  temperature_mean = temperatures ? sum / n : std::numeric_limits<double>::quiet_NaN();
  if (temperatures && high > low) {
    for (double& t : out.line.temperature) t -= temperature_mean;
  } else {
    out.line.temperature.clear();
  }
  out.line.step = (out.line.order.back() - out.line.order.front()) / std::max(n - 1.0, 1.0);
  out.force_floor = std::max(kNoiseFloor * force, 1e-12);
  out.torque_floor = std::max(kNoiseFloor * torque, 1e-13);
  return out;
}

GroupFit plainFit(const Group& group, const Timeline& line, double floor) {
  GroupFit fit;
  for (std::size_t a = 0; a < 3; ++a) {
    fit.choice[a] = candidateOf(group[a], DriftShape::kNone, 0.0, false, line, {0});
  }
  profile(fit, static_cast<double>(line.order.size()), floor);
  return fit;
}

double medianHeldOut(const FullGroup& fit) {
  std::vector<double> sizes;
  for (const Vector3d& e : fit.held_out) sizes.push_back(e.norm());
  const auto middle = sizes.begin() + static_cast<std::ptrdiff_t>(sizes.size() / 2);
  std::nth_element(sizes.begin(), middle, sizes.end());
  return *middle;
}

// how well one reading of the axes fits, with a bias that may do what it likes
struct Reading {
  double force = 0.0, torque = 0.0;  // median held-out error
  double weight = 0.0;
};

Reading tryReading(const Problem& p, bool drift) {
  const auto fitOf = [&](const Group& group, double floor) {
    Timeline plain = p.line;
    plain.temperature.clear();
    GroupFit fit;
    for (std::size_t a = 0; a < 3; ++a) {
      fit.choice[a] = candidateOf(group[a], drift ? DriftShape::kRandomWalk : DriftShape::kNone,
                                  drift ? 0.3 / plain.step : 0.0, false, plain, {0});
    }
    profile(fit, static_cast<double>(plain.order.size()), floor);
    return fullFit(group, fit, plain, {0}, floor);
  };
  Reading out;
  const FullGroup force = fitOf(forceGroup(p.R, p.w), p.force_floor);
  const Vector3d gravity = force.group.effects.head<3>();
  out.force = std::max(medianHeldOut(force), p.force_floor);
  out.torque = std::max(medianHeldOut(fitOf(torqueGroup(p.R, p.w, gravity), p.torque_floor)),
                        p.torque_floor);
  out.weight = gravity.norm();
  return out;
}

// base, sensor, or auto where neither fits better
WrenchAxes chooseAxes(const Reading& base, const Reading& sensor) {
  constexpr double kClearly = 0.7;
  const double ratio = base.force * base.torque / (sensor.force * sensor.torque);
  if (ratio < kClearly) return WrenchAxes::kBase;
  if (ratio > 1.0 / kClearly) return WrenchAxes::kSensor;
  // a weight without bias and centre of mass reads as a bias without weight in the wrong axes
  if (sensor.weight < 0.2 * base.weight) return WrenchAxes::kBase;
  if (base.weight < 0.2 * sensor.weight) return WrenchAxes::kSensor;
  return WrenchAxes::kAuto;
}

void checkInput(const std::vector<StaticPose>& poses, const std::vector<Vector6>& wrenches) {
  if (poses.size() != wrenches.size()) {
    throw InputError("payload: " + std::to_string(poses.size()) + " poses, " +
                     std::to_string(wrenches.size()) + " wrenches: give one wrench a pose");
  }
  if (poses.size() > kMostPoses) {
    throw InputError("payload: " + std::to_string(poses.size()) + " poses: give at most " +
                     std::to_string(kMostPoses) + ", averages of standing periods");
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

// ---- linear functions of the fit

void checkIdentified(const PayloadModel& model) {
  if (!model.refusal.empty() || model.order.empty()) {
    throw InputError("payload: not identified: " + model.refusal);
  }
}

struct Functional {
  VectorXd row;     // on the effects
  VectorXd kernel;  // drift covariance with the fitted readings, unit rate
  double variance = 0.0;
};

std::size_t recordingAt(const PayloadModel& model, double order) {
  std::size_t recording = 0;
  while (recording + 1 < model.starts.size() && order >= model.order[model.starts[recording + 1]]) {
    ++recording;
  }
  return recording;
}

Functional biasFunctional(const PayloadModel& model, int axis, double order, double temperature) {
  const BiasGroup& group = model.group[static_cast<std::size_t>(axis / 3)];
  const BiasComponent& b = group.component[static_cast<std::size_t>(axis % 3)];
  const std::size_t recording = recordingAt(model, order);
  Functional f;
  f.row = VectorXd::Zero(group.effects.size());
  const Index lead = b.temperature ? 1 : 0;
  if (b.temperature && std::isfinite(temperature)) {
    f.row[b.first_effect] = temperature - model.temperature_mean;
  }
  bias_series::fillOwnEffects(b.shape, model.order, model.starts, order, recording,
                              f.row.segment(b.first_effect + lead, b.own_effects - lead));
  const auto n = static_cast<Index>(model.order.size());
  f.kernel = VectorXd::Zero(n);
  if (b.ratio > 0.0) {
    const double origin = model.order[model.starts[recording]];
    const std::size_t end =
        recording + 1 < model.starts.size() ? model.starts[recording + 1] : model.order.size();
    for (std::size_t i = model.starts[recording]; i < end; ++i) {
      f.kernel[static_cast<Index>(i)] =
          b.ratio * bias_series::covariance(b.shape, order, model.order[i], origin);
    }
    f.variance = b.ratio * bias_series::covariance(b.shape, order, order, origin);
  }
  return f;
}

std::pair<double, double> evaluate(const BiasGroup& group, std::size_t component,
                                   const Functional& f) {
  const BiasComponent& b = group.component[component];
  const double value = f.row.dot(group.effects) + f.kernel.dot(b.weighted);
  const VectorXd k = b.whitener * f.kernel;
  const VectorXd rest = f.row - b.design.transpose() * (b.whitener.transpose() * k);
  const double own = std::max(f.variance - k.squaredNorm(), 0.0) * b.noise * b.noise;
  return {value, std::max(rest.dot(group.covariance * rest), 0.0) + own};
}

// first pose after the break whose largest jump is least, if that is no more than the scatter
std::optional<std::size_t> smallestBreak(const PayloadModel& model) {
  std::optional<std::size_t> place;
  double least = kLeastJump;
  for (std::size_t r = 1; r < model.starts.size(); ++r) {
    const std::size_t start = model.starts[r];
    double size = 0.0;
    for (int axis = 0; axis < 6; ++axis) {
      const BiasGroup& group = model.group[static_cast<std::size_t>(axis / 3)];
      const auto component = static_cast<std::size_t>(axis % 3);
      const auto biasAt = [&](std::size_t i) {
        return evaluate(group, component,
                        biasFunctional(model, axis, model.order[i], model.temperature_mean))
            .first;
      };
      size = std::max(
          size, std::abs(biasAt(start) - biasAt(start - 1)) / group.component[component].noise);
    }
    if (size >= least) continue;
    least = size;
    place = start;
  }
  return place;
}

double rms(const std::vector<Vector6>& values, Index first) {
  if (values.empty()) return 0.0;
  double sum = 0.0;
  for (const Vector6& v : values) sum += v.segment<3>(first).squaredNorm();
  return std::sqrt(sum / (3.0 * static_cast<double>(values.size())));
}

double rmsOf(const FullGroup& fit) {
  double sum = 0.0;
  for (const VectorXd& r : fit.residual) sum += r.squaredNorm();
  return std::sqrt(sum / (3.0 * static_cast<double>(fit.residual[0].size())));
}

std::vector<double> toVector(const VectorXd& v) { return {v.data(), v.data() + v.size()}; }

// ---- in-situ correction: f = A Rᵀg + b, τ = (c× + S) f + b with S symmetric

void correctInSitu(PayloadModel& model, const Problem& problem, const PayloadOptions& options) {
  InSituCorrection& out = model.in_situ;
  const std::size_t n = problem.R.size();
  if (n < 20) {
    out.reason = std::to_string(n) + " poses: the 15 gains and cross-talks need at least 20";
    return;
  }
  // gravity's directions in sensor axes have to fill space
  Matrix3d second = Matrix3d::Zero();
  Vector3d mean = Vector3d::Zero();
  std::vector<Vector3d> load;
  for (const Matrix3d& R : problem.R) {
    load.push_back(R.transpose() * model.gravity);
    mean += load.back() / static_cast<double>(n);
  }
  for (const Vector3d& f : load) second += (f - mean) * (f - mean).transpose();
  const Eigen::SelfAdjointEigenSolver<Matrix3d> spread(second / static_cast<double>(n));
  if (std::sqrt(spread.eigenvalues()[0]) < 0.15 * model.weight) {
    out.reason = "gravity's directions in sensor axes lie near a plane: tilt about other axes too";
    return;
  }
  // each component: bias model as found, three free gains about the fitted load
  Matrix3d A = Matrix3d::Identity(), T = Matrix3d::Zero();
  double gain = 0.0, largest = 0.0;
  for (int g = 0; g < 2; ++g) {
    for (int a = 0; a < 3; ++a) {
      const BiasComponent& b =
          model.group[static_cast<std::size_t>(g)].component[static_cast<std::size_t>(a)];
      MatrixXd X(static_cast<Index>(n), 3 + b.own_effects);
      VectorXd y(static_cast<Index>(n));
      for (std::size_t i = 0; i < n; ++i) {
        const Vector3d expected = g == 0 ? load[i] : Vector3d(model.center_of_mass.cross(load[i]));
        X.row(static_cast<Index>(i)).head<3>() = load[i].transpose();
        y[static_cast<Index>(i)] = problem.w[i][3 * g + a] - expected[a];
      }
      X.rightCols(b.own_effects) = b.design.middleCols(b.first_effect, b.own_effects);
      const MatrixXd Xw = b.whitener * X;
      const VectorXd yw = b.whitener * y;
      const VectorXd x = Xw.colPivHouseholderQr().solve(yw);
      const MatrixXd own = Xw.rightCols(b.own_effects);
      const VectorXd x0 = own.colPivHouseholderQr().solve(yw);
      gain += ((yw - own * x0).squaredNorm() - (yw - Xw * x).squaredNorm()) / (b.noise * b.noise);
      (g == 0 ? A : T).row(a) += x.head<3>().transpose();
      if (g == 0) {
        const MatrixXd P = (Xw.transpose() * Xw).inverse() * b.noise * b.noise;
        largest = std::max(largest, std::sqrt(P.diagonal().head<3>().maxCoeff()));
      }
    }
  }
  const double scale =
      options.known_weight ? *options.known_weight / model.weight : 3.0 / A.trace();
  // shared effects were fitted already: 18 gains less weight vector (3) and centre of mass (3)
  out.p = bias_series::chiSquareTail(12, gain);
  out.largest_sd = largest;
  const Matrix3d force = scale * A.inverse();
  const Matrix3d cross = 0.5 * (T + T.transpose());
  if (largest > 0.02) {
    out.reason = "elements of the force block are known to " + std::to_string(largest) +
                 " only: record more poses";
    return;
  }
  if (out.p > 0.01 && !options.known_weight) {
    out.reason = "residuals ask for no correction: p = " + std::to_string(out.p);
    return;
  }
  out.given = true;
  out.reason = options.known_weight ? "scale from the known weight"
                                    : "scale unknown without a known weight: mean gain kept at 1";
  out.matrix.topLeftCorner<3, 3>() = force;
  out.matrix.bottomLeftCorner<3, 3>() = -cross * A.inverse();
}

}  // namespace

const char* toString(WrenchAxes axes) {
  return axes == WrenchAxes::kAuto ? "auto" : axes == WrenchAxes::kBase ? "base" : "sensor";
}

const char* toString(DriftShape shape) {
  switch (shape) {
    case DriftShape::kNone:
      return "none";
    case DriftShape::kLinear:
      return "linear";
    case DriftShape::kRandomWalk:
      return "random_walk";
    case DriftShape::kSmooth:
      return "smooth";
  }
  return "none";
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
  out.lag1_p = bias_series::twoSided((out.lag1 + 1.0 / count) * std::sqrt(count));
  const double minus = count - plus, expected = 1.0 + 2.0 * plus * minus / count;
  const double variance = (expected - 1.0) * (expected - 2.0) / (count - 1.0);
  if (variance > 0.0) out.runs_p = bias_series::twoSided((runs - expected) / std::sqrt(variance));
  return out;
}

PredictedWrench predictBias(const PayloadModel& model, double order, double temperature) {
  checkIdentified(model);
  PredictedWrench out;
  for (int axis = 0; axis < 6; ++axis) {
    const BiasGroup& group = model.group[static_cast<std::size_t>(axis / 3)];
    const auto [value, variance] = evaluate(group, static_cast<std::size_t>(axis % 3),
                                            biasFunctional(model, axis, order, temperature));
    out.wrench[axis] = value;
    out.sd[axis] = std::sqrt(variance);
  }
  return out;
}

PredictedWrench predictWrench(const PayloadModel& model, const StaticPose& pose) {
  checkIdentified(model);
  PredictedWrench out;
  const Vector3d load = pose.R.transpose() * model.gravity;
  const Matrix3d lever = -skew(load);
  for (int axis = 0; axis < 6; ++axis) {
    const BiasGroup& group = model.group[static_cast<std::size_t>(axis / 3)];
    Functional f = biasFunctional(model, axis, pose.order, pose.temperature);
    f.row.head<3>() = axis < 3 ? Vector3d(pose.R.col(axis)) : Vector3d(lever.row(axis - 3));
    const auto component = static_cast<std::size_t>(axis % 3);
    const auto [value, variance] = evaluate(group, component, f);
    const double noise = group.component[component].noise;
    out.wrench[axis] = value;
    out.sd[axis] = std::sqrt(variance + noise * noise);
  }
  if (model.axes == WrenchAxes::kSensor) return out;
  out.wrench.head<3>() = (pose.R * out.wrench.head<3>()).eval();
  out.wrench.tail<3>() = (pose.R * out.wrench.tail<3>()).eval();
  const Matrix3d squares = pose.R.cwiseAbs2();
  out.sd.head<3>() = (squares * out.sd.head<3>().cwiseAbs2()).cwiseSqrt().eval();
  out.sd.tail<3>() = (squares * out.sd.tail<3>().cwiseAbs2()).cwiseSqrt().eval();
  return out;
}

PayloadModel identifyPayload(const std::vector<StaticPose>& poses,
                             const std::vector<Vector6>& wrenches, const PayloadOptions& options) {
  checkInput(poses, wrenches);
  PayloadModel model;
  if (poses.size() < kLeastPoses) {
    model.refusal =
        std::to_string(poses.size()) + " poses: give at least " + std::to_string(kLeastPoses);
    return model;
  }
  std::vector<Matrix3d> rotations;
  for (const StaticPose& p : poses) rotations.push_back(p.R);
  const double weakest = weakestDirection(rotations);
  if (weakest < kWeakestDirection) {
    model.refusal =
        "the orientations do not tell weight from bias (rank below 6): turn the sensor about two "
        "horizontal axes by tens of degrees";
    return model;
  }

  // axes: the reading that leaves less when the bias may drift
  const bool structured = poses.size() >= kLeastForStructure;
  std::vector<std::size_t> all(poses.size());
  std::iota(all.begin(), all.end(), std::size_t{0});
  std::array<Reading, 2> reading;
  for (std::size_t k = 0; k < 2; ++k) {
    double mean = 0.0;
    const WrenchAxes axes = k == 0 ? WrenchAxes::kBase : WrenchAxes::kSensor;
    reading[k] = tryReading(problemOf(poses, inSensorAxes(poses, wrenches, axes), all, mean),
                            structured && options.drift);
  }
  model.base_residual = reading[0].force;
  model.sensor_residual = reading[1].force;
  model.axes =
      options.axes == WrenchAxes::kAuto ? chooseAxes(reading[0], reading[1]) : options.axes;
  if (model.axes == WrenchAxes::kAuto) {
    model.refusal = "wrenches in base axes and in sensor axes fit alike: say which they are";
    return model;
  }

  // structure, then the worst outlier, until nothing changes
  const std::vector<Vector6> w = inSensorAxes(poses, wrenches, model.axes);
  model.used = all;
  Structure structure;
  Problem problem;
  FullGroup force, torque;
  std::vector<double> no_break;
  const auto most = static_cast<std::size_t>(kMostOutliers * static_cast<double>(poses.size()));
  while (true) {
    problem = problemOf(poses, w, model.used, model.temperature_mean);
    problem.no_break = no_break;
    if (!structured) problem.line.temperature.clear();
    structure = searchStructure(problem, options.drift && structured, options.breaks && structured);
    force = fullFit(forceGroup(problem.R, problem.w), structure.force, problem.line,
                    structure.starts, problem.force_floor);
    const Vector3d gravity = force.group.effects.head<3>();
    torque = fullFit(torqueGroup(problem.R, problem.w, gravity), structure.torque, problem.line,
                     structure.starts, problem.torque_floor);
    model.order = problem.line.order;
    model.starts = structure.starts;
    model.group = {force.group, torque.group};
    if (const auto place = smallestBreak(model)) {
      // the break and its neighbours are drift
      for (std::size_t i = *place - 2; i <= std::min(*place + 2, model.order.size() - 1); ++i) {
        no_break.push_back(model.order[i]);
      }
      continue;
    }
    const auto n = static_cast<double>(model.used.size());
    if (!options.outliers || model.used.size() <= kLeastPoses + 2 ||
        model.rejected.size() >= most) {
      break;
    }
    const double limit = bias_series::chiSquareQuantile(6, kOutlierTail / n) * (n / (n - 6.0));
    std::vector<double> distance;
    for (std::size_t i = 0; i < model.used.size(); ++i) {
      distance.push_back(
          force.held_out[i].dot(force.held_out_covariance[i].inverse() * force.held_out[i]) +
          torque.held_out[i].dot(torque.held_out_covariance[i].inverse() * torque.held_out[i]));
    }
    const auto worst = std::max_element(distance.begin(), distance.end());
    if (!(*worst > limit)) break;
    const auto place = worst - distance.begin();
    model.rejected.push_back(model.used[static_cast<std::size_t>(place)]);
    model.used.erase(model.used.begin() + place);
  }
  std::sort(model.rejected.begin(), model.rejected.end());

  // numbers
  const std::size_t n = model.used.size();
  model.structure_tested = structured;
  model.has_temperature = !problem.line.temperature.empty();
  model.gravity = force.group.effects.head<3>();
  model.gravity_covariance = force.group.covariance.topLeftCorner<3, 3>();
  model.weight = model.gravity.norm();
  const Vector3d direction = model.gravity / std::max(model.weight, 1e-300);
  model.weight_sd = std::sqrt(direction.dot(model.gravity_covariance * direction));
  model.center_of_mass = torque.group.effects.head<3>();
  // centre of mass: torque noise, and the weight it was divided by
  Matrix3d by_gravity;
  for (int k = 0; k < 3; ++k) {
    const double step = 1e-4 * std::max(model.weight, 1e-9);
    const Vector3d moved = model.gravity + step * Vector3d::Unit(k);
    const FullGroup other = fullFit(torqueGroup(problem.R, problem.w, moved), structure.torque,
                                    problem.line, structure.starts, problem.torque_floor);
    by_gravity.col(k) = (other.group.effects.head<3>() - model.center_of_mass) / step;
  }
  model.center_covariance = torque.group.covariance.topLeftCorner<3, 3>() +
                            by_gravity * model.gravity_covariance * by_gravity.transpose();

  for (std::size_t i = 0; i < n; ++i) {
    Vector6 r, h;
    for (Index a = 0; a < 3; ++a) {
      r[a] = force.residual[static_cast<std::size_t>(a)][static_cast<Index>(i)];
      r[3 + a] = torque.residual[static_cast<std::size_t>(a)][static_cast<Index>(i)];
    }
    h << force.held_out[i], torque.held_out[i];
    model.residual.push_back(r);
    model.held_out.push_back(h);
  }
  model.force_rms = rms(model.residual, 0);
  model.torque_rms = rms(model.residual, 3);
  model.held_out_force_rms = rms(model.held_out, 0);
  model.held_out_torque_rms = rms(model.held_out, 3);

  // constant bias for comparison, and the tests on both
  const Group force_data = forceGroup(problem.R, problem.w);
  const FullGroup plain_force =
      fullFit(force_data, plainFit(force_data, problem.line, problem.force_floor), problem.line,
              {0}, problem.force_floor, true);
  const Group torque_data = torqueGroup(problem.R, problem.w, plain_force.group.effects.head<3>());
  const FullGroup plain_torque =
      fullFit(torque_data, plainFit(torque_data, problem.line, problem.torque_floor), problem.line,
              {0}, problem.torque_floor, true);
  model.plain_force_rms = rmsOf(plain_force);
  model.plain_torque_rms = rmsOf(plain_torque);
  for (std::size_t a = 0; a < 6; ++a) {
    const FullGroup& plain = a < 3 ? plain_force : plain_torque;
    const FullGroup& full = a < 3 ? force : torque;
    model.plain_test[a] = testSequence(toVector(plain.residual[a % 3]));
    const VectorXd white =
        full.group.component[a % 3].whitener.transpose().triangularView<Eigen::Upper>().solve(
            full.group.component[a % 3].weighted);
    model.final_test[a] = testSequence(toVector(white));
  }

  // bias, drift and breaks with their uncertainty
  const double last = model.order.back();
  const double mean_temperature = model.temperature_mean;
  const PredictedWrench at_last = predictBias(model, last, poses[model.used.back()].temperature);
  model.last_bias = at_last.wrench;
  model.last_bias_sd = at_last.sd;
  for (int axis = 0; axis < 6; ++axis) {
    const auto component = static_cast<std::size_t>(axis % 3);
    BiasGroup& group = model.group[static_cast<std::size_t>(axis / 3)];
    BiasComponent& b = group.component[component];
    Functional mean;
    mean.row = VectorXd::Zero(group.effects.size());
    mean.kernel = VectorXd::Zero(static_cast<Index>(n));
    for (std::size_t i = 0; i < n; ++i) {
      const Functional f =
          biasFunctional(model, axis, model.order[i], poses[model.used[i]].temperature);
      mean.row += f.row / static_cast<double>(n);
      mean.kernel += f.kernel / static_cast<double>(n);
    }
    mean.variance = mean.kernel.mean();
    const auto [value, variance] = evaluate(group, component, mean);
    model.bias[axis] = value;
    model.bias_sd[axis] = std::sqrt(variance);

    const auto difference = [&](std::size_t from, std::size_t to) {
      const Functional f0 = biasFunctional(model, axis, model.order[from], mean_temperature);
      const Functional f1 = biasFunctional(model, axis, model.order[to], mean_temperature);
      Functional d;
      d.row = f1.row - f0.row;
      d.kernel = f1.kernel - f0.kernel;
      d.variance = f1.variance + f0.variance - 2.0 * f1.kernel[static_cast<Index>(from)];
      return evaluate(group, component, d);
    };
    for (std::size_t r = 0; r < model.starts.size(); ++r) {
      const std::size_t end = r + 1 < model.starts.size() ? model.starts[r + 1] : n;
      const auto [change, change_variance] = difference(model.starts[r], end - 1);
      model.drift[static_cast<std::size_t>(axis)].push_back({change, std::sqrt(change_variance)});
      if (r + 1 == model.starts.size()) break;
      if (model.breaks.size() <= r) {
        BiasBreak fresh;
        fresh.pose = model.used[end];
        fresh.order = model.order[end];
        fresh.gain = r < structure.gains.size() ? structure.gains[r] : 0.0;
        model.breaks.push_back(fresh);
      }
      const auto [jump, jump_variance] = difference(end - 1, end);
      model.breaks[r].jump[axis] = jump;
      model.breaks[r].jump_sd[axis] = std::sqrt(jump_variance);
    }
    if (b.temperature) {
      model.temperature_coefficient[axis] = group.effects[b.first_effect];
      model.temperature_sd[axis] = std::sqrt(group.covariance(b.first_effect, b.first_effect));
    }
    // how much likelier than no drift, other components as they are
    if (b.shape != DriftShape::kNone) {
      const Group& data = axis < 3 ? force_data : torqueGroup(problem.R, problem.w, model.gravity);
      const GroupFit& chosen = axis < 3 ? structure.force : structure.torque;
      GroupFit without = chosen;
      without.choice[component] = candidateOf(data[component], DriftShape::kNone, 0.0,
                                              b.temperature, problem.line, structure.starts);
      profile(without, static_cast<double>(n),
              axis < 3 ? problem.force_floor : problem.torque_floor);
      b.drift_gain = (without.criterion - without.choice[component].cost) -
                     (chosen.criterion - chosen.choice[component].cost);
    }
  }
  if (options.in_situ) correctInSitu(model, problem, options);
  return model;
}

}  // namespace assembly_cell
