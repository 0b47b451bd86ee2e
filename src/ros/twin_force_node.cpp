// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/ros/twin_force_node.h"

#include <algorithm>
#include <chrono>
#include <cmath>

#include "assembly_cell/Ack.h"
#include "assembly_cell/base/input_error.h"
#include "assembly_cell/base/text.h"
#include "assembly_cell/description/cell_description.h"
#include "assembly_cell/ros/conversions.h"
#include "assembly_cell/ros/parameters.h"
#include "assembly_cell/twin_force/contact_checks.h"
#include "assembly_cell/twin_force/contacts_file.h"

namespace assembly_cell::ros_bridge {

namespace {

constexpr int kQueue = 100;
constexpr std::size_t kCapacity = 64;            // contacts that are kept
constexpr double kHistory = 60.0;                // of blocks kept at most, and longest window [s]
constexpr double kUnknownVariance = 1e6;         // on the wire, for what no contact tells
constexpr double kConverterStep = 10.0 / 65536;  // 16 bit over ±5 V [V]

template <class Message>
double duration(const Message& message, std::size_t values) {
  return message.period * static_cast<double>(values / 6);
}

bool finiteBlock(const std::vector<double>& samples, double period) {
  return !samples.empty() && samples.size() % 6 == 0 && std::isfinite(period) && period > 0.0 &&
         std::all_of(samples.begin(), samples.end(), [](double v) { return std::isfinite(v); });
}

/// Nearest in time; null for an empty list.
template <class Message>
typename Message::ConstPtr nearest(const std::deque<typename Message::ConstPtr>& list,
                                   const ros::Time& stamp) {
  typename Message::ConstPtr best;
  for (const auto& m : list) {
    if (!best || std::abs((m->header.stamp - stamp).toSec()) <
                     std::abs((best->header.stamp - stamp).toSec())) {
      best = m;
    }
  }
  return best;
}

template <class Message>
void keep(std::deque<typename Message::ConstPtr>& list, const typename Message::ConstPtr& message) {
  // a clock that went back starts anew
  if (!list.empty() && message->header.stamp < list.back()->header.stamp) list.clear();
  list.push_back(message);
  while ((list.back()->header.stamp - list.front()->header.stamp).toSec() > kHistory) {
    list.pop_front();
  }
}

template <class Array, class Source>
void copy(const Source& from, Array& to) {
  for (std::size_t i = 0; i < to.size(); ++i) {
    to[i] = std::isfinite(from.data()[i]) ? from.data()[i] : kUnknownVariance;
  }
}

}  // namespace

TwinForceNode::TwinForceNode(ros::NodeHandle& nh, ros::NodeHandle& pnh) {
  Parameters parameters(pnh);
  TwinForceSetup setup;
  setup.mechanism = loadMechanism(parameters.text("scenario"),
                                  parameters.texts("overrides", std::vector<std::string>{}));
  window_ = parameters.number("window", {1e-3, kHistory}, 0.2);
  time_limit_ = parameters.number("time_limit", {0.0, 0.02}, 1e-3);
  settled_force_ = parameters.number("settled_force", kPositive, 0.02);
  carrier_motion_ = parameters.number("carrier_motion", kPositive, 1e-5);
  data_timeout_ = parameters.number("data_timeout", {0.01, 3600.0}, 10.0);
  converter_step_ = parameters.number("converter_step", kNotNegative, kConverterStep);
  use_displacement_ = parameters.flag("use_displacement", true);
  setup.options.required_position = parameters.number("required_position", kPositive, 3e-5);
  setup.options.required_rotation = parameters.number("required_rotation", kPositive, 1e-3);
  setup.options.smallest_p = parameters.number("smallest_p", {0.0, 0.5}, 1e-3);
  const double position_sd = parameters.number("prior_position_sd", kPositive, 0.02);
  const double rotation_sd = parameters.number("prior_rotation_sd", kPositive, 0.1);
  const auto prior = parameters.numbers("prior_position", 3, std::vector<double>{0, 0, 0});
  setup.options.prior =
      nominalPrior({Eigen::Matrix3d::Identity(), Eigen::Vector3d(prior[0], prior[1], prior[2])},
                   position_sd, rotation_sd);
  setup.on_plane = parameters.flag("on_plane", true);
  setup.move_sd = parameters.number("move_sd", kPositive, setup.move_sd);
  setup.move_angle_sd = parameters.number("move_angle_sd", kPositive, setup.move_angle_sd);
  setup.contact_force = parameters.number("contact_force", kPositive, setup.contact_force);
  setup.contact_tilt = parameters.number("contact_tilt", {0.02, 0.14}, setup.contact_tilt);
  setup.capacity = kCapacity;
  lockstep_ = parameters.flag("lockstep", false);
  // the name that the simulator knows: relative to the cell's namespace
  std::string name = ros::this_node::getName();
  const std::string ns = nh.getNamespace() == "/" ? "/" : nh.getNamespace() + "/";
  if (name.compare(0, ns.size(), ns) == 0) name = name.substr(ns.size());
  name_ = parameters.text("name_in_lockstep", name);
  parameters.refuseUnknown();
  const CellDescription description = loadCellDescription(Parameters(nh).text("robot_description"));
  setup.X_AH = description.X_AH;
  setup.X_CP = description.X_BP;
  contacts_ = std::make_unique<TwinForceContacts>(setup);
  S_a_.setZero();
  S_b_.setZero();

  pose_pub_ = nh.advertise<geometry_msgs::PoseWithCovarianceStamped>("pose", 10);
  status_pub_ = nh.advertise<TwinForceState>("twin_force/status", 10, true);
  if (lockstep_) ack_pub_ = nh.advertise<Ack>("ack", kQueue, true);
  const auto hints = ros::TransportHints().tcpNoDelay();
  a_sub_ = nh.subscribe("sensor_a/wrench_samples", kQueue, &TwinForceNode::onWrenchA, this, hints);
  b_sub_ = nh.subscribe("sensor_b/wrench_samples", kQueue, &TwinForceNode::onWrenchB, this, hints);
  if (use_displacement_) {
    d_sub_ = nh.subscribe("sensor_b/displacement_samples", kQueue, &TwinForceNode::onDisplacement,
                          this, hints);
  }
  carrier_sub_ = nh.subscribe("carrier_pose", kQueue, &TwinForceNode::onCarrier, this, hints);
  const auto onCalibration = [this](Matrix6& S, const SensorCalibration& calibration) {
    using RowMajor = Eigen::Matrix<double, 6, 6, Eigen::RowMajor>;
    std::lock_guard<std::mutex> lock(mutex_);
    S = Eigen::Map<const RowMajor>(calibration.volts_to_wrench.data());
  };
  calibration_a_sub_ = nh.subscribe<SensorCalibration>(
      "sensor_a/calibration", 1, [this, onCalibration](const auto& m) { onCalibration(S_a_, *m); });
  calibration_b_sub_ = nh.subscribe<SensorCalibration>(
      "sensor_b/calibration", 1, [this, onCalibration](const auto& m) { onCalibration(S_b_, *m); });
  tare_srv_ = pnh.advertiseService("tare", &TwinForceNode::onTare, this);
  add_srv_ = pnh.advertiseService("add_contact", &TwinForceNode::onAdd, this);
  reset_srv_ = pnh.advertiseService("reset", &TwinForceNode::onReset, this);
  solve_srv_ = pnh.advertiseService("solve", &TwinForceNode::onSolve, this);
  status_pub_.publish(status());
}

// ---- the data path ----

void TwinForceNode::onWrenchA(const WrenchSamples::ConstPtr& message) {
  std::lock_guard<std::mutex> lock(mutex_);
  keep<WrenchSamples>(a_, message);
  last_a_ = message->sequence;
  arrived_.notify_all();
  acknowledge();
}

void TwinForceNode::onWrenchB(const WrenchSamples::ConstPtr& message) {
  std::lock_guard<std::mutex> lock(mutex_);
  keep<WrenchSamples>(b_, message);
  last_b_ = message->sequence;
  arrived_.notify_all();
  acknowledge();
}

void TwinForceNode::onDisplacement(const DisplacementSamples::ConstPtr& message) {
  std::lock_guard<std::mutex> lock(mutex_);
  keep<DisplacementSamples>(d_, message);
  last_d_ = message->sequence;
  arrived_.notify_all();
  acknowledge();
}

void TwinForceNode::onCarrier(const geometry_msgs::PoseStamped::ConstPtr& message) {
  try {
    fromPose(message->pose, "carrier_pose");
  } catch (const InputError& error) {
    ROS_ERROR_THROTTLE(1.0, "ignored: %s", error.what());
    return;
  }
  {
    std::lock_guard<std::mutex> lock(mutex_);
    keep<geometry_msgs::PoseStamped>(carrier_, message);
    arrived_.notify_all();
  }
  publishPose();
}

// once all streams have a block
void TwinForceNode::acknowledge() {
  if (!lockstep_ || !last_a_ || last_a_ != last_b_) return;
  if (use_displacement_ && last_d_ != last_a_) return;
  if (acknowledged_ == last_a_) return;
  acknowledged_ = last_a_;
  Ack ack;
  ack.node = name_;
  ack.sequence = *last_a_;
  ack_pub_.publish(ack);
}

TwinForceNode::Reading TwinForceNode::read(double length) {
  using Clock = std::chrono::steady_clock;
  if (length == 0.0) length = window_;
  if (!(length >= 1e-3 && length <= 0.5 * kHistory)) {
    throw InputError(
        text("window is %g s: give 0.001 to %g s, 0 for the node's own", length, 0.5 * kHistory));
  }
  std::unique_lock<std::mutex> lock(mutex_);
  const ros::Time from = b_.empty() ? ros::Time() : b_.back()->header.stamp;
  const auto deadline =
      Clock::now() + std::chrono::milliseconds(static_cast<std::int64_t>(data_timeout_ * 1e3));
  const auto wait = [&](const char* what) {
    if (!ros::ok()) throw InputError("the node is shutting down");
    if (Clock::now() >= deadline) {
      throw InputError(std::string("no ") + what +
                       text(" within %g s of wall time", data_timeout_));
    }
    arrived_.wait_for(lock, std::chrono::milliseconds(20));
  };

  // blocks of sensor_b after the call, and what goes with each
  std::vector<WrenchSamples::ConstPtr> window;
  while (true) {
    window.clear();
    double covered = 0.0;
    for (const auto& b : b_) {
      if (b->header.stamp <= from || covered >= length - 1e-9) continue;
      if (!finiteBlock(b->wrench, b->period)) {
        throw InputError("sensor_b: a block is not one of finite samples");
      }
      window.push_back(b);
      covered += duration(*b, b->wrench.size());
    }
    if (covered >= length - 1e-9) break;
    wait("wrench of sensor_b");
  }
  const ros::Time end =
      window.back()->header.stamp +
      ros::Duration(window.back()->period *
                    (static_cast<double>(window.back()->wrench.size() / 6) - 1.0));
  const auto arrived = [&](const auto& list, const ros::Time& until) {
    return !list.empty() && list.back()->header.stamp >= until;
  };
  const ros::Time last = window.back()->header.stamp;
  const ros::Duration slack(time_limit_ + 1e-9);
  while (!arrived(a_, last - slack)) wait("wrench of sensor_a");
  while (use_displacement_ && !arrived(d_, last - slack)) wait("displacement of sensor_b");
  while (!arrived(carrier_, end - ros::Duration(0.5 * window.back()->period))) wait("carrier_pose");

  Reading reading;
  std::optional<Pose> first;
  for (const auto& b : window) {
    const auto a = nearest<WrenchSamples>(a_, b->header.stamp);
    const double apart = std::abs((a->header.stamp - b->header.stamp).toSec());
    if (apart > time_limit_ + 1e-9) {
      throw InputError(
          text("not simultaneous: the wrenches of both sensors are %.3g s apart, more "
               "than %g s",
               apart, time_limit_));
    }
    reading.time_difference = std::max(reading.time_difference, apart);
    if (!finiteBlock(a->wrench, a->period)) {
      throw InputError("sensor_a: a block is not one of finite samples");
    }
    for (const auto& [samples, sensor] : {std::make_pair(a, "sensor_a"), {b, "sensor_b"}}) {
      if (std::any_of(samples->saturated.begin(), samples->saturated.end(),
                      [](auto bits) { return bits != 0; })) {
        throw InputError(std::string("saturated: a channel of ") + sensor +
                         " is at its limit; press less");
      }
    }
    Vector6 displacement = Vector6::Zero();
    if (use_displacement_) {
      const auto d = nearest<DisplacementSamples>(d_, b->header.stamp);
      if (std::abs((d->header.stamp - b->header.stamp).toSec()) > time_limit_ + 1e-9) {
        throw InputError("not simultaneous: no displacement goes with the wrench of sensor_b");
      }
      if (!finiteBlock(d->displacement, d->period)) {
        throw InputError("sensor_b: a block of displacements is not one of finite samples");
      }
      displacement = momentsOf(d->displacement.data(), d->displacement.size() / 6).mean;
    }
    reading.window.add(momentsOf(a->wrench.data(), a->wrench.size() / 6),
                       momentsOf(b->wrench.data(), b->wrench.size() / 6), displacement);
  }
  // the carrier at rest meanwhile
  for (const auto& pose : carrier_) {
    if (pose->header.stamp < window.front()->header.stamp) continue;
    if (pose->header.stamp > end + ros::Duration(window.back()->period)) break;
    reading.X_SC = fromPose(pose->pose, "carrier_pose");
    if (!first) first = reading.X_SC;
    const double motion =
        (reading.X_SC.p - first->p).norm() +
        0.1 * vectorFromRotation(first->R.transpose() * reading.X_SC.R).value.norm();
    if (motion > carrier_motion_) {
      throw InputError(text("moving: the carrier moved by %.2g m, more than %g m; hold it", motion,
                            carrier_motion_));
    }
  }
  if (!reading.window.settled(settled_force_) && window.size() > 1) {
    throw InputError(
        text("not settled: halves of the window differ by more than %g N", settled_force_));
  }
  reading.middle = window.front()->header.stamp + (end - window.front()->header.stamp) * 0.5;
  return reading;
}

// ---- services ----

bool TwinForceNode::onTare(std_srvs::Trigger::Request&, std_srvs::Trigger::Response& response) {
  const std::lock_guard<std::mutex> turn(services_);
  try {
    const Reading free = read(0.0);
    contacts_->tare(free.window, free.X_SC);
    response.success = true;
    response.message = text("zero from %d samples", free.window.samples());
  } catch (const InputError& error) {
    response.message = error.what();
  }
  return true;
}

bool TwinForceNode::onAdd(AddContact::Request& request, AddContact::Response& response) {
  const std::lock_guard<std::mutex> turn(services_);
  try {
    if (contacts_->full()) {
      throw InputError(text("%zu contacts are kept: call ~reset first", kCapacity));
    }
    const Reading reading = read(request.window);
    Matrix6 rounding_a, rounding_b;
    {
      std::lock_guard<std::mutex> lock(mutex_);
      // without a calibration every channel counts as its own newton and newton metre
      const Matrix6 plain = 1e-6 * Matrix6::Identity();
      rounding_a = S_a_.isZero() ? plain : roundingCovariance(S_a_, converter_step_);
      rounding_b = S_b_.isZero() ? plain : roundingCovariance(S_b_, converter_step_);
    }
    const TwinContact& contact =
        contacts_->add(reading.window, reading.X_SC, rounding_a, rounding_b);
    readings_.push_back(reading);
    response.success = true;
    response.message = text("contact %.0f: %.2f N", static_cast<double>(contacts_->size() - 1),
                            contact.wrench_b.head<3>().norm());

    // signs: of every pair of forces, and of all contacts together
    const auto& all = contacts_->contacts();
    const SignCheck check =
        checkSigns(contact, contacts_->options().prior->pose.R, Eigen::Vector3d::Zero());
    const SignVerdict together = all.size() > 2 ? checkSigns(all) : SignVerdict::kUndecided;
    if (check.pair == SignVerdict::kReversed || together == SignVerdict::kReversed) {
      signs_ = "reversed";
      response.message += "; one sensor reports the opposite sign: check its calibration";
      ROS_ERROR("twin force: one sensor reports the opposite sign");
    } else if (check.pair == SignVerdict::kRight && signs_ != "reversed") {
      signs_ = "right";
    }
  } catch (const InputError& error) {
    response.message = error.what();
  }
  response.status = status();
  status_pub_.publish(response.status);
  return true;
}

bool TwinForceNode::onReset(std_srvs::Trigger::Request&, std_srvs::Trigger::Response& response) {
  const std::lock_guard<std::mutex> turn(services_);
  response.success = true;
  response.message =
      text("%.0f contacts and the zero forgotten", static_cast<double>(contacts_->size()));
  contacts_->clear();
  readings_.clear();
  signs_ = "undecided";
  pose_known_ = false;
  advice_ = ContactAdvice();
  status_pub_.publish(status());
  return true;
}

bool TwinForceNode::onSolve(SolveTwinForce::Request&, SolveTwinForce::Response& response) {
  {
    const std::lock_guard<std::mutex> turn(services_);
    pose_known_ = false;
    advice_ = ContactAdvice();
    try {
      const TwinForceEstimate& e = contacts_->solve();
      response.message = std::string(toString(e.status)) + (*e.reason ? ": " : "") + e.reason;
      if (signs_ == "reversed") {
        response.message = "one sensor reports the opposite sign: check its calibration";
      } else if (hasPose(e.status)) {
        pose_known_ = true;
        advice_ = contacts_->advise(advised_);
      }
    } catch (const InputError& error) {
      response.message = error.what();
    }
    response.success = pose_known_;
    response.status = status();
    ContactsFile file;
    file.contacts = contacts_->contacts();
    file.prior = contacts_->options().prior;
    file.tare_covariance = contacts_->options().tare_covariance;
    response.contacts = contactsYaml(file);
    status_pub_.publish(response.status);
  }
  publishPose();
  return true;
}

// ---- what goes out ----

TwinForceState TwinForceNode::status() const {
  TwinForceState out;
  out.header.frame_id = kHoleFrame;
  const TwinForceEstimate& e = contacts_->estimate();
  out.status = toString(e.status);
  out.reason = e.reason;
  out.signs = signs_;
  for (std::size_t i = 0; i < readings_.size(); ++i) {
    const TwinContact& c = contacts_->contacts()[i];
    FeltContact contact;
    contact.stamp = out.header.stamp = readings_[i].middle;
    copy(c.wrench_a, contact.wrench_a);
    copy(c.wrench_b, contact.wrench_b);
    copy(c.covariance_a, contact.covariance_a);
    copy(c.covariance_b, contact.covariance_b);
    contact.move = toPose(c.move);
    if (c.move_covariance) copy(*c.move_covariance, contact.move_covariance);
    copy(readings_[i].window.displacement(), contact.deflection);
    contact.samples = static_cast<std::uint32_t>(readings_[i].window.samples());
    contact.time_difference = readings_[i].time_difference;
    out.contacts.push_back(contact);
  }
  out.pose.pose.orientation.w = 1.0;
  out.advised_move.orientation.w = 1.0;
  if (!pose_known_) return out;

  out.pose_known = true;
  for (const int i : e.rejected) out.rejected.push_back(static_cast<std::uint32_t>(i));
  const Reading& last = readings_.back();
  const Pose X_HP = contacts_->pegPose(last.X_SC, last.window.displacement());
  out.pose.pose = toPose(X_HP);
  copy(coordinateCovariance(e), out.pose.covariance);
  out.chi2 = e.chi2;
  out.dof = static_cast<std::uint32_t>(e.dof);
  copy(e.eigenvalues, out.eigenvalues);
  copy(e.weak_direction, out.weak_direction);
  out.position_sd = std::sqrt(e.covariance.topLeftCorner<3, 3>().trace());
  out.rotation_sd = std::sqrt(e.covariance.bottomRightCorner<3, 3>().trace());
  if (advice_.candidate >= 0) {
    out.advice_known = true;
    out.advised_move = toPose(inverse(X_HP) * advised_.X_HP);
    out.advised_force = toVector3(advised_.force);
    out.advised_eigenvalue = advice_.smallest_eigenvalue;
    if (std::isfinite(advice_.position_sd)) out.advised_position_sd = advice_.position_sd;
    if (std::isfinite(advice_.rotation_sd)) out.advised_rotation_sd = advice_.rotation_sd;
  }
  return out;
}

void TwinForceNode::publishPose() {
  const std::unique_lock<std::mutex> turn(services_, std::try_to_lock);
  if (!turn || !pose_known_) return;
  geometry_msgs::PoseWithCovarianceStamped message;
  Pose X_SC;
  Vector6 displacement = Vector6::Zero();
  {
    std::lock_guard<std::mutex> lock(mutex_);
    if (carrier_.empty()) return;
    message.header.stamp = carrier_.back()->header.stamp;
    X_SC = fromPose(carrier_.back()->pose, "carrier_pose");
    if (use_displacement_ && !d_.empty()) {
      const auto& d = *d_.back();
      if (finiteBlock(d.displacement, d.period)) {
        displacement = momentsOf(d.displacement.data(), d.displacement.size() / 6).mean;
      }
    }
  }
  message.header.frame_id = kHoleFrame;
  // the estimate, moved as the carrier has moved since; its covariance refers to the new place
  const TwinForceEstimate& e = contacts_->estimate();
  const Pose X_HP = contacts_->pegPose(X_SC, displacement);
  message.pose.pose = toPose(X_HP);
  Matrix6 shift = Matrix6::Identity();
  shift.topRightCorner<3, 3>() = -skew(X_HP.p - e.pose.p);
  const bool observable = e.null_count == 0;
  copy(observable ? Matrix6(shift * e.covariance * shift.transpose()) : coordinateCovariance(e),
       message.pose.covariance);
  pose_pub_.publish(message);
  tf_.sendTransform(transformStamped(kHoleFrame, "peg_estimated", X_HP, message.header.stamp));
}

}  // namespace assembly_cell::ros_bridge
