// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/ros/estimation/twin_force_node.h"

#include <geometry_msgs/PoseWithCovarianceStamped.h>
#include <std_srvs/Trigger.h>

#include "assembly_cell/AddContact.h"
#include "assembly_cell/BeginTwinForce.h"
#include "assembly_cell/TareTwinForce.h"
#include "assembly_cell/base/fields.h"
#include "assembly_cell/base/input_error.h"
#include "assembly_cell/base/text.h"
#include "assembly_cell/description/cell_description.h"
#include "assembly_cell/ros/bridge/conversions.h"
#include "assembly_cell/ros/bridge/parameters.h"
#include "assembly_cell/ros/estimation/twin_force_client.h"
#include "assembly_cell/ros/process/participants.h"

namespace assembly_cell::ros_bridge {

void fields(FieldList& f, TwinForceNodeSettings& s) {
  f.text("scenario", s.scenario,
         "Scenario file with the nominal parts of the mechanism; their poses are not used.")
      .required();
  f.number("smallest_p", s.smallest_p, {0.0, 0.5},
           "Contacts whose chi-square has a smaller probability are inconsistent.");
  f.number("prior_position_sd", s.prior_position_sd, positive("m"),
           "Sd of the nominal position, per axis.");
  f.number("prior_rotation_sd", s.prior_rotation_sd, positive("rad"),
           "Sd of the rotation from upright, per axis.");
  f.numbers("prior_position", s.prior_position.data(), 3, finite("m"),
            "Nominal position of the peg in the hole at the first contact.");
  f.flag("on_plane", s.on_plane,
         "All contacts lie in the plane of the hole, which determines the height.");
  TwinUncertainty& u = s.uncertainty;
  f.number("move_sd", u.move, positive("m"),
           "Sd of a move of the carrier, per axis, besides the scatter of the reported poses.");
  f.number("move_angle_sd", u.move_angle, positive("rad"),
           "Sd of a rotation of the carrier, besides the same scatter.");
  f.number(
      "gain_sd", u.gain, Range::kNotNegative,
      "Sd of each entry of E in w' = (I + E) w, torques at 30 mm, for a sensor whose calibration "
      "has no wrench_covariance.");
  f.number("frame_rotation_sd", u.rotation, notNegative("rad"),
           "Sd of the rotation of a sensor against its place in the files, per axis.");
  f.number("frame_offset_sd", u.offset, notNegative("m"),
           "Sd of the position of a sensor against its place in the files, per axis.");
  f.number("drift_sd", u.drift, notNegative("N/s"),
           "Sd of the steady drift of a zero, per axis, torques at 30 mm.");
  f.number("walk_sd", u.walk, notNegative("N/s^0.5"),
           "Sd of the random walk of a zero, per axis, torques at 30 mm.");
  TwinForceTask& t = s.task;
  f.number("required_position", t.required_position, positive("m"),
           "Sd of the position that is accurate enough for the status OK, per axis.");
  f.number("required_rotation", t.required_rotation, positive("rad"),
           "Sd of the rotation that is accurate enough, per axis.");
  f.number("contact_force", t.contact_force, positive("N"),
           "Force of the contacts that are advised.");
  f.number("contact_tilt", t.contact_tilt, {0.02, 0.14, "rad"},
           "Tilt of the peg against the plane in these contacts.");
  f.number("settled_force", t.settled_force, positive("N"),
           "A window whose halves differ by more is refused.");
  f.number("carrier_motion", s.carrier_motion, positive("m"),
           "A window is refused if the carrier moves farther meanwhile, beyond the scatter of its "
           "encoders.");
  f.number("window", s.window, {1e-3, 0.5 * TwinForceHistory::kLength, "s"},
           "Duration of a window of a call that names none.");
  TwinForceStreams::Settings& streams = s.streams;
  f.number("time_limit", streams.history.time_limit, {0.0, 0.02, "s"},
           "Wrenches of both sensors farther apart in time are not simultaneous.");
  f.number("data_timeout", streams.data_timeout, {0.01, 3600.0, "s"},
           "Longest wait for the samples of a window, wall clock.");
  f.number(
      "converter_step", streams.history.converter_step, notNegative("V"),
      "Step q of the converters of both sensors; q²/12 of each channel goes into the covariances.");
  f.flag("use_displacement", streams.history.use_displacement,
         "The pose is corrected by the deflection of the coupling, measured by sensor_b.");
  f.flag("lockstep", streams.lockstep, "Blocks are acknowledged.");
  f.text("name_in_lockstep", streams.name, "Name in the participants of the simulator.")
      .derived("its name relative to the cell");
}

TwinForceNode::TwinForceNode(ros::NodeHandle& nh, ros::NodeHandle& pnh) {
  TwinForceNodeSettings& s = settings_;
  s.streams.name = participantName(nh.getNamespace(), pnh.getNamespace());
  Parameters parameters(pnh);
  parameters.read(fieldsOf(s));
  TwinForceSetup setup;
  setup.mechanism =
      loadMechanism(s.scenario, parameters.texts("overrides", std::vector<std::string>{}));
  parameters.refuseUnknown();
  setup.options.smallest_p = s.smallest_p;
  setup.options.prior =
      nominalPrior({Eigen::Matrix3d::Identity(), Eigen::Vector3d::Map(s.prior_position.data())},
                   s.prior_position_sd, s.prior_rotation_sd);
  setup.on_plane = s.on_plane;
  setup.uncertainty = s.uncertainty;
  const CellDescription description = loadCellDescription(Parameters(nh).text("robot_description"));
  setup.X_AH = description.X_AH;
  setup.X_CP = description.X_BP;
  limits_.carrier_motion = s.carrier_motion;
  session_ = std::make_unique<TwinForceSession>(setup);
  begin(s.task, contactTask(s.task));

  pose_pub_ = nh.advertise<geometry_msgs::PoseWithCovarianceStamped>("pose", 10);
  state_pub_ = nh.advertise<TwinForceState>("twin_force/status", 10, true);
  streams_ = std::make_unique<TwinForceStreams>(nh, s.streams, [this] { publishPose(); });

  ros::NodeHandle service_nh(pnh);
  service_nh.setCallbackQueue(&service_queue_);
  using Trigger = std_srvs::Trigger;
  advertise<BeginTwinForce>(service_nh, "begin", [this](const auto& request, auto&) {
    const TwinForceTask task = fromMessage(request.task);
    if (!streams_->waitForCalibrations()) {
      throw InputError("no calibration of sensor_a or sensor_b: are their drivers running?");
    }
    const std::lock_guard<std::mutex> lock(mutex_);
    begin(task, request.task);
    state_pub_.publish(session_->state());
    return text("ready for %zu contacts", task.capacity);
  });
  const auto tare = [this](const BlockWindow& window) {
    return take(window, &TwinForceSession::tareAnswer, &TwinForceSession::tare);
  };
  advertise<Trigger>(service_nh, "tare", [tare](const auto&, auto&) { return tare({}); });
  advertise<TareTwinForce>(service_nh, "tare_window", [tare](const auto& request, auto&) {
    return tare({0.0, request.first, request.last, request.blocks});
  });
  advertise<AddContact>(service_nh, "add_contact", [this](const auto& request, auto& response) {
    const auto publish_state = [&](void*) {
      const std::lock_guard<std::mutex> lock(mutex_);
      response.status = session_->state();
      state_pub_.publish(response.status);
    };
    const std::unique_ptr<void, decltype(publish_state)> at_end(this, publish_state);
    return take({request.window, request.first, request.last, request.blocks},
                &TwinForceSession::addAnswer, &TwinForceSession::add);
  });
  advertise<Trigger>(service_nh, "reset", [this](const auto&, auto&) {
    const std::lock_guard<std::mutex> lock(mutex_);
    const std::size_t count = session_->contactCount();
    begin(settings_.task, contactTask(settings_.task));
    state_pub_.publish(session_->state());
    return text("%zu contacts and the zero forgotten", count);
  });
  services_.push_back(
      service_nh.advertiseService<SolveTwinForce::Request, SolveTwinForce::Response>(
          "solve", [this](SolveTwinForce::Request&, SolveTwinForce::Response& response) {
            {
              const std::lock_guard<std::mutex> lock(mutex_);
              session_->solve(response);
              state_pub_.publish(response.status);
            }
            publishPose();
            return true;
          }));
  state_pub_.publish(session_->state());
  service_spinner_.start();
}

template <class Service, class Call>
void TwinForceNode::advertise(ros::NodeHandle& pnh, const std::string& name, const Call& call) {
  using Request = typename Service::Request;
  using Response = typename Service::Response;
  services_.push_back(
      pnh.advertiseService<Request, Response>(name, [call](Request& request, Response& response) {
        try {
          response.message = call(request, response);
          response.success = true;
        } catch (const InputError& error) {
          response.message = error.what();
        }
        return true;
      }));
}

// With mutex_ locked, but in the constructor.
void TwinForceNode::begin(const TwinForceTask& task, const ContactTask& message) {
  if (streams_) session_->setGainCovariances(streams_->gainCovariances());
  session_->begin(task, message);
  limits_.settled_force = task.settled_force;
}

// Without mutex_: other calls don't wait for samples, which in lockstep arrive only after these
// calls are answered.
TwinForceStreams::Average TwinForceNode::average(BlockWindow window) {
  std::unique_lock<std::mutex> coming(coming_, std::defer_lock);
  if (!window.isNamed() && !coming.try_lock()) {
    throw InputError("another call waits for samples to come: call again once it has its answer");
  }
  AveragingLimits limits;
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    if (window.duration == 0.0) window.duration = settings_.window;
    limits = limits_;
  }
  return streams_->average(window, limits);
}

