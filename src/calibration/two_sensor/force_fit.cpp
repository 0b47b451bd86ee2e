// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>

#include "force_system.h"

namespace assembly_cell {

namespace {

constexpr int kForceFitIterations = 30;
constexpr double kConverged = 1e-10;     // relative change of S
constexpr double kMinRedundancy = 0.02;  // of a test, so that its residual is informative

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

// M += W ⊗ outer
void addKronecker(Eigen::Ref<Eigen::MatrixXd> M, const Small& W, const Eigen::MatrixXd& outer) {
  for (Eigen::Index j = 0; j < W.cols(); ++j) {
    for (Eigen::Index i = 0; i < W.rows(); ++i) {
      if (W(i, j) == 0.0) continue;
      M.block(i * outer.rows(), j * outer.cols(), outer.rows(), outer.cols()) += W(i, j) * outer;
    }
  }
}

// Contribution of a test at a state of the adjustment.
struct Linear {
  PerSide<Small> D;  // d(residual)/d(strain)
  Small C, W;        // covariance of the residual and its inverse
  SmallVector y;     // known side, carried to the measured strains
};

Linear linearised(const ForceTest& test, const PerSide<Eigen::MatrixXd>& S,
                  const PerSide<Vector6>& strain) {
  const int rows = static_cast<int>(S.a.rows()), terms = static_cast<int>(S.a.cols());
  Linear out;
  out.C = test.reference;
  out.y = test.known;
  for (const Side side : kSides) {
    const SensorPart& part = test.part[side];
    if (!part.present) continue;
    Small& D = out.D[side];
    D = part.K * slope(S[side], strain[side]);
    out.C += D * part.covariance * D.transpose();
    out.y -= D * (part.strain - strain[side]);
  }
  if (test.kind == ObservationKind::kReacting && !test.pose_covariance.isZero(0.0)) {
    Vector6 w = Vector6::Zero();
    w.head(rows) = S.b * strainTerms(strain.b, terms);
    const Small J = poseJacobian(test.X_AB, w, rows);
    out.C += J * test.pose_covariance * J.transpose();
  }
  if (test.kind == ObservationKind::kIndentation && test.point_variance > 0.0) {
    const Side side = test.part.a.present ? Side::kA : Side::kB;
    const Eigen::Vector3d F = (S[side] * strainTerms(strain[side], terms)).head<3>();
    out.C += test.point_variance * skew(F) * skew(F).transpose();
  }
  // perfect data: keep the weights finite
  const double scale = out.C.trace();
  out.C.diagonal().array() += scale > 0.0 ? 1e-14 * scale : 1e-18;
  out.W = out.C.llt().solve(Small::Identity(test.equations, test.equations));
  return out;
}

// Gauss–Helmert: errors in both the observed strains and the shared zeros, so not a problem for
// math/least_squares.h (docs/how_to/calibration.md, "How it is estimated"): linearise at the
// present matrices and adjusted strains, solve for matrices and shared zeros, adjust the strains,
// until nothing moves.
class Adjustment {
 public:
  Adjustment(const ForceSystem& system, const PerSide<Eigen::MatrixXd>& S)
      : system_(system),
        rows_(system.rows),
        terms_(static_cast<int>(S.a.cols())),
        half_(rows_ * terms_),
        unknowns_(2 * half_),
        zeros_(6 * static_cast<Eigen::Index>(system.zero_covariance.size())),
        parts_(system.tests.size()),
        zeta_(Eigen::VectorXd::Zero(zeros_)),
        u_(zeta_),
        prior_(Eigen::MatrixXd::Zero(zeros_, zeros_)),
        N_(unknowns_, unknowns_),
        N_z_(unknowns_, zeros_),
        H_(zeros_, zeros_),
        rhs_(unknowns_),
        rhs_z_(zeros_) {
    fit.S = S;
    fit.equations = equationsOf(system);
    fit.dof = fit.equations - static_cast<int>(unknowns_);
    fit.residual.resize(system.tests.size());
    fit.test_chi2.assign(system.tests.size(), 0.0);
    fit.normalised = fit.test_chi2;
    for (const ForceTest& test : system.tests)
      strain_.push_back({test.part.a.strain, test.part.b.strain});
    // a perfect zero keeps a tiny covariance
    for (std::size_t z = 0; z < system.zero_covariance.size(); ++z) {
      const Matrix6 covariance = system.zero_covariance[z] + 1e-24 * Matrix6::Identity();
      prior_.block<6, 6>(6 * z, 6 * z) = covariance.llt().matrixL();
    }
  }

