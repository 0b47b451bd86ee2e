// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/calibration/dead_weights/dead_weights.h"

#include <Eigen/Cholesky>
#include <Eigen/QR>
#include <Eigen/SVD>
#include <algorithm>
#include <cmath>
#include <limits>

#include "assembly_cell/base/input_error.h"
#include "assembly_cell/base/table.h"
#include "assembly_cell/base/text.h"
#include "dead_weight_labels.h"

namespace assembly_cell {

namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::Vector3d;
using Eigen::VectorXd;

constexpr double kNoLoad = 0.03;    // of the largest reading: below it the sensor is unloaded
constexpr double kFullRank = 0.01;  // singular value of the loads, of the largest
constexpr std::size_t kMinRows = 8;
const char* const kAxes[] = {"fx", "fy", "fz", "tx", "ty", "tz"};

// Size of a reading: the larger of force and moment, relative to the largest of the file.
std::vector<double> readingSizes(const std::vector<DeadWeight>& rows) {
  double force = 1e-300, moment = 1e-300;
  for (const DeadWeight& row : rows) {
    force = std::max(force, row.reading.head<3>().norm());
    moment = std::max(moment, row.reading.tail<3>().norm());
  }
  std::vector<double> out;
  for (const DeadWeight& row : rows) {
    out.push_back(
        std::max(row.reading.head<3>().norm() / force, row.reading.tail<3>().norm() / moment));
  }
  return out;
}

// Blocks by the readings, as a label may be wrong.
std::vector<std::size_t> blocksOf(const std::vector<DeadWeight>& rows) {
  const std::vector<double> size = readingSizes(rows);
  std::vector<std::size_t> out(rows.size(), 0);
  for (std::size_t i = 1; i < rows.size(); ++i) {
    out[i] = out[i - 1] + (size[i] < kNoLoad && size[i - 1] >= kNoLoad);
  }
  return out;
}

// load = map reading + offset of the block, rows of the labels that count
struct Line {
  MatrixXd A, Y;
  std::vector<std::size_t> row;
};

Line lineOf(const std::vector<DeadWeight>& rows, const std::vector<std::size_t>& block,
            const std::vector<std::size_t>& used) {
  // columns for the blocks that have a row
  std::vector<Index> column(block.back() + 1, -1);
  Index count = 0;
  for (const std::size_t i : used) {
    if (column[block[i]] < 0) column[block[i]] = count++;
  }
  Line out;
  const auto n = static_cast<Index>(used.size());
  out.A = MatrixXd::Zero(n, 6 + count);
  out.Y.resize(n, 6);
  for (Index k = 0; k < n; ++k) {
    const std::size_t i = used[static_cast<std::size_t>(k)];
    out.A.row(k).head<6>() = rows[i].reading;
    out.A(k, 6 + column[block[i]]) = 1.0;
    out.Y.row(k) = *rows[i].label;
  }
  out.row = used;
  return out;
}

void fillRank(const std::vector<DeadWeight>& rows, DeadWeightSolution& out) {
  double force = 1e-300, moment = 1e-300;
  for (const std::size_t i : out.used) {
    force = std::max(force, rows[i].label->head<3>().norm());
    moment = std::max(moment, rows[i].label->tail<3>().norm());
  }
  MatrixXd loads(static_cast<Index>(out.used.size()), 6);
  for (std::size_t k = 0; k < out.used.size(); ++k) {
    const Vector6& w = *rows[out.used[k]].label;
    loads.row(static_cast<Index>(k)) << w.head<3>().transpose() / force,
        w.tail<3>().transpose() / moment;
  }
  const Eigen::JacobiSVD<MatrixXd> svd(loads, Eigen::ComputeFullV);
  for (Index k = 0; k < 6; ++k) {
    if (k < svd.singularValues().size() &&
        svd.singularValues()[k] > kFullRank * svd.singularValues()[0]) {
      ++out.rank;
      continue;
    }
    // the load of this direction, its largest components
    const Vector6 v = svd.matrixV().col(k);
    std::string what;
    for (Index a = 0; a < 6; ++a) {
      if (std::abs(v[a]) < 0.4 * v.cwiseAbs().maxCoeff()) continue;
      what += (what.empty() ? "" : " with ") + std::string(kAxes[a]);
    }
    out.missing.push_back(what + " by itself: no load has it, hang a weight that gives it");
  }
  for (Index a = 0; a < 6; ++a) {
    const double low = loads.col(a).minCoeff(), high = loads.col(a).maxCoeff();
    if (std::max(high, -low) < kFullRank) continue;
    if (high < kFullRank || low > -kFullRank) {
      out.one_sign.push_back(std::string(high < kFullRank ? "-" : "+") + kAxes[a]);
    }
  }
}

// ordinary least squares of the labels that are left, with leave-one-out by leverage
void fillMap(const std::vector<DeadWeight>& rows, DeadWeightSolution& out) {
  const Line line = lineOf(rows, out.block, out.used);
  const Eigen::CompleteOrthogonalDecomposition<MatrixXd> solver(line.A);
  const MatrixXd C = solver.solve(line.Y), e = line.Y - line.A * C;
  const Index n = line.A.rows(), p = solver.rank();
  out.map = C.topRows<6>().transpose();
  const MatrixXd inverse =
      (line.A.transpose() * line.A).completeOrthogonalDecomposition().pseudoInverse();
  const Matrix6 noise = e.transpose() * e / std::max<double>(static_cast<double>(n - p), 1.0);
  out.covariance = MatrixXd::Zero(36, 36);
  for (Index a = 0; a < 6; ++a) {
    for (Index b = 0; b < 6; ++b) {
      out.covariance.block<6, 6>(6 * a, 6 * b) = noise(a, b) * inverse.topLeftCorner<6, 6>();
    }
  }
  Vector6 left = Vector6::Zero();
  double count = 0.0;
  for (Index k = 0; k < n; ++k) {
    const double leverage = line.A.row(k).dot(inverse * line.A.row(k).transpose());
    if (leverage > 1.0 - 1e-9) continue;
    left += (e.row(k).transpose() / (1.0 - leverage)).cwiseAbs2();
    ++count;
  }
  out.residual_rms = (e.colwise().squaredNorm() / static_cast<double>(n)).cwiseSqrt().transpose();
  out.left_out_rms = (left / std::max(count, 1.0)).cwiseSqrt();
  // each block's reading of no load: the map's offset turned back
  const Matrix6 back = out.map.completeOrthogonalDecomposition().pseudoInverse();
  out.zero.assign(out.blocks, Vector6::Constant(std::numeric_limits<double>::quiet_NaN()));
  for (Index k = 0; k < n; ++k) {
    Index column = 6;
    while (line.A(k, column) == 0.0) ++column;
    out.zero[out.block[line.row[static_cast<std::size_t>(k)]]] = -back * C.row(column).transpose();
  }
}

void leaveBlocksOut(const std::vector<DeadWeight>& rows, DeadWeightSolution& out) {
  Vector6 squares = Vector6::Zero();
  double count = 0.0;
  out.block_possible = out.blocks > 1;
  for (std::size_t b = 0; b < out.blocks; ++b) {
    std::vector<std::size_t> kept, left;
    for (const std::size_t i : out.used) (out.block[i] == b ? left : kept).push_back(i);
    if (left.empty() || kept.empty()) continue;
    const Line line = lineOf(rows, out.block, kept);
    const Eigen::CompleteOrthogonalDecomposition<MatrixXd> solver(line.A);
    const MatrixXd C = solver.solve(line.Y);
    // loads that only this block has
    Eigen::JacobiSVD<MatrixXd> svd(line.Y);
    if (svd.singularValues()[5] < kFullRank * svd.singularValues()[0]) out.block_possible = false;
    const std::size_t first = left.front();
    for (const std::size_t i : left) {
      const Vector6 reading = rows[i].reading - rows[first].reading;
      squares +=
          (*rows[i].label - *rows[first].label - C.topRows<6>().transpose() * reading).cwiseAbs2();
      count += i != first;
    }
  }
  out.left_out_block_rms = (squares / std::max(count, 1.0)).cwiseSqrt();
}

void fillUnlabelled(const std::vector<DeadWeight>& rows, DeadWeightSolution& out) {
  for (std::size_t i = 0; i < rows.size(); ++i) {
    if (rows[i].label) continue;
    // a block without any label begins with no load
    std::size_t first = i;
    while (first > 0 && out.block[first - 1] == out.block[i]) --first;
    const bool zeroed = out.zero[out.block[i]].allFinite();
    const Vector6 s = rows[i].reading - (zeroed ? out.zero[out.block[i]] : rows[first].reading);
    out.unlabelled.push_back(i);
    out.unlabelled_load.push_back(out.map * s);
    Vector6 sd;
    for (Index a = 0; a < 6; ++a) {
      sd[a] = std::sqrt(std::max(s.dot(out.covariance.block<6, 6>(6 * a, 6 * a) * s), 0.0) +
                        std::pow(out.left_out_rms[a], 2));
    }
    out.unlabelled_sd.push_back(sd);
  }
}

}  // namespace

