// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
// Forward models of thesis chapter 9 (thesis peg: kg, mm, s).
#include "assembly_cell/vibration/locus_model.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "assembly_cell/vibration/inertia.h"
#include "support/refusals.h"

namespace assembly_cell {
namespace {

using Complex = std::complex<double>;

LocusCase peg(double w, double alpha = .7) { return {.766, 25, 25, 1500, w, alpha}; }

// the table of 9.2.2, printed digits
TEST(LocusModel, Table) {
  struct Row {
    double w, a, b, rho;
    bool radial;
  };
  const Row rows[] = {{10, .190, .189, .002, true},    {80, .899, .364, .424, true},
                      {89, 9.21, .469, .903, true},    {95, 1.61, -.594, 2.16, true},
                      {108, 1.62, -.424, 1.71, false}, {125, 1.017, .201, .670, false},
                      {180, .129, .062, .348, false}};
  for (const Row& row : rows) {
    const PlanarLocus x = transverseLocus(peg(row.w), 1e7, 1e7);
    EXPECT_NEAR(x.a, row.a, row.a > 1.1 ? 5.1e-3 : 5.1e-4) << row.w;
    EXPECT_NEAR(x.b, row.b, 5.1e-4) << row.w;
    EXPECT_NEAR(std::abs(x.N) / std::abs(x.P), row.rho, row.rho > 1 ? 5.1e-3 : 5.1e-4) << row.w;
    const double axis = row.radial ? .7 : .7 + M_PI / 2;
    EXPECT_NEAR(std::remainder(x.psi - axis, M_PI), 0, 1e-9) << row.w;
  }
  // between the resonances: a circle against the exciter
  const ContactInertia i = contactInertia(.766, 25, 25);
  const double w0 = std::sqrt(2e7 / (i.Ix + i.Iy_local));
  EXPECT_NEAR(w0, 100.13, .005);
  const PlanarLocus x = transverseLocus(peg(w0), 1e7, 1e7);
  EXPECT_NEAR(x.b, -.781, 5e-4);
  EXPECT_LT(std::abs(x.P), 1e-12 * std::abs(x.N));
}

// alpha and alpha + pi give the same P and N; arg N − 2 alpha is constant
TEST(LocusModel, HalfTurnInvariance) {
  SupportMatrix K6 = SupportMatrix::Zero(), C6 = SupportMatrix::Zero();
  K6.diagonal() << 300, 500, 400, 8e6, 9e6, 7e6;
  C6.diagonal() << 3, 5, 4, 8e3, 9e3, 7e3;
  for (const double alpha : {0.3, 1.9, 4.0}) {
    const PlanarLocus a = generalLocus(peg(80, alpha), 12.5, 50, 9806.6, K6, C6);
    const PlanarLocus b = generalLocus(peg(80, alpha + M_PI), 12.5, 50, 9806.6, K6, C6);
    EXPECT_LT(std::abs(a.P - b.P) + std::abs(a.N - b.N), 1e-14 * a.a);
    const PlanarLocus c = isotropicLocus(peg(80, alpha), 1e7, 2e3);
    const PlanarLocus zero = isotropicLocus(peg(80, 0), 1e7, 2e3);
    EXPECT_LT(std::abs(c.N - zero.N * std::polar(1.0, 2 * alpha)), 1e-14 * c.a);
    EXPECT_LT(std::abs(c.P - zero.P), 1e-14 * c.a);
  }
}

// the general support with rotational springs alone is 9.2.1, whatever its height
TEST(LocusModel, GeneralContainsTheSpecialCases) {
  SupportMatrix K6 = SupportMatrix::Zero(), C6 = SupportMatrix::Zero();
  K6.diagonal().tail<3>().setConstant(1e7);
  C6.diagonal().tail<3>().setConstant(2e3);
  for (const double w : {0.0, 60.0, 89.92, 95.0, 200.0}) {
    const PlanarLocus a = generalLocus(peg(w), 12.5, 50, 0, K6, C6);
    const PlanarLocus b = isotropicLocus(peg(w), 1e7, 2e3);
    EXPECT_LT(std::abs(a.P - b.P) + std::abs(a.N - b.N), 1e-12 * b.a) << w;
  }
  // no yaw: a stiff vertical axis
  K6(5, 5) = 1e17;
  C6.setZero();
  const PlanarLocus a = generalLocus(peg(60), 12.5, 50, 0, K6, C6);
  const PlanarLocus b = transverseLocus(peg(60), 1e7, 1e7);
  EXPECT_LT(std::abs(a.P - b.P) + std::abs(a.N - b.N), 1e-9 * b.a);
  // yaw alone
  K6.diagonal().tail<3>() << 1e17, 1e17, 1e7;
  const PlanarLocus c = generalLocus(peg(60), 12.5, 50, 0, K6, C6);
  const PlanarLocus d = verticalLocus(peg(60), 1e7);
  EXPECT_LT(std::abs(c.P - d.P) + std::abs(c.N - d.N), 1e-8 * d.a);
}

// gravity softens rocking about the contact by m g h, without yaw to couple with
TEST(LocusModel, GravitySoftens) {
  SupportMatrix K6 = SupportMatrix::Zero();
  K6.diagonal().tail<3>() << 1e7, 1e7, 1e17;
  const double softened = 1e7 - .766 * 9806.6 * 25;
  const PlanarLocus a = generalLocus(peg(60), 12.5, 50, 9806.6, K6, SupportMatrix::Zero());
  const PlanarLocus b = transverseLocus(peg(60), softened, softened);
  EXPECT_LT(std::abs(a.P - b.P) + std::abs(a.N - b.N), 1e-9 * b.a);
}

// 9.2.1 without motion: A_t/A_r = (2h² + r²)/(2h²)
TEST(LocusModel, StaticLimit) {
  const PlanarLocus x = isotropicLocus(peg(0, 0), 1e7);
  const Complex A_r = x.P + std::conj(x.N), A_t = x.P - std::conj(x.N);
  EXPECT_NEAR((A_t / A_r).real(), 1.5, 1e-13);
}

TEST(LocusModel, SegmentAndCircle) {
  const PlanarLocus segment = doubleContactLocus(peg(80, 2.5), 12.5, 1e7, 3e3);
  EXPECT_LT(std::abs(segment.b), 1e-13 * segment.a);
  EXPECT_NEAR(segment.psi, 2.5, 1e-12);  // for any damping
  // sliding: k R e^{-if} − m w² R e^{-if} = F − friction, which opposes the velocity i w P
  const double m = .766, k = 300, F = 1500, mu_N = 700;
  for (const double w : {10.0, 40.0}) {
    const PlanarLocus x = slidingLocus(m, k, F, mu_N, w);
    const Complex force = F - mu_N * Complex(0, 1) * x.P / std::abs(x.P);
    EXPECT_LT(std::abs((k - m * w * w) * x.P - force), 1e-12 * F);
    EXPECT_FALSE(x.has_direction);
    EXPECT_NEAR(mu_N, -F * std::sin(std::arg(x.P)), 1e-9);
  }
}

TEST(LocusModel, Refusals) {
  EXPECT_NE(refusalOf([] { slidingLocus(1, 1, 1, 2, 3); }).find("F: value 1.0"), std::string::npos);
  EXPECT_NE(refusalOf([] { slidingLocus(1, 4, 2, 1, 2); }).find("resonance"), std::string::npos);
  const double w = std::sqrt(1e7 / contactInertia(.766, 25, 25).Ix);
  EXPECT_NE(refusalOf([&] { transverseLocus(peg(w), 1e7, 1e7); }).find("resonance"),
            std::string::npos);
  EXPECT_EQ(refusalOf([&] { transverseLocus(peg(w), 1e7, 1e7, 1e3); }), "nothing thrown");
  EXPECT_NE(refusalOf([] {
              generalLocus(peg(0), 1, 50, 0, SupportMatrix::Zero(), SupportMatrix::Zero());
            }).find("singular"),
            std::string::npos);
}

}  // namespace
}  // namespace assembly_cell
