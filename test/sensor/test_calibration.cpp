// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/sensor/calibration.h"

#include <gtest/gtest.h>
#include <stdlib.h>

#include <Eigen/LU>
#include <filesystem>
#include <fstream>
#include <functional>
#include <limits>
#include <sstream>
#include <string>

#include "assembly_cell/base/input_error.h"
#include "assembly_cell/scene/scenario.h"
#include "assembly_cell/sensor/bridge.h"
#include "temporary_folder.h"

namespace assembly_cell {
namespace {

namespace fs = std::filesystem;

const std::string kConfig = ASSEMBLY_CELL_SOURCE_DIR "/config/";
constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();

class CalibrationFile : public ::testing::Test {
 protected:
  static std::string read(const std::string& path) {
    std::ostringstream out;
    out << std::ifstream(path).rdbuf();
    return out.str();
  }

  // what loading says after `from` became `to` in a sound file
  std::string refusal(const std::string& from, const std::string& to) {
    saveCalibration(sample(), path_);
    std::string content = read(path_);
    const std::size_t place = content.find(from);
    if (place == std::string::npos) return "'" + from + "' isn't in the file";
    content.replace(place, from.size(), to);
    std::ofstream(path_) << content;
    try {
      loadCalibration(path_);
    } catch (const InputError& error) {
      return error.what();
    }
    return "accepted";
  }

  static Calibration sample() {
    Calibration c;
    c.id = "sample";
    c.serial_number = "SN: \"17\" #3";
    c.date = "2026-01-12";
    c.volts_to_wrench = strainMatrix(bridgeA(16, 0.0)).inverse();
    c.volts_to_displacement = c.volts_to_wrench / 3e5;
    c.zero_volts << 0.1, -0.2, 1e-300, -0.0, 1.0 / 3.0, 2.0;
    return c;
  }