std::vector<DeadWeight> readDeadWeights(const std::string& path) {
  std::vector<std::string> names;
  for (const char* prefix : {"", "known_"}) {
    for (const char* axis : kAxes) names.push_back(std::string(prefix) + axis);
  }
  Table table = readTable(path, names, true);
  std::vector<std::size_t> column = wrenchColumns(table);
  for (const std::size_t c : wrenchColumns(table, "known_")) column.push_back(c);
  std::vector<DeadWeight> out;
  for (std::size_t i = 0; i < table.rows.size(); ++i) {
    DeadWeight row;
    row.line = table.line[i];
    Vector6 label;
    for (std::size_t k = 0; k < 6; ++k) {
      row.reading[static_cast<Index>(k)] = table.rows[i][column[k]];
      label[static_cast<Index>(k)] = table.rows[i][column[k + 6]];
    }
    const Vector6* const parts[] = {&row.reading, &label};
    const bool noted = !label.array().isNaN().all();
    for (std::size_t k = 0; k < (noted ? 12u : 6u); ++k) {
      if (std::isfinite((*parts[k / 6])[static_cast<Index>(k % 6)])) continue;
      throw InputError(table.place(i) + "column " + table.names[column[k]] +
                       " is empty: give a number, or leave all known ones of the row empty");
    }
    if (noted) row.label = label;
    out.push_back(row);
  }
  return out;
}

