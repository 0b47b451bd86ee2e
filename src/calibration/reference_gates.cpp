// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
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
  const char* names[] = {"fx", "fy", "fz", "tx", "ty", "tz"};
  addGate(gates, !(weakest > kWeakLoad),
          {"loads", Verdict::kRefuse, weakest, kWeakLoad,
           std::string("the runs hardly load ") + names[axis] + " by itself: add a run that does"});
}

}  // namespace

void checkReferenceRuns(const std::vector<ReferenceAverages>& runs) {
  for (const ReferenceAverages& run : runs) {
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

void judgeReference(const std::vector<ReferenceAverages>& runs, const ReferenceAverages* hold_out,
                    ReferenceSolution& out) {
  std::vector<Gate>& gates = out.gates;
  loadGate(runs, gates);
  const double each = static_cast<double>(out.cells) / out.coefficients;
  addGate(gates, each < kCellsPerCoefficient,
          {"cells_per_coefficient", Verdict::kRefuse, each, kCellsPerCoefficient,
           text("%zu bursts or pieces of 20 ms for %d coefficients a row: record longer", out.cells,
                out.coefficients)});
  addGate(gates, std::abs(out.lag) > 0.99 * kLagRange,
          {"lag", Verdict::kWarn, out.lag, kLagRange,
           "the lag ends at its limit: are these the same loads, and times in one clock?"});
  const ReferenceError& error = out.left_out[static_cast<std::size_t>(out.model)];
  const double ratio = std::max(error.force / out.plain.force, error.torque / out.plain.torque);
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
