// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "dead_weight_labels.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <numeric>
#include <random>

#include "assembly_cell/base/median.h"
#include "assembly_cell/base/text.h"

namespace assembly_cell {

namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::Vector3d;
using Eigen::VectorXd;

// A wrong label is off by a step between weights or by an arm. Misfits below an eighth of the
// smallest such step, or this fraction of the load, count as noise in the robust fit: the sensor is
// not quite linear. Of 200 files with up to five swaps each, half of these fractions misses
// 1 more row, twice 3.
constexpr double kStep = 0.125;
constexpr double kForceFraction = 0.003;   // [N/N]
constexpr double kMomentFraction = 0.001;  // [m]
constexpr double kTukey = 8.0;             // in these units: beyond it a row has weight 0
constexpr int kStarts = 200;               // random halves and thirds; a tenth does for one swap
// a label is wrong where another one is nearer by this factor ...
constexpr double kNearer = 3.0;
// ... and its own misfit is beyond this many robust sd
constexpr double kBeyond = 6.0;
constexpr double kNoiseForceFraction = 0.005, kNoiseMomentFraction = 0.0005;
// misfits of a file whose labels are right, of the smallest step between labels: 0.17 and 0.74 in
// the recording, a single wrong one leaves 0.85
constexpr double kCleanForce = 0.5, kCleanMoment = 0.78;
// fits no label: sd, and share of the load or arm that is in doubt [N/N], [m]
constexpr double kGross = 10.0, kGrossForceFraction = 0.1, kGrossArm = 0.03;

struct Scales {
  double force_step, moment_step;  // smallest label but zero
};

Scales scalesOf(const MatrixXd& labels) {
  Scales out{1e300, 1e300};
  for (Index i = 0; i < labels.rows(); ++i) {
    const double force = labels.row(i).head<3>().norm(), moment = labels.row(i).tail<3>().norm();
    if (force > 1e-9) out.force_step = std::min(out.force_step, force);
    if (moment > 1e-9) out.moment_step = std::min(out.moment_step, moment);
  }
  if (out.moment_step > 1e299) out.moment_step = 0.1 * out.force_step;
  return out;
}

// Misfits of the rows in units of the noise.
VectorXd distances(const LabelledRows& d, const MatrixXd& C, const Scales& scales) {
  const MatrixXd read = d.A * C;
  VectorXd out(read.rows());
  for (Index i = 0; i < read.rows(); ++i) {
    const Vector6 e = (d.Y.row(i) - read.row(i)).transpose();
    const double load = read.row(i).head<3>().norm();
    out[i] = std::hypot(
        e.head<3>().norm() / std::hypot(kStep * scales.force_step, kForceFraction * load),
        e.tail<3>().norm() / std::hypot(kStep * scales.moment_step, kMomentFraction * load));
  }
  return out;
}

MatrixXd weighted(const LabelledRows& d, const VectorXd& w) {
  const MatrixXd normal = d.A.transpose() * w.asDiagonal() * d.A;
  // regularisation: what no row determines stays small
  const double floor = 1e-12 * normal.trace();
  return (normal + floor * MatrixXd::Identity(normal.rows(), normal.cols()))
      .ldlt()
      .solve(d.A.transpose() * w.asDiagonal() * d.Y);
}

// Tukey's weights, from wide to narrow; returns the cost, 1 for a row of weight 0.
double settle(const LabelledRows& d, const Scales& scales, double widest, MatrixXd& C) {
  for (double width = widest; width >= 1.0; width *= 0.5) {
    for (int pass = 0; pass < 8; ++pass) {
      const VectorXd u = (distances(d, C, scales) / (width * kTukey)).cwiseMin(1.0);
      const VectorXd w = (1.0 - u.array().square()).square().matrix();
      if ((w.array() > 0.0).count() < d.A.cols()) return 1e300;
      C = weighted(d, w);
    }
  }
  const VectorXd u = (distances(d, C, scales) / kTukey).cwiseMin(1.0);
  return (1.0 - (1.0 - u.array().square()).cube()).sum();
}

MatrixXd robustFit(const LabelledRows& d, const Scales& scales) {
  const Index n = d.A.rows();
  MatrixXd best;
  double lowest = 1e301;
  const auto consider = [&](const VectorXd& weights, double widest) {
    MatrixXd C = weighted(d, weights);
    const double cost = settle(d, scales, widest, C);
    if (cost < lowest) {
      lowest = cost;
      best = C;
    }
  };
  VectorXd w = VectorXd::Ones(n);
  for (int pass = 0; pass < 60; ++pass) {  // least absolute misfits
    w = distances(d, weighted(d, w), scales).cwiseMax(1e-2).cwiseInverse();
  }
  consider(w, 8.0);
  std::mt19937 random(1);
  std::vector<Index> order(static_cast<std::size_t>(n));
  std::iota(order.begin(), order.end(), Index{0});
  for (int start = 0; start < kStarts; ++start) {
    for (std::size_t i = order.size() - 1; i > 0; --i)
      std::swap(order[i], order[random() % (i + 1)]);
    VectorXd half = VectorXd::Constant(n, 1e-9);
    for (Index k = 0; k < n / (2 + start % 2); ++k) half[order[static_cast<std::size_t>(k)]] = 1.0;
    consider(half, 4.0);
  }
  return best;
}

double robustSd(const MatrixXd& e) {
  std::vector<double> sizes(static_cast<std::size_t>(e.size()));
  const MatrixXd flat = e.cwiseAbs();
  std::copy(flat.data(), flat.data() + flat.size(), sizes.begin());
  return std::max(1.4826 * upperMedian(sizes), 1e-9);
}

// ---- labels that may have been intended

struct Meant {
  Vector6 label;
  std::string text;
};

Vector6 joined(const Vector6& force, const Vector6& moment) {
  Vector6 out;
  out << force.head<3>(), moment.tail<3>();
  return out;
}

std::vector<Meant> alternatives(const LabelledRows& d, std::size_t k) {
  const Vector6 own = d.Y.row(static_cast<Index>(k));
  std::vector<Meant> out;
  std::vector<Vector3d> arms;
  for (std::size_t j = 0; j < d.labelled.size(); ++j) {
    const Vector6 other = d.Y.row(static_cast<Index>(j));
    const std::string at = text("line %zu", d.rows[d.labelled[j]].line);
    const double force2 = other.head<3>().squaredNorm();
    if (force2 > 0.0) {
      const Vector3d arm = other.head<3>().cross(other.tail<3>()) / force2;
      const bool known = std::any_of(arms.begin(), arms.end(),
                                     [&](const Vector3d& a) { return (a - arm).norm() < 1e-3; });
      if (!known) arms.push_back(arm);
    }
    if (j == k) continue;
    out.push_back({other, "reads as the label of " + at});
    if (d.block[d.labelled[j]] != d.block[d.labelled[k]]) continue;
    out.push_back({joined(other, own), "force reads as that of " + at});
    out.push_back({joined(own, other), "moment reads as that of " + at});
  }
  for (const Vector3d& arm : arms) {
    Vector6 label = own;
    label.tail<3>() = arm.cross(Vector3d(own.head<3>()));
    out.push_back(
        {label, text("reads as an arm of (%.3g, %.3g, %.3g) m", arm.x(), arm.y(), arm.z())});
  }
  out.push_back({-own, "reads with the other sign"});
  out.push_back({joined(own, -own), "moment reads with the other sign"});
  out.push_back({joined(-own, own), "force reads with the other sign"});
  return out;
}

// whether `meant` explains the reading where the own label doesn't, in every part that differs
bool explains(const Vector6& meant, const Vector6& own, const Vector6& read, const double sd[2]) {
  if ((meant - own).cwiseAbs().maxCoeff() < 1e-9) return false;
  for (int part = 0; part < 2; ++part) {
    const auto of = [&](const Vector6& w) -> Vector3d { return w.segment<3>(3 * part); };
    if ((of(meant) - of(own)).norm() < 1e-9) continue;
    const double misfit = (of(own) - of(read)).norm(), left = (of(meant) - of(read)).norm();
    if (misfit < kNearer * left || misfit < kBeyond * sd[part]) return false;
  }
  return true;
}

}  // namespace

