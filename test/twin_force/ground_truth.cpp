// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "ground_truth.h"

#include <cmath>

namespace assembly_cell {
namespace twin_truth {

Matrix3d rotation(const Vector3d& v) {
  const double angle = v.norm();
  if (angle == 0.0) return Matrix3d::Identity();
  return Eigen::AngleAxisd(angle, v / angle).toRotationMatrix();
}

Vector6 seenFrom(const Pose& X, const Vector6& w) {
  Vector6 out;
  const Vector3d f = X.R * w.head<3>(), m = X.R * w.tail<3>();
  out << f, m.x() + X.p.y() * f.z() - X.p.z() * f.y(), m.y() + X.p.z() * f.x() - X.p.x() * f.z(),
      m.z() + X.p.x() * f.y() - X.p.y() * f.x();
  return out;
}

Vector6 onLine(const Vector3d& point, const Vector3d& force) {
  Vector6 w;
  w << force, point.cross(force);
  return w;
}

Matrix6 noise(double sigma_force, double sigma_moment) {
  Matrix6 c = Matrix6::Zero();
  c.diagonal() << Vector3d::Constant(sigma_force * sigma_force),
      Vector3d::Constant(sigma_moment * sigma_moment);
  return c;
}

void press(Scene& s, const Vector3d& point_A, const Vector3d& force_on_B_A, const Pose& move) {
  const Vector6 w_B = seenFrom(inverse(s.X_AB), onLine(point_A, force_on_B_A));
  s.moves.push_back(move);
  s.w_b.push_back(seenFrom(inverse(move), w_B));
}

Scene begin(const std::string& name, const Matrix3d& R, const Vector3d& T) {
  Scene s;
  s.name = name;
  s.X_AB = {R, T};
  s.covariance_a = s.covariance_b = noise(0.05, 2e-3);
  return s;
}

Vector6 gaussian(const Matrix6& covariance, std::mt19937_64& random) {
  std::normal_distribution<double> normal;
  Vector6 x;
  for (int i = 0; i < 6; ++i) x[i] = normal(random);
  // square root by eigenvectors: also of semidefinite ones
  const Eigen::SelfAdjointEigenSolver<Matrix6> eigen(covariance);
  return eigen.eigenvectors() * eigen.eigenvalues().cwiseMax(0.0).cwiseSqrt().cwiseProduct(x);
}

std::vector<TwinContact> measure(const Scene& s, std::mt19937_64* random) {
  std::vector<TwinContact> out(s.size());
  for (std::size_t i = 0; i < s.size(); ++i) {
    TwinContact& c = out[i];
    c.wrench_a = -seenFrom(s.X_AB, seenFrom(s.moves[i], s.w_b[i]));
    c.wrench_b = s.w_b[i];
    c.covariance_a = s.covariance_a;
    c.covariance_b = s.covariance_b;
    c.move = s.moves[i];
    if (i < s.move_covariance.size()) c.move_covariance = s.move_covariance[i];
    if (random == nullptr) continue;
    c.wrench_a += gaussian(s.covariance_a, *random);
    c.wrench_b += gaussian(s.covariance_b, *random);
    if (c.move_covariance) {
      const Vector6 x = gaussian(*c.move_covariance, *random);
      const Matrix3d dR = rotation(x.tail<3>());
      c.move = {dR * c.move.R, dR * c.move.p + x.head<3>()};
    }
  }
  return out;
}

Matrix6 bound(const Scene& s, const Matrix6* prior, double offset_force, double offset_moment) {
  const auto n = static_cast<Eigen::Index>(s.size());
  const bool moving = !s.move_covariance.empty();
  const bool offset = offset_force > 0.0;
  const Eigen::Index per = moving ? 12 : 6, first = 6 + (offset ? 12 : 0);
  const Eigen::Index unknowns = first + per * n;
  const Eigen::Index rows = (moving ? 18 : 12) * n;
  const auto predict = [&](const VectorXd& x) {
    VectorXd y(rows);
    const Pose X{rotation(x.segment<3>(3)) * s.X_AB.R, s.X_AB.p + x.head<3>()};
    for (Eigen::Index i = 0; i < n; ++i) {
      const auto k = static_cast<std::size_t>(i);
      const Vector6 w_b = s.w_b[k] + x.segment<6>(first + per * i);
      Pose move = s.moves[k];
      if (moving) {
        const Vector6 d = x.segment<6>(first + per * i + 6);
        const Matrix3d dR = rotation(d.tail<3>());
        move = {dR * move.R, dR * move.p + d.head<3>()};
        y.segment<6>(12 * n + 6 * i) = d;
      }
      Vector6 o_a = Vector6::Zero(), o_b = Vector6::Zero();
      if (offset) {
        o_a = x.segment<6>(6);
        o_b = x.segment<6>(12);
      }
      y.segment<6>(12 * i) = o_a - seenFrom(X, seenFrom(move, w_b));
      y.segment<6>(12 * i + 6) = w_b + o_b;
    }
    return y;
  };
  MatrixXd H(rows, unknowns);
  for (Eigen::Index j = 0; j < unknowns; ++j) {
    const double h = 1e-5;
    VectorXd x = VectorXd::Zero(unknowns);
    x[j] = h;
    const VectorXd up = predict(x);
    x[j] = -h;
    H.col(j) = (up - predict(x)) / (2 * h);
  }
  MatrixXd W = MatrixXd::Zero(rows, rows);
  for (Eigen::Index i = 0; i < n; ++i) {
    W.block<6, 6>(12 * i, 12 * i) = s.covariance_a.inverse();
    W.block<6, 6>(12 * i + 6, 12 * i + 6) = s.covariance_b.inverse();
    if (moving) {
      // an exactly known move is one with 1e-9 of uncertainty
      W.block<6, 6>(12 * n + 6 * i, 12 * n + 6 * i) =
          (s.move_covariance[static_cast<std::size_t>(i)] + 1e-18 * Matrix6::Identity()).inverse();
    }
  }
  MatrixXd I = H.transpose() * W * H;
  if (offset) {
    I.block<12, 12>(6, 6).diagonal() +=
        (VectorXd(12) << VectorXd::Constant(3, offset_force), VectorXd::Constant(3, offset_moment),
         VectorXd::Constant(3, offset_force), VectorXd::Constant(3, offset_moment))
            .finished()
            .cwiseAbs2()
            .cwiseInverse();
  }
  // eliminate all but the pose
  const Eigen::Index m = unknowns - 6;
  Matrix6 pose =
      I.topLeftCorner<6, 6>() -
      I.topRightCorner(6, m) * I.bottomRightCorner(m, m).ldlt().solve(I.bottomLeftCorner(m, 6));
  if (prior != nullptr) pose += prior->inverse();
  return pose.inverse();
}

Vector6 errorOf(const Pose& truth, const Pose& estimate) {
  const Eigen::AngleAxisd turn(truth.R * estimate.R.transpose());
  Vector6 d;
  d << truth.p - estimate.p, turn.angle() * turn.axis();
  return d;
}

PosePrior defaultPrior(const Pose& nominal) {
  PosePrior prior;
  prior.pose = nominal;
  prior.covariance.setZero();
  prior.covariance.diagonal() << Vector3d::Constant(1e-4), Vector3d::Constant(1e-2);
  return prior;
}

double normalisedDistance(const TwinForceEstimate& estimate, const Pose& pose) {
  Vector6 d;
  d << pose.p - estimate.pose.p, vectorFromRotation(pose.R * estimate.pose.R.transpose()).value;
  // in units of what is required; null directions are orthonormal there
  const Vector6 inverse = estimate.scale.cwiseInverse();
  const auto null = estimate.null_directions.leftCols(estimate.null_count);
  Vector6 y = inverse.cwiseProduct(d);
  y -= null * (null.transpose() * y);
  const Matrix6 scaled = inverse.asDiagonal() * estimate.covariance * inverse.asDiagonal();
  const Eigen::SelfAdjointEigenSolver<Matrix6> eigen(scaled);
  double sum = 0.0;
  for (int k = estimate.null_count; k < 6; ++k) {
    const double part = eigen.eigenvectors().col(k).dot(y);
    sum += part * part / eigen.eigenvalues()[k];
  }
  return sum;
}

PairMisfit pairMisfit(const TwinContact& i, const TwinContact& j) {
  // values, and variances by d(F_i·F_j) and d(F_i·M_j + F_j·M_i) of both wrenches
  struct Side {
    double force, reciprocal, var_force, var_reciprocal;
  };
  const auto side = [same = &i == &j](const Vector6& wi, const Matrix6& ci, const Vector6& wj,
                                      const Matrix6& cj) {
    Vector6 fi, fj, ri, rj;
    fi << wj.head<3>(), Vector3d::Zero();
    fj << wi.head<3>(), Vector3d::Zero();
    ri << wj.tail<3>(), wj.head<3>();
    rj << wi.tail<3>(), wi.head<3>();
    const double both = same ? 4.0 : 1.0, other = same ? 0.0 : 1.0;
    return Side{wi.head<3>().dot(wj.head<3>()),
                wi.head<3>().dot(wj.tail<3>()) + wj.head<3>().dot(wi.tail<3>()),
                both * fi.dot(ci * fi) + other * fj.dot(cj * fj),
                both * ri.dot(ci * ri) + other * rj.dot(cj * rj)};
  };
  const auto inB = [](const TwinContact& c) {
    const Matrix6 phi = wrenchTransform(c.move);
    return Matrix6(phi * c.covariance_b * phi.transpose());
  };
  const Side a = side(i.wrench_a, i.covariance_a, j.wrench_a, j.covariance_a);
  const Side b = side(seenFrom(i.move, i.wrench_b), inB(i), seenFrom(j.move, j.wrench_b), inB(j));
  return {(a.force - b.force) / std::sqrt(a.var_force + b.var_force),
          (a.reciprocal - b.reciprocal) / std::sqrt(a.var_reciprocal + b.var_reciprocal)};
}

std::vector<Scene> geometries() {
  const Vector3d x = Vector3d::UnitX(), z = Vector3d::UnitZ();
  const double deg = M_PI / 180;
  const Vector3d along = Vector3d(1, 2, 3).normalized();
  const Vector3d T(0.08, -0.06, 0.1);
  std::vector<Scene> all;
  // lines: first along −z through p1, second at β in the xz plane through p2
  const auto two = [&](const std::string& name, const Matrix3d& R, const Vector3d& shift,
                       double beta, const Vector3d& p1, const Vector3d& p2) {
    Scene s = begin(name, R, shift);
    press(s, p1, -20 * z);
    press(s, p2, -20 * (std::cos(beta) * z + std::sin(beta) * x));
    all.push_back(s);
  };
  const Vector3d p1(0.03, 0.05, 0.02), p2(-0.02, -0.01, 0.05);
  const double right = M_PI / 2;
  two("generic", rotation(0.7 * along), T, right, p1, p2);
  two("theta 1 deg, T along press", rotation(deg * along), 0.14 * z, right, p1, p2);
  two("theta 0.05 deg, T along press", rotation(0.05 * deg * along), 0.14 * z, right, p1, p2);
  two("T 1 deg from the forces' plane", rotation(0.7 * along),
      0.14 * Vector3d(0.6, std::tan(deg), 0.8).normalized(), right, p1, p2);
  two("axis 1 deg from the forces' plane",
      rotation(0.7 * Vector3d(0.6, std::tan(deg), 0.8).normalized()), T, right, p1, p2);
  for (const double beta : {30.0, 10.0, 5.0, 1.0, 0.0}) {
    two("lines " + std::to_string(static_cast<int>(beta)) + " deg", rotation(0.3 * along), T,
        beta * deg, Vector3d(0, 0.03, 0.02), Vector3d(0, -0.03, 0.02));
  }
  two("both lines through O_A = O_B", rotation(0.7 * along), Vector3d::Zero(), right,
      Vector3d::Zero(), Vector3d::Zero());
  two("perpendicular, 80 mm arms", rotation(0.7 * along), T, right, Vector3d(0.08, 0, 0),
      Vector3d(0, -0.08, 0));
  two("theta 179 deg", rotation(179 * deg * along), T, right, p1, p2);
  Scene three = begin("aligned, T along press, three contacts", Matrix3d::Identity(), 0.14 * z);
  press(three, p1, -20 * z);
  press(three, p2, Vector3d(-15, 3, -12));
  press(three, Vector3d(0.01, -0.04, 0.03), Vector3d(4, 14, -14));
  all.push_back(three);
  return all;
}

}  // namespace twin_truth
}  // namespace assembly_cell
