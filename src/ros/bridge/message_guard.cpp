// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/ros/bridge/message_guard.h"

#include <cmath>
#include <iterator>
#include <string>
#include <vector>

namespace assembly_cell::ros_bridge {

namespace {

constexpr double kSilence = 5.0, kSilenceInLockstep = 60.0;  // of a publisher that has ended [s]
constexpr Range kFiniteField{-1e18, 1e18, ""};               // squares of it stay finite
constexpr Range kFractionField{-1.001, 1.001, ""};
constexpr std::size_t kMaxContacts = 10000;
constexpr Range kJointField{-1e3, 1e3, "rad"};     // some turns
constexpr Range kRateField{-1e3, 1e3, ""};         // of a flange [m/s], [rad/s]
constexpr Range kMotionStepField{1e-6, 0.1, "s"};  // between poses that determine a rate
constexpr Range kDurationField{0.0, 1e9, "s"};     // of a run
constexpr Range kTiltField{-3.2, 3.2, "rad"};      // of a peg
constexpr std::size_t kMaxCurve = 1000000;         // points: at 20 ms five hours
constexpr std::size_t kMaxEntries = 10000;         // settings, estimates or events of a run
constexpr std::size_t kMaxText = 10000;            // of a line of a record [bytes]

MessageCheck header(const std_msgs::Header& header) {
  MessageCheck check;
  check.stamp("header.stamp", header.stamp.toSec()).name("header.frame_id", header.frame_id);
  return check;
}

template <class Numbers>
void finite(MessageCheck& check, const char* field, const Numbers& numbers,
            const Range& range = kFiniteField) {
  check.numbers(field, numbers.data(), numbers.size(), range);
}

void vector(MessageCheck& check, const char* field, double x, double y, double z,
            const Range& range) {
  const double values[] = {x, y, z};
  check.numbers(field, values, 3, range);
}

void pose(MessageCheck& check, const geometry_msgs::Pose& pose) {
  vector(check, "position", pose.position.x, pose.position.y, pose.position.z, kPositionField);
  check.quaternion("orientation", pose.orientation.x, pose.orientation.y, pose.orientation.z,
                   pose.orientation.w);
}

// of six channels: period, whole samples, a mark for each
void block(MessageCheck& check, const char* field, double period, std::size_t values) {
  check.number("period", period, kPeriodField).block(field, values, 6);
}

}  // namespace

MessageCheck check(const StrainSamples& m) {
  MessageCheck check = header(m.header);
  block(check, "volts", m.period, m.volts.size());
  check.same("saturated", m.saturated.size(), m.volts.size() / 6);
  finite(check, "volts", m.volts, kVoltsField);
  if (!std::isnan(m.temperature)) check.number("temperature", m.temperature, kFiniteField);
  return check;
}

MessageCheck check(const WrenchSamples& m) {
  MessageCheck check = header(m.header);
  block(check, "wrench", m.period, m.wrench.size());
  check.noneOr("saturated", m.saturated.size(), m.wrench.size() / 6);
  return check.sixes("wrench", m.wrench.data(), m.wrench.size(), kForceField, kTorqueField);
}

MessageCheck check(const DisplacementSamples& m) {
  MessageCheck check = header(m.header);
  block(check, "displacement", m.period, m.displacement.size());
  return check.sixes("displacement", m.displacement.data(), m.displacement.size(),
                     kDisplacementField, kRotationField);
}

MessageCheck check(const AccelerometerSamples& m) {
  MessageCheck check = header(m.header);
  check.number("period", m.period, kPeriodField);
  check.block("acceleration", m.acceleration.size(), 2);
  finite(check, "acceleration", m.acceleration, kAccelerationField);
  return check;
}

MessageCheck check(const Exciter& m) {
  MessageCheck check = header(m.header);
  check.number("amplitude", m.amplitude, kAmplitudeField);
  check.number("frequency", m.frequency, kFrequencyField).number("phase", m.phase, kPhaseField);
  // none while it is off
  return m.on ? check.direction("direction", m.direction) : check;
}

MessageCheck check(const PlantState& m) {
  MessageCheck check = header(m.header);
  check.name("holder", m.holder).name("refused_node", m.refused_node);
  return check.name("refused_reason", m.refused_reason);
}

MessageCheck check(const SupervisorState& m) { return header(m.header).name("goal", m.goal); }

MessageCheck check(const Ack& m) { return MessageCheck().name("node", m.node); }

MessageCheck check(const SensorCalibration& m) {
  MessageCheck check = header(m.header);
  check.name("id", m.id).name("serial_number", m.serial_number).name("date", m.date);
  check.name("observations_digest", m.observations_digest);
  finite(check, "volts_to_wrench", m.volts_to_wrench, kCoefficientField);
  finite(check, "volts_to_displacement", m.volts_to_displacement, kCoefficientField);
  finite(check, "zero_volts", m.zero_volts, kCoefficientField);
  check.noneOr("wrench_products", m.wrench_products.size(), 126);
  finite(check, "wrench_products", m.wrench_products, kCoefficientField);
  check.noneOr("displacement_products", m.displacement_products.size(), 126);
  finite(check, "displacement_products", m.displacement_products, kCoefficientField);
  finite(check, "wrench_covariance", m.wrench_covariance);
  finite(check, "displacement_covariance", m.displacement_covariance);
  finite(check, "displacement_variance", m.displacement_variance);
  finite(check, "wrench_range", m.wrench_range);
  finite(check, "displacement_range", m.displacement_range);
  finite(check, "noise", m.noise);
  check.number("wrench_fit.chi2", m.wrench_fit.chi2, kFiniteField);
  check.number("wrench_fit.p", m.wrench_fit.p, kFiniteField);
  finite(check, "wrench_fit.residual_rms", m.wrench_fit.residual_rms);
  finite(check, "wrench_fit.predicted_sd", m.wrench_fit.predicted_sd);
  check.number("displacement_fit.chi2", m.displacement_fit.chi2, kFiniteField);
  check.number("displacement_fit.p", m.displacement_fit.p, kFiniteField);
  finite(check, "displacement_fit.residual_rms", m.displacement_fit.residual_rms);
  finite(check, "displacement_fit.predicted_sd", m.displacement_fit.predicted_sd);
  return check;
}

MessageCheck check(const LocusEstimate& m) {
  MessageCheck check = header(m.header);
  finite(check, "probabilities", m.probabilities, kFractionField);
  finite(check, "p", m.p);
  finite(check, "n", m.n);
  finite(check, "force", m.force);
  finite(check, "vertical", m.vertical);
  finite(check, "yaw", m.yaw);
  const double scalars[] = {m.semi_major,   m.semi_minor, m.orientation,     m.orientation_sd,
                            m.frequency,    m.noise_sd,   m.inflation,       m.misfit,
                            m.direction_sd, m.friction,   m.friction_sd,     m.friction_across,
                            m.vertical_sd,  m.yaw_sd,     m.better_frequency};
  check.numbers("locus", scalars, std::size(scalars), kFiniteField);
  finite(check, "hypothesis_direction", m.hypothesis_direction);
  finite(check, "hypothesis_weight", m.hypothesis_weight);
  return check.same("hypothesis_weight", m.hypothesis_weight.size(), m.hypothesis_direction.size());
}

MessageCheck check(const ContactArray& m) {
  MessageCheck check = header(m.header);
  if (m.contacts.size() > kMaxContacts) check.same("contacts", m.contacts.size(), kMaxContacts);
  for (const Contact& c : m.contacts) {
    vector(check, "contacts.position", c.position.x, c.position.y, c.position.z, kPositionField);
    vector(check, "contacts.normal", c.normal.x, c.normal.y, c.normal.z, kFractionField);
    vector(check, "contacts.force", c.force.x, c.force.y, c.force.z, kFiniteField);
    check.number("contacts.gap", c.gap, kPositionField);
  }
  return check;
}

MessageCheck check(const AlignmentReport& m) {
  MessageCheck check = header(m.header);
  check.stamp("reference", m.reference.toSec());
  finite(check, "true_offset", m.true_offset);
  finite(check, "estimated_offset", m.estimated_offset);
  finite(check, "true_tilt", m.true_tilt);
  finite(check, "estimated_tilt", m.estimated_tilt);
  if (m.estimate_known) pose(check, m.estimated_pose);
  return check.number("clearance", m.clearance, kFiniteField)
      .number("clearance_sd", m.clearance_sd, kFiniteField)
      .number("simulated_time", m.simulated_time, kFiniteField)
      .number("wall_time", m.wall_time, kFiniteField);
}

MessageCheck check(const TwinForceState& m) {
  MessageCheck check = header(m.header);
  if (m.contacts.size() > kMaxContacts) check.same("contacts", m.contacts.size(), kMaxContacts);
  for (const FeltContact& c : m.contacts) {
    finite(check, "contacts.wrench_a", c.wrench_a);
    finite(check, "contacts.wrench_b", c.wrench_b);
    finite(check, "contacts.deflection", c.deflection);
    pose(check, c.move);
  }
  if (!m.pose_known) return check;
  pose(check, m.pose.pose);
  finite(check, "pose.covariance", m.pose.covariance);
  return check;
}

namespace {

// size: of a list or a text; field: "size of ..."
void atMost(MessageCheck& check, const char* field, std::size_t size, std::size_t max) {
  check.number(field, static_cast<double>(size), {0.0, static_cast<double>(max), ""});
}

template <class Pairs>
void pairs(MessageCheck& check, const char* field, const char* size, const Pairs& all) {
  atMost(check, size, all.size(), kMaxEntries);
  if (!check.good()) return;
  for (const auto& pair : all) {
    check.name(field, pair.key);
    atMost(check, size, pair.value.size(), kMaxText);
  }
}

// as many numbers as the curve has points
void curve(MessageCheck& check, const char* field, const std::vector<double>& numbers,
           std::size_t points, const Range& range) {
  check.same(field, numbers.size(), points);
  if (check.good()) finite(check, field, numbers, range);
}

}  // namespace

MessageCheck check(const AssemblyRecord& m) {
  MessageCheck check = header(m.header);
  check.name("goal_id", m.goal_id).name("serial", m.serial).name("program", m.program);
  check.name("scenario", m.scenario).name("program_hash", m.program_hash);
  check.stamp("start", m.start.toSec()).number("duration", m.duration, kDurationField);
  check.name("strategy", m.strategy).name("result", m.result).name("failure", m.failure);
  atMost(check, "size of text", m.text.size(), kMaxText);
  pairs(check, "versions", "size of versions", m.versions);
  pairs(check, "calibrations", "size of calibrations", m.calibrations);
  pairs(check, "settings", "size of settings", m.settings);
  const std::size_t points = m.curve_time.size();
  atMost(check, "size of curve_time", points, kMaxCurve);
  curve(check, "curve_time", m.curve_time, points, kDurationField);
  curve(check, "curve_depth", m.curve_depth, points, kPositionField);
  curve(check, "curve_axial", m.curve_axial, points, kForceField);
  curve(check, "curve_lateral", m.curve_lateral, points, kForceField);
  curve(check, "curve_moment", m.curve_moment, points, kTorqueField);
  curve(check, "curve_tilt", m.curve_tilt, points, kTiltField);
  const std::size_t estimates = m.estimates.size(), events = m.events.size();
  atMost(check, "size of estimates", estimates, kMaxEntries);
  check.same("estimate_values", m.estimate_values.size(), estimates);
  check.same("estimate_sds", m.estimate_sds.size(), estimates);
  finite(check, "estimate_values", m.estimate_values);
  finite(check, "estimate_sds", m.estimate_sds);
  atMost(check, "size of events", events, kMaxEntries);
  check.same("event_times", m.event_times.size(), events);
  check.same("event_texts", m.event_texts.size(), events);
  finite(check, "event_times", m.event_times);
  if (!check.good()) return check;
  for (const std::string& name : m.estimates) check.name("estimates", name);
  for (const std::string& kind : m.events) check.name("events", kind);
  for (const std::string& line : m.event_texts) {
    atMost(check, "size of event_texts", line.size(), kMaxText);
  }
  return check;
}

MessageCheck check(const AssemblyVerdict& m) {
  MessageCheck check = header(m.header);
  check.name("goal_id", m.goal_id).name("serial", m.serial).name("program", m.program);
  atMost(check, "size of message", m.message.size(), kMaxText);
  atMost(check, "size of verdicts", m.verdicts.size(), kMaxEntries);
  if (!check.good()) return check;
  for (const RuleVerdict& verdict : m.verdicts) {
    check.name("verdicts.rule", verdict.rule).name("verdicts.kind", verdict.kind);
    check.name("verdicts.quantity", verdict.quantity);
    check.number("verdicts.margin", verdict.margin, kFiniteField);
    check.number("verdicts.depth", verdict.depth, kPositionField);
    atMost(check, "size of verdicts.text", verdict.text.size(), kMaxText);
  }
  return check;
}

MessageCheck check(const RecorderState& m) {
  MessageCheck check = header(m.header);
  check.name("serial", m.serial).name("program", m.program);
  atMost(check, "size of reason", m.reason.size(), kMaxText);
  atMost(check, "size of store", m.store.size(), kMaxText);
  const std::size_t points = m.band_depth.size();
  atMost(check, "size of band_depth", points, kMaxCurve);
  curve(check, "band_depth", m.band_depth, points, kPositionField);
  curve(check, "band_low", m.band_low, points, kForceField);
  curve(check, "band_high", m.band_high, points, kForceField);
  return check;
}

MessageCheck check(const IdentifyLocusGoal& goal) {
  return MessageCheck()
      .stamp("start", goal.start.toSec())
      .stamp("exciter.header.stamp", goal.exciter.header.stamp.toSec());
}

namespace {

template <class Goal>
MessageCheck recorded(const Goal& goal) {
  MessageCheck check;
  return check.name("strategy", goal.strategy)
      .name("serial", goal.serial)
      .name("program", goal.program);
}

}  // namespace

MessageCheck check(const AlignPegGoal& goal) { return recorded(goal); }

// its depth is checked by the node
MessageCheck check(const AssemblePegGoal& goal) { return recorded(goal); }

// its time_limit is checked by the node
MessageCheck check(const IdentifyGoal& goal) {
  return MessageCheck().name("target", goal.target).name("file", goal.file);
}

MessageCheck check(const CalibrateSensorsGoal& goal) {
  return MessageCheck().name("plan", goal.plan).name("id", goal.id);
}

// its force is checked by the node
MessageCheck check(const MoveToContactGoal&) { return {}; }

MessageCheck check(const RetreatGoal&) { return {}; }

namespace {

template <class Feedback>
MessageCheck feedback(const Feedback& m) {
  MessageCheck check = header(m.header);
  check.name("status.goal_id.id", m.status.goal_id.id).name("feedback.state", m.feedback.state);
  const double numbers[] = {m.feedback.time, m.feedback.position_sd, m.feedback.rotation_sd,
                            m.feedback.clearance, m.feedback.clearance_sd};
  return check.numbers("feedback", numbers, std::size(numbers), kFiniteField);
}

}  // namespace

MessageCheck check(const AlignPegActionFeedback& m) { return feedback(m); }

MessageCheck check(const AssemblePegActionFeedback& m) {
  MessageCheck check = feedback(m);
  return check.number("feedback.depth", m.feedback.depth, kPositionField)
      .number("feedback.force", m.feedback.force, kForceField)
      .number("feedback.axial", m.feedback.axial, kForceField);
}

MessageCheck check(const geometry_msgs::PoseStamped& m) {
  MessageCheck check = header(m.header);
  pose(check, m.pose);
  return check;
}

MessageCheck check(const geometry_msgs::WrenchStamped& m) {
  MessageCheck check = header(m.header);
  const auto& [force, torque] = std::tie(m.wrench.force, m.wrench.torque);
  vector(check, "wrench.force", force.x, force.y, force.z, kForceField);
  vector(check, "wrench.torque", torque.x, torque.y, torque.z, kTorqueField);
  return check;
}

MessageCheck check(const geometry_msgs::TwistStamped& m) {
  MessageCheck check = header(m.header);
  const auto& [linear, angular] = std::tie(m.twist.linear, m.twist.angular);
  vector(check, "twist.linear", linear.x, linear.y, linear.z, kRateField);
  vector(check, "twist.angular", angular.x, angular.y, angular.z, kRateField);
  return check;
}

MessageCheck check(const sensor_msgs::JointState& m) { return header(m.header); }

MessageCheck check(const trajectory_msgs::JointTrajectory& m) {
  MessageCheck check = header(m.header);
  check.same("points", m.points.size(), 1);
  if (!check.good()) return check;
  check.same("points[0].positions", m.points[0].positions.size(), m.joint_names.size());
  finite(check, "points[0].positions", m.points[0].positions, kJointField);
  return check;
}

MessageCheck check(const CarrierMotion& m) {
  MessageCheck check = header(m.header);
  check.number("step", m.step, kMotionStepField);
  pose(check, m.before);
  pose(check, m.at);
  pose(check, m.after);
  return check;
}

ros::Time later(const ros::Time& stamp, double seconds) {
  const double end = stamp.toSec() + seconds;
  if (!(end > 0.0)) return ros::Time();
  if (end >= ros::TIME_MAX.toSec()) return ros::TIME_MAX;
  return stamp + ros::Duration(seconds);
}

// ---- streams ----

StreamFilter::StreamFilter(bool lockstep) : silence_(lockstep ? kSilenceInLockstep : kSilence) {}

std::string StreamFilter::checkPublisher(const std::string& publisher) {
  const ros::WallTime now = ros::WallTime::now();
  if (publisher != publisher_) {
    if (!received_.isZero() && (now - received_).toSec() < silence_) {
      return "the stream is that of " + publisher_ + ": end one of the two publishers";
    }
    publisher_ = publisher;
  }
  received_ = now;
  return {};
}

std::string StreamFilter::checkStamp(const ros::Time& stamp) {
  if (window_.accept(stamp.toSec())) return {};
  return "header.stamp is far ahead of those before";
}

}  // namespace assembly_cell::ros_bridge
