// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include <Eigen/Eigenvalues>
#include <Eigen/SVD>
#include <algorithm>
#include <cmath>

#include "assembly_cell/base/input_error.h"
#include "assembly_cell/base/text.h"
#include "reference_cells.h"

namespace assembly_cell {

namespace {

using Eigen::Index;

constexpr double kOtherRate = 5.0;  // ratio of spacings of one set-up; 1.8 in the recordings
constexpr double kWeakLoad = 0.02;  // of the strongest direction of load
// variance of a channel's cells over what its noise within them explains: 1 of a dead channel, 1e3
// and more of one that is loaded
constexpr double kDeadChannel = 10.0;
constexpr double kSameChannels = 1e-6;  // of the strongest combination: rounding leaves 1e-8
constexpr double kRounding = 1e-12;     // of a channel's largest reading
constexpr double kShareLeft = 0.3;  // of the load, of a run left out; 0.04 to 0.1 in the recordings
constexpr double kLongestArm = 1.0;  // [m] of loads by hand; 0.07 in the recordings
constexpr double kFrozen = 1.0;      // [s] a recording holds one value for 0.4 s
constexpr double kMoves = 0.05;      // of the range: the other sensor moved meanwhile
const char* const kAxisNames[] = {"fx", "fy", "fz", "tx", "ty", "tz"};

Vector6 largest(const std::vector<ReferenceAverages>& runs) {
  Vector6 out = Vector6::Zero();
  for (const ReferenceAverages& run : runs) {
    for (const ReferenceCell& cell : run.cells.cells) {
      out = out.cwiseMax((cell.wrench - run.cells.wrench_tare).cwiseAbs());
    }
  }
  return out;
}

void loadGate(const std::vector<ReferenceAverages>& runs, std::vector<Gate>& gates) {
  const Vector6 rated = largest(runs);
  const double force = rated.head<3>().maxCoeff(), torque = rated.tail<3>().maxCoeff();
  Matrix6 sum = Matrix6::Zero();
  for (const ReferenceAverages& run : runs) {
    for (const ReferenceCell& cell : run.cells.cells) {
      Vector6 w = cell.wrench - run.cells.wrench_tare;
      w.head<3>() /= std::max(force, 1e-12);
      w.tail<3>() /= std::max(torque, 1e-12);
      sum += w * w.transpose();
    }
  }
  const Eigen::JacobiSVD<Matrix6> svd(sum, Eigen::ComputeFullV);
  const double weakest = std::sqrt(svd.singularValues()[5] / svd.singularValues()[0]);
  Index axis = 0;
  svd.matrixV().col(5).cwiseAbs().maxCoeff(&axis);
  addGate(gates, !(weakest > kWeakLoad),
          {"loads", Verdict::kRefuse, weakest, kWeakLoad,
           std::string("the runs hardly load ") + kAxisNames[axis] +
               " by itself: add a run that does"});
}

// Variance of a channel's cells over that explained by the noise within them.
double signalToNoise(const std::vector<ReferenceAverages>& runs, Index channel) {
  double between = 0.0, within = 0.0, cells = 0.0, samples = 0.0, biggest = 0.0;
  for (const ReferenceAverages& run : runs) {
    biggest = std::max(biggest, run.run->raw.col(channel).cwiseAbs().maxCoeff());
    double mean = 0.0;
    for (const ReferenceCell& cell : run.cells.cells) mean += cell.raw[channel];
    mean /= static_cast<double>(run.cells.cells.size());
    for (const ReferenceCell& cell : run.cells.cells) {
      const auto count = static_cast<double>(cell.count);
      between += count * std::pow(cell.raw[channel] - mean, 2);
      // by neighbours: a load that changes within the cell is no noise
      for (std::size_t i = cell.first + 1; i < cell.first + cell.count; ++i) {
        const auto k = static_cast<Index>(i);
        within += 0.5 * std::pow(run.run->raw(k, channel) - run.run->raw(k - 1, channel), 2);
      }
      samples += count - 1.0;
      ++cells;
    }
  }
  const double floor = std::pow(kRounding * biggest, 2);
  if (!(between / cells > floor)) return 0.0;
  return (between / cells) / std::max(within / std::max(samples, 1.0), floor);
}

// Every channel must follow the load and be independent of the others.
void channelGates(const std::vector<ReferenceAverages>& runs, std::vector<Gate>& gates) {
  const Index channels = runs.front().run->raw.cols();
  Index worst = 0;
  double lowest = HUGE_VAL;
  for (Index k = 0; k < channels; ++k) {
    const double ratio = signalToNoise(runs, k);
    if (ratio >= lowest) continue;
    lowest = ratio;
    worst = k;
  }
  addGate(gates, !(lowest > kDeadChannel),
          {"channels", Verdict::kRefuse, lowest, kDeadChannel,
           "raw channel " + std::to_string(worst + 1) +
               " doesn't follow the load: check its wiring, or leave the column out"});
  Eigen::MatrixXd sum = Eigen::MatrixXd::Zero(channels, channels);
  for (const ReferenceAverages& run : runs) {
    for (const ReferenceCell& cell : run.cells.cells) {
      const Eigen::VectorXd raw = cell.raw - run.cells.raw_tare;
      sum += raw * raw.transpose();
    }
  }
  const Eigen::VectorXd scale = sum.diagonal().cwiseMax(1e-300).cwiseSqrt().cwiseInverse();
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> solver(scale.asDiagonal() * sum *
                                                              scale.asDiagonal());
  const double weakest =
      std::sqrt(std::max(solver.eigenvalues()[0], 0.0) / solver.eigenvalues()[channels - 1]);
  Index same = 0;
  solver.eigenvectors().col(0).cwiseAbs().maxCoeff(&same);
  addGate(gates, !(weakest > kSameChannels),
          {"independent_channels", Verdict::kRefuse, weakest, kSameChannels,
           "raw channel " + std::to_string(same + 1) +
               " is a combination of the others: leave the column out"});
}

// Does any column move by more than kMoves of its range from sample i to j?
bool moves(const Eigen::MatrixXd& values, Index i, Index end) {
  for (Index k = 0; k < values.cols(); ++k) {
    const auto spell = values.col(k).segment(i, end - i);
    const double range = values.col(k).maxCoeff() - values.col(k).minCoeff();
    if (spell.maxCoeff() - spell.minCoeff() > kMoves * range) return true;
  }
  return false;
}

// Where one of the sensors holds all its values while the other moves; empty: nowhere.
std::string frozenSpell(const ReferenceRun& run) {
  for (const bool raw : {true, false}) {
    const Eigen::MatrixXd &held = raw ? run.raw : run.wrench, &other = raw ? run.wrench : run.raw;
    for (Index i = 0, j = 1; j <= held.rows(); ++j) {
      if (j < held.rows() && held.row(j) == held.row(i)) continue;
      const double from = run.t[static_cast<std::size_t>(i)];
      const double to = run.t[static_cast<std::size_t>(j - 1)];
      if (to - from > kFrozen && moves(other, i, j)) {
        return run.name + (raw ? ": the raw channels" : ": the reference's six values") +
               text(
                   " stay the same to the last digit from %.6g to %.6g s (rows %td to %td) while "
                   "the other sensor moves: frozen; take this part out",
                   from, to, i + 1, j);
      }
      i = j;
    }
  }
  return "";
}

// A reference's axis that is the same in every sample of every run.
std::string frozenAxis(const std::vector<ReferenceAverages>& runs) {
  for (Index k = 0; k < 6; ++k) {
    const double value = runs.front().run->wrench(0, k);
    const bool constant = std::all_of(runs.begin(), runs.end(), [&](const ReferenceAverages& run) {
      return (run.run->wrench.col(k).array() == value).all();
    });
    if (constant) {
      return std::string(kAxisNames[k]) + text(
                                              " of the reference is %.6g in all rows: frozen, or "
                                              "not connected",
                                              value);
    }
  }
  return "";
}

void frozenGate(const std::vector<ReferenceAverages>& runs, const ReferenceAverages* hold_out,
                std::vector<Gate>& gates) {
  std::string found = frozenAxis(runs);
  for (const ReferenceAverages& run : runs) {
    if (found.empty()) found = frozenSpell(*run.run);
  }
  if (found.empty() && hold_out != nullptr) found = frozenSpell(*hold_out->run);
  addGate(gates, !found.empty(), {"frozen", Verdict::kRefuse, 1.0, 0.0, found});
}

// Rms of the loads: force, torque.
Eigen::Vector2d loadOf(const std::vector<ReferenceAverages>& runs) {
  Vector6 squares = Vector6::Zero();
  double count = 0.0;
  for (const ReferenceAverages& run : runs) {
    for (const ReferenceCell& cell : run.cells.cells) {
      squares += (cell.wrench - run.cells.wrench_tare).cwiseAbs2();
      ++count;
    }
  }
  return {std::sqrt(squares.head<3>().sum() / (3.0 * count)),
          std::sqrt(squares.tail<3>().sum() / (3.0 * count))};
}

// Do the loads make sense, and does the map follow them?
void plausibleGates(const std::vector<ReferenceAverages>& runs, const ReferenceError& error,
                    std::vector<Gate>& gates) {
  const Eigen::Vector2d load = loadOf(runs);
  const double arm = load[1] / std::max(load[0], 1e-12);
  addGate(gates, arm > kLongestArm,
          {"arm", Verdict::kRefuse, arm, kLongestArm,
           text("the reference's torques are those of forces %.3g m from it: in %s? Give N and N m",
                arm, arm > 10.0 ? "N mm" : "N cm")});
  const double share =
      std::max(error.force / std::max(load[0], 1e-12), error.torque / std::max(load[1], 1e-12));
  addGate(gates, share > kShareLeft,
          {"follows", Verdict::kRefuse, share, kShareLeft,
           text("a run left out is predicted to %.3g N and %.3g N m only, of %.3g N and %.3g N m "
                "(rms): the raw channels don't follow the reference; are both of the same time and "
                "set-up?",
                error.force, error.torque, load[0], load[1])});
}

bool sameRecording(const ReferenceRun& a, const ReferenceRun& b) {
  return a.t.size() == b.t.size() && a.raw == b.raw && a.wrench == b.wrench;
}

}  // namespace

void checkReferenceRuns(const std::vector<ReferenceAverages>& runs) {
  for (std::size_t i = 0; i < runs.size(); ++i) {
    const ReferenceAverages& run = runs[i];
    for (std::size_t k = 0; k < i; ++k) {
      if (run.run->raw.cols() != runs[k].run->raw.cols() ||
          !sameRecording(*runs[k].run, *run.run)) {
        continue;
      }
      throw InputError(run.run->name + ": the same recording as " + runs[k].run->name +
                       ": give each once, the map must be checked against another");
    }
    if (run.run->raw.cols() != runs.front().run->raw.cols()) {
      throw InputError(run.run->name + ": " + std::to_string(run.run->raw.cols()) +
                       " raw channels, " + std::to_string(runs.front().run->raw.cols()) + " in " +
                       runs.front().run->name + ": give runs of one sensor");
    }
    const double ratio = run.cells.spacing / runs.front().cells.spacing;
    if (ratio > kOtherRate || ratio < 1.0 / kOtherRate) {
      throw InputError(run.run->name +
                       text(": a sample every %.3g s, every %.3g s in ", run.cells.spacing,
                            runs.front().cells.spacing) +
                       runs.front().run->name + ": give runs of one rate");
    }
  }
}

void evaluateReference(const std::vector<ReferenceAverages>& runs,
                       const ReferenceAverages* hold_out, ReferenceSolution& out) {
  std::vector<Gate>& gates = out.gates;
  frozenGate(runs, hold_out, gates);
  loadGate(runs, gates);
  channelGates(runs, gates);
  const double each = static_cast<double>(out.cells) / out.coefficients;
  addGate(gates, each < kCellsPerCoefficient,
          {"cells_per_coefficient", Verdict::kRefuse, each, kCellsPerCoefficient,
           text("%zu bursts or pieces of 20 ms for %d coefficients a row: record longer", out.cells,
                out.coefficients)});
  addGate(gates, std::abs(out.lag) > 0.99 * kLagRange,
          {"lag", Verdict::kWarn, out.lag, kLagRange,
           "the lag ends at its limit: are these the same loads, and times in one clock?"});
  const ReferenceError& error = out.left_out[static_cast<std::size_t>(out.model)];
  const double force = error.force / out.plain.force, torque = error.torque / out.plain.torque;
  const bool evaluated = std::isfinite(force) && std::isfinite(torque);
  addGate(gates, !evaluated,
          {"left_out", Verdict::kRefuse, evaluated ? std::max(force, torque) : std::nan(""), 1.0,
           std::string("no run left out can check the model ") + toString(out.model) +
               ": record longer, or take a smaller --model"});
  if (evaluated) plausibleGates(runs, error, gates);
  const double ratio = evaluated ? std::max(force, torque) : 0.0;
  addGate(gates, ratio > 1.0,
          {"against_plain", Verdict::kWarn, ratio, 1.0,
           "a run left out is predicted worse than by ordinary least squares: its tare, or its "
           "set-up, differs"});
  double untared = 0.0;
  for (const ReferenceAverages& run : runs) untared += !run.cells.tared;
  if (hold_out != nullptr) untared += !hold_out->cells.tared;
  addGate(gates, untared > 0.0,
          {"tare", Verdict::kWarn, untared, 0.0,
           "runs that begin under load: begin each with the sensor unloaded"});
  if (hold_out != nullptr) {
    Vector6 all = largest(runs), held = largest({*hold_out});
    const double beyond = held.cwiseQuotient(all.cwiseMax(1e-12)).maxCoeff();
    addGate(gates, beyond > 1.1,
            {"range", Verdict::kWarn, beyond, 1.1,
             "the run held out has larger loads than the others: add such a run"});
  }
  out.accepted = !refused(gates);
}

}  // namespace assembly_cell
