// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/calibration/reference/reference.h"

#include <Eigen/Cholesky>
#include <Eigen/QR>
#include <algorithm>
#include <array>
#include <cmath>

#include "assembly_cell/base/input_error.h"
#include "assembly_cell/base/median.h"
#include "assembly_cell/base/text.h"
#include "reference_cells.h"

namespace assembly_cell {

namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr double kHuber = 1.5;  // sd: 4 % of efficiency on normal noise; 1 and 3 within 2 % here
constexpr double kLagStep = 0.005;  // [s] of the first scan: loads by hand change in tenths
constexpr double kBetter = 0.01;    // fraction by which a larger model must predict better

int coefficientsOf(ReferenceModel model, Index channels) {
  const int n = static_cast<int>(channels);
  if (model == ReferenceModel::kLinear) return n;
  return model == ReferenceModel::kSquares ? 2 * n : n + n * (n + 1) / 2;
}

// of readings in units of the scale
void designRow(ReferenceModel model, const VectorXd& s, Eigen::Ref<VectorXd> row) {
  const Index n = s.size();
  row.head(n) = s;
  if (model == ReferenceModel::kSquares) row.tail(n) = s.cwiseAbs2();
  if (model != ReferenceModel::kQuadratic) return;
  for (Index i = 0, k = n; i < n; ++i) {
    for (Index j = i; j < n; ++j) row[k++] = s[i] * s[j];
  }
}

struct Fit {
  ReferenceModel model = ReferenceModel::kLinear;
  VectorXd scale;  // of the channels
  double lag = 0.0, lag_sd = 0.0;
  MatrixXd C;         // coefficients × 6
  MatrixXd residual;  // cells × 6
  MatrixXd weight;    // cells × 6
  Vector6 sd = Vector6::Zero();
  MatrixXd design;
};

Index cellCount(const std::vector<const ReferenceAverages*>& runs) {
  std::size_t n = 0;
  for (const ReferenceAverages* run : runs) n += run->cells.cells.size();
  return static_cast<Index>(n);
}

MatrixXd shiftedWrench(const std::vector<const ReferenceAverages*>& runs, double lag) {
  MatrixXd y(cellCount(runs), 6);
  Index row = 0;
  for (const ReferenceAverages* run : runs) {
    for (std::size_t c = 0; c < run->cells.cells.size(); ++c) {
      y.row(row++) = referenceAt(run->cells, c, run->cells.cells[c].t - lag);
    }
  }
  return y;
}

MatrixXd slopes(const std::vector<const ReferenceAverages*>& runs) {
  MatrixXd d(cellCount(runs), 6);
  Index row = 0;
  for (const ReferenceAverages* run : runs) {
    for (const ReferenceCell& cell : run->cells.cells) d.row(row++) = cell.slope;
  }
  return d;
}

double medianOfAbsolute(const VectorXd& values) {
  std::vector<double> sizes(static_cast<std::size_t>(values.size()));
  for (std::size_t i = 0; i < sizes.size(); ++i) {
    sizes[i] = std::abs(values[static_cast<Index>(i)]);
  }
  return upperMedian(sizes);
}

// The lag with the smallest cost, of steps over the whole range.
double firstLag(const std::vector<const ReferenceAverages*>& runs, const MatrixXd& design) {
  const Eigen::ColPivHouseholderQR<MatrixXd> qr(design);
  double best = 0.0, lowest = std::numeric_limits<double>::infinity();
  const int steps = static_cast<int>(std::lround(kLagRange / kLagStep));
  for (int k = -steps; k <= steps; ++k) {
    const double lag = kLagStep * k;
    const MatrixXd y = shiftedWrench(runs, lag);
    const MatrixXd e = y - design * qr.solve(y);
    double cost = 0.0;
    for (Index axis = 0; axis < 6; ++axis) cost += std::log(e.col(axis).cwiseAbs().mean() + 1e-12);
    if (cost >= lowest) continue;
    lowest = cost;
    best = lag;
  }
  return best;
}

// One pass of Huber's weights over all axes and one Gauss–Newton step of the lag (variable
// projection). Weights and lag change together, so this isn't a problem for math/least_squares.h.
double improve(Fit& fit, const std::vector<const ReferenceAverages*>& runs, bool lag_free) {
  const MatrixXd y = shiftedWrench(runs, fit.lag), d = slopes(runs);
  double along = 0.0, information = 0.0;
  for (Index axis = 0; axis < 6; ++axis) {
    const VectorXd& w = fit.weight.col(axis);
    const MatrixXd weighted = w.cwiseSqrt().asDiagonal() * fit.design;
    const Eigen::ColPivHouseholderQR<MatrixXd> qr(weighted);
    const auto solve = [&](const VectorXd& v) -> VectorXd {
      const VectorXd right = w.cwiseSqrt().cwiseProduct(v);
      return qr.solve(right);
    };
    fit.C.col(axis) = solve(y.col(axis));
    fit.residual.col(axis) = y.col(axis) - fit.design * fit.C.col(axis);
    const double sd = std::max(1.4826 * medianOfAbsolute(fit.residual.col(axis)), 1e-12);
    fit.sd[axis] = sd;
    const VectorXd rest = d.col(axis) - fit.design * solve(d.col(axis));
    along += w.cwiseProduct(rest).dot(fit.residual.col(axis)) / (sd * sd);
    information += w.cwiseProduct(rest).dot(rest) / (sd * sd);
    fit.weight.col(axis) =
        (kHuber * sd / fit.residual.col(axis).array().abs().max(kHuber * sd)).matrix();
  }
  fit.lag_sd = lag_free && information > 0.0 ? 1.0 / std::sqrt(information) : 0.0;
  const double step = lag_free && information > 0.0 ? along / information : 0.0;
  fit.lag = std::clamp(fit.lag + step, -kLagRange, kLagRange);
  return std::abs(step);
}

Fit fitRuns(const std::vector<const ReferenceAverages*>& runs, ReferenceModel model,
            const std::optional<double>& lag) {
  Fit fit;
  fit.model = model;
  const Index channels = runs.front()->run->raw.cols(), n = cellCount(runs);
  fit.scale = VectorXd::Constant(channels, 1e-300);
  for (const ReferenceAverages* run : runs) {
    for (const ReferenceCell& cell : run->cells.cells) {
      fit.scale = fit.scale.cwiseMax((cell.raw - run->cells.raw_tare).cwiseAbs());
    }
  }
  const Index p = coefficientsOf(model, channels);
  MatrixXd rows(p, n);
  Index at = 0;
  for (const ReferenceAverages* run : runs) {
    for (const ReferenceCell& cell : run->cells.cells) {
      designRow(model, (cell.raw - run->cells.raw_tare).cwiseQuotient(fit.scale), rows.col(at++));
    }
  }
  fit.design = rows.transpose();
  fit.C = MatrixXd::Zero(p, 6);
  fit.residual = MatrixXd::Zero(n, 6);
  fit.weight = MatrixXd::Ones(n, 6);
  fit.lag = lag ? *lag : firstLag(runs, fit.design);
  constexpr int kPasses = 60;  // each brings the lag a tenth nearer at least
  for (int pass = 0; pass < kPasses; ++pass) {
    if (improve(fit, runs, !lag) < 1e-7 && pass > 20) break;
  }
  return fit;
}

// ---- what a fit leaves

struct Sums {
  Vector6 squares = Vector6::Zero();
  double count = 0.0;
  void add(const Vector6& e) {
    squares += e.cwiseAbs2();
    ++count;
  }
  ReferenceError error() const {
    const Vector6 mean = squares / count;
    return {std::sqrt(mean.head<3>().mean()), std::sqrt(mean.tail<3>().mean()), mean.cwiseSqrt()};
  }
};

// of every sample of a run, the reference as it was a lag before
void addErrors(const Fit& fit, const ReferenceAverages& run, Sums& sums) {
  VectorXd row(fit.C.rows());
  for (std::size_t c = 0; c < run.cells.cells.size(); ++c) {
    const ReferenceCell& cell = run.cells.cells[c];
    for (std::size_t i = cell.first; i < cell.first + cell.count; ++i) {
      const auto k = static_cast<Index>(i);
      const VectorXd s = run.run->raw.row(k).transpose() - run.cells.raw_tare;
      designRow(fit.model, s.cwiseQuotient(fit.scale), row);
      const double t = run.run->t[i];
      const Vector6 moved = referenceAt(run.cells, c, t - fit.lag) - referenceAt(run.cells, c, t);
      sums.add(run.run->wrench.row(k).transpose() - run.cells.wrench_tare + moved -
               fit.C.transpose() * row);
    }
  }
}

// ordinary least squares of all samples with an offset, as it is commonly done
void addPlainErrors(const std::vector<const ReferenceAverages*>& runs,
                    const ReferenceAverages& left_out, Sums& sums) {
  const Index q = left_out.run->raw.cols() + 1;
  MatrixXd normal = MatrixXd::Zero(q, q), moment = MatrixXd::Zero(q, 6);
  for (const ReferenceAverages* run : runs) {
    MatrixXd A(run->run->raw.rows(), q);
    A << run->run->raw, VectorXd::Ones(A.rows());
    normal += A.transpose() * A;
    moment += A.transpose() * run->run->wrench;
  }
  const MatrixXd map = normal.ldlt().solve(moment);
  for (Index i = 0; i < left_out.run->raw.rows(); ++i) {
    sums.add(left_out.run->wrench.row(i).transpose() -
             map.topRows(q - 1).transpose() * left_out.run->raw.row(i).transpose() -
             map.row(q - 1).transpose());
  }
}

// Variance of the mean over that of independent residuals, from the lag-1 correlation.
double inflation(const VectorXd& e) {
  const Index n = e.size();
  const double squares = e.squaredNorm();
  if (n < 4 || !(squares > 0.0)) return 1.0;
  const double r = std::clamp(e.head(n - 1).dot(e.tail(n - 1)) / squares, 0.0, 0.95);
  return (1.0 + r) / (1.0 - r);
}

ReferenceRunResult resultOf(const Fit& fit, const ReferenceAverages& run) {
  ReferenceRunResult out;
  out.name = run.run->name;
  out.time_unit = run.run->time_unit;
  out.samples = run.run->t.size();
  out.bursts = run.cells.bursts;
  out.tared = run.cells.tared;
  out.raw_tare = run.cells.raw_tare;
  out.wrench_tare = run.cells.wrench_tare;
  Sums sums;
  addErrors(fit, run, sums);
  out.error = sums.error();
  const std::vector<const ReferenceAverages*> alone = {&run};
  const MatrixXd y = shiftedWrench(alone, fit.lag);
  const auto n = static_cast<Index>(run.cells.cells.size());
  MatrixXd A(n, 2), e(n, 6);
  VectorXd row(fit.C.rows());
  for (Index i = 0; i < n; ++i) {
    const ReferenceCell& cell = run.cells.cells[static_cast<std::size_t>(i)];
    designRow(fit.model, (cell.raw - run.cells.raw_tare).cwiseQuotient(fit.scale), row);
    e.row(i) = y.row(i) - (fit.C.transpose() * row).transpose();
    A.row(i) << 1.0, cell.t;
  }
  const double length = A(n - 1, 1) - A(0, 1);
  A.col(1) = (A.col(1).array() - A.col(1).mean()) / std::max(length, 1e-9);
  for (Index axis = 0; axis < 6; ++axis) {
    const Eigen::Vector2d line(e.col(axis).mean(),
                               A.col(1).dot(e.col(axis)) / A.col(1).squaredNorm());
    const VectorXd rest = e.col(axis) - A * line;
    const double variance =
        rest.squaredNorm() / std::max<double>(static_cast<double>(n - 2), 1.0) * inflation(rest);
    out.offset[axis] = line[0];
    out.offset_sd[axis] = std::sqrt(variance / static_cast<double>(n));
    out.drift[axis] = line[1];
    out.drift_sd[axis] = std::sqrt(variance / A.col(1).squaredNorm());
  }
  return out;
}

// ---- coefficients in the channels' own units

void fillMap(const Fit& fit, ReferenceSolution& out) {
  const Index n = fit.scale.size();
  const Index full = n + n * (n + 1) / 2;
  const bool linear = fit.model == ReferenceModel::kLinear;
  // where each fitted coefficient goes among all of a row, and its unit
  std::vector<Index> place;
  VectorXd unit(fit.C.rows());
  for (Index i = 0; i < n; ++i) {
    place.push_back(i);
    unit[i] = fit.scale[i];
  }
  for (Index i = 0, k = n; i < n && !linear; ++i) {
    for (Index j = i; j < n; ++j, ++k) {
      if (fit.model == ReferenceModel::kSquares && i != j) continue;
      unit[static_cast<Index>(place.size())] = fit.scale[i] * fit.scale[j];
      place.push_back(k);
    }
  }
  const Index width = linear ? n : full;
  MatrixXd all = MatrixXd::Zero(6, width);
  const auto p = static_cast<Index>(place.size());
  for (Index c = 0; c < p; ++c) {
    all.col(place[static_cast<std::size_t>(c)]) = fit.C.row(c).transpose() / unit[c];
  }
  out.map = all.leftCols(n);
  if (!linear) out.products = all.rightCols(full - n);

  // axes share their mean weights; residuals count as far as Huber's function lets them
  const VectorXd mean_weight = fit.weight.rowwise().mean();
  const MatrixXd inverse = (fit.design.transpose() * mean_weight.asDiagonal() * fit.design)
                               .ldlt()
                               .solve(MatrixXd::Identity(p, p));
  const MatrixXd counted = fit.weight.cwiseProduct(fit.residual);
  const double dof = std::max<double>(static_cast<double>(fit.residual.rows() - p), 1.0);
  Matrix6 noise = counted.transpose() * counted / dof;
  Vector6 grow;
  for (Index a = 0; a < 6; ++a) {
    grow[a] = std::sqrt(inflation(counted.col(a))) / fit.weight.col(a).mean();
  }
  noise = grow.asDiagonal() * noise * grow.asDiagonal();
  out.covariance = MatrixXd::Zero(6 * width, 6 * width);
  for (Index a = 0; a < 6; ++a) {
    for (Index b = 0; b < 6; ++b) {
      for (Index i = 0; i < p; ++i) {
        for (Index j = 0; j < p; ++j) {
          out.covariance(a * width + place[static_cast<std::size_t>(i)],
                         b * width + place[static_cast<std::size_t>(j)]) =
              noise(a, b) * inverse(i, j) / (unit[i] * unit[j]);
        }
      }
    }
  }
  out.residual_sd = fit.sd;
}

// error of the runs left out, by model
void leaveOut(const std::vector<ReferenceAverages>& runs, const ReferenceAverages* hold_out,
              const ReferenceOptions& options, ReferenceSolution& out) {
  Sums plain;
  std::array<Sums, 3> sums;
  const std::size_t turns = hold_out != nullptr ? 1 : runs.size();
  std::array<bool, 3> possible = {true, true, true};
  for (std::size_t turn = 0; turn < turns; ++turn) {
    std::vector<const ReferenceAverages*> kept;
    for (std::size_t r = 0; r < runs.size(); ++r) {
      if (hold_out != nullptr || r != turn) kept.push_back(&runs[r]);
    }
    const ReferenceAverages& left = hold_out != nullptr ? *hold_out : runs[turn];
    addPlainErrors(kept, left, plain);
    for (const ReferenceModel model : kReferenceModels) {
      const auto m = static_cast<std::size_t>(model);
      const int p = coefficientsOf(model, left.run->raw.cols());
      possible[m] =
          possible[m] && (static_cast<double>(cellCount(kept)) >= kCellsPerCoefficient * p ||
                          model == ReferenceModel::kLinear);
      if (possible[m]) addErrors(fitRuns(kept, model, options.lag), left, sums[m]);
    }
  }
  out.plain = plain.error();
  double best = std::numeric_limits<double>::infinity();
  for (const ReferenceModel model : kReferenceModels) {
    const auto m = static_cast<std::size_t>(model);
    ReferenceError error;
    error.force = error.torque = std::numeric_limits<double>::quiet_NaN();
    error.axis.setConstant(error.force);
    if (possible[m]) error = sums[m].error();
    out.left_out.push_back(error);
    const double score = error.force / out.plain.force + error.torque / out.plain.torque;
    if (!(score < (1.0 - kBetter) * best)) continue;
    best = score;
    out.model = model;
  }
  if (options.model) out.model = *options.model;
}

}  // namespace

