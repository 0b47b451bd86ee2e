// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/sensor/bridge.h"

#include <gtest/gtest.h>

#include <Eigen/LU>
#include <cmath>
#include <limits>
#include <vector>

#include "assembly_cell/base/input_error.h"
#include "assembly_cell/sensor/calibration.h"

namespace assembly_cell {
namespace {

// Matrices of sensor A about the datum corner O_D, printed with five decimals in the design.
Matrix6 printedC() {
  Matrix6 C;
  C << -.00048, .01461, -.04160, 1.37280, .01373, -.01098,  //
      .00104, .06689, -.04033, 1.35071, -.01621, .00810,    //
      -.04240, .00015, .01311, .00977, 1.39605, .01536,     //
      -.04126, .00033, .07026, -.01250, 1.38928, -.01389,   //
      .01355, -.04092, -.00041, .01629, -.00815, 1.35770,   //
      .07053, -.04156, .00094, -.01126, .01266, 1.40692;
  return C;
}

Matrix6 printedS() {
  Matrix6 S;
  S << .72628, -.37299, -.18838, -.08813, -18.13339, 17.50794,  //
      -18.53715, 18.83305, .69148, -.29152, -.13448, -.13383,   //
      .11130, .16542, -17.59205, 17.68648, .77168, -.37810,     //
      .92446, -.19071, -.54902, .54061, .03145, -.01070,        //
      .02291, -.01991, .87922, -.17239, -.56817, .53729,        //
      -.57688, .57357, .02930, -.01011, .90990, -.17552;
  return S;
}

// Half a unit of the last printed digit.
constexpr double kPrinted = 0.5e-5 * (1.0 + 1e-6);

// V = C w about O_D: the wrench about O_D is carried to the reference point first.
Matrix6 strainMatrixAboutDatum(const Bridge& bridge) {
  return strainMatrix(bridge) *
         wrenchTransform({Eigen::Matrix3d::Identity(), -bridge.reference_point});
}

TEST(Bridge, StrainMatrixOfAEqualsThePrintedOneAboutTheDatum) {
  const Matrix6 C = strainMatrixAboutDatum(bridgeA(16, 0.0));
  EXPECT_LE((C - printedC()).cwiseAbs().maxCoeff(), kPrinted) << C;
  EXPECT_LE((C.inverse() - printedS()).cwiseAbs().maxCoeff(), kPrinted) << C.inverse();
}

// The channel is the moment about its hinge: an independent computation by torques.
TEST(Bridge, ChannelsMeasureTheMomentAboutTheirHinge) {
  for (const Bridge& bridge : {bridgeA(16, 0.0), bridgeB(16, 0.0)}) {
    const Matrix6 C = strainMatrix(bridge);
    Vector6 w;
    w << 11, -7, 5, 0.3, 0.9, -1.1;
    const Eigen::Vector3d F = w.head<3>(),
                          M_datum = w.tail<3>().eval() + bridge.reference_point.cross(F);
    for (std::size_t k = 0; k < 6; ++k) {
      const Hinge& h = bridge.hinges[k];
      const double m = h.direction.dot(M_datum - h.position.cross(F));
      EXPECT_NEAR((C * w)[static_cast<int>(k)], h.gain * h.strain_per_moment * m, 1e-12);
      EXPECT_NEAR(h.direction.norm(), 1.0, 1e-15);
    }
  }
}

// Small loads: the serial hinges give the printed matrix whatever the nonlinearity; the second
// order is left, some 1 % of the strain at full load and so 10⁻⁵ of it at a thousandth.
TEST(Bridge, FiniteRotationsVanishForSmallLoads) {
  Vector6 w;
  w << 40, -30, 20, 1.0, 1.5, -2.0;
  for (Bridge bridge : {bridgeA(16, 0.0), bridgeB(16, 0.0)}) {
    const Vector6 linear = strainMatrix(bridge) * w;
    EXPECT_LT((deflect(bridge, w).volts - linear).norm(), 1e-13 * linear.norm());
    bridge.nonlinearity = 1.0;
    const double large = (deflect(bridge, w).volts - linear).norm() / linear.norm();
    const double small = (1e3 * deflect(bridge, 1e-3 * w).volts - linear).norm() / linear.norm();
    EXPECT_GT(large, 1e-3);
    EXPECT_LT(large, 5e-2);
    EXPECT_NEAR(small / large, 1e-3, 2e-4);
  }
}

// "Load 50 N along x: 127 µm", three digits.
TEST(Bridge, CarrierMovesAsPrinted) {
  Bridge bridge = bridgeA(16, 0.0);
  bridge.nonlinearity = 1.0;
  Vector6 w = Vector6::Zero();
  w[0] = 50;
  const BridgeState state = deflect(bridge, w);
  EXPECT_NEAR((state.X_DC.p - kCarrierAtRest).x(), 127e-6, 3e-6);
  EXPECT_EQ(deflect(bridge, Vector6::Zero()).X_DC.p, kCarrierAtRest);
}

// 1 K moves the zero by the printed drift and the gain by 2·10⁻⁴.
TEST(Bridge, TemperatureMovesZeroAndGain) {
  Bridge warm = bridgeA(24, 0.0);
  warm.temperature = 21.0;
  const Bridge cold = bridgeA(24, 0.0);
  NormalSource normal(1);
  const Vector6 strain = Vector6::Constant(2.0);
  const Vector6 change =
      convertVolts(warm, strain, normal).volts - convertVolts(cold, strain, normal).volts;
  const double drift[] = {.0025, -.0040, .0030, -.0020, .0035, .0015};
  for (int k = 0; k < 6; ++k) EXPECT_NEAR(change[k], drift[k] + 4e-4, 1.3e-6);  // two codes
}

// "Rated: ±50 N, ±2 N·m on all six together gives at most 4.36 V": over both sensors, offsets
// apart.
TEST(Bridge, RatedLoadsFitTheConverter) {
  Vector6 rated;
  rated << 50, 50, 50, 2, 2, 2;
  for (const Bridge& bridge : {bridgeA(16, 0.0), bridgeB(16, 0.0)}) {
    const Vector6 most = strainMatrix(bridge).cwiseAbs() * rated;
    EXPECT_LE(most.maxCoeff(), 4.365);  // three printed digits
    EXPECT_GT(most.minCoeff(), 2.5);    // no channel wastes half of its range
  }
}

TEST(Bridge, BadParametersAreRefusedByName) {
  EXPECT_THROW(bridgeA(12, 0.0), InputError);
  EXPECT_THROW(bridgeB(16, -1e-3), InputError);
  EXPECT_THROW(bridgeB(16, std::numeric_limits<double>::quiet_NaN()), InputError);
  try {
    bridgeA(12, 0.0);
  } catch (const InputError& error) {
    EXPECT_STREQ(error.what(), "bridge: bits is 12: give 10, 16 or 24");
  }
}

// Without noise a conversion is off by at most half a code: 10 V / 2^b / 2.
TEST(Bridge, ConversionRoundsToTheNearestCode) {
  for (const int bits : {10, 16, 24}) {
    const Bridge bridge = bridgeB(bits, 0.0);
    const Matrix6 C = strainMatrix(bridge);
    const double lsb = std::ldexp(10.0, -bits);
    NormalSource normal(3), load(5);
    for (int i = 0; i < 1000; ++i) {
      Vector6 w;
      for (int k = 0; k < 6; ++k) w[k] = (k < 3 ? 10.0 : 0.4) * load();
      const StrainSample sample = convert(bridge, C, w, normal);
      for (int k = 0; k < 6; ++k) {
        const double ideal = (C * w)[k] + bridge.hinges[static_cast<std::size_t>(k)].offset;
        EXPECT_LE(std::abs(sample.volts[k] - ideal), 0.5 * lsb * (1 + 1e-9));
        EXPECT_EQ(sample.volts[k] / lsb, std::nearbyint(sample.volts[k] / lsb));
      }
      EXPECT_EQ(sample.saturated, 0);
    }
  }
}

TEST(Bridge, EndCodesAreFlaggedAndHold) {
  const Bridge bridge = bridgeA(16, 0.0);
  const Matrix6 S = strainMatrix(bridge).inverse();
  const double lsb = std::ldexp(10.0, -16);
  NormalSource normal(1);
  for (int k = 0; k < 6; ++k) {
    const double offset = bridge.hinges[static_cast<std::size_t>(k)].offset;
    Vector6 volts = Vector6::Zero();
    const auto at = [&](double v) {
      volts[k] = v - offset;
      return convert(bridge, strainMatrix(bridge), S * volts, normal);
    };
    EXPECT_EQ(at(1e3).saturated, 1 << k);
    EXPECT_EQ(at(1e3).volts[k], 5.0 - lsb);
    EXPECT_EQ(at(-1e3).saturated, 1 << k);
    EXPECT_EQ(at(-1e3).volts[k], -5.0);
    EXPECT_EQ(at(5.0 - lsb).saturated, 1 << k);
    EXPECT_EQ(at(5.0 - 2.0 * lsb).saturated, 0);
    EXPECT_EQ(at(-5.0 + lsb).saturated, 0);
  }
  // what is no number is an end code, never a NaN
  const StrainSample sample =
      convert(bridge, strainMatrix(bridge),
              Vector6::Constant(std::numeric_limits<double>::quiet_NaN()), normal);
  EXPECT_EQ(sample.saturated, 0x3f);
  EXPECT_TRUE(sample.volts.allFinite());
}

// One reading at 16 bits: 0.013 N and 0.26 N·mm in the design, about the datum (two digits).
TEST(Bridge, NoiseOfAWrenchIsThatOfTheDesign) {
  const Bridge bridge = bridgeA(16, 0.5e-3);
  const Matrix6 C = strainMatrixAboutDatum(bridge);
  const Matrix6 S = C.inverse();
  NormalSource normal(11);
  const int n = 20000;
  Vector6 sum = Vector6::Zero(), squares = Vector6::Zero();
  for (int i = 0; i < n; ++i) {
    const Vector6 w = S * convert(bridge, C, Vector6::Zero(), normal).volts;
    sum += w;
    squares += w.cwiseAbs2();
  }
  const Vector6 sd = (squares / n - (sum / n).cwiseAbs2()).cwiseSqrt();
  EXPECT_NEAR(sd.head<3>().mean(), 0.013, 0.0005);
  // expected: σ² = noise² + q²/12 through S; the estimate's own error is 1/sqrt(2n) = 0.5 %, 5
  // sigma
  const double lsb = 10.0 / 65536;
  const double channel = std::sqrt(0.25e-6 + lsb * lsb / 12.0);
  for (int k = 0; k < 6; ++k) EXPECT_NEAR(sd[k] / (channel * S.row(k).norm()), 1.0, 0.025);
}

// Fixed numbers: the definition (mt19937_64, 53 bits, polar method) is part of the interface. They
// come from an independent script in another language.
TEST(NormalSource, GivesTheSameNumbersEverywhere) {
  NormalSource normal(1);
  const std::vector<double> expected = {-0.039399956754155314, -0.38683176162103955,
                                        -0.24894784633514516,  0.6868236391793252,
                                        -0.05464685232137162,  -0.7951462437094919};
  for (const double x : expected) EXPECT_NEAR(normal(), x, 4e-16 * std::abs(x) + 1e-16);
}

// Moments and tail of 10⁶ numbers; 5 sigma of each estimate.
TEST(NormalSource, IsStandardNormal) {
  NormalSource normal(42);
  const int n = 1000000;
  double m1 = 0, m2 = 0, m4 = 0, lag = 0, last = 0;
  int beyond = 0;
  for (int i = 0; i < n; ++i) {
    const double x = normal();
    m1 += x;
    m2 += x * x;
    m4 += x * x * x * x;
    lag += x * last;
    last = x;
    beyond += std::abs(x) > 1.959963984540054 ? 1 : 0;
  }
  EXPECT_NEAR(m1 / n, 0.0, 5 * 1e-3);
  EXPECT_NEAR(m2 / n, 1.0, 5 * std::sqrt(2.0) * 1e-3);
  EXPECT_NEAR(m4 / n, 3.0, 5 * std::sqrt(96.0) * 1e-3);
  EXPECT_NEAR(lag / n, 0.0, 5 * 1e-3);
  EXPECT_NEAR(beyond / double(n), 0.05, 5 * std::sqrt(0.05 * 0.95) * 1e-3);
}

}  // namespace
}  // namespace assembly_cell
