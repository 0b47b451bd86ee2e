// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "bias_search.h"

#include <Eigen/Cholesky>
#include <Eigen/QR>
#include <algorithm>
#include <cmath>
#include <limits>

#include "bias_series.h"

namespace assembly_cell::bias_series {

namespace {

using Eigen::Index;
using Eigen::Matrix3d;
using Eigen::MatrixXd;
using Eigen::Vector3d;
using Eigen::VectorXd;

constexpr double kInfinity = std::numeric_limits<double>::infinity();
constexpr std::size_t kMinRecording = 4;  // poses between breaks
constexpr std::size_t kMaxBreaks = 6;
// Cost of a drift or temperature coefficient in −2 log likelihood, in addition to BIC. Of 60 clean
// recordings of 50 poses none gets a false drift (half of it: 6; twice: 0); a random walk of 0.3
// noise sd a pose is detected in 20 of 40 (half of it: 22; twice: 12).
constexpr double kAxisCost = 9.0;
constexpr double kBreakTail = 1e-5;  // false breaks a clean recording, all places together
constexpr std::size_t kScanPlaces = 120;

// drift variances over the noise's that are tried, half a decade apart
std::vector<double> ratiosOf(DriftShape shape, double step) {
  std::vector<double> out;
  const bool smooth = shape == DriftShape::kSmooth;
  for (double e = smooth ? -6.0 : -3.0; e <= (smooth ? 0.6 : 1.6); e += 0.5) {
    out.push_back(std::pow(10.0, e) / (smooth ? step * step * step : step));
  }
  return out;
}

Index ownCount(DriftShape shape, std::size_t recordings) {
  return static_cast<Index>(recordings) * (hasSlope(shape) ? 2 : 1);
}

MatrixXd ownDesign(DriftShape shape, bool temperature, const Timeline& line,
                   const std::vector<std::size_t>& starts) {
  const Index own = ownCount(shape, starts.size());
  MatrixXd out(line.order.size(), own + (temperature ? 1 : 0));
  VectorXd row(own);
  std::size_t recording = 0;
  for (std::size_t i = 0; i < line.order.size(); ++i) {
    while (recording + 1 < starts.size() && i >= starts[recording + 1]) ++recording;
    fillOwnEffects(shape, line.order, starts, line.order[i], recording, row);
    if (temperature) out(i, 0) = line.temperature[i];
    out.row(i).tail(own) = row.transpose();
  }
  return out;
}

double residualSquares(const Candidate& c, const Vector3d& shared) {
  Eigen::Vector4d v;
  v << -shared, 1.0;
  return std::max(v.dot(c.gram * v), 0.0);
}

using Candidates = std::array<std::vector<Candidate>, 3>;

Candidates candidatesOf(const Triple& data, const Timeline& line,
                        const std::vector<std::size_t>& starts, bool drift) {
  Candidates out;
  for (std::size_t a = 0; a < 3; ++a) {
    const auto add = [&](DriftShape shape, double ratio) {
      for (const bool temperature : {false, true}) {
        if (temperature && line.temperature.empty()) continue;
        out[a].push_back(candidateOf(data[a], shape, ratio, temperature, line, starts));
      }
    };
    add(DriftShape::kNone, 0.0);
    if (!drift) continue;
    add(DriftShape::kLinear, 0.0);
    for (const DriftShape shape : {DriftShape::kRandomWalk, DriftShape::kSmooth}) {
      for (const double ratio : ratiosOf(shape, line.step)) add(shape, ratio);
    }
  }
  return out;
}

GroupFit bestOf(const Candidates& candidates, double n, double floor) {
  GroupFit best;
  best.criterion = kInfinity;
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
    double last = kInfinity;
    for (int round = 0; round < 8 && (round < 2 || fit.criterion < last - 1e-9); ++round) {
      last = fit.criterion;
      for (std::size_t a = 0; a < 3; ++a) {
        double lowest = kInfinity;
        for (const Candidate& c : candidates[a]) {
          const double s2 = residualSquares(c, fit.shared) / n + floor * floor;
          const double value = n * std::log(s2) + c.log_det + c.cost;
          if (value < lowest) {
            lowest = value;
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

// ---- breaks ----

bool isFree(const std::vector<std::size_t>& starts, std::size_t place, std::size_t n) {
  if (place < kMinRecording || place + kMinRecording > n) return false;
  return std::all_of(starts.begin(), starts.end(), [&](std::size_t s) {
    return s == 0 || (place > s ? place - s : s - place) >= kMinRecording;
  });
}

class BreakSearch {
 public:
  BreakSearch(const Problem& problem, bool drift)
      : problem_(problem), drift_(drift), n_(problem.R.size()) {
    data_[kForce] = seriesOf(problem, kForce, Vector3d::Zero());
  }

  // gravity from forces with a freely drifting bias
  Vector3d freeGravity() const {
    return uniformFit(data_[kForce], problem_.line, drift_ ? 1.0 / problem_.line.step : 0.0,
                      problem_.floor[kForce])
        .shared;
  }
  void setGravity(const Vector3d& gravity) {
    data_[kTorque] = seriesOf(problem_, kTorque, gravity);
  }

  Structure fitWith(const std::vector<std::size_t>& starts) const {
    Structure out;
    out.starts = starts;
    const auto n = static_cast<double>(n_);
    for (const Kind k : kKinds) {
      out.fit[k] =
          bestOf(candidatesOf(data_[k], problem_.line, starts, drift_), n, problem_.floor[k]);
    }
    const double per_break = chiSquareQuantile(6, kBreakTail / std::max(n, 2.0)) * n / (n - 6.0);
    out.criterion = out.fit[kForce].criterion + out.fit[kTorque].criterion +
                    per_break * static_cast<double>(starts.size() - 1);
    return out;
  }

  // Adds the break that lowers the criterion by the largest amount: a coarse scan for long
  // recordings, then the neighbours of the best. False when none lowers it.
  bool addBreak(Structure& best) const {
    if (best.starts.size() > kMaxBreaks) return false;
    const std::size_t stride = std::max<std::size_t>(1, n_ / kScanPlaces);
    Structure found;
    std::size_t centre = 0;
    found.criterion = kInfinity;
    const auto tryAt = [&](std::size_t place) {
      const bool small = std::find(problem_.no_break.begin(), problem_.no_break.end(),
                                   problem_.line.order[place]) != problem_.no_break.end();
      if (small || !isFree(best.starts, place, n_)) return;
      std::vector<std::size_t> starts = best.starts;
      starts.insert(std::upper_bound(starts.begin(), starts.end(), place), place);
      Structure trial = fitWith(starts);
      if (trial.criterion < found.criterion) {
        found = std::move(trial);
        centre = place;
      }
    };
    for (std::size_t place = kMinRecording; place < n_; place += stride) tryAt(place);
    if (stride > 1 && centre > 0) {
      const std::size_t low = centre - std::min(centre, stride), high = centre + stride;
      for (std::size_t place = low; place <= high; ++place) tryAt(place);
    }
    if (!(found.criterion < best.criterion)) return false;
    best = std::move(found);
    return true;
  }

  // Removes breaks that no longer lower the criterion and records the gains of the others.
  void dropBreaks(Structure& best) const {
    const auto without = [&](std::size_t b) {
      std::vector<std::size_t> starts = best.starts;
      starts.erase(starts.begin() + static_cast<std::ptrdiff_t>(b));
      return fitWith(starts);
    };
    for (std::size_t b = 1; b < best.starts.size();) {
      Structure trial = without(b);
      if (trial.criterion <= best.criterion) {
        best = std::move(trial);
        b = 1;
      } else {
        ++b;
      }
    }
    best.gains.clear();
    for (std::size_t b = 1; b < best.starts.size(); ++b) {
      best.gains.push_back(without(b).criterion - best.criterion);
    }
  }

 private:
  const Problem& problem_;
  bool drift_;
  std::size_t n_;
  std::array<Triple, 2> data_;
};

// Variance of Student's t: of effects whose noise was estimated with so many degrees of freedom.
double studentVariance(double dof) { return dof / std::max(dof - 2.0, 1.0); }

// (Q_ii)⁻¹ (Q y)_i for each pose, Q = V⁻¹ − V⁻¹X(XᵀV⁻¹X)⁻¹XᵀV⁻¹; X whitened
void leaveOneOut(const std::array<MatrixXd, 3>& X, const Vector3d& variance, FullGroup& out) {
  std::array<VectorXd, 3> own_inverse;  // diagonal of V⁻¹
  std::array<MatrixXd, 3> VX;
  for (std::size_t a = 0; a < 3; ++a) {
    const MatrixXd& whitener = out.group.component[a].whitener;
    VX[a] = whitener.transpose() * X[a] / variance[a];
    own_inverse[a] = whitener.colwise().squaredNorm().transpose() / variance[a];
  }
  for (Index i = 0; i < X[0].rows(); ++i) {
    Matrix3d Q;
    Vector3d q;
    for (std::size_t a = 0; a < 3; ++a) {
      q[a] = out.group.component[a].weighted[i] / variance[a];
      for (std::size_t b = 0; b < 3; ++b) {
        Q(a, b) = -(VX[a].row(i) * out.group.covariance).dot(VX[b].row(i));
      }
      Q(a, a) += own_inverse[a][i];
    }
    const Matrix3d C = (Q + 1e-12 * Q.trace() * Matrix3d::Identity()).inverse();
    out.held_out.push_back(C * q);
    out.held_out_covariance.push_back(0.5 * (C + C.transpose()));
  }
}

}  // namespace

Triple seriesOf(const Problem& problem, Kind kind, const Vector3d& gravity) {
  Triple out;
  const std::size_t n = problem.R.size();
  for (std::size_t a = 0; a < 3; ++a) {
    Series& s = out[a];
    s.y.resize(n);
    s.X.resize(n, 3);
    for (std::size_t i = 0; i < n; ++i) {
      const Matrix3d& R = problem.R[i];
      s.y[i] = problem.w[i][3 * kind + a];
      if (kind == kForce) {
        s.X.row(i) = R.col(a).transpose();  // row a of Rᵀ
      } else {
        s.X.row(i) = -skew(R.transpose() * gravity).row(a);
      }
    }
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
  out.log_det = whiten(shape, ratio, line.order, starts, columns);
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
  const double log_n = std::log(static_cast<double>(line.order.size()));
  out.cost = temperature ? kAxisCost + log_n : 0.0;
  if (shape != DriftShape::kNone) out.cost += kAxisCost;
  if (hasSlope(shape)) out.cost += static_cast<double>(starts.size()) * log_n;
  if (ratio > 0.0) out.cost += log_n;
  return out;
}

void profile(GroupFit& fit, double n, double floor) {
  for (int round = 0; round < 6; ++round) {
    Matrix3d N = Matrix3d::Zero();
    Vector3d h = Vector3d::Zero();
    for (std::size_t a = 0; a < 3; ++a) {
      N += fit.choice[a].gram.topLeftCorner<3, 3>() / fit.variance[a];
      h += fit.choice[a].gram.topRightCorner<3, 1>() / fit.variance[a];
    }
    fit.shared = N.colPivHouseholderQr().solve(h);
    Vector3d squares;
    for (std::size_t a = 0; a < 3; ++a) squares[a] = residualSquares(fit.choice[a], fit.shared);
    // shrinkage by two poses of the mean variance: no axis gets all the weight by chance
    const double mean = squares.sum() / (3.0 * n);
    fit.variance = (squares.array() + 2.0 * mean) / (n + 2.0) + floor * floor;
  }
  fit.criterion = 0.0;
  for (std::size_t a = 0; a < 3; ++a) {
    const Candidate& c = fit.choice[a];
    fit.criterion += n * std::log(fit.variance[a]) +
                     residualSquares(c, fit.shared) / fit.variance[a] + c.log_det + c.cost;
  }
}

GroupFit uniformFit(const Triple& data, const Timeline& line, double ratio, double floor) {
  GroupFit fit;
  const DriftShape shape = ratio > 0.0 ? DriftShape::kRandomWalk : DriftShape::kNone;
  for (std::size_t a = 0; a < 3; ++a) {
    fit.choice[a] = candidateOf(data[a], shape, ratio, false, line, {0});
  }
  profile(fit, static_cast<double>(line.order.size()), floor);
  return fit;
}

Structure searchStructure(const Problem& problem, bool drift, bool breaks) {
  BreakSearch search(problem, drift);
  Vector3d gravity = search.freeGravity();
  Structure best;
  // again with the gravity that was found
  for (int pass = 0; pass < 2; ++pass) {
    search.setGravity(gravity);
    best = search.fitWith(best.starts);
    while (breaks && search.addBreak(best)) {
    }
    search.dropBreaks(best);
    gravity = best.fit[kForce].shared;
  }
  return best;
}

FullGroup fullFit(const Triple& data, const GroupFit& fit, const Timeline& line,
                  const std::vector<std::size_t>& starts, double floor, bool equal_weights) {
  const std::size_t n = line.order.size();
  FullGroup out;
  BiasGroup& group = out.group;
  Index effects = 3;
  for (std::size_t a = 0; a < 3; ++a) {
    const Candidate& c = fit.choice[a];
    BiasComponent& b = group.component[a];
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
    BiasComponent& b = group.component[a];
    b.design = MatrixXd::Zero(n, effects);
    b.design.leftCols(3) = data[a].X;
    b.design.middleCols(b.first_effect, b.own_effects) =
        ownDesign(b.shape, b.temperature, line, starts);
    b.whitener = MatrixXd::Identity(n, n);
    whiten(b.shape, b.ratio, line.order, starts, b.whitener);
    X[a] = b.whitener * b.design;
    y[a] = b.whitener * data[a].y;
  }
  // generalised least squares; variances with the effects' degrees of freedom
  Vector3d variance = fit.variance, dof;
  if (equal_weights) variance.setConstant(variance.mean());
  for (int round = 0; round < 4; ++round) {
    MatrixXd N = MatrixXd::Zero(effects, effects);
    VectorXd h = VectorXd::Zero(effects);
    for (std::size_t a = 0; a < 3; ++a) {
      N += X[a].transpose() * X[a] / variance[a];
      h += X[a].transpose() * y[a] / variance[a];
    }
    const VectorXd scale = N.diagonal().cwiseMax(1e-300).cwiseSqrt().cwiseInverse();
    const MatrixXd scaled = scale.asDiagonal() * N * scale.asDiagonal();
    const MatrixXd inverse = scaled.completeOrthogonalDecomposition().pseudoInverse();
    group.covariance = scale.asDiagonal() * inverse * scale.asDiagonal();
    group.effects = group.covariance * h;
    Vector3d squares;
    for (std::size_t a = 0; a < 3; ++a) {
      squares[a] = (y[a] - X[a] * group.effects).squaredNorm();
      const double leverage = (X[a] * group.covariance).cwiseProduct(X[a]).sum() / variance[a];
      dof[a] = std::max(static_cast<double>(n) - leverage, 1.0);
    }
    const double mean = squares.sum() / dof.sum();
    variance = ((squares.array() + 2.0 * mean) / (dof.array() + 2.0)).max(floor * floor);
    if (equal_weights) variance.setConstant(variance.mean());
  }
  for (std::size_t a = 0; a < 3; ++a) {
    BiasComponent& b = group.component[a];
    b.noise = std::sqrt(variance[a]);
    b.weighted = b.whitener.transpose() * (y[a] - X[a] * group.effects);
    out.residual[a] = b.weighted;  // noise² V⁻¹ r is the estimated white part
  }
  leaveOneOut(X, variance, out);
  // the axes share the payload's effects; each has its own bias, and a variance that is drawn to
  // their mean: about 4 degrees of freedom more than its own
  VectorXd student = VectorXd::Constant(effects, studentVariance(dof.sum()));
  for (std::size_t a = 0; a < 3; ++a) {
    const BiasComponent& b = group.component[a];
    student.segment(b.first_effect, b.own_effects).setConstant(studentVariance(dof[a] + 4.0));
  }
  student = student.cwiseSqrt();
  group.covariance = (student.asDiagonal() * group.covariance * student.asDiagonal()).eval();
  return out;
}

}  // namespace assembly_cell::bias_series
