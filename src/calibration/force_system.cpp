// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "force_system.h"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <Eigen/QR>
#include <Eigen/SVD>
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <map>

#include "assembly_cell/calibration/plan.h"
#include "assembly_cell/sensor/bridge.h"

namespace assembly_cell {

namespace {

constexpr double kRank = 1e-8;         // of singular values, column-scaled
constexpr double kSurelyFull = 1e-10;  // of eigenvalues: far above rounding
constexpr int kIterations = 30;
constexpr double kConverged = 1e-10;       // of the change of S, in parts of S
constexpr std::size_t kSharedZeros = 24;   // beyond that their correlation is left out
constexpr double kLeastRedundancy = 0.02;  // of a test whose residual still says something
constexpr int kLoads = 200;                // over which a predicted sd is taken

const Matrix6& nominalOf(const ObservationSet& set, Side side) {
  return side == Side::kA ? set.a.nominal : set.b.nominal;
}

// ---- zeros ----

struct Zero {
  double stamp = 0.0;
  std::size_t order = 0;  // index of the observation
  Vector6 volts = Vector6::Zero();
  Matrix6 covariance = Matrix6::Zero();
};

struct Zeros {
  std::vector<Zero> list;
  bool merged = false;    // the converter hides drift and noise: one zero for all
  std::size_t first = 0;  // index of the first among the unknowns
  bool shared = true;
};

Zeros zerosOf(const ObservationSet& set, Side side) {
  const SensorDescription& sensor = side == Side::kA ? set.a : set.b;
  Zeros zeros;
  for (std::size_t i = 0; i < set.observations.size(); ++i) {
    const Observation& o = set.observations[i];
    const auto& reading = side == Side::kA ? o.a : o.b;
    if (o.kind != ObservationKind::kUnloaded || !reading || !unusable(*reading, sensor).empty()) {
      continue;
    }
    zeros.list.push_back({o.stamp, i, reading->volts, reading->covariance});
  }
  if (zeros.list.empty()) return zeros;

  // the same offset falls on the same code: repetition teaches nothing
  Vector6 low = zeros.list[0].volts, high = low, sum = Vector6::Zero();
  for (const Zero& zero : zeros.list) {
    low = low.cwiseMin(zero.volts);
    high = high.cwiseMax(zero.volts);
    sum += zero.volts;
  }
  if (sensor.noise < 0.5 * sensor.lsb() && (high - low).maxCoeff() <= 1.001 * sensor.lsb()) {
    zeros.merged = true;
    const auto count = static_cast<double>(zeros.list.size());
    zeros.list.resize(1);
    zeros.list[0].volts = sum / count;
  }
  return zeros;
}

// strain of a reading: zero of its time, drift judged; returns why not
std::string strainOf(const Observation& o, std::size_t order, Side side, const ObservationSet& set,
                     const Zeros& zeros, Part& part) {
  const SensorDescription& sensor = side == Side::kA ? set.a : set.b;
  const Reading& reading = side == Side::kA ? *o.a : *o.b;
  const std::string name = std::string("sensor ") + toString(side) + ": ";
  const std::string why = unusable(reading, sensor);
  if (!why.empty()) return name + why;
  if (zeros.list.empty()) return name + "no unloaded reading: add one before the test";
  std::size_t after = 0;
  while (after < zeros.list.size() && zeros.list[after].order < order) ++after;
  const std::size_t before = after > 0 ? after - 1 : 0;
  if (after == zeros.list.size() || zeros.merged) after = before;
  const Zero &z0 = zeros.list[before], &z1 = zeros.list[after];
  double weight = 0.0;
  if (after != before) {
    // drift between the unloaded readings around the test
    const double one = std::sqrt(sensor.noise * sensor.noise + sensor.lsb() * sensor.lsb() / 12.0);
    const double limit = std::max(3.0 * one, sensor.lsb());
    const double drift = (z1.volts - z0.volts).cwiseAbs().maxCoeff();
    if (drift > limit) {
      char text[120];
      std::snprintf(text, sizeof text, "zero drifted by %.3g V (limit %.3g V): tare more often",
                    drift, limit);
      return name + text;
    }
    if (z1.stamp > z0.stamp) {
      weight = std::clamp((o.stamp - z0.stamp) / (z1.stamp - z0.stamp), 0.0, 1.0);
    }
  }
  part.present = true;
  part.strain = reading.volts - (1.0 - weight) * z0.volts - weight * z1.volts;
  part.covariance = reading.covariance;
  if (zeros.shared) {
    part.zeros[0] = {static_cast<int>(zeros.first + before), 1.0 - weight};
    if (weight > 0.0) part.zeros[1] = {static_cast<int>(zeros.first + after), weight};
  } else {
    part.covariance +=
        (1.0 - weight) * (1.0 - weight) * z0.covariance + weight * weight * z1.covariance;
  }
  return "";
}

// loaded position of a point that moves with the carrier
Eigen::Vector3d loadedPoint(const Eigen::Vector3d& point, const Calibration& c,
                            const Vector6& strain, const Eigen::Vector3d& reference) {
  const Vector6 d = displacementFromVolts(c, c.zero_volts + strain);
  const Eigen::Vector3d corner = kCarrierAtRest - reference;  // O_C at rest in the sensor frame
  return corner + d.head<3>() + rotationFromVector({d.tail<3>()}) * (point - corner);
}

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

// rows of the design matrix of one test
void designRows(const ForceTest& test, int rows, int terms, const Vector6& a, const Vector6& b,
                Eigen::Ref<Eigen::MatrixXd> A) {
  A.setZero();
  const auto fill = [&](const Part& part, const Vector6& strain, Eigen::Index first) {
    if (!part.present) return;
    const Eigen::RowVectorXd x = strainTerms(strain, terms).transpose();
    for (int i = 0; i < test.equations; ++i) {
      for (int r = 0; r < rows; ++r) {
        A.block(i, first + r * terms, 1, terms) = part.K(i, r) * x;
      }
    }
  };
  fill(test.a, a, 0);
  fill(test.b, b, rows * terms);
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
  out.W = out.C.ldlt().solve(Small::Identity(test.equations, test.equations));
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

Eigen::VectorXd strainTerms(const Vector6& strain, int terms) {
  Eigen::VectorXd x(terms);
  x.head<6>() = strain;
  if (terms == 27) x.tail<kStrainProducts>() = strainProducts(strain);
  return x;
}

ForceSystem buildSystem(const ObservationSet& set, const ForceSettings& settings, int rows) {
  ForceSystem system;
  system.rows = rows;
  std::array<Zeros, 2> zeros = {zerosOf(set, Side::kA), zerosOf(set, Side::kB)};
  for (Zeros& side : zeros) {
    side.shared = zeros[0].list.size() + zeros[1].list.size() <= kSharedZeros;
    side.first = system.zero_covariance.size();
    if (!side.shared) continue;
    for (const Zero& zero : side.list) system.zero_covariance.push_back(zero.covariance);
  }
  const ReferenceAccuracy& accuracy = set.accuracy;
  const Eigen::Vector3d reference = Bridge{}.reference_point;

  for (std::size_t i = 0; i < set.observations.size(); ++i) {
    const Observation& o = set.observations[i];
    const bool indentation = o.kind == ObservationKind::kIndentation;
    if (o.kind != ObservationKind::kReacting && o.kind != ObservationKind::kWeight &&
        !(indentation && rows == 6)) {
      continue;
    }
    ForceTest test;
    test.observation = i;
    test.kind = o.kind;
    test.equations = indentation ? 3 : rows;
    test.known = SmallVector::Zero(test.equations);
    test.reference = Small::Zero(test.equations, test.equations);
    const bool reacting = o.kind == ObservationKind::kReacting;
    std::string why;
    if (reacting || o.side == Side::kA) why = strainOf(o, i, Side::kA, set, zeros[0], test.a);
    if (why.empty() && (reacting || o.side == Side::kB)) {
      why = strainOf(o, i, Side::kB, set, zeros[1], test.b);
    }
    Part& part = o.side == Side::kA ? test.a : test.b;
    test.point = o.point;
    test.point_variance = settings.use_reference_covariance ? accuracy.point * accuracy.point : 0.0;
    if (why.empty() && !reacting && o.point_at_rest) {
      const Calibration* c = o.side == Side::kA ? settings.displacement_a : settings.displacement_b;
      if (c == nullptr) {
        why = std::string("sensor ") + toString(o.side) +
              ": the point is that at rest but no displacement calibration is given: identify the "
              "displacement first";
      } else {
        test.point = loadedPoint(o.point, *c, part.strain, reference);
      }
    }
    if (!why.empty()) {
      TestResult dropped;
      dropped.observation = i;
      dropped.dropped = why;
      system.dropped.push_back(dropped);
      continue;
    }
    if (reacting) {
      test.X_AB = o.X_AB;
      test.a.K = Small::Identity(rows, rows);
      test.b.K = rows == 6 ? Small(wrenchTransform(o.X_AB)) : Small(o.X_AB.R);
      if (settings.use_reference_covariance) {
        if (o.X_covariance) {
          test.pose_covariance = *o.X_covariance;
        } else {
          test.pose_covariance.diagonal()
              << Eigen::Vector3d::Constant(accuracy.position * accuracy.position),
              Eigen::Vector3d::Constant(accuracy.rotation * accuracy.rotation);
        }
      }
    } else if (indentation) {
      part.K = Small::Zero(3, 6);
      part.K.leftCols(3) = -skew(test.point);
      part.K.rightCols(3).setIdentity();
    } else {
      part.K = Small::Identity(rows, rows);
      Vector6 w;
      const Eigen::Vector3d F = o.mass * set.gravity * o.direction;
      w << F, test.point.cross(F);
      test.known = w.head(rows);
      if (settings.use_reference_covariance) {
        // (turn of the direction, relative mass, point)
        Eigen::Matrix<double, 6, 7> J = Eigen::Matrix<double, 6, 7>::Zero();
        J.topLeftCorner<3, 3>() = -skew(F);
        J.block<3, 1>(0, 3) = F;
        J.bottomLeftCorner<3, 4>() = skew(test.point) * J.topLeftCorner<3, 4>();
        J.bottomRightCorner<3, 3>() = -skew(F);
        Eigen::Matrix<double, 7, 1> variance;
        variance << Eigen::Vector3d::Constant(accuracy.direction * accuracy.direction),
            accuracy.mass * accuracy.mass, Eigen::Vector3d::Constant(test.point_variance);
        const Matrix6 C = J * variance.asDiagonal() * J.transpose();
        test.reference = C.topLeftCorner(rows, rows);
      }
    }
    system.tests.push_back(test);
  }
  return system;
}

ForceSystem noiseFree(const ForceSystem& system, const ObservationSet& set) {
  ForceSystem out = system;
  const Matrix6 C_a = nominalOf(set, Side::kA).inverse(), C_b = nominalOf(set, Side::kB).inverse();
  for (ForceTest& test : out.tests) {
    if (test.kind == ObservationKind::kReacting) {
      const Vector6 w = nominalOf(set, Side::kA) * test.a.strain;
      test.b.strain = -C_b * transformWrench(inverse(test.X_AB), w);
      continue;
    }
    const bool on_a = test.a.present;
    Part& part = on_a ? test.a : test.b;
    Vector6 w = nominalOf(set, on_a ? Side::kA : Side::kB) * part.strain;
    if (test.kind == ObservationKind::kWeight) w.head(system.rows) = test.known;
    if (test.kind == ObservationKind::kIndentation || system.rows == 3) {
      w.tail<3>() = test.point.cross(w.head<3>());
    }
    part.strain = (on_a ? C_a : C_b) * w;
  }
  return out;
}

DesignRank rankOf(const ForceSystem& system, int terms) {
  DesignRank out;
  out.unknowns = 2 * system.rows * terms;
  for (const ForceTest& test : system.tests) out.equations += test.used ? test.equations : 0;
  out.weakest = Eigen::VectorXd::Zero(out.unknowns);
  if (out.equations == 0) return out;
  Eigen::MatrixXd A(out.equations, out.unknowns);
  Eigen::Index row = 0;
  for (const ForceTest& test : system.tests) {
    if (!test.used) continue;
    designRows(test, system.rows, terms, test.a.strain, test.b.strain,
               A.middleRows(row, test.equations));
    row += test.equations;
  }
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
    // squared singular values drown in rounding: take them themselves
    const Eigen::BDCSVD<Eigen::MatrixXd> svd(A, Eigen::ComputeFullV);
    const auto& values = svd.singularValues();
    for (const double value : values) out.rank += value > kRank * values[0] ? 1 : 0;
    const double smallest = values.size() < out.unknowns ? 0.0 : values[values.size() - 1];
    out.condition = smallest > 0.0 ? values[0] / smallest : HUGE_VAL;
    out.weakest = svd.matrixV().col(out.unknowns - 1);
  }
  out.weakest = scale.asDiagonal() * out.weakest;
  const double most = out.weakest.cwiseAbs().maxCoeff();
  if (most > 0.0) out.weakest /= most;
  return out;
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
  Eigen::MatrixXd prior = Eigen::MatrixXd::Zero(zeros, zeros);
  for (std::size_t z = 0; z < system.zero_covariance.size(); ++z) {
    const auto at = static_cast<Eigen::Index>(6 * z);
    prior.block<6, 6>(at, at) = system.zero_covariance[z];
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

    // zeros eliminated: (H + P⁻¹)⁻¹ = P (I + H P)⁻¹
    Eigen::MatrixXd PX, Pr;
    Eigen::PartialPivLU<Eigen::MatrixXd> lu;
    if (zeros > 0) {
      lu.compute(Eigen::MatrixXd::Identity(zeros, zeros) + H * prior);
      PX = prior * lu.solve(N_z.transpose());
      Pr = prior * lu.solve(rhs_z);
      N.noalias() -= N_z * PX;
      rhs.noalias() -= N_z * Pr;
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
      u = lu.solve(rhs_z - N_z.transpose() * theta);
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
  fit.chi2 = zeros > 0 ? u.dot(zeta) : 0.0;
  for (std::size_t k = 0; k < n; ++k) {
    const ForceTest& test = system.tests[k];
    if (test.used) fit.chi2 += fit.test_chi2[k];
    fit.normalised[k] = std::sqrt(fit.test_chi2[k] / test.equations);
    if (!normalise) continue;
    // a used test has pulled the result towards itself, an unused one adds the result's error
    Eigen::MatrixXd A(test.equations, unknowns);
    designRows(test, rows, terms, a[k], b[k], A);
    const Small APA = A * fit.covariance * A.transpose();
    const Eigen::LLT<Small> root(parts[k].C);
    const Small E = root.matrixL().solve(root.matrixL().solve(APA).transpose().eval());
    const Small Q = Small::Identity(test.equations, test.equations) + (test.used ? -E : E);
    const SmallVector x = root.matrixL().solve(fit.residual[k]);
    const Eigen::SelfAdjointEigenSolver<Small> eigen(Q);
    double sum = 0.0;
    for (int i = 0; i < test.equations; ++i) {
      const double redundancy = eigen.eigenvalues()[i];
      if (redundancy < kLeastRedundancy) continue;
      const double along = eigen.eigenvectors().col(i).dot(x);
      sum += along * along / redundancy;
    }
    fit.normalised[k] = std::sqrt(sum / test.equations);
  }
  return fit;
}

bool plainLeastSquares(const ForceSystem& system, Eigen::MatrixXd& S_a, Eigen::MatrixXd& S_b) {
  constexpr int kTerms = 6;
  const int rows = system.rows;
  Eigen::Index equations = 0;
  for (const ForceTest& test : system.tests) equations += test.used ? test.equations : 0;
  if (equations == 0) return false;
  const Eigen::Index unknowns = 2 * rows * kTerms;
  Eigen::MatrixXd A(equations, unknowns);
  Eigen::VectorXd y(equations);
  Eigen::Index row = 0;
  for (const ForceTest& test : system.tests) {
    if (!test.used) continue;
    designRows(test, rows, kTerms, test.a.strain, test.b.strain, A.middleRows(row, test.equations));
    y.segment(row, test.equations) = test.known;
    row += test.equations;
  }
  const Eigen::VectorXd theta = A.colPivHouseholderQr().solve(y);
  S_a = S_b = Eigen::MatrixXd::Zero(rows, kTerms);
  for (int r = 0; r < rows; ++r) {
    S_a.row(r) = theta.segment(r * kTerms, kTerms).transpose();
    S_b.row(r) = theta.segment((rows + r) * kTerms, kTerms).transpose();
  }
  return theta.allFinite();
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
  Eigen::MatrixXd L_both[2];
  for (int side = 0; side < 2; ++side) {
    Eigen::MatrixXd dS(rows, terms);
    for (int r = 0; r < rows; ++r) {
      dS.row(r) = weakest.segment((side * rows + r) * terms, terms).transpose();
    }
    const Matrix6 C = nominalOf(set, side == 0 ? Side::kA : Side::kB).inverse();
    Eigen::MatrixXd L = dS.leftCols(6) * C * full.asDiagonal();
    for (int r = 0; r < rows; ++r) L.row(r) /= full[r];
    L_both[side] = L;
    linear = std::max(linear, L.cwiseAbs().maxCoeff());
    if (terms == 27) {
      // products of strains at about 2 V
      for (int r = 0; r < rows; ++r) {
        quadratic = std::max(quadratic, 4.0 * dS.row(r).tail(21).cwiseAbs().maxCoeff() / full[r]);
      }
    }
    for (int r = 0; r < rows; ++r) {
      for (int c = 0; c < 6; ++c) {
        found.push_back({std::abs(L(r, c)), std::string(kAxes[static_cast<std::size_t>(r)]) +
                                                " of " + (side == 0 ? "A" : "B") + " under " +
                                                kAxes[static_cast<std::size_t>(c)]});
      }
    }
  }
  if (quadratic > 3.0 * linear) return "products of strains";
  // one common factor of everything
  const double p = L_both[0](0, 0);
  const Eigen::MatrixXd scaled = p * Eigen::MatrixXd::Identity(rows, 6);
  if (std::abs(p) > 0.0 && (L_both[0] - scaled).norm() < 0.2 * scaled.norm() &&
      (L_both[1] - scaled).norm() < 0.2 * scaled.norm()) {
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
                    const Matrix6& nominal, int rows, int terms, const RatedLoad& rated) {
  Matrix6 C = nominal.inverse();
  if (rows == 6) {
    const Eigen::FullPivLU<Matrix6> lu(S.leftCols(6));
    if (lu.isInvertible()) C = lu.inverse();
  }
  NormalSource normal(1);
  const auto uniform = [&] { return std::erf(normal() / std::sqrt(2.0)); };
  Vector6 sum = Vector6::Zero();
  for (int i = 0; i < kLoads; ++i) {
    Vector6 w;
    for (int k = 0; k < 6; ++k) w[k] = (k < 3 ? rated.force : rated.torque) * uniform();
    const Eigen::VectorXd x = strainTerms(C * w, terms);
    for (int r = 0; r < rows; ++r) {
      sum[r] += x.dot(covariance.block(r * terms, r * terms, terms, terms) * x);
    }
  }
  return (sum.cwiseMax(0.0) / kLoads).cwiseSqrt();
}

}  // namespace assembly_cell
