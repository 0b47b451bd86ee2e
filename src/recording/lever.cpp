// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "lever.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <array>
#include <cmath>

namespace assembly_cell {

namespace {

using Eigen::Matrix3d;
using Eigen::MatrixXd;
using Eigen::Vector3d;

// maximum couple over force [m] of a point contact with friction in a window; twice either admits
// contacts in a hole, half leaves too few: 0.3 mm more scatter
constexpr double kLeverPitch = 0.3e-3;
constexpr double kLeverFloor = 2e-3;  // sd of a window's lever by rolling and bending [m]
constexpr double kHuber = 1.0;
// a face across z: share of the force along z, couple over force [m], samples, share passed over
constexpr double kAcross = 0.9, kFacePitch = 6e-3, kFaceFirst = 0.05;
constexpr std::size_t kFaceSamples = 20;
// Hypotheses. Spread of a window's lever [m]: half its sd, which counts neighbouring samples as
// one, but no more than kWidest; share of windows that fit neither, spread over kOutlierRange [m]
constexpr double kWidest = 4e-3, kOutliers = 0.1, kOutlierRange = 0.2;
// of an edge beside the first face that the tip presses on: chamfer, rounding; and if it isn't that
constexpr double kEdgeSd = 1.5e-3, kOtherEdge = 1e-3;
constexpr double kStep = 0.5e-3, kBeyond = 20e-3;  // grid [m]
constexpr std::size_t kMostSteps = 200;
constexpr std::size_t kFolds = 5;
constexpr double kOneDepth = 5e-3;  // [m] within which tip and side are not distinguished
// weight of a contact of the side beside one of the tip: chosen, contacts of the tip are likelier
constexpr double kSide = 0.7;
// log likelihood of windows left out by which the edge must predict better: odds of e^10
constexpr double kClearly = 10.0;
constexpr double kUnlikely = 3.0;  // sd of the difference
// spread of the likely levers [m] from which it is stated: more than one fits
constexpr double kUnsureSpread = 3e-3;

double density(double x, double sd) {
  return std::exp(-0.5 * x * x / (sd * sd)) / (sd * std::sqrt(2.0 * M_PI));
}

// Huber's mean, started from the weighted median.
Lever combined(const std::vector<LeverWindow>& windows) {
  std::vector<std::pair<double, double>> levers;  // value, weight
  double sum = 0.0;
  for (const LeverWindow& w : windows) {
    levers.push_back({w.point.z(), 1.0 / (w.sd * w.sd + kLeverFloor * kLeverFloor)});
    sum += levers.back().second;
  }
  std::sort(levers.begin(), levers.end());
  double below = 0.0, lever = levers.front().first;
  for (const auto& [value, weight] : levers) {
    lever = value;
    below += weight;
    if (below >= 0.5 * sum) break;
  }
  double weights = 0.0, squares = 0.0;
  for (int pass = 0; pass < 50; ++pass) {
    double values = 0.0;
    weights = squares = 0.0;
    for (const auto& [value, weight] : levers) {
      const double u = std::abs(value - lever) * std::sqrt(weight);
      const double w = weight * std::min(1.0, kHuber / std::max(u, 1e-12));
      weights += w;
      values += w * value;
      squares += w * w * (value - lever) * (value - lever);
    }
    lever = values / weights;
  }
  return {lever, std::sqrt(std::max(squares / (weights * weights), 1.0 / weights))};
}

// Levers times depths of an edge; the last edge is below all windows: there is none.
struct Grid {
  std::vector<double> lever, edge;
};

std::vector<double> range(double low, double high) {
  const double step = std::max(kStep, (high - low) / static_cast<double>(kMostSteps));
  std::vector<double> out;
  for (double x = low; x <= high; x += step) out.push_back(x);
  return out;
}

Grid gridOf(const std::vector<LeverWindow>& windows, double sign,
            const std::optional<double>& surface) {
  double low = HUGE_VAL, high = -HUGE_VAL, top = HUGE_VAL, bottom = -HUGE_VAL;
  for (const LeverWindow& w : windows) {
    low = std::min(low, sign * w.point.z());
    high = std::max(high, sign * w.point.z());
    top = std::min(top, sign * w.depth);
    bottom = std::max(bottom, sign * w.depth);
  }
  if (surface) top = std::min(top, sign * *surface);
  Grid out;
  out.lever = range(low - kBeyond, high + kBeyond + (bottom - top));
  out.edge = range(top - kBeyond, bottom);
  out.edge.push_back(HUGE_VAL);
  return out;
}

// Log likelihood of each fold of the windows over the grid.
std::array<MatrixXd, kFolds> likelihoods(const std::vector<LeverWindow>& windows, double sign,
                                         const Grid& grid) {
  std::array<MatrixXd, kFolds> out;
  const auto rows = static_cast<Eigen::Index>(grid.lever.size());
  const auto cols = static_cast<Eigen::Index>(grid.edge.size());
  for (MatrixXd& fold : out) fold = MatrixXd::Zero(rows, cols);
  const double none = kOutliers / kOutlierRange;
  for (std::size_t i = 0; i < windows.size(); ++i) {
    const double z = sign * windows[i].point.z(), depth = sign * windows[i].depth;
    const double sd = std::hypot(std::min(0.5 * windows[i].sd, kWidest), kLeverFloor);
    MatrixXd& fold = out[i % kFolds];
    for (Eigen::Index r = 0; r < rows; ++r) {
      const double lever = grid.lever[static_cast<std::size_t>(r)];
      const double tip = (1.0 - kOutliers) * density(z - lever, sd);
      for (Eigen::Index c = 0; c < cols; ++c) {
        const double below = depth - grid.edge[static_cast<std::size_t>(c)];
        double p = tip;
        if (below > 0.0) {
          p = std::max(p, kSide * (1.0 - kOutliers) * density(z - (lever - below), sd));
        }
        fold(r, c) += std::log(p + none);
      }
    }
  }
  return out;
}

// Windows of each fold by the others' best: only levers, or levers and edges.
double heldOut(const std::array<MatrixXd, kFolds>& folds, const MatrixXd& prior,
               const MatrixXd& all, bool edges) {
  double sum = 0.0;
  for (const MatrixXd& fold : folds) {
    const MatrixXd others = all - fold + prior;
    Eigen::Index r = 0, c = 0;
    if (edges) {
      others.maxCoeff(&r, &c);
    } else {
      c = others.cols() - 1;
      others.col(c).maxCoeff(&r);
    }
    sum += fold(r, c);
  }
  return sum;
}

// What tip and side differ by where all windows are at one depth below a face; else 0.
double unknownSide(const std::vector<LeverWindow>& windows, double sign,
                   const std::optional<double>& surface) {
  double top = HUGE_VAL, bottom = -HUGE_VAL;
  for (const LeverWindow& w : windows) {
    top = std::min(top, sign * w.depth);
    bottom = std::max(bottom, sign * w.depth);
  }
  if (!surface || bottom - top > kOneDepth || top - sign * *surface < kOneDepth) return 0.0;
  return 0.5 * (top - sign * *surface);
}

}  // namespace

std::optional<LeverWindow> leverWindow(const ContactAnalysis& a, std::size_t first,
                                       std::size_t end) {
  const double sd = std::sqrt(a.noise.diagonal().tail<3>().maxCoeff());
  Matrix3d normal = Matrix3d::Zero();
  Vector3d moment = Vector3d::Zero();
  double squares = 0.0;
  std::size_t count = 0;
  for (std::size_t i = first; i < end; ++i) {
    const Vector3d F = a.samples[i].wrench.head<3>(), M = a.samples[i].wrench.tail<3>();
    const double force = F.norm();
    if (force < kLeverForce) continue;
    const double pitch = std::abs(F.dot(M)) / (force * force);
    if (pitch > std::hypot(kLeverPitch, 2.0 * sd / force)) continue;
    const Matrix3d A = -skew(F);  // r × F
    normal += A.transpose() * A;
    moment += A.transpose() * M;
    squares += M.squaredNorm();
    ++count;
  }
  if (5 * count < 4 * (end - first)) return std::nullopt;
  const Eigen::LDLT<Matrix3d> solver(normal);
  const Vector3d point = solver.solve(moment);
  const double n = static_cast<double>(count);
  const double left = std::sqrt(std::max(squares - point.dot(moment), 0.0) / n);
  const double information = 1.0 / solver.solve(Vector3d::UnitZ()).z();
  if (!(information > 0.0) || !point.allFinite()) return std::nullopt;
  // neighbouring samples are correlated: a window counts as three measurements of a moment
  return LeverWindow{point, std::max(left, sd) * std::sqrt(n / information), 0.0};
}

std::vector<double> depths(const WrenchRecording& r) {
  Vector3d down = Vector3d::Zero();
  for (const Pose& pose : r.pose) down += pose.R.col(2);
  down.normalize();
  std::vector<double> out;
  for (const Pose& pose : r.pose) out.push_back(pose.p.dot(down));
  return out;
}

std::optional<double> firstSurface(const ContactAnalysis& a, const std::vector<double>& depth) {
  std::vector<double> pressed;
  for (std::size_t i = 0; i < depth.size(); ++i) {
    const Vector3d F = a.samples[i].wrench.head<3>(), M = a.samples[i].wrench.tail<3>();
    const double force = F.norm();
    if (force < kLeverForce || std::abs(F.z()) < kAcross * force ||
        std::abs(F.dot(M)) > kFacePitch * force * force) {
      continue;
    }
    pressed.push_back(depth[i]);
  }
  if (pressed.size() < kFaceSamples) return std::nullopt;
  std::sort(pressed.begin(), pressed.end());
  return pressed[static_cast<std::size_t>(kFaceFirst * static_cast<double>(pressed.size()))];
}

Lever leverOf(const std::vector<LeverWindow>& windows, const std::optional<double>& surface) {
  Lever tips = combined(windows);
  const double sign = tips.value < 0.0 ? -1.0 : 1.0;
  tips.sd = std::hypot(tips.sd, unknownSide(windows, sign, surface));
  const Grid grid = gridOf(windows, sign, surface);
  const std::array<MatrixXd, kFolds> folds = likelihoods(windows, sign, grid);
  MatrixXd all = MatrixXd::Zero(folds[0].rows(), folds[0].cols());
  MatrixXd prior = all;
  for (const MatrixXd& fold : folds) all += fold;
  if (surface) {
    for (Eigen::Index c = 0; c + 1 < prior.cols(); ++c) {
      const double apart = grid.edge[static_cast<std::size_t>(c)] - sign * *surface;
      prior.col(c).setConstant(
          std::log(std::exp(-0.5 * apart * apart / (kEdgeSd * kEdgeSd)) + kOtherEdge));
    }
  }
  const Eigen::VectorXd profile = (all + prior).rowwise().maxCoeff();
  const Eigen::ArrayXd likely = (profile.array() - profile.maxCoeff()).exp();
  const Eigen::Map<const Eigen::ArrayXd> levers(grid.lever.data(), likely.size());
  const double mean = (likely * levers).sum() / likely.sum();
  const double sd =
      std::sqrt((likely * (levers - mean).square()).sum() / likely.sum() + kStep * kStep / 12.0);
  const bool better =
      heldOut(folds, prior, all, true) - heldOut(folds, prior, all, false) > kClearly;
  const bool apart = std::abs(sign * tips.value - mean) > kUnlikely * std::hypot(sd, tips.sd);
  if (!better && !apart) return {tips.value, sd > kUnsureSpread ? sd : tips.sd};
  return {sign * mean, std::hypot(sd, kEdgeSd)};
}

}  // namespace assembly_cell