const char* toString(ReferenceModel model) {
  return std::array{"linear", "squares", "quadratic"}[static_cast<std::size_t>(model)];
}

ReferenceSolution solveReference(const std::vector<ReferenceRun>& runs,
                                 const ReferenceRun* hold_out, const ReferenceOptions& options) {
  if (runs.empty() || (runs.size() == 1 && hold_out == nullptr)) {
    throw InputError(
        "runs: " + std::to_string(runs.size()) +
        " given and none held out: give another RUN, or --holdout RUN, to check against");
  }
  std::vector<ReferenceAverages> averaged;
  for (const ReferenceRun& run : runs) averaged.push_back({&run, cellsOf(run)});
  if (hold_out != nullptr) averaged.push_back({hold_out, cellsOf(*hold_out)});
  checkReferenceRuns(averaged);
  std::optional<ReferenceAverages> held;
  if (hold_out != nullptr) {
    held = averaged.back();
    averaged.pop_back();
  }
  ReferenceSolution out;
  leaveOut(averaged, held ? &*held : nullptr, options, out);
  std::vector<const ReferenceAverages*> all;
  for (const ReferenceAverages& run : averaged) all.push_back(&run);
  const Fit fit = fitRuns(all, out.model, options.lag);
  out.lag = fit.lag;
  out.lag_sd = fit.lag_sd;
  out.cells = static_cast<std::size_t>(fit.design.rows());
  out.coefficients = static_cast<int>(fit.C.rows());
  fillMap(fit, out);
  for (const ReferenceAverages& run : averaged) out.runs.push_back(resultOf(fit, run));
  if (held) out.hold_out = resultOf(fit, *held);
  evaluateReference(averaged, held ? &*held : nullptr, out);
  return out;
}

