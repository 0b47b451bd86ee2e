// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <Eigen/QR>
#include <algorithm>
#include <array>
#include <cmath>

#include "assembly_cell/sensor/bridge.h"
#include "force_system.h"

namespace assembly_cell {

namespace {

constexpr double kRank = 1e-8;         // of the column-scaled design
constexpr double kSurelyFull = 1e-10;  // ratio of eigenvalues far above rounding
constexpr int kLoads = 200;            // random loads of the predicted sd

}  // namespace

DesignRank rankOf(const ForceSystem& system, int terms) {
  DesignRank out;
  out.unknowns = 2 * system.rows * terms;
  out.equations = equationsOf(system);
  out.weakest = Eigen::VectorXd::Zero(out.unknowns);
  if (out.equations == 0) return out;
  Eigen::MatrixXd A = designOf(system, terms);
  Eigen::VectorXd scale = A.colwise().norm().transpose();
  for (double& s : scale) s = s > 0.0 ? 1.0 / s : 0.0;
  A = A * scale.asDiagonal();

  Eigen::MatrixXd normal = Eigen::MatrixXd::Zero(out.unknowns, out.unknowns);
  normal.selfadjointView<Eigen::Lower>().rankUpdate(A.transpose());
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(normal);
  const double largest = eigen.eigenvalues()[out.unknowns - 1];
  if (out.equations >= out.unknowns && eigen.eigenvalues()[0] > kSurelyFull * largest) {
    out.rank = out.unknowns;
    out.condition = std::sqrt(largest / eigen.eigenvalues()[0]);
    out.weakest = eigen.eigenvectors().col(0);
  } else {
    // squared singular values are below rounding: pivoted QR instead
    const Eigen::ColPivHouseholderQR<Eigen::MatrixXd> qr(A);
    const auto& R = qr.matrixQR();
    const Eigen::Index size = std::min(R.rows(), R.cols());
    while (out.rank < size && std::abs(R(out.rank, out.rank)) > kRank * std::abs(R(0, 0))) {
      ++out.rank;
    }
    out.condition = HUGE_VAL;
    if (out.rank == out.unknowns) {
      out.condition = std::abs(R(0, 0) / R(out.rank - 1, out.rank - 1));
      out.weakest = eigen.eigenvectors().col(0);
    } else {
      // a vector of the null space
      Eigen::VectorXd null = Eigen::VectorXd::Zero(out.unknowns);
      null[out.rank] = 1.0;
      null.head(out.rank) = -R.topLeftCorner(out.rank, out.rank)
                                 .triangularView<Eigen::Upper>()
                                 .solve(Eigen::VectorXd(R.col(out.rank).head(out.rank)));
      out.weakest = (qr.colsPermutation() * null).normalized();
    }
  }
  out.weakest = scale.asDiagonal() * out.weakest;
  const double size = out.weakest.cwiseAbs().maxCoeff();
  if (size > 0.0) out.weakest /= size;
  return out;
}

PerSide<Eigen::MatrixXd> plainLeastSquares(const ForceSystem& system) {
  constexpr int kLoadTerms = 6;
  if (equationsOf(system) == 0) return {};
  Eigen::VectorXd y(equationsOf(system));
  Eigen::Index row = 0;
  for (const ForceTest& test : system.tests) {
    if (!test.used) continue;
    y.segment(row, test.equations) = test.known;
    row += test.equations;
  }
  return matricesOf(designOf(system, kLoadTerms).colPivHouseholderQr().solve(y), system.rows,
                    kLoadTerms);
}

std::string describeWeak(const Eigen::VectorXd& weakest, const ObservationSet& set, int rows,
                         int terms, const RatedLoad& rated) {
  constexpr std::array<const char*, 6> kAxes = {"fx", "fy", "fz", "tx", "ty", "tz"};
  if (weakest.size() != 2 * rows * terms || weakest.isZero(0.0)) return "none";
  Vector6 full;
  full << Eigen::Vector3d::Constant(rated.force), Eigen::Vector3d::Constant(rated.torque);

  // error of each component per true load, in parts of full scale
  struct Entry {
    double size;
    std::string text;
  };
  std::vector<Entry> found;
  double quadratic = 0.0, linear = 0.0;
  const PerSide<Eigen::MatrixXd> dS = matricesOf(weakest, rows, terms);
  PerSide<Eigen::MatrixXd> errors;
  for (const Side side : kSides) {
    Eigen::MatrixXd& L = errors[side];
    L = dS[side].leftCols(6) * Matrix6(set.sensor[side].nominal.inverse()) * full.asDiagonal();
    for (int r = 0; r < rows; ++r) {
      L.row(r) /= full[r];
      // products of strains at about 2 V
      const double product =
          terms == 27 ? 4.0 * dS[side].row(r).tail(21).cwiseAbs().maxCoeff() / full[r] : 0.0;
      quadratic = std::max(quadratic, product);
      for (int c = 0; c < 6; ++c) {
        found.push_back({std::abs(L(r, c)), std::string(kAxes[r]) + " of " +
                                                (side == Side::kA ? "A" : "B") + " under " +
                                                kAxes[c]});
      }
    }
    linear = std::max(linear, L.cwiseAbs().maxCoeff());
  }
  if (quadratic > 3.0 * linear) return "products of strains";
  // one common factor of everything
  const double p = errors.a(0, 0);
  const Eigen::MatrixXd scaled = p * Eigen::MatrixXd::Identity(rows, 6);
  if (std::abs(p) > 0.0 && (errors.a - scaled).norm() < 0.2 * scaled.norm() &&
      (errors.b - scaled).norm() < 0.2 * scaled.norm()) {
    return "common scale of both sensors";
  }
  std::sort(found.begin(), found.end(),
            [](const Entry& l, const Entry& r) { return l.size > r.size; });
  std::string out = found[0].text;
  for (std::size_t i = 1; i < 3 && found[i].size > 0.5 * found[0].size; ++i) {
    out += ", " + found[i].text;
  }
  return out;
}

Vector6 predictedSd(const Eigen::MatrixXd& covariance, const Eigen::MatrixXd& S,
                    const Matrix6& nominal, const RatedLoad& rated) {
  const auto rows = S.rows(), terms = S.cols();
  Matrix6 C = nominal.inverse();
  if (rows == 6) {
    const Matrix6 own = Matrix6(S.leftCols(6)).inverse();
    if (own.allFinite()) C = own;
  }
  NormalSource normal(1);
  const auto uniform = [&] { return std::erf(normal() / std::sqrt(2.0)); };
  Vector6 sum = Vector6::Zero();
  for (int i = 0; i < kLoads; ++i) {
    Vector6 w;
    for (int k = 0; k < 6; ++k) w[k] = (k < 3 ? rated.force : rated.torque) * uniform();
    const Eigen::VectorXd x = strainTerms(C * w, static_cast<int>(terms));
    for (int r = 0; r < rows; ++r) {
      sum[r] += x.dot(covariance.block(r * terms, r * terms, terms, terms) * x);
    }
  }
  return (sum.cwiseMax(0.0) / kLoads).cwiseSqrt();
}

}  // namespace assembly_cell
