// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/ros/estimation/twin_force_node.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <utility>

#include "assembly_cell/base/input_error.h"
#include "assembly_cell/base/text.h"
#include "assembly_cell/description/cell_description.h"
#include "assembly_cell/ros/bridge/conversions.h"
#include "assembly_cell/ros/estimation/twin_force_client.h"
#include "assembly_cell/ros/process/lockstep.h"
#include "assembly_cell/twin_force/contacts_file.h"

namespace assembly_cell::ros_bridge {

namespace {

constexpr std::size_t kMaxContacts = 300;        // of a task: what the strategy asks for at most
constexpr double kUnknownVariance = 1e6;         // on the wire, for what no contact tells
constexpr double kConverterStep = 10.0 / 65536;  // 16 bit over ±5 V [V]
constexpr char kReversed[] = "one sensor reports the opposite sign: check its calibration";

template <class Array, class Source>
void copy(const Source& from, Array& to) {
  for (std::size_t i = 0; i < to.size(); ++i) {
    to[i] = std::isfinite(from.data()[i]) ? from.data()[i] : kUnknownVariance;
  }
}

double positive(double value, const char* name) {
  if (std::isfinite(value) && value > 0.0) return value;
  throw InputError(text("%s is %g: give a positive number", name, value));
}

TwinForceTask taskOf(const ContactTask& in) {
  TwinForceTask task;
  if (in.reference_known) task.reference = fromPose(in.reference, "reference");
  task.contact_force = positive(in.contact_force, "contact_force");
  task.contact_tilt = positive(in.contact_tilt, "contact_tilt");
  task.settled_force = positive(in.settled_force, "settled_force");
  task.required_position = positive(in.required_position, "required_position");
  task.required_rotation = positive(in.required_rotation, "required_rotation");
  task.capacity = in.capacity;
  if (task.capacity >= 2 && task.capacity <= kMaxContacts) return task;
  throw InputError(text("capacity is %zu: give 2 to %zu", task.capacity, kMaxContacts));
}

// Named, and the same blocks? A coming window is another one each time.
bool same(const TwinForceStreams::Window& one, const TwinForceStreams::Window& other) {
  return !one.last.isZero() && one.first == other.first && one.last == other.last &&
         one.blocks == other.blocks;
}

const char* nameOf(SignVerdict verdict) {
  return verdict == SignVerdict::kRight      ? "right"
         : verdict == SignVerdict::kReversed ? "reversed"
                                             : "undecided";
}

}  // namespace

TwinForceNode::TwinForceNode(ros::NodeHandle& nh, ros::NodeHandle& pnh) {
  Parameters parameters(pnh);
  TwinForceSetup setup = readSetup(parameters);
  const TwinForceStreams::Settings settings =
      readSettings(parameters, participantName(nh.getNamespace(), pnh.getNamespace()));
  parameters.refuseUnknown();
  const CellDescription description = loadCellDescription(Parameters(nh).text("robot_description"));
  setup.X_AH = description.X_AH;
  setup.X_CP = description.X_BP;
  contacts_ = std::make_unique<TwinForceContacts>(setup);
  begin(own_task_);

  pose_pub_ = nh.advertise<geometry_msgs::PoseWithCovarianceStamped>("pose", 10);
  status_pub_ = nh.advertise<TwinForceState>("twin_force/status", 10, true);
  streams_ = std::make_unique<TwinForceStreams>(nh, settings, [this] { publishPose(); });
  ros::NodeHandle service_nh(pnh);
  service_nh.setCallbackQueue(&service_queue_);
  begin_srv_ = service_nh.advertiseService("begin", &TwinForceNode::onBegin, this);
  tare_srv_ = service_nh.advertiseService("tare", &TwinForceNode::onTare, this);
  tare_window_srv_ = service_nh.advertiseService("tare_window", &TwinForceNode::onTareWindow, this);
  add_srv_ = service_nh.advertiseService("add_contact", &TwinForceNode::onAdd, this);
  reset_srv_ = service_nh.advertiseService("reset", &TwinForceNode::onReset, this);
  solve_srv_ = service_nh.advertiseService("solve", &TwinForceNode::onSolve, this);
  status_pub_.publish(status());
  service_spinner_.start();
}

TwinForceSetup TwinForceNode::readSetup(Parameters& parameters) {
  TwinForceSetup setup;
  setup.mechanism = loadMechanism(parameters.text("scenario"),
                                  parameters.texts("overrides", std::vector<std::string>{}));
  setup.options.smallest_p = parameters.number("smallest_p", {0.0, 0.5}, 1e-3);
  const double position_sd = parameters.number("prior_position_sd", kPositive, kNominalPositionSd);
  const double rotation_sd = parameters.number("prior_rotation_sd", kPositive, kNominalRotationSd);
  const auto prior = parameters.numbers("prior_position", 3, std::vector<double>{0, 0, 0});
  setup.options.prior =
      nominalPrior({Eigen::Matrix3d::Identity(), Eigen::Vector3d(prior[0], prior[1], prior[2])},
                   position_sd, rotation_sd);
  setup.on_plane = parameters.flag("on_plane", true);
  TwinUncertainty& u = setup.uncertainty;
  u.move = parameters.number("move_sd", kPositive, u.move);
  u.move_angle = parameters.number("move_angle_sd", kPositive, u.move_angle);
  u.gain = parameters.number("gain_sd", kNotNegative, u.gain);
  u.rotation = parameters.number("frame_rotation_sd", kNotNegative, u.rotation);
  u.offset = parameters.number("frame_offset_sd", kNotNegative, u.offset);
  u.drift = parameters.number("drift_sd", kNotNegative, u.drift);
  u.walk = parameters.number("walk_sd", kNotNegative, u.walk);

  TwinForceTask& t = own_task_;
  t.required_position = parameters.number("required_position", kPositive, t.required_position);
  t.required_rotation = parameters.number("required_rotation", kPositive, t.required_rotation);
  t.contact_force = parameters.number("contact_force", kPositive, t.contact_force);
  t.contact_tilt = parameters.number("contact_tilt", {0.02, 0.14}, t.contact_tilt);
  t.settled_force = parameters.number("settled_force", kPositive, t.settled_force);
  limits_.carrier_motion = parameters.number("carrier_motion", kPositive, 1e-5);
  window_ = parameters.number("window", {1e-3, 0.5 * TwinForceStreams::kHistory}, 0.2);
  return setup;
}

TwinForceStreams::Settings TwinForceNode::readSettings(Parameters& parameters,
                                                       const std::string& name) {
  TwinForceStreams::Settings settings;
  settings.time_limit = parameters.number("time_limit", {0.0, 0.02}, 1e-3);
  settings.data_timeout = parameters.number("data_timeout", {0.01, 3600.0}, 10.0);
  settings.converter_step = parameters.number("converter_step", kNotNegative, kConverterStep);
  settings.use_displacement = parameters.flag("use_displacement", true);
  settings.lockstep = parameters.flag("lockstep", false);
  settings.name = parameters.text("name_in_lockstep", name);
  return settings;
}

// ---- services ----

void TwinForceNode::begin(const TwinForceTask& task) {
  if (streams_) {
    const PerSide<Eigen::MatrixXd> gains = streams_->gainCovariances();
    contacts_->setGainCovariances(gains.a, gains.b);
  }
  contacts_->begin(task);
  limits_.settled_force = task.settled_force;
  told_ = contactTask(task);
  origins_.clear();
  free_.reset();
  pose_known_ = false;
  advised_.reset();
}

// Without services_: who waits for samples keeps nobody else waiting, in lockstep they come only
// once others have been answered.
TwinForceNode::Reading TwinForceNode::read(TwinForceStreams::Window window) {
  std::unique_lock<std::mutex> coming(coming_, std::defer_lock);
  if (window.last.isZero() && !coming.try_lock()) {
    throw InputError("another call waits for samples to come: call again once it has its answer");
  }
  AveragingLimits limits;
  {
    const std::lock_guard<std::mutex> turn(services_);
    if (window.duration == 0.0) window.duration = window_;
    limits = limits_;
  }
  return streams_->read(window, limits);
}

bool TwinForceNode::onBegin(BeginTwinForce::Request& request, BeginTwinForce::Response& response) {
  const std::lock_guard<std::mutex> turn(services_);
  try {
    const TwinForceTask task = taskOf(request.task);
    if (!streams_->waitForCalibrations()) {
      throw InputError("no calibration of sensor_a or sensor_b: are their drivers running?");
    }
    begin(task);
    told_ = request.task;
    response.success = true;
    response.message = text("ready for %zu contacts", task.capacity);
    status_pub_.publish(status());
  } catch (const InputError& error) {
    response.message = error.what();
  }
  return true;
}

std::pair<bool, std::string> TwinForceNode::tare(const TwinForceStreams::Window& window) {
  const auto taken = [this] {
    return text("zero from %d samples", free_->window.means().samples());
  };
  try {
    {
      const std::lock_guard<std::mutex> turn(services_);
      if (free_ && same(window, free_asked_)) return {true, taken()};
    }
    const Reading reading = read(window);
    const std::lock_guard<std::mutex> turn(services_);
    const WindowAnswer answer = contacts_->tare(reading.window);
    if (!answer.refusal.empty()) return {false, answer.refusal};
    free_ = reading;
    free_asked_ = window;
    return {true, taken()};
  } catch (const InputError& error) {
    return {false, error.what()};
  }
}

bool TwinForceNode::onTare(std_srvs::Trigger::Request&, std_srvs::Trigger::Response& response) {
  const auto [done, message] = tare({});
  response.success = done;
  response.message = message;
  return true;
}

bool TwinForceNode::onTareWindow(TareTwinForce::Request& request,
                                 TareTwinForce::Response& response) {
  const auto [done, message] = tare({0.0, request.first, request.last, request.blocks});
  response.success = done;
  response.message = message;
  return true;
}

std::vector<TwinForceNode::Origin>::const_iterator TwinForceNode::known(
    const TwinForceStreams::Window& window) const {
  return std::find_if(origins_.begin(), origins_.end(), [&](const Origin& origin) {
    const bool same_zero = origin.free && free_ ? origin.free->first == free_->first &&
                                                      origin.free->last == free_->last
                                                : !origin.free && !free_;
    return same_zero && same(origin.asked, window);
  });
}

std::vector<TwinForceNode::Origin>::const_iterator TwinForceNode::add(
    const TwinForceStreams::Window& window, const Reading& reading) {
  const WindowAnswer answer = contacts_->add(reading.window);
  if (!answer.refusal.empty()) throw InputError(answer.refusal + ": call ~reset first");
  std::string message = text("contact %zu: %.2f N", origins_.size(), answer.force);
  if (answer.signs_reversed) {
    message += std::string("; ") + kReversed;
    ROS_ERROR("twin force: %s", kReversed);
  }
  origins_.push_back({reading, free_, window, std::move(message)});
  return std::prev(origins_.end());
}

std::string TwinForceNode::keep(const TwinForceStreams::Window& window) {
  std::optional<Reading> reading;
  while (true) {
    {
      const std::lock_guard<std::mutex> turn(services_);
      const auto origin = known(window);
      if (origin != origins_.end()) return origin->message;
      // nor has a call that was said again meanwhile kept it
      if (reading) return add(window, *reading)->message;
    }
    reading = read(window);
  }
}

bool TwinForceNode::onAdd(AddContact::Request& request, AddContact::Response& response) {
  try {
    response.message = keep({request.window, request.first, request.last, request.blocks});
    response.success = true;
  } catch (const InputError& error) {
    response.message = error.what();
  }
  const std::lock_guard<std::mutex> turn(services_);
  response.status = status();
  status_pub_.publish(response.status);
  return true;
}

bool TwinForceNode::onReset(std_srvs::Trigger::Request&, std_srvs::Trigger::Response& response) {
  const std::lock_guard<std::mutex> turn(services_);
  response.success = true;
  response.message = text("%zu contacts and the zero forgotten", origins_.size());
  begin(own_task_);
  status_pub_.publish(status());
  return true;
}

bool TwinForceNode::onSolve(SolveTwinForce::Request&, SolveTwinForce::Response& response) {
  {
    const std::lock_guard<std::mutex> turn(services_);
    pose_known_ = false;
    advised_.reset();
    try {
      const TwinForceSolution solution = contacts_->solve();
      response.message = toString(solution.status);
      if (!solution.reason.empty()) response.message += ": " + solution.reason;
      if (contacts_->signs() == SignVerdict::kReversed) {
        response.message = kReversed;
      } else if (hasPose(solution.status)) {
        pose_known_ = true;
        advised_ = contacts_->advise();
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
    file.errors = contacts_->options().errors;
    response.contacts = contactsYaml(file);
    status_pub_.publish(response.status);
  }
  publishPose();
  return true;
}

// ---- what goes out ----

FeltContact TwinForceNode::feltContact(std::size_t i) const {
  const TwinContact& c = contacts_->contacts()[i];
  const Reading& pressed = origins_[i].pressed;
  FeltContact out;
  out.stamp = pressed.middle;
  copy(c.wrench_a, out.wrench_a);
  copy(c.wrench_b, out.wrench_b);
  copy(c.covariance_a, out.covariance_a);
  copy(c.covariance_b, out.covariance_b);
  out.move = toPose(c.move);
  if (c.move_covariance) copy(*c.move_covariance, out.move_covariance);
  copy(pressed.window.means().displacement(), out.deflection);
  out.samples = static_cast<std::uint32_t>(pressed.window.means().samples());
  out.time_difference = pressed.time_difference;
  out.window = {pressed.first, pressed.last};
  out.blocks = static_cast<std::uint32_t>(pressed.window.blocks());
  if (const auto& free = origins_[i].free) {
    out.zero_window = {free->first, free->last};
    out.zero_blocks = static_cast<std::uint32_t>(free->window.blocks());
  }
  return out;
}

TwinForceState TwinForceNode::status() const {
  TwinForceState out;
  out.header.frame_id = kHoleFrame;
  out.task = told_;
  const TwinForceEstimate& e = contacts_->estimate();
  out.status = toString(e.status);
  out.reason = e.reason;
  out.signs = nameOf(contacts_->signs());
  for (std::size_t i = 0; i < origins_.size(); ++i) {
    out.contacts.push_back(feltContact(i));
    out.header.stamp = out.contacts.back().stamp;
  }
  for (auto* pose :
       {&out.pose.pose, &out.advised_move, &out.reference_pose.pose, &out.advised_pose}) {
    pose->orientation.w = 1.0;
  }
  if (pose_known_) tellPose(out);
  return out;
}

void TwinForceNode::tellPose(TwinForceState& out) const {
  const TwinForceEstimate& e = contacts_->estimate();
  out.pose_known = true;
  for (const int i : e.rejected) out.rejected.push_back(static_cast<std::uint32_t>(i));
  const AveragingWindow& last = origins_.back().pressed.window;
  const Pose X_HP =
      contacts_->pegPose(contacts_->carrierPose(last.carrier()), last.means().displacement());
  out.pose.pose = toPose(X_HP);
  copy(coordinateCovariance(e), out.pose.covariance);
  out.reference_pose.pose = toPose(e.pose);
  copy(e.covariance, out.reference_pose.covariance);
  out.chi2 = e.chi2;
  out.dof = static_cast<std::uint32_t>(e.dof);
  copy(e.eigenvalues, out.eigenvalues);
  copy(e.weak_direction, out.weak_direction);
  out.position_sd = std::sqrt(e.covariance.topLeftCorner<3, 3>().trace());
  out.rotation_sd = std::sqrt(e.covariance.bottomRightCorner<3, 3>().trace());
  if (!advised_) return;
  out.advice_known = true;
  out.advised_move = toPose(inverse(X_HP) * advised_->X_HP);
  out.advised_pose = toPose(advised_->X_HP);
  out.advised_force = toVector3(advised_->force);
  out.advised_eigenvalue = advised_->smallest_eigenvalue;
  if (std::isfinite(advised_->position_sd)) out.advised_position_sd = advised_->position_sd;
  if (std::isfinite(advised_->rotation_sd)) out.advised_rotation_sd = advised_->rotation_sd;
}

void TwinForceNode::publishPose() {
  const std::unique_lock<std::mutex> turn(services_, std::try_to_lock);
  if (!turn || !pose_known_) return;
  const auto now = streams_->now();
  if (!now) return;
  geometry_msgs::PoseWithCovarianceStamped message;
  message.header.stamp = now->stamp;
  message.header.frame_id = kHoleFrame;
  // the estimate, moved as the carrier has moved since; its covariance refers to the new place
  const TwinForceEstimate& e = contacts_->estimate();
  const Pose X_HP = contacts_->pegPose(contacts_->carrierPose(now->carrier), now->displacement);
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
