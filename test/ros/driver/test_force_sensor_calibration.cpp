// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "force_sensor_fixture.h"

namespace assembly_cell::ros_bridge::force_sensor_calibration_test {
namespace {

using ForceSensorCalibration = ForceSensorDriver;

TEST_F(ForceSensorCalibration, ReturnsItsCalibration) {
  const Calibration file =
      loadCalibration(ASSEMBLY_CELL_SOURCE_DIR "/config/calibration/sensor_a.yaml");
  const auto response = a_.call<GetCalibration>("get_calibration");
  const SensorCalibration latched = a_.newest(a_.calibration_, kAnything);
  EXPECT_TRUE(response.success);
  for (const SensorCalibration& c : {response.calibration, latched}) {
    EXPECT_EQ(c.id, file.id);
    EXPECT_EQ(c.serial_number, file.serial_number);
    EXPECT_EQ(c.date, file.date);
    EXPECT_EQ(c.header.frame_id, "sensor_a");
    EXPECT_EQ(c.volts_to_wrench[1], file.volts_to_wrench(0, 1));  // row-major
    EXPECT_EQ(c.zero_volts[5], file.zero_volts[5]);
  }
}

TEST_F(ForceSensorCalibration, TakesSoundCalibrationsOnly) {
  SetBias::Request bias;
  bias.bias[2] = 5.0;
  a_.call<SetBias>("set_bias", bias);
  const SensorCalibration old = a_.call<GetCalibration>("get_calibration").calibration;
  SetCalibration::Request request;
  const auto refused = [&](const std::string& part) {
    const auto response = a_.call<SetCalibration>("set_calibration", request);
    EXPECT_FALSE(response.success);
    EXPECT_TRUE(has(response.message, part)) << response.message;
  };
  request.calibration = old;
  request.calibration.volts_to_wrench.fill(1.0);
  refused("singular");
  request.calibration = old;
  request.calibration.volts_to_wrench[7] = kNaN;
  refused("set_calibration refused: volts_to_wrench[7] is nan: give");
  request.calibration = old;
  request.calibration.volts_to_displacement[3] = std::numeric_limits<double>::infinity();
  refused("set_calibration refused: volts_to_displacement[3] is inf: give");
  request.calibration = old;
  request.calibration.wrench_fit.p = -kNaN;
  refused("set_calibration refused: wrench_fit.p is nan: give");
  request.calibration = old;
  request.calibration.id = "";
  refused("id is empty");
  request.calibration = old;
  request.calibration.serial_number = "simulated-b";
  refused("this sensor is 'simulated-a'");
  EXPECT_NEAR(a_.firstOf(a_.pass(a_.block(kLoad)))[2], kLoad[2] - 5.0, kRounding);

  // twice the matrix, twice the wrench; the bias belonged to the old one
  request.calibration = old;
  request.calibration.id = "doubled";
  for (double& x : request.calibration.volts_to_wrench) x *= 2.0;
  EXPECT_TRUE(a_.call<SetCalibration>("set_calibration", request).success);
  EXPECT_LE((a_.firstOf(a_.pass(a_.block(kLoad))) - 2 * kLoad).cwiseAbs().maxCoeff(), kRounding);
  a_.newest(a_.calibration_, [](const SensorCalibration& c) { return c.id == "doubled"; });
  request.calibration = old;
  EXPECT_TRUE(a_.call<SetCalibration>("set_calibration", request).success);

  // sensor_b must keep its displacement
  request.calibration = b_.call<GetCalibration>("get_calibration").calibration;
  request.calibration.volts_to_displacement.fill(0.0);
  const auto response = b_.call<SetCalibration>("set_calibration", request);
  EXPECT_FALSE(response.success);
  EXPECT_TRUE(has(response.message, "volts_to_displacement is zero")) << response.message;
}

// Under a stream of blocks every sample is read through one calibration, whole, and none through an
// older one than the sample before; the latched one is that of the last call.
TEST_F(ForceSensorCalibration, CalibrationsChangeBetweenTwoSamples) {
  const SensorCalibration old = a_.call<GetCalibration>("get_calibration").calibration;
  std::atomic<int> calls{0};
  constexpr int kCalls = 60;
  auto changes = std::async(std::launch::async, [&] {
    SetCalibration::Request request;
    for (int n = 1; n <= kCalls; ++n) {
      // twice the same load at the next factor: matrix and zero must come together
      request.calibration = old;
      request.calibration.id = "factor " + std::to_string(1 + n);
      for (double& x : request.calibration.volts_to_wrench) x *= 1 + n;
      EXPECT_TRUE(a_.call<SetCalibration>("set_calibration", request).success);
      ++calls;
    }
  });
  const std::uint32_t first = a_.sequence_ + 1;
  while (calls < kCalls) {
    a_.send(a_.block(kLoad, 50));
    ros::WallDuration(0.002).sleep();
  }
  changes.get();
  a_.pass(a_.block(kLoad, 50));
  double last = 1.0;
  int factors = 0;
  for (const WrenchSamples& w : a_.copy(a_.wrench_samples_)) {
    if (w.sequence < first) continue;
    for (std::size_t k = 0; k < w.saturated.size(); ++k) {
      const Vector6 got = Vector6::Map(&w.wrench[6 * k]);
      const double factor = std::round(got[2] / kLoad[2]);
      ASSERT_LE((got - factor * kLoad).cwiseAbs().maxCoeff(), kCalls * kRounding);
      ASSERT_GE(factor, last);
      factors += factor > last;
      last = factor;
    }
  }
  EXPECT_EQ(last, kCalls + 1);
  EXPECT_GT(factors, 5);  // changes did happen within the stream
  const SensorCalibration latched =
      a_.newest(a_.calibration_, [](const SensorCalibration& c) { return c.id == "factor 61"; });
  const auto now = a_.call<GetCalibration>("get_calibration");
  EXPECT_EQ(now.calibration.id, "factor 61");
  EXPECT_EQ(now.calibration.header.stamp, latched.header.stamp);  // since when: its age
  EXPECT_LT(std::abs((ros::Time::now() - latched.header.stamp).toSec()), kPatience);
  EXPECT_TRUE(has(now.message, "active for")) << now.message;
  SetCalibration::Request request;
  request.calibration = old;
  EXPECT_TRUE(a_.call<SetCalibration>("set_calibration", request).success);
}

// A complete quadratic map with covariance comes over the wire whole, and is used.
TEST_F(ForceSensorCalibration, TakesQuadraticCalibrationsWithCovariance) {
  const SensorCalibration old = b_.call<GetCalibration>("get_calibration").calibration;
  Calibration c = fromMessage(old, "");
  c.id = "quadratic";
  c.quadratic_wrench = c.quadratic_displacement = true;
  for (int i = 0; i < 6; ++i) {
    for (int k = 0; k < kStrainProducts; ++k) {
      c.wrench_products(i, k) = 0.01 * (i + 1) + 0.003 * k;
      c.displacement_products(i, k) = 1e-6 * (i - 3 + 0.1 * k);
    }
  }
  const auto spread = [](Eigen::Index n, double scale) {
    Eigen::MatrixXd m(n, n);
    for (Eigen::Index i = 0; i < n; ++i) {
      for (Eigen::Index j = 0; j < n; ++j) m(i, j) = scale / (1.0 + static_cast<double>(i + j));
    }
    return m;  // of Hilbert: symmetric, positive
  };
  c.wrench_covariance = spread(162, 1e-6) + 1e-9 * Eigen::MatrixXd::Identity(162, 162);
  c.displacement_covariance = spread(27, 1e-3) + 1e-6 * Eigen::MatrixXd::Identity(27, 27);
  c.displacement_variance.setConstant(1e-12);
  c.noise.setConstant(4e-4);
  c.wrench_range.setConstant(1.0);
  c.wrench_fit.dof = 192;
  c.wrench_fit.chi2 = 180.5;
  c.observations_digest = "crc32:01234567";
  SetCalibration::Request request;
  request.calibration = toMessage(c);
  const auto response = b_.call<SetCalibration>("set_calibration", request);
  ASSERT_TRUE(response.success) << response.message;
  const Calibration got = fromMessage(b_.call<GetCalibration>("get_calibration").calibration, "");
  EXPECT_EQ(calibrationChecksum(got), calibrationChecksum(c));

  const Vector6 v = b_.volts(kLoad);
  const StrainSamples block = b_.block(kLoad, 200);
  EXPECT_LE((b_.firstOf(b_.pass(block)) - wrenchFromVolts(c, v)).cwiseAbs().maxCoeff(), kRounding);
  const ros::Time end = block.header.stamp + ros::Duration(199 * block.period);
  const auto now = [&](const auto& m) { return std::abs((m.header.stamp - end).toSec()) < 1e-6; };
  const auto wrench = b_.newest(b_.wrench_with_covariance_, now);
  const Matrix6 noise = c.noise.cwiseAbs2().asDiagonal();
  const Matrix6 expected = wrenchCovariance(c, v, noise);
  // rounding of the mean of 200 readings
  EXPECT_LE((Matrix6::Map(wrench.covariance.data()) - expected).norm(), 1e-9 * expected.norm());
  EXPECT_LE((fromWrench(wrench.wrench) - wrenchFromVolts(c, v)).norm(), kRounding);
  const auto displacement = b_.newest(b_.displacement_, now);
  const Matrix6 of_displacement = displacementCovariance(c, v, noise);
  EXPECT_LE((Matrix6::Map(displacement.covariance.data()) - of_displacement).norm(),
            1e-9 * of_displacement.norm());
  EXPECT_LE((Vector6::Map(displacement.displacement.data()) - displacementFromVolts(c, v)).norm(),
            1e-12);

  // an array of a wrong size, or no covariance at all
  const auto refused = [&](const std::string& part) {
    const auto answer = b_.call<SetCalibration>("set_calibration", request);
    EXPECT_FALSE(answer.success);
    EXPECT_TRUE(has(answer.message, part)) << answer.message;
  };
  request.calibration.wrench_products.pop_back();
  refused("wrench_products has 125 entries");
  request.calibration = toMessage(c);
  request.calibration.wrench_covariance.resize(36);
  refused("wrench_covariance has 36 entries: give none or 26244");
  request.calibration = toMessage(c);
  request.calibration.wrench_covariance[0] = -1.0;
  refused("covariance");
  request.calibration = toMessage(c);
  request.calibration.displacement_products[4] = kNaN;
  refused("displacement_products[4] is nan");
  request.calibration = old;
  EXPECT_TRUE(b_.call<SetCalibration>("set_calibration", request).success);
}

}  // namespace
}  // namespace assembly_cell::ros_bridge::force_sensor_calibration_test
