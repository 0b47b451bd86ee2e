// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>

#include "force_system.h"

namespace assembly_cell {

namespace {

constexpr int kIterations = 30;
constexpr double kConverged = 1e-10;       // of the change of S, in parts of S
constexpr double kLeastRedundancy = 0.02;  // of a test whose residual still says something

Small poseJacobian(const Pose& X, const Vector6& w_B, int rows) {
  const Eigen::Matrix3d f = skew(X.R * w_B.head<3>());
  Small J = Small::Zero(rows, 6);
  J.topRightCorner(3, 3) = -f;
  if (rows == 6) {
    J.bottomLeftCorner(3, 3) = -f;
    J.bottomRightCorner(3, 3) = -skew(X.R * w_B.tail<3>()) - skew(X.p) * f;
  }
  return J;
}

// dw/dstrain of rows × terms at a strain
Small slope(const Eigen::MatrixXd& S, const Vector6& strain) {
  Small out = S.leftCols<6>();
  if (S.cols() == 6) return out;
  for (int i = 0, k = 6; i < 6; ++i) {
    for (int j = i; j < 6; ++j, ++k) {
      out.col(i) += S.col(k) * strain[j];
      out.col(j) += S.col(k) * strain[i];
    }
  }
  return out;
}

// M += W ⊗ (x yᵀ) at blocks of x.size() × y.size()
void addKronecker(Eigen::MatrixXd& M, Eigen::Index row, Eigen::Index col, const Small& W,
                  const Eigen::VectorXd& x, const Eigen::VectorXd& y, Eigen::MatrixXd& outer) {
  outer.noalias() = x * y.transpose();
  for (Eigen::Index j = 0; j < W.cols(); ++j) {
    for (Eigen::Index i = 0; i < W.rows(); ++i) {
      if (W(i, j) == 0.0) continue;
      M.block(row + i * x.size(), col + j * y.size(), x.size(), y.size()) += W(i, j) * outer;
    }
  }
}

// what a test contributes at a state of the adjustment
struct Linear {
  Small D_a, D_b;  // d(residual)/d(strain)
  Small C, W;      // covariance of the residual and its inverse
  SmallVector y;   // known side, carried to the measured strains
};

Linear linearised(const ForceTest& test, const Eigen::MatrixXd& S_a, const Eigen::MatrixXd& S_b,
                  const Vector6& a, const Vector6& b, int rows, int terms) {
  Linear out;
  out.C = test.reference;
  out.y = test.known;
  if (test.a.present) {
    out.D_a = test.a.K * slope(S_a, a);
    out.C += out.D_a * test.a.covariance * out.D_a.transpose();
    out.y -= out.D_a * (test.a.strain - a);
  }
  if (test.b.present) {
    out.D_b = test.b.K * slope(S_b, b);
    out.C += out.D_b * test.b.covariance * out.D_b.transpose();
    out.y -= out.D_b * (test.b.strain - b);
  }
  if (test.kind == ObservationKind::kReacting && !test.pose_covariance.isZero(0.0)) {
    Vector6 w = Vector6::Zero();
    w.head(rows) = S_b * strainTerms(b, terms);
    const Small J = poseJacobian(test.X_AB, w, rows);
    out.C += J * test.pose_covariance * J.transpose();
  }
  if (test.kind == ObservationKind::kIndentation && test.point_variance > 0.0) {
    const Eigen::MatrixXd& S = test.a.present ? S_a : S_b;
    const Eigen::Vector3d F = (S * strainTerms(test.a.present ? a : b, terms)).head<3>();
    out.C += test.point_variance * skew(F) * skew(F).transpose();
  }
  // perfect data: keep the weights finite
  const double scale = out.C.trace();
  out.C.diagonal().array() += scale > 0.0 ? 1e-14 * scale : 1e-18;
  out.W = out.C.llt().solve(Small::Identity(test.equations, test.equations));
  return out;
}

}  // namespace

Eigen::MatrixXd whitenedRows(const ForceTest& test, const Eigen::MatrixXd& S_a,
                             const Eigen::MatrixXd& S_b, int rows, int terms) {
  const Linear p = linearised(test, S_a, S_b, test.a.strain, test.b.strain, rows, terms);
  Eigen::MatrixXd A(test.equations, 2 * rows * terms);
  designRows(test, rows, terms, test.a.strain, test.b.strain, A);
  return p.C.llt().matrixL().solve(A);
}

ForceFit fitForce(const ForceSystem& system, const Eigen::MatrixXd& S_a, const Eigen::MatrixXd& S_b,
                  int terms, bool iterate, bool normalise) {
  const int rows = system.rows;
  const Eigen::Index half = rows * terms, unknowns = 2 * half;
  const auto zeros = static_cast<Eigen::Index>(6 * system.zero_covariance.size());
  const std::size_t n = system.tests.size();
  ForceFit fit;
  fit.S_a = S_a;
  fit.S_b = S_b;
  fit.residual.resize(n);
  fit.test_chi2.assign(n, 0.0);
  fit.normalised.assign(n, 0.0);
  for (const ForceTest& test : system.tests) fit.equations += test.used ? test.equations : 0;
  fit.dof = fit.equations - static_cast<int>(unknowns);

  // state of the adjustment
  std::vector<Vector6> a(n), b(n);
  for (std::size_t k = 0; k < n; ++k) {
    a[k] = system.tests[k].a.strain;
    b[k] = system.tests[k].b.strain;
  }
  Eigen::VectorXd zeta = Eigen::VectorXd::Zero(zeros);
  // root of their prior covariance; a perfect zero keeps a tiny one
  Eigen::MatrixXd prior = Eigen::MatrixXd::Zero(zeros, zeros);
  for (std::size_t z = 0; z < system.zero_covariance.size(); ++z) {
    const auto at = static_cast<Eigen::Index>(6 * z);
    const Matrix6 covariance = system.zero_covariance[z] + 1e-24 * Matrix6::Identity();
    prior.block<6, 6>(at, at) = covariance.llt().matrixL();
  }

  const auto linearise = [&](std::size_t k) {
    return linearised(system.tests[k], fit.S_a, fit.S_b, a[k], b[k], rows, terms);
  };
  const auto zeroPart = [&](const Part& part) {
    Vector6 out = Vector6::Zero();
    for (const ZeroPart& zero : part.zeros) {
      if (zero.index >= 0) out += zero.weight * zeta.segment<6>(6 * zero.index);
    }
    return out;
  };

  Eigen::MatrixXd N(unknowns, unknowns), N_z(unknowns, zeros), H(zeros, zeros), outer;
  Eigen::VectorXd rhs(unknowns), rhs_z(zeros), u = Eigen::VectorXd::Zero(zeros);
  std::vector<Linear> parts(n);
  Eigen::LLT<Eigen::MatrixXd> factor;
  Eigen::VectorXd scale;
  for (int iteration = 1; iteration <= (iterate ? kIterations : 1); ++iteration) {
    N.setZero();
    N_z.setZero();
    H.setZero();
    rhs.setZero();
    rhs_z.setZero();
    for (std::size_t k = 0; k < n; ++k) {
      parts[k] = linearise(k);
      const ForceTest& test = system.tests[k];
      if (!test.used) continue;
      const Linear& p = parts[k];
      struct Block {
        const Part* part;
        const Small* D;
        Eigen::Index first;
        Eigen::VectorXd x;
      };
      std::array<Block, 2> blocks;
      std::size_t count = 0;
      if (test.a.present) blocks[count++] = {&test.a, &p.D_a, 0, strainTerms(a[k], terms)};
      if (test.b.present) blocks[count++] = {&test.b, &p.D_b, half, strainTerms(b[k], terms)};
      for (std::size_t i = 0; i < count; ++i) {
        const Small KW = blocks[i].part->K.transpose() * p.W;
        for (std::size_t j = 0; j <= i; ++j) {
          addKronecker(N, blocks[i].first, blocks[j].first, KW * blocks[j].part->K, blocks[i].x,
                       blocks[j].x, outer);
        }
        const SmallVector Ky = KW * p.y;
        for (int r = 0; r < rows; ++r) {
          rhs.segment(blocks[i].first + r * terms, terms) += Ky[r] * blocks[i].x;
        }
        // shared zeros: residual is Aθ − y − Dζ
        for (std::size_t j = 0; j < count; ++j) {
          const Small KWD = KW * *blocks[j].D;
          for (const ZeroPart& zero : blocks[j].part->zeros) {
            if (zero.index < 0) continue;
            for (int r = 0; r < rows; ++r) {
              N_z.block(blocks[i].first + r * terms, 6 * zero.index, terms, 6) -=
                  zero.weight * blocks[i].x * KWD.row(r);
            }
          }
        }
        const Small DW = blocks[i].D->transpose() * p.W;
        const SmallVector DWy = DW * p.y;
        for (const ZeroPart& zi : blocks[i].part->zeros) {
          if (zi.index < 0) continue;
          rhs_z.segment<6>(6 * zi.index) -= zi.weight * DWy;
          for (std::size_t j = 0; j < count; ++j) {
            const Small DWD = DW * *blocks[j].D;
            for (const ZeroPart& zj : blocks[j].part->zeros) {
              if (zj.index < 0) continue;
              H.block<6, 6>(6 * zi.index, 6 * zj.index) += zi.weight * zj.weight * DWD;
            }
          }
        }
      }
    }
    N.triangularView<Eigen::StrictlyUpper>() = N.transpose();

    // zeros eliminated: with P = LLᵀ, (H + P⁻¹)⁻¹ = L (I + LᵀHL)⁻¹ Lᵀ
    Eigen::LLT<Eigen::MatrixXd> zero_factor;
    if (zeros > 0) {
      const Eigen::MatrixXd HL = H * prior;
      Eigen::MatrixXd inner = prior.transpose() * HL;
      inner.diagonal().array() += 1.0;
      zero_factor.compute(inner);
      const Eigen::MatrixXd NL = N_z * prior;
      const Eigen::MatrixXd half_step = zero_factor.matrixL().solve(NL.transpose());
      const Eigen::VectorXd projected = prior.transpose() * rhs_z;
      N.noalias() -= half_step.transpose() * half_step;
      rhs.noalias() -= NL * zero_factor.solve(projected);
    }
    scale = N.diagonal().cwiseMax(0.0).cwiseSqrt();
    for (double& s : scale) s = s > 0.0 ? 1.0 / s : 1.0;
    fit.information = N;
    factor.compute(scale.asDiagonal() * N * scale.asDiagonal());
    if (factor.info() != Eigen::Success) return fit;
    fit.iterations = iteration;
    if (!iterate) {
      fit.converged = true;
      break;
    }
    const Eigen::VectorXd theta = scale.cwiseProduct(factor.solve(scale.cwiseProduct(rhs)));
    if (!theta.allFinite()) return fit;

    // parameters, zeros, adjusted strains
    const Eigen::MatrixXd old_a = fit.S_a, old_b = fit.S_b;
    for (int r = 0; r < rows; ++r) {
      fit.S_a.row(r) = theta.segment(r * terms, terms).transpose();
      fit.S_b.row(r) = theta.segment(half + r * terms, terms).transpose();
    }
    if (zeros > 0) {
      const Eigen::VectorXd pull = rhs_z - N_z.transpose() * theta;
      const Eigen::VectorXd projected = prior.transpose() * pull;
      u = zero_factor.solve(projected);  // ζ in standard deviations of its prior
      zeta = prior * u;
    }
    double moved = 0.0;
    for (std::size_t k = 0; k < n; ++k) {
      const ForceTest& test = system.tests[k];
      const Linear& p = parts[k];
      SmallVector r = -p.y;
      const Vector6 za = zeroPart(test.a), zb = zeroPart(test.b);
      if (test.a.present) {
        r += test.a.K * (fit.S_a * strainTerms(a[k], terms)) - p.D_a * za;
      }
      if (test.b.present) {
        r += test.b.K * (fit.S_b * strainTerms(b[k], terms)) - p.D_b * zb;
      }
      fit.residual[k] = r;
      const SmallVector Wr = p.W * r;
      fit.test_chi2[k] = r.dot(Wr);
      const auto adjust = [&](const Part& part, const Small& D, const Vector6& zero, Vector6& v) {
        if (!part.present) return;
        const Vector6 next = part.strain - zero - part.covariance * (D.transpose() * Wr);
        moved = std::max(moved, (next - v).cwiseAbs().maxCoeff());
        v = next;
      };
      adjust(test.a, p.D_a, za, a[k]);
      adjust(test.b, p.D_b, zb, b[k]);
    }
    const double change = std::max((fit.S_a - old_a).norm() / fit.S_a.norm(),
                                   (fit.S_b - old_b).norm() / fit.S_b.norm());
    if (change < kConverged && moved < 1e-9) {
      fit.converged = true;
      break;
    }
  }

  fit.covariance = scale.asDiagonal() *
                   factor.solve(Eigen::MatrixXd::Identity(unknowns, unknowns)) * scale.asDiagonal();
  fit.covariance = (0.5 * (fit.covariance + fit.covariance.transpose())).eval();
  if (!iterate) return fit;
  fit.chi2 = u.squaredNorm();
  for (std::size_t k = 0; k < n; ++k) {
    const ForceTest& test = system.tests[k];
    if (test.used) fit.chi2 += fit.test_chi2[k];
    fit.normalised[k] = std::sqrt(fit.test_chi2[k] / test.equations);
    if (!normalise) continue;
    // a used test has pulled the result towards itself, an unused one adds the result's error
    Eigen::MatrixXd A(test.equations, unknowns);
    designRows(test, rows, terms, a[k], b[k], A);
    const Small APA = A * fit.covariance * A.transpose();
    // C ∓ APAᵀ is that of this residual; the floor keeps what nothing else checks from counting
    Eigen::MatrixXd Q = parts[k].C * (1.0 + kLeastRedundancy);
    if (test.used) {
      Q -= APA;
    } else {
      Q += APA;
    }
    const Eigen::LLT<Eigen::MatrixXd> root(Q);
    const double sum = root.info() == Eigen::Success
                           ? fit.residual[k].dot(root.solve(fit.residual[k]))
                           : fit.test_chi2[k];
    fit.normalised[k] = std::sqrt(sum / test.equations);
  }
  return fit;
}

}  // namespace assembly_cell