Calibration referenceCalibration(const ReferenceSolution& s,
                                 const std::vector<ReferenceRun>& runs) {
  if (s.map.cols() != 6) {
    throw InputError("--save: the sensor has " + std::to_string(s.map.cols()) +
                     " channels: a stored calibration has six, take the matrix from the output");
  }
  Calibration c;
  c.volts_to_wrench = s.map;
  c.zero_volts = s.runs.back().raw_tare;
  c.quadratic_wrench = s.products.size() > 0;
  if (c.quadratic_wrench) c.wrench_products = s.products;
  // a stored one has the variance of every product; those that were left out have none
  c.wrench_covariance = 0.5 * (s.covariance + s.covariance.transpose());
  Vector6 low = runs.front().raw.row(0), high = low;
  std::string bytes;
  for (const ReferenceRun& run : runs) {
    for (Index i = 0; i < run.raw.rows(); ++i) {
      low = low.cwiseMin(run.raw.row(i).transpose());
      high = high.cwiseMax(run.raw.row(i).transpose());
      bytes.append(reinterpret_cast<const char*>(run.raw.row(i).eval().data()), 48);
      bytes.append(reinterpret_cast<const char*>(run.wrench.row(i).eval().data()), 48);
    }
  }
  c.wrench_range = (high - c.zero_volts).cwiseMax(c.zero_volts - low);
  c.wrench_fit.dof = 6 * (static_cast<int>(s.cells) - s.coefficients);
  c.wrench_fit.chi2 = c.wrench_fit.dof;  // the noise is taken from what the fit leaves
  c.wrench_fit.residual_rms = s.residual_sd;
  c.observations_digest = crcText(bytes);
  return c;
}

}  // namespace assembly_cell
