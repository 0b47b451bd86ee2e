// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/geometry/spatial.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "assembly_cell/geometry/contact_geometry.h"

namespace assembly_cell {
namespace {

using Eigen::AngleAxisd;
using Eigen::Matrix3d;
using Eigen::Vector3d;

constexpr double kPi = 3.14159265358979323846;
// a few dozen roundings of numbers of size one
constexpr double kRounding = 2e-14;

class Spatial : public ::testing::Test {
 protected:
  double uniform(double low, double high) {
    return std::uniform_real_distribution<double>(low, high)(engine_);
  }
  Vector3d vector() { return {uniform(-1, 1), uniform(-1, 1), uniform(-1, 1)}; }
  Pose pose() {
    return {AngleAxisd(uniform(-kPi, kPi), vector().normalized()).toRotationMatrix(), vector()};
  }
  Vector6 wrench() { return (Vector6() << vector(), vector()).finished(); }

 private:
  std::mt19937_64 engine_{11};
};

TEST_F(Spatial, ForceAtALeverMakesATorque) {
  Vector6 w_B = Vector6::Zero();
  w_B(2) = 1.0;
  const Pose X_AB{Matrix3d::Identity(), Vector3d(1, 0, 0)};
  Vector6 expected;
  expected << 0, 0, 1, 0, -1, 0;
  EXPECT_EQ(transformWrench(X_AB, w_B), expected);
}

// A rigid body's power does not depend on the point and axes it is counted in.
TEST_F(Spatial, WrenchKeepsItsPower) {
  for (int i = 0; i < 1000; ++i) {
    const Pose X_AB = pose();
    const Vector6 w_B = wrench();
    const Vector3d velocity_A = vector(), omega_A = vector();  // of the point at A's origin
    const Vector3d velocity_B = X_AB.R.transpose() * (velocity_A + omega_A.cross(X_AB.p));
    const Vector3d omega_B = X_AB.R.transpose() * omega_A;
    const Vector6 w_A = transformWrench(X_AB, w_B);
    EXPECT_NEAR(w_A.head<3>().dot(velocity_A) + w_A.tail<3>().dot(omega_A),
                w_B.head<3>().dot(velocity_B) + w_B.tail<3>().dot(omega_B), kRounding);
  }
}

TEST_F(Spatial, WrenchMatrixIsTheFunctionAndComposes) {
  for (int i = 0; i < 1000; ++i) {
    const Pose X_AB = pose(), X_BC = pose();
    const Vector6 w = wrench();
    EXPECT_LT((wrenchTransform(X_AB) * w - transformWrench(X_AB, w)).norm(), kRounding);
    EXPECT_LT((wrenchTransform(X_AB * X_BC) - wrenchTransform(X_AB) * wrenchTransform(X_BC)).norm(),
              kRounding);
    EXPECT_LT((wrenchTransform(inverse(X_AB)) * wrenchTransform(X_AB) - Matrix6::Identity()).norm(),
              kRounding);
  }
}

TEST_F(Spatial, EulerAnglesComeBack) {
  for (int i = 0; i < 5000; ++i) {
    const EulerAngles e{uniform(-kPi, kPi), uniform(0.01, kPi - 0.01), uniform(-kPi, kPi)};
    const EulerAngles back = eulerFromRotation(rotationFromEuler(e));
    // the angles' condition number is 1/sin(theta) <= 100
    EXPECT_NEAR(back.phi, e.phi, 100 * kRounding);
    EXPECT_NEAR(back.theta, e.theta, 100 * kRounding);
    EXPECT_NEAR(back.psi, e.psi, 100 * kRounding);
  }
  for (const double theta : {0.0, kPi}) {  // peg horizontal: only phi and psi together are known
    const Matrix3d R = rotationFromEuler({0.4, theta, 0.3});
    const EulerAngles back = eulerFromRotation(R);
    EXPECT_EQ(back.phi, 0.0);
    EXPECT_LT((rotationFromEuler(back) - R).norm(), kRounding);
  }
}

// Peg x is the thesis's axis 2, y its -axis 1, z its axis 3; rows of R = Rz(psi) Ry(theta) Rz(phi).
TEST_F(Spatial, ColumnsOfThePegAreTheThesisAxes) {
  for (int i = 0; i < 1000; ++i) {
    const EulerAngles e{uniform(-kPi, kPi), uniform(0, kPi), uniform(-kPi, kPi)};
    const double cph = std::cos(e.phi), sph = std::sin(e.phi);
    const double cth = std::cos(e.theta), sth = std::sin(e.theta);
    const double cps = std::cos(e.psi), sps = std::sin(e.psi);
    const Vector3d R0(cph * cth * cps - sph * sps, sph * cth * cps + cph * sps, -sth * cps);
    const Vector3d R1(-cph * cth * sps - sph * cps, -sph * cth * sps + cph * cps, sth * sps);
    const Vector3d a(cph * sth, sph * sth, cth);
    const Matrix3d R_HP = rotationFromEuler(e);
    EXPECT_LT((R_HP.col(0) - fromThesisAxes(R1)).norm(), kRounding);
    EXPECT_LT((R_HP.col(1) + fromThesisAxes(R0)).norm(), kRounding);
    EXPECT_LT((R_HP.col(2) - fromThesisAxes(a)).norm(), kRounding);
  }
  EXPECT_EQ(toThesisAxes(Vector3d(1, 2, 3)), Vector3d(3, 1, 2));  // thesis (1, 2, 3) = (z, x, y)
  EXPECT_EQ(fromThesisAxes(toThesisAxes(Vector3d(1, 2, 3))), Vector3d(1, 2, 3));
}

TEST_F(Spatial, RotationVectorAtItsLimits) {
  EXPECT_EQ(rotationFromVector({}), Matrix3d::Identity());
  EXPECT_EQ(vectorFromRotation(Matrix3d::Identity()).value, Vector3d::Zero());
  for (const double angle : {1e-12, 1e-8, 2e-8, 1e-4, 1.0, 3.0, kPi - 1e-8}) {
    for (int i = 0; i < 200; ++i) {
      const Vector3d v = angle * vector().normalized();
      const Matrix3d R = rotationFromVector({v});
      // Rodrigues' formula; its terms are exact to rounding at every angle
      const double half = std::sin(0.5 * angle) / (0.5 * angle);
      const Matrix3d expected = Matrix3d::Identity() + std::sin(angle) / angle * skew(v) +
                                0.5 * half * half * skew(v) * skew(v);
      EXPECT_LT((R - expected).norm(), 5e-15) << angle;
      // a matrix holds small angles to an absolute rounding of one; near pi as well
      EXPECT_LT((vectorFromRotation(R).value - v).norm(), kRounding) << angle;
    }
  }
}

}  // namespace
}  // namespace assembly_cell
