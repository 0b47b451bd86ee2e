// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/ros/bridge/calibration_messages.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "assembly_cell/base/input_error.h"
#include "assembly_cell/base/text.h"
#include "assembly_cell/guard/message_check.h"
#include "assembly_cell/ros/bridge/conversions.h"

namespace assembly_cell::ros_bridge {

namespace {

using RowMajor6 = Eigen::Matrix<double, 6, 6, Eigen::RowMajor>;
using RowMajor6x21 = Eigen::Matrix<double, 6, kStrainProducts, Eigen::RowMajor>;
using RowMajor = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

std::vector<double> rowsOf(const RowMajor& m) { return {m.data(), m.data() + m.size()}; }

void checkSize(std::size_t size, std::size_t wanted, const char* field, const std::string& source) {
  if (size == wanted) return;
  throw InputError(source + ": " + field + " has " + std::to_string(size) + " entries: give none" +
                   (wanted > 0 ? " or " + std::to_string(wanted) : ""));
}

MapStatistics toMessage(const FitStatistics& fit) {
  MapStatistics message;
  message.chi2 = fit.chi2;
  message.dof = fit.dof;
  message.p = fit.p;
  Vector6::Map(message.residual_rms.data()) = fit.residual_rms;
  Vector6::Map(message.predicted_sd.data()) = fit.predicted_sd;
  return message;
}

FitStatistics fromMessage(const MapStatistics& message) {
  FitStatistics fit;
  fit.chi2 = message.chi2;
  fit.dof = message.dof;
  fit.p = message.p;
  fit.residual_rms = Vector6::Map(message.residual_rms.data());
  fit.predicted_sd = Vector6::Map(message.predicted_sd.data());
  return fit;
}

// n × n; 0 × 0 when empty
Eigen::MatrixXd squareOf(const std::vector<double>& data, Eigen::Index n, const char* field,
                         const std::string& source) {
  if (data.empty()) return {};
  checkSize(data.size(), static_cast<std::size_t>(n * n), field, source);
  return Eigen::Map<const RowMajor>(data.data(), n, n);
}

std::vector<std::string> textsOf(const std::vector<Gate>& gates, Verdict verdict) {
  std::vector<std::string> texts;
  for (const Gate& gate : gates) {
    if (gate.verdict == verdict) texts.push_back(gate.text);
  }
  return texts;
}

// -1 for unknown: messages have no NaN
double known(double value) { return std::isfinite(value) ? value : -1.0; }

// common fields of solutions of forces and of displacements
template <class Solution, class Message>
void fillCommon(const Solution& s, Message& m) {
  m.accepted = s.accepted;
  m.rank = static_cast<std::uint32_t>(s.rank);
  m.dof = s.dof;
  m.condition = known(s.condition);
  m.chi2 = known(s.chi2);
  m.p = known(s.p);
  m.weak_direction = s.weak_direction;
  m.refusals = textsOf(s.gates, Verdict::kRefuse);
  m.warnings = textsOf(s.gates, Verdict::kWarn);
  m.message = s.message;
}

}  // namespace

SensorCalibration toMessage(const Calibration& c) {
  SensorCalibration message;
  message.id = c.id;
  message.serial_number = c.serial_number;
  message.date = c.date;
  RowMajor6::Map(message.volts_to_wrench.data()) = c.volts_to_wrench;
  RowMajor6::Map(message.volts_to_displacement.data()) = c.volts_to_displacement;
  Vector6::Map(message.zero_volts.data()) = c.zero_volts;
  if (c.quadratic_wrench) message.wrench_products = rowsOf(c.wrench_products);
  if (c.quadratic_displacement) message.displacement_products = rowsOf(c.displacement_products);
  message.wrench_covariance = rowsOf(c.wrench_covariance);
  message.displacement_covariance = rowsOf(c.displacement_covariance);
  Vector6::Map(message.displacement_variance.data()) = c.displacement_variance;
  Vector6::Map(message.wrench_range.data()) = c.wrench_range;
  Vector6::Map(message.displacement_range.data()) = c.displacement_range;
  Vector6::Map(message.noise.data()) = c.noise;
  message.temperature = c.temperature;
  message.wrench_fit = toMessage(c.wrench_fit);
  message.displacement_fit = toMessage(c.displacement_fit);
  message.observations_digest = c.observations_digest;
  return message;
}

Calibration fromMessage(const SensorCalibration& message, const std::string& source) {
  Calibration c;
  c.id = message.id;
  c.serial_number = message.serial_number;
  c.date = message.date;
  c.volts_to_wrench = RowMajor6::Map(message.volts_to_wrench.data());
  c.volts_to_displacement = RowMajor6::Map(message.volts_to_displacement.data());
  c.zero_volts = Vector6::Map(message.zero_volts.data());
  const auto products = [&](const std::vector<double>& data, const char* field, Matrix6x21& m) {
    if (data.empty()) return false;
    checkSize(data.size(), 6 * kStrainProducts, field, source);
    m = RowMajor6x21::Map(data.data());
    return true;
  };
  c.quadratic_wrench = products(message.wrench_products, "wrench_products", c.wrench_products);
  c.quadratic_displacement =
      products(message.displacement_products, "displacement_products", c.displacement_products);
  const Eigen::Index wrench_terms = c.quadratic_wrench ? 6 + kStrainProducts : 6;
  const Eigen::Index displacement_terms = c.quadratic_displacement ? 6 + kStrainProducts : 6;
  c.wrench_covariance =
      squareOf(message.wrench_covariance, 6 * wrench_terms, "wrench_covariance", source);
  c.displacement_covariance = squareOf(message.displacement_covariance, displacement_terms,
                                       "displacement_covariance", source);
  c.displacement_variance = Vector6::Map(message.displacement_variance.data());
  c.wrench_range = Vector6::Map(message.wrench_range.data());
  c.displacement_range = Vector6::Map(message.displacement_range.data());
  c.noise = Vector6::Map(message.noise.data());
  c.temperature = message.temperature;
  c.wrench_fit = fromMessage(message.wrench_fit);
  c.displacement_fit = fromMessage(message.displacement_fit);
  c.observations_digest = message.observations_digest;
  return c;
}

CalibrationTest toMessage(const Observation& o) {
  CalibrationTest test;
  test.kind = toString(o.kind);
  if (isOneSided(o.kind)) test.sensor = toString(o.side);
  test.id = o.id;
  test.pose = toPose(o.X_AB);
  if (o.X_covariance) test.pose_covariance = rowsOf(*o.X_covariance);
  test.mass = o.mass;
  test.direction = toVector3(o.direction);
  test.point = toPoint(o.point);
  test.point_at_rest = o.point_at_rest;
  test.gauges = o.gauges;
  if (o.displacement) test.displacement.assign(o.displacement->data(), o.displacement->data() + 6);
  test.load = o.load;
  test.channel = static_cast<std::uint8_t>(o.channel);
  return test;
}

Observation fromMessage(const CalibrationTest& test, const std::string& source) {
  const auto kind = observationKind(test.kind);
  if (!kind) {
    throw InputError(source + ": kind is '" + test.kind + "': give " + kObservationKinds);
  }
  Observation o;
  o.kind = *kind;
  const bool one_side = isOneSided(o.kind);
  if (one_side && test.sensor != "a" && test.sensor != "b") {
    throw InputError(source + ": sensor is '" + test.sensor + "': give a or b");
  }
  o.side = one_side && test.sensor == "b" ? Side::kB : Side::kA;
  o.id = test.id;
  if (o.kind == ObservationKind::kReacting) {
    geometry_msgs::Pose pose = test.pose;
    auto& q = pose.orientation;
    if (q.x == 0.0 && q.y == 0.0 && q.z == 0.0 && q.w == 0.0) q.w = 1.0;
    o.X_AB = fromPose(pose, source + ": pose");
    if (!test.pose_covariance.empty()) {
      o.X_covariance = squareOf(test.pose_covariance, 6, "pose_covariance", source);
    }
  }
  o.mass = test.mass;
  if (o.kind == ObservationKind::kWeight) {
    o.direction = {test.direction.x, test.direction.y, test.direction.z};
  }
  o.point = {test.point.x, test.point.y, test.point.z};
  o.point_at_rest = test.point_at_rest;
  o.gauges = test.gauges;
  if (!test.displacement.empty()) {
    checkSize(test.displacement.size(), 6, "displacement", source);
    o.displacement = Vector6(test.displacement.data());
  }
  o.load = test.load;
  o.channel = test.channel;
  return o;
}

LoadStep toMessage(const LoadRequest& request) {
  LoadStep step;
  step.test = toMessage(request.target);
  step.wrench = toWrench(request.wrench);
  Vector6::Map(step.strain.data()) = request.strain;
  step.text = describe(request);
  return step;
}

LoadRequest fromMessage(const LoadStep& step, const std::string& source) {
  LoadRequest request;
  request.target = fromMessage(step.test, source);
  request.wrench = fromWrench(step.wrench);
  request.strain = Vector6::Map(step.strain.data());
  const MessageCheck found =
      MessageCheck()
          .sixes("wrench", request.wrench.data(), 6, kForceField, kTorqueField)
          .numbers("strain", step.strain.data(), step.strain.size(), kCoefficientField);
  if (!found.good()) throw InputError(source + ": " + found.text());
  return request;
}

CalibrationResult toMessage(const ForceSolution& s, const ObservationSet& set) {
  CalibrationResult m;
  fillCommon(s, m);
  m.procedure = toString(s.procedure);
  m.model = s.quadratic ? "quadratic" : "linear";
  m.unknowns = static_cast<std::uint32_t>(s.unknowns);
  m.equations = static_cast<std::uint32_t>(s.equations);
  for (std::size_t k = 0; k < 6; ++k) {
    m.residual_rms[k] = known(s.residual_rms[k]);
    m.predicted_sd_a[k] = known(s.predicted_sd.a[k]);
    m.predicted_sd_b[k] = known(s.predicted_sd.b[k]);
  }
  m.hold_out_rms = known(s.hold_out_rms);
  m.normalised.assign(set.observations.size(), 0.0);
  for (const TestResult& test : s.tests) {
    const Observation& o = set.observations.at(test.observation);
    if (test.dropped) {
      m.dropped.push_back("observation " + std::to_string(test.observation + 1) +
                          (o.id.empty() ? "" : " (" + o.id + ")") + ": " + test.dropped.text);
    } else {
      m.normalised[test.observation] = known(test.normalised);
      ++m.tests;
    }
  }
  return m;
}

DisplacementResult toMessage(const DisplacementSolution& s) {
  DisplacementResult m;
  fillCommon(s, m);
  m.tests = static_cast<std::uint32_t>(s.tests);
  for (std::size_t k = 0; k < 6; ++k) {
    m.residual_sd[k] = known(s.residual_sd[k]);
    m.output_sd[k] = known(s.output_sd[k]);
  }
  m.dropped = s.dropped;
  return m;
}

CalibrationResult toMessage(const CalibrationSolution& s) {
  CalibrationResult m;
  if (s.force) m = toMessage(*s.force, s.set);
  if (s.displacement.a) m.displacement_a = toMessage(*s.displacement.a);
  if (s.displacement.b) m.displacement_b = toMessage(*s.displacement.b);
  m.accepted = s.accepted;
  m.message = s.message;
  return m;
}

std::string wrenchText(const Vector6& w, const char* pattern) {
  std::string line;
  for (int k = 0; k < 6; ++k) {
    line += (k == 0 ? "" : " ") + text(pattern, w[k]) + (k == 2 ? " N," : "");
  }
  return line + " N m";
}

}  // namespace assembly_cell::ros_bridge