  const test::TemporaryFolder scratch_;
  const fs::path folder_ = scratch_.path();
  const std::string path_ = scratch_ / "sensor.yaml";
};

TEST_F(CalibrationFile, KeepsEveryBit) {
  saveCalibration(sample(), path_);
  const Calibration c = loadCalibration(path_);
  EXPECT_EQ(c.id, sample().id);
  EXPECT_EQ(c.serial_number, sample().serial_number);
  EXPECT_EQ(c.date, sample().date);
  EXPECT_EQ(c.volts_to_wrench, sample().volts_to_wrench);
  EXPECT_EQ(c.volts_to_displacement, sample().volts_to_displacement);
  EXPECT_EQ(c.zero_volts, sample().zero_volts);
  // nothing but the file is left behind
  EXPECT_EQ(std::distance(fs::directory_iterator(folder_), fs::directory_iterator()), 1);
}

// A map with everything a calibration may carry.
Calibration quadraticSample() {
  Calibration c;
  c.id = "quadratic";
  c.serial_number = "simulated-a";
  c.volts_to_wrench = strainMatrix(bridgeA(16, 0.0)).inverse();
  c.volts_to_displacement = c.volts_to_wrench / 3e5;
  c.quadratic_wrench = c.quadratic_displacement = true;
  NormalSource normal(1);
  for (int i = 0; i < 6; ++i) {
    for (int j = 0; j < kStrainProducts; ++j) {
      c.wrench_products(i, j) = 0.05 * normal();
      c.displacement_products(i, j) = 1e-6 * normal();
    }
  }
  Eigen::MatrixXd root(162, 162);
  for (Eigen::Index i = 0; i < root.size(); ++i) root.data()[i] = 1e-3 * normal();
  c.wrench_covariance = root * root.transpose();
  c.displacement_covariance = root.topLeftCorner(27, 27) * root.topLeftCorner(27, 27).transpose();
  c.wrench_covariance = (0.5 * (c.wrench_covariance + c.wrench_covariance.transpose())).eval();
  c.displacement_covariance =
      (0.5 * (c.displacement_covariance + c.displacement_covariance.transpose())).eval();
  c.displacement_variance.setConstant(1e-12);
  c.temperature = 21.5;
  c.noise.setConstant(5e-4);
  c.wrench_range.setConstant(4.0);
  c.wrench_fit = {190.0, 192, 0.5, Vector6::Constant(0.01), Vector6::Constant(0.02)};
  c.observations_digest = "crc32:01234567";
  return c;
}

TEST_F(CalibrationFile, KeepsProductsCovarianceAndStatistics) {
  const Calibration c = quadraticSample();
  saveCalibration(c, path_);
  const Calibration back = loadCalibration(path_);
  EXPECT_TRUE(back.quadratic_wrench && back.quadratic_displacement);
  EXPECT_EQ(back.wrench_products, c.wrench_products);
  EXPECT_EQ(back.displacement_products, c.displacement_products);
  EXPECT_EQ(back.wrench_covariance, c.wrench_covariance);
  EXPECT_EQ(back.displacement_covariance, c.displacement_covariance);
  EXPECT_EQ(back.displacement_variance, c.displacement_variance);
  EXPECT_EQ(back.temperature, c.temperature);
  EXPECT_EQ(back.wrench_fit.dof, 192);
  EXPECT_EQ(back.wrench_fit.residual_rms, c.wrench_fit.residual_rms);
  EXPECT_EQ(back.observations_digest, c.observations_digest);
  EXPECT_EQ(calibrationChecksum(back), calibrationChecksum(c));
  // one digit of a product
  std::string content = read(path_);
  content.replace(content.find("21.5"), 4, "22.5");
  std::ofstream(path_) << content;
  EXPECT_THROW(loadCalibration(path_), InputError);
}

// (I⊗b)ᵀ P (I⊗b) + J Σ Jᵀ written with full Kronecker products and finite differences.
TEST(CalibrationCovariance, IsThatOfItsDefinition) {
  const Calibration c = quadraticSample();
  Vector6 v;
  v << 1.0, -2.0, 0.5, 3.0, -1.5, 0.2;
  Eigen::Matrix<double, 27, 1> b;
  b << v, strainProducts(v);
  Eigen::MatrixXd B = Eigen::MatrixXd::Zero(162, 6);
  for (int i = 0; i < 6; ++i) B.block(27 * i, i, 27, 1) = b;
  Matrix6 J;
  const double h = 1e-4;  // the map is quadratic: central differences are exact but for rounding
  for (int k = 0; k < 6; ++k) {
    const Vector6 step = h * Vector6::Unit(k);
    J.col(k) = (wrenchFromVolts(c, v + step) - wrenchFromVolts(c, v - step)) / (2 * h);
  }
  Matrix6 noise = Matrix6::Identity() * 2.5e-7;
  noise(0, 1) = noise(1, 0) = 1e-7;
  const Matrix6 expected = B.transpose() * c.wrench_covariance * B + J * noise * J.transpose();
  EXPECT_LT((wrenchCovariance(c, v, noise) - expected).norm(), 1e-9 * expected.norm());
  for (int k = 0; k < 6; ++k) {
    const Vector6 step = h * Vector6::Unit(k);
    J.col(k) = (displacementFromVolts(c, v + step) - displacementFromVolts(c, v - step)) / (2 * h);
  }
  Matrix6 displacement = J * noise * J.transpose();
  displacement.diagonal().array() += 1e-12 * b.dot(c.displacement_covariance * b);
  EXPECT_LT((displacementCovariance(c, v, noise) - displacement).norm(),
            1e-8 * displacement.norm());
  Calibration plain = c;
  plain.quadratic_wrench = false;
  plain.wrench_covariance = c.wrench_covariance.topLeftCorner(36, 36);
  Eigen::MatrixXd B6 = Eigen::MatrixXd::Zero(36, 6);
  for (int i = 0; i < 6; ++i) B6.block(6 * i, i, 6, 1) = v;
  const Matrix6 linear = B6.transpose() * plain.wrench_covariance * B6 +
                         c.volts_to_wrench * noise * c.volts_to_wrench.transpose();
  EXPECT_LT((wrenchCovariance(plain, v, noise) - linear).norm(), 1e-9 * linear.norm());
  EXPECT_EQ(outsideWrenchRange(c, Vector6::Unit(2) * 4.5), 4u);
}

// E = S' S⁻¹ − 1 of maps S' that differ by the columns of a root of the covariance
TEST(GainCovariance, IsThatOfMapsThatDiffer) {
  NormalSource normal(5);
  for (const int terms : {6, 27}) {
    Calibration c;
    for (double& x : c.volts_to_wrench.reshaped()) x = normal();
    EXPECT_EQ(gainCovariance(c).size(), 0);
    c.quadratic_wrench = terms == 27;
    Eigen::MatrixXd root(6 * terms, 6 * terms);
    for (double& x : root.reshaped()) x = 1e-3 * normal();
    c.wrench_covariance = root * root.transpose();
    Eigen::MatrixXd expected = Eigen::MatrixXd::Zero(36, 36);
    for (const auto& column : root.colwise()) {
      Matrix6 other = c.volts_to_wrench;
      for (int i = 0; i < 6; ++i) {
        for (int k = 0; k < 6; ++k) other(i, k) += column[terms * i + k];
      }
      const Matrix6 E = other * c.volts_to_wrench.fullPivLu().inverse() - Matrix6::Identity();
      const Matrix6 rows = E.transpose();
      expected += rows.reshaped() * rows.reshaped().transpose();
    }
    EXPECT_LT((gainCovariance(c) - expected).norm(), 1e-9 * expected.norm());
  }
}

TEST_F(CalibrationFile, AnyChangeOfTheContentIsSeen) {
  for (const auto& change : {std::pair{"sample", "simple"},
                             {"2026", "2025"},
                             {"0.1,", "0.2,"},
                             {"17", "18"},
                             {"-0.2", "0.2"}}) {
    const std::string said = refusal(change.first, change.second);
    EXPECT_NE(said.find("checksum is 'crc32:"), std::string::npos) << said;
    EXPECT_NE(said.find(path_), std::string::npos) << said;
    EXPECT_EQ(said.find('\n'), std::string::npos);
  }
}

TEST_F(CalibrationFile, RefusesByName) {
  const auto expect = [&](const std::string& from, const std::string& to, const std::string& part) {
    const std::string said = refusal(from, to);
    EXPECT_NE(said.find(part), std::string::npos) << said;
    EXPECT_NE(said.find(path_), std::string::npos) << said;
    EXPECT_EQ(said.find('\n'), std::string::npos) << said;
  };
  expect("format: assembly_cell", "format: other", "is no calibration");
  expect("date:", "dote:", "unknown key 'dote'");
  expect("id: \"sample\"\n", "", "key 'id' is missing");
  expect("id: \"sample\"\n", "id: \"sample\"\nid: \"b\"\n", "key 'id' is there twice");
  expect("id: \"sample\"", "id: \"\"", "id is empty");
  expect("cols: 6", "cols: 5", "volts_to_wrench is not 6 by 6");
  expect("zero_volts: [0.1, ", "zero_volts: [", "zero_volts has 5 entries");
  expect("zero_volts: [0.1, ", "zero_volts: [.nan, ", "zero_volts[0] is '.nan'");
  expect("zero_volts: [0.1, ", "zero_volts: [x, ", "zero_volts[0] is 'x'");
  expect("zero_volts: [0.1, ", "zero_volts: [.inf, ", "zero_volts[0] is '.inf'");
  expect("[0.1", "{0.1", "line ");
}

TEST_F(CalibrationFile, MissingOrForeignFilesAreNamed) {
  for (const std::string& path : {path_, folder_.string()}) {
    try {
      loadCalibration(path);
      FAIL() << path << " was accepted";
    } catch (const InputError& error) {
      EXPECT_NE(std::string(error.what()).find(path), std::string::npos) << error.what();
    }
  }
}

TEST_F(CalibrationFile, SavingToNowhereIsRefused) {
  EXPECT_THROW(saveCalibration(sample(), (folder_ / "no" / "such.yaml").string()), InputError);
  EXPECT_TRUE(fs::is_empty(folder_));
}

TEST_F(CalibrationFile, UnsoundOnesAreNeitherSavedNorPassed) {
  const auto said = [&](const std::function<void(Calibration&)>& spoil) {
    Calibration c = sample();
    spoil(c);
    EXPECT_THROW(saveCalibration(c, path_), InputError);
    EXPECT_FALSE(fs::exists(path_));
    try {
      checkCalibration(c, "here");
    } catch (const InputError& error) {
      return std::string(error.what());
    }
    return std::string("accepted");
  };
  const auto begins = [](const std::string& text, const std::string& with) {
    EXPECT_EQ(text.compare(0, with.size(), with), 0) << text;
  };
  begins(said([](Calibration& c) { c.id = ""; }), "here: id is empty");
  begins(said([](Calibration& c) { c.serial_number = ""; }), "here: serial_number is empty");
  begins(said([](Calibration& c) { c.id = "a\nb"; }), "here: id, serial_number or date holds");
  begins(said([](Calibration& c) { c.volts_to_wrench(2, 3) = kNaN; }),
         "here: volts_to_wrench is not finite");
  begins(said([](Calibration& c) { c.volts_to_displacement(2, 3) = 1.0 / 0.0; }),
         "here: volts_to_displacement is not finite");
  begins(said([](Calibration& c) { c.zero_volts[3] = kNaN; }), "here: zero_volts is not finite");
  begins(said([](Calibration& c) { c.volts_to_wrench.col(2) = c.volts_to_wrench.col(4); }),
         "here: volts_to_wrench is singular");
  begins(said([](Calibration& c) { c.volts_to_wrench.setZero(); }),
         "here: volts_to_wrench is singular");
}

// ---- the files that come with the package ----

constexpr double kShipped = 1e-9;  // relative; the files hold every digit, the inverse loses few

void expectBridge(const Calibration& c, const Bridge& bridge) {
  const Matrix6 product = c.volts_to_wrench * strainMatrix(bridge);
  EXPECT_LE((product - Matrix6::Identity()).cwiseAbs().maxCoeff(), kShipped) << product;
  for (int k = 0; k < 6; ++k) {
    EXPECT_EQ(c.zero_volts[k], bridge.hinges[static_cast<std::size_t>(k)].offset);
  }
}

TEST(ShippedCalibration, OfSensorAIsItsBridge) {
  const Calibration c = loadCalibration(kConfig + "calibration/sensor_a.yaml");
  expectBridge(c, bridgeA(16, 0.0));
  EXPECT_TRUE(c.volts_to_displacement.isZero(0.0));
}

// d = K⁻¹ w: volts of a coupling force K d must come back as d. K from the cell's scenario, thesis
// order z, x, y, about z, about x, about y.
TEST(ShippedCalibration, OfSensorBIsItsBridgeAndTheCoupling) {
  const Calibration c = loadCalibration(kConfig + "calibration/sensor_b.yaml");
  expectBridge(c, bridgeB(16, 0.0));
  const CouplingMatrix k =
      loadScenario(kConfig + "scenarios/cell.yaml").mechanism.coupling.stiffness;
  const Matrix6 C = strainMatrix(bridgeB(16, 0.0));
  Vector6 d;  // x y z [m], rotation vector [rad]
  d << 1e-4, -2e-4, 3e-5, 2e-3, -1e-3, 4e-3;
  Vector6 w;  // of the deflected coupling on the carrier
  w << k.diagonal[1] * d[0] + k.k26 * d[4], k.diagonal[2] * d[1] + k.k35 * d[3],
      k.diagonal[0] * d[2], k.diagonal[4] * d[3] + k.k35 * d[1],
      k.diagonal[5] * d[4] + k.k26 * d[0], k.diagonal[3] * d[5];
  const Vector6 back = displacementFromVolts(c, C * w + c.zero_volts);
  for (int i = 0; i < 6; ++i) EXPECT_NEAR(back[i], d[i], kShipped * d.cwiseAbs().maxCoeff());
}

TEST(ShippedCalibration, OfTheReplayIsTheIdentity) {
  const Calibration c = loadCalibration(kConfig + "calibration/sensor_replay.yaml");
  EXPECT_TRUE(c.volts_to_wrench.isIdentity(0.0));
  EXPECT_TRUE(c.zero_volts.isZero(0.0));
}

}  // namespace
}  // namespace assembly_cell