std::vector<WrongLabel> wrongLabels(const LabelledRows& d) {
  const Scales scales = scalesOf(d.Y);
  // if ordinary least squares explains every label, none is wrong
  const MatrixXd rest = d.Y - d.A * weighted(d, VectorXd::Ones(d.A.rows()));
  if (rest.leftCols<3>().rowwise().norm().maxCoeff() < kCleanForce * scales.force_step &&
      rest.rightCols<3>().rowwise().norm().maxCoeff() < kCleanMoment * scales.moment_step) {
    return {};
  }
  const MatrixXd read = d.A * robustFit(d, scales), e = d.Y - read;
  const double force_sd = robustSd(e.leftCols<3>()), moment_sd = robustSd(e.rightCols<3>());
  std::vector<WrongLabel> out;
  for (std::size_t k = 0; k < d.labelled.size(); ++k) {
    const auto row = static_cast<Index>(k);
    const Vector6 own = d.Y.row(row), r = read.row(row);
    const double load = r.head<3>().norm();
    const double sd[2] = {std::hypot(force_sd, kNoiseForceFraction * load),
                          std::hypot(moment_sd, kNoiseMomentFraction * load)};
    WrongLabel wrong{d.labelled[k], e.row(row).head<3>().norm(), e.row(row).tail<3>().norm(), r,
                     ""};
    double lowest = 1e300;
    for (const Meant& meant : alternatives(d, k)) {
      if (!explains(meant.label, own, r, sd)) continue;
      const Vector6 left = meant.label - r;
      const double misfit = std::hypot(left.head<3>().norm() / (kStep * scales.force_step),
                                       left.tail<3>().norm() / (kStep * scales.moment_step));
      if (misfit >= lowest) continue;
      lowest = misfit;
      wrong.text = meant.text;
    }
    const bool gross =
        wrong.force_error >
            std::max(kGross * force_sd, 0.5 * scales.force_step) + kGrossForceFraction * load ||
        wrong.moment_error > std::max(kGross * moment_sd, scales.moment_step) + kGrossArm * load;
    if (wrong.text.empty() && gross) wrong.text = "fits no label of the file";
    if (!wrong.text.empty()) out.push_back(wrong);
  }
  return out;
}

}  // namespace assembly_cell
