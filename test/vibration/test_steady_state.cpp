// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
// Inertia, stiffness and steady vibration, thesis 4.4 to 4.18 (its peg: kg, mm, s).
#include "assembly_cell/vibration/steady_state.h"

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <cmath>
#include <random>

#include "assembly_cell/vibration/inertia.h"
#include "assembly_cell/vibration/single_dof.h"
#include "support/refusals.h"
#include "support/thesis_forms.h"

namespace assembly_cell {
namespace {

constexpr double kM = 0.766, kR = 25, kH = 25, kK = 1e7;

// worked out apart from this code, to the digits given
TEST(Inertia, ThesisPeg) {
  const ContactInertia i = contactInertia(kM, kR, kH);
  EXPECT_NEAR(i.Ix, 1236.77, 0.005);
  EXPECT_NEAR(i.Iy, 1217.24, 0.005);
  EXPECT_NEAR(i.Iz, 258.91, 0.005);
  EXPECT_NEAR(i.beta * 180 / M_PI, 43.807, 5e-4);
  EXPECT_NEAR(centroidInertia(kM, kR, kH), 279.27, 0.005);
  EXPECT_NEAR(chordInertia(kM, kR, kH, 12.5), 877.71, 0.005);
  EXPECT_NEAR(chordInertia(kM, kR, kH, 24), 1199.24, 0.005);
  EXPECT_NEAR(std::sqrt(kK / i.Ix), 89.92, 0.005);
  EXPECT_NEAR(std::sqrt(kK / i.Iy), 90.64, 0.005);
  EXPECT_NEAR(std::sqrt(kK / i.Iz), 196.53, 0.005);
  EXPECT_NEAR(std::sqrt(kK / chordInertia(kM, kR, kH, 12.5)), 106.74, 0.005);
  EXPECT_NEAR(std::sqrt(kK / chordInertia(kM, kR, kH, 24)), 91.32, 0.005);
}

// eigenvalues of the tensor from the parallel axis theorem, 1e-14 of its size
TEST(Inertia, IsThePrincipalTensorOfTheCylinder) {
  std::mt19937_64 random(1);
  std::uniform_real_distribution<double> log10(-3, 3);
  for (int run = 0; run < 200; ++run) {
    const double r = std::pow(10, log10(random)), h = r * std::pow(10, log10(random)), m = 0.7;
    const Eigen::Vector3d arm(0, -r, h);
    const double transverse = m * (3 * r * r + 4 * h * h) / 12;
    Eigen::Matrix3d I = Eigen::Vector3d(transverse, transverse, m * r * r / 2).asDiagonal();
    I += m * (arm.squaredNorm() * Eigen::Matrix3d::Identity() - arm * arm.transpose());
    const ContactInertia i = contactInertia(m, r, h);
    const double size = I.norm();
    EXPECT_NEAR(I(0, 0), i.Ix, 1e-14 * size);
    EXPECT_NEAR(I(1, 2), i.Iyz_local, 1e-14 * size);
    const Eigen::Vector3d y(0, std::cos(i.beta), std::sin(i.beta));
    const Eigen::Vector3d z(0, -std::sin(i.beta), std::cos(i.beta));
    EXPECT_LT((I * y - i.Iy * y).norm(), 1e-14 * size);
    EXPECT_LT((I * z - i.Iz * z).norm(), 1e-14 * size);
    EXPECT_TRUE(i.beta > 0 && i.beta < M_PI / 2);
  }
}

TEST(Inertia, Limits) {
  // long pegs: the principal axis is the peg's; short ones: upright the other way (thesis: 0)
  EXPECT_NEAR(contactInertia(1, 1, 1e6).beta, 0, 1e-5);
  EXPECT_NEAR(contactInertia(1, 1e6, 1).beta, M_PI / 2, 1e-5);
  EXPECT_NEAR(chordInertia(1, 1, 1, 0), 19.0 / 12, 1e-15);
  // 4.17: all three springs, kx (2h + l)²
  EXPECT_NEAR(chordStiffness(2, 3, 5, 1, 0.5, 0.25), 2 * 6.25 + 5 + 3 * 0.0625, 1e-14);
}

// M(t) of 4.4–4.6 as force times arm, and the equation of motion by differences of the closed form
TEST(SteadyState, SolvesTheEquationsOfMotion) {
  const ContactInertia i = contactInertia(kM, kR, kH);
  const double F = 1500, w = 60, alpha = 0.8, t = 0.123;
  const double tau = w * t - alpha;
  // about the contact: force point (0, -r, 2h), force along the tangent (clockwise) and outward
  const Eigen::Vector3d moment =
      Eigen::Vector3d(0, -kR, 2 * kH).cross(F * Eigen::Vector3d(-std::sin(tau), std::cos(tau), 0));
  const Eigen::Vector3d y(0, std::cos(i.beta), std::sin(i.beta));
  const Eigen::Vector3d z(0, -std::sin(i.beta), std::cos(i.beta));
  const ContactRotation x = singleContact({kM, kR, kH, kK, F, w, alpha}, t);
  // rounding of sums of moments
  EXPECT_NEAR(x.theta_x * (kK - i.Ix * w * w), moment.x(), 1e-9 * F * kH);
  EXPECT_NEAR(x.theta_y * (kK - i.Iy * w * w), moment.dot(y), 1e-9 * F * kH);
  EXPECT_NEAR(x.theta_z * (kK - i.Iz * w * w), moment.dot(z), 1e-9 * F * kH);
  // 4.16 against the damped universal form long after its start: e^{-γu} = 1e-35
  const double I = chordInertia(kM, kR, kH, 12.5);
  const SingleDof s{I, kK, 2e-4 * I * 95, 2 * F * kH, 0, 0, w, 0, 0, 0};
  const double late = 2 * M_PI / w * 80000;
  EXPECT_NEAR(doubleContact(F, kH, kK, I, w, late) / singleDof(s, late).theta, 1, 1e-6);
}

TEST(SteadyState, SymmetricAndPeriodic) {
  const ContactRotation a = singleContact({kM, kR, kH, kK, 1500, 60, 0.3}, 0.01);
  const ContactRotation turned = singleContact({kM, kR, kH, kK, 1500, 60, 0.3 + 0.6}, 0.02);
  EXPECT_NEAR(a.theta_x, turned.theta_x, 1e-15);
  const ContactRotation half = singleContact({kM, kR, kH, kK, 1500, 60, 0.3 + M_PI}, 0.01);
  EXPECT_NEAR(a.theta_y, -half.theta_y, 1e-15);
  const PlaneRotation p = planeRotation(a, 0.7);
  EXPECT_NEAR(p.theta_p * std::cos(p.axis - 0.7), a.theta_y, 1e-15);
  EXPECT_NEAR(p.theta_p * std::sin(p.axis - 0.7), a.theta_z, 1e-15);
}

// 4.11–4.13 as rotation vector × arm, 4.14 and 4.15 as forces of springs at G
TEST(SteadyState, ForcesOnTheContact) {
  const double l = 12.5, k = 300, g = 9806.6, F = 1500, w = 60, alpha = 0.8, t = 0.123;
  const double beta = contactInertia(kM, kR, kH).beta;
  const ContactRotation x = singleContact({kM, kR, kH, kK, F, w, alpha}, t);
  const SingleContactForces f = singleContactForces({kM, kR, kH, kK, F, w, alpha}, {l, k, g}, t, x);
  const Eigen::Vector3d rotation(x.theta_x, x.theta_y * std::cos(beta) - x.theta_z * std::sin(beta),
                                 x.theta_y * std::sin(beta) + x.theta_z * std::cos(beta));
  const Eigen::Vector3d G = rotation.cross(Eigen::Vector3d(0, -kR, 2 * kH + l));
  EXPECT_NEAR(f.X, G.y(), 1e-12);
  EXPECT_NEAR(f.Y, -G.x(), 1e-12);
  EXPECT_NEAR(f.Z, G.z(), 1e-12);
  EXPECT_NEAR(f.radial, F * std::cos(w * t - alpha) - k * G.y(), 1e-9);
  EXPECT_NEAR(f.tangential, F * std::sin(w * t - alpha) + k * G.x(), 1e-9);
  EXPECT_NEAR(f.normal, kM * g + k * G.z(), 1e-9);
}

TEST(SteadyState, Refusals) {
  const double w = std::sqrt(kK / contactInertia(kM, kR, kH).Iy);
  const auto at = [&](double frequency) {
    return refusalOf([&] { singleContact({kM, kR, kH, kK, 1500, frequency, 0}, 0.1); });
  };
  EXPECT_NE(at(w).find("resonance"), std::string::npos);
  EXPECT_EQ(at(w * 1.001), "nothing thrown");
  EXPECT_NE(refusalOf([] { contactInertia(1, -1, 1); }).find("r: value -1.0"), std::string::npos);
  EXPECT_NE(refusalOf([] { chordInertia(1, 1, 1, 2); }).find("d: value 2.0"), std::string::npos);
  EXPECT_NE(refusalOf([] { chordStiffness(-1, 1, 1, 1, 1, 1); }).find("kx"), std::string::npos);
  EXPECT_NE(refusalOf([] { contactInertia(1, 1e200, 1e200); }).find("range"), std::string::npos);
}

}  // namespace
}  // namespace assembly_cell