DeadWeightSolution solveDeadWeights(const std::vector<DeadWeight>& rows) {
  DeadWeightSolution out;
  std::vector<std::size_t> labelled;
  double largest = 0.0;
  for (std::size_t i = 0; i < rows.size(); ++i) {
    if (!rows[i].label) continue;
    labelled.push_back(i);
    largest = std::max(largest, rows[i].label->head<3>().norm());
  }
  if (labelled.size() < kMinRows || !(largest > 0.0)) {
    throw InputError(text("%zu rows with known loads, the largest %.3g N: give %zu rows at least, ",
                          labelled.size(), largest, kMinRows) +
                     "and loads above 0");
  }
  out.block = blocksOf(rows);
  out.blocks = out.block.back() + 1;
  const Line line = lineOf(rows, out.block, labelled);
  out.wrong = wrongLabels({rows, out.block, labelled, line.A, line.Y});
  for (const std::size_t i : labelled) {
    const bool wrong = std::any_of(out.wrong.begin(), out.wrong.end(),
                                   [&](const WrongLabel& w) { return w.row == i; });
    if (!wrong) out.used.push_back(i);
  }
  fillRank(rows, out);
  fillMap(rows, out);
  leaveBlocksOut(rows, out);
  fillUnlabelled(rows, out);
  out.findings = deadWeightDoubts(rows, out);
  return out;
}

}  // namespace assembly_cell