std::string TwinForceNode::take(
    const BlockWindow& window,
    std::optional<std::string> (TwinForceSession::*answer)(const BlockWindow&) const,
    std::string (TwinForceSession::*add)(const BlockWindow&, const TwinForceStreams::Average&)) {
  std::optional<TwinForceStreams::Average> averaged;
  while (true) {
    {
      const std::lock_guard<std::mutex> lock(mutex_);
      // known before, or taken meanwhile by a repeated call
      if (const auto known = (session_.get()->*answer)(window)) return *known;
      if (averaged) return (session_.get()->*add)(window, *averaged);
    }
    averaged = average(window);
  }
}

void TwinForceNode::publishPose() {
  const std::unique_lock<std::mutex> lock(mutex_, std::try_to_lock);
  if (!lock || !session_->hasPose()) return;
  const auto now = streams_->now();
  if (!now) return;
  geometry_msgs::PoseWithCovarianceStamped message;
  message.header.stamp = now->stamp;
  message.header.frame_id = kHoleFrame;
  const Pose X_HP = session_->pose(*now);
  message.pose.pose = toPose(X_HP);
  session_->setCovariance(X_HP, message.pose.covariance);
  pose_pub_.publish(message);
  tf_.sendTransform(transformStamped(kHoleFrame, "peg_estimated", X_HP, message.header.stamp));
}

}  // namespace assembly_cell::ros_bridge