  void iterate() {
    for (int iteration = 1; iteration <= kForceFitIterations && !fit.converged; ++iteration) {
      linearise();
      eliminateZeros();
      if (!factorise()) return;
      fit.iterations = iteration;
      const Eigen::VectorXd theta = scale_.cwiseProduct(factor_.solve(scale_.cwiseProduct(rhs_)));
      if (!theta.allFinite()) return;
      const PerSide<Eigen::MatrixXd> old = fit.S;
      fit.S = matricesOf(theta, rows_, terms_);
      if (zeros_ > 0) {
        const Eigen::VectorXd pull = rhs_z_ - N_z_.transpose() * theta;
        const Eigen::VectorXd projected = prior_.transpose() * pull;
        u_ = zero_factor_.solve(projected);
        zeta_ = prior_ * u_;
      }
      const double moved = adjustStrains();
      const double change = std::max((fit.S.a - old.a).norm() / fit.S.a.norm(),
                                     (fit.S.b - old.b).norm() / fit.S.b.norm());
      fit.converged = change < kConverged && moved < 1e-9;
    }
    finish();
  }

  void stayAtStart() {
    linearise();
    eliminateZeros();
    if (!factorise()) return;
    fit.iterations = 1;
    fit.converged = true;
    finish();
  }

  void evaluateResiduals(bool normalise) {
    if (fit.covariance.size() == 0) return;
    fit.chi2 = u_.squaredNorm();
    for (std::size_t k = 0; k < system_.tests.size(); ++k) {
      const ForceTest& test = system_.tests[k];
      if (test.used) fit.chi2 += fit.test_chi2[k];
      fit.normalised[k] = std::sqrt(fit.test_chi2[k] / test.equations);
      if (!normalise) continue;
      // the result depends on a used test; for an unused one its error adds
      Eigen::MatrixXd A(test.equations, unknowns_);
      designRows(test, rows_, terms_, strain_[k], A);
      const Small APA = A * fit.covariance * A.transpose();
      // C ∓ APAᵀ is that of this residual; the floor bounds a test that no other one checks
      Eigen::MatrixXd Q = parts_[k].C * (1.0 + kMinRedundancy);
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
  }

  ForceFit fit;

 private:
  // one sensor's part of a linearised test
  struct Block {
    const SensorPart* part;
    const Small* D;
    Eigen::Index first;
    Eigen::VectorXd x;
  };

  // normal equations of all tests in use
  void linearise() {
    N_.setZero();
    N_z_.setZero();
    H_.setZero();
    rhs_.setZero();
    rhs_z_.setZero();
    for (std::size_t k = 0; k < system_.tests.size(); ++k) {
      const ForceTest& test = system_.tests[k];
      parts_[k] = linearised(test, fit.S, strain_[k]);
      if (!test.used) continue;
      std::vector<Block> blocks;
      for (const Side side : kSides) {
        if (!test.part[side].present) continue;
        blocks.push_back({&test.part[side], &parts_[k].D[side], side == Side::kA ? 0 : half_,
                          strainTerms(strain_[k][side], terms_)});
      }
      accumulate(blocks, parts_[k]);
    }
    N_.triangularView<Eigen::StrictlyUpper>() = N_.transpose();
  }

  // residual: Aθ − y − Dζ
  void accumulate(const std::vector<Block>& blocks, const Linear& p) {
    const auto forZeros = [](const Block& block, const auto& work) {
      for (const ZeroPart& zero : block.part->zeros) {
        if (zero.index >= 0) work(zero);
      }
    };
    for (std::size_t i = 0; i < blocks.size(); ++i) {
      const Block& row = blocks[i];
      const Small KW = row.part->K.transpose() * p.W;
      for (std::size_t j = 0; j <= i; ++j) {
        addKronecker(N_.block(row.first, blocks[j].first, half_, half_), KW * blocks[j].part->K,
                     row.x * blocks[j].x.transpose());
      }
      const SmallVector Ky = KW * p.y;
      for (int r = 0; r < rows_; ++r) {
        rhs_.segment(row.first + r * terms_, terms_) += Ky[r] * row.x;
      }
      for (const Block& column : blocks) {
        const Small KWD = KW * *column.D;
        forZeros(column, [&](const ZeroPart& zero) {
          for (int r = 0; r < rows_; ++r) {
            N_z_.block(row.first + r * terms_, 6 * zero.index, terms_, 6) -=
                zero.weight * row.x * KWD.row(r);
          }
        });
      }
      const Small DW = row.D->transpose() * p.W;
      const SmallVector DWy = DW * p.y;
      forZeros(row, [&](const ZeroPart& zi) {
        rhs_z_.segment<6>(6 * zi.index) -= zi.weight * DWy;
        for (const Block& column : blocks) {
          const Small DWD = DW * *column.D;
          forZeros(column, [&](const ZeroPart& zj) {
            H_.block<6, 6>(6 * zi.index, 6 * zj.index) += zi.weight * zj.weight * DWD;
          });
        }
      });
    }
  }

  // with P = LLᵀ the zeros' prior, (H + P⁻¹)⁻¹ = L (I + LᵀHL)⁻¹ Lᵀ
  void eliminateZeros() {
    if (zeros_ == 0) return;
    const Eigen::MatrixXd HL = H_ * prior_;
    Eigen::MatrixXd inner = prior_.transpose() * HL;
    inner.diagonal().array() += 1.0;
    zero_factor_.compute(inner);
    const Eigen::MatrixXd NL = N_z_ * prior_;
    const Eigen::MatrixXd half_step = zero_factor_.matrixL().solve(NL.transpose());
    const Eigen::VectorXd projected = prior_.transpose() * rhs_z_;
    N_.noalias() -= half_step.transpose() * half_step;
    rhs_.noalias() -= NL * zero_factor_.solve(projected);
  }

  bool factorise() {
    scale_ = N_.diagonal().cwiseMax(0.0).cwiseSqrt();
    for (double& s : scale_) s = s > 0.0 ? 1.0 / s : 1.0;
    factor_.compute(scale_.asDiagonal() * N_ * scale_.asDiagonal());
    return factor_.info() == Eigen::Success;
  }

  // residuals of all tests and the strains that belong to them; the largest change of a strain [V]
  double adjustStrains() {
    double moved = 0.0;
    for (std::size_t k = 0; k < system_.tests.size(); ++k) {
      const ForceTest& test = system_.tests[k];
      const Linear& p = parts_[k];
      SmallVector r = -p.y;
      PerSide<Vector6> zero = {Vector6::Zero(), Vector6::Zero()};
      for (const Side side : kSides) {
        const SensorPart& part = test.part[side];
        if (!part.present) continue;
        for (const ZeroPart& z : part.zeros) {
          if (z.index >= 0) zero[side] += z.weight * zeta_.segment<6>(6 * z.index);
        }
        r +=
            part.K * (fit.S[side] * strainTerms(strain_[k][side], terms_)) - p.D[side] * zero[side];
      }
      fit.residual[k] = r;
      const SmallVector Wr = p.W * r;
      fit.test_chi2[k] = r.dot(Wr);
      for (const Side side : kSides) {
        const SensorPart& part = test.part[side];
        if (!part.present) continue;
        const Vector6 next =
            part.strain - zero[side] - part.covariance * (p.D[side].transpose() * Wr);
        moved = std::max(moved, (next - strain_[k][side]).cwiseAbs().maxCoeff());
        strain_[k][side] = next;
      }
    }
    return moved;
  }

  void finish() {
    fit.covariance = scale_.asDiagonal() *
                     factor_.solve(Eigen::MatrixXd::Identity(unknowns_, unknowns_)) *
                     scale_.asDiagonal();
    fit.covariance = (0.5 * (fit.covariance + fit.covariance.transpose())).eval();
  }

  const ForceSystem& system_;
  int rows_, terms_;
  Eigen::Index half_, unknowns_, zeros_;
  std::vector<PerSide<Vector6>> strain_;  // adjusted
  std::vector<Linear> parts_;
  Eigen::VectorXd zeta_, u_;  // shared zeros; in standard deviations of their prior
  Eigen::MatrixXd prior_;     // root of their prior covariance
  Eigen::MatrixXd N_, N_z_, H_;
  Eigen::VectorXd rhs_, rhs_z_, scale_;
  Eigen::LLT<Eigen::MatrixXd> factor_, zero_factor_;
};

}  // namespace

Eigen::MatrixXd whitenedRows(const ForceTest& test, const PerSide<Eigen::MatrixXd>& S) {
  const int rows = static_cast<int>(S.a.rows()), terms = static_cast<int>(S.a.cols());
  const PerSide<Vector6> strain = {test.part.a.strain, test.part.b.strain};
  const Linear p = linearised(test, S, strain);
  Eigen::MatrixXd A(test.equations, 2 * rows * terms);
  designRows(test, rows, terms, strain, A);
  return p.C.llt().matrixL().solve(A);
}

ForceFit fitForce(const ForceSystem& system, const PerSide<Eigen::MatrixXd>& S, bool normalise) {
  Adjustment adjustment(system, S);
  adjustment.iterate();
  adjustment.evaluateResiduals(normalise);
  return adjustment.fit;
}

ForceFit covarianceAt(const ForceSystem& system, const PerSide<Eigen::MatrixXd>& S) {
  Adjustment adjustment(system, S);
  adjustment.stayAtStart();
  return adjustment.fit;
}

}  // namespace assembly_cell
