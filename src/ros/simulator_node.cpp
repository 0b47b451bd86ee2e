// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/ros/simulator_node.h"

#include <diagnostic_msgs/DiagnosticArray.h>
#include <rosgraph_msgs/Clock.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include "assembly_cell/ContactArray.h"
#include "assembly_cell/base/input_error.h"
#include "assembly_cell/cell/start.h"
#include "assembly_cell/ros/conversions.h"
#include "assembly_cell/ros/parameters.h"
#include "assembly_cell/scene/part_pairs.h"

namespace assembly_cell::ros_bridge {

namespace {

constexpr int kQueue = 100;                          // wherever every sample counts
constexpr std::chrono::seconds kConnectionCheck{5};  // wall clock

std::int64_t nanoseconds(double seconds) {
  return static_cast<std::int64_t>(std::llround(seconds * 1e9));
}

double seconds(std::chrono::steady_clock::duration duration) {
  return std::chrono::duration<double>(duration).count();
}

StrainSamples strainMessage(const StrainBlock& block, const std::vector<double>& volts,
                            const std::vector<std::uint8_t>& saturated) {
  StrainSamples message;
  message.period = block.period;
  message.volts = volts;
  message.saturated = saturated;
  message.temperature = Bridge{}.temperature;
  return message;
}

std::string describe(const Eigen::Vector3d& p) {
  return "(" + std::to_string(p.x()) + ", " + std::to_string(p.y()) + ", " + std::to_string(p.z()) +
         ") m";
}

diagnostic_msgs::KeyValue keyValue(const std::string& key, const std::string& value) {
  diagnostic_msgs::KeyValue entry;
  entry.key = key;
  entry.value = value;
  return entry;
}

}  // namespace

SimulatorNode::SimulatorNode(ros::NodeHandle& nh, ros::NodeHandle& pnh) : nh_(nh) {
  // all parameters are read and checked here
  Parameters parameters(pnh);
  const std::string file = parameters.text("scenario");
  const auto overrides = parameters.texts("overrides", std::vector<std::string>{});
  cell_parameters_.seed = static_cast<std::uint64_t>(parameters.integer("seed", 0, 2147483647, 1));
  cell_parameters_.bits = parameters.integer("bits", 10, 24, 16);
  cell_parameters_.noise = parameters.number("noise", Range{0.0, 1.0}, 0.5e-3);
  cell_parameters_.accelerometer_noise =
      parameters.number("accelerometer_noise", Range{0.0, 1e3}, 0.02);
  cell_parameters_.accelerometer_height =
      parameters.number("accelerometer_height", Range{-1.0, 1.0}, 0.0);
  publish_truth_ = parameters.flag("publish_truth", true);
  bool use_sim_time = false;
  ros::param::get("/use_sim_time", use_sim_time);
  lockstep_ = parameters.flag("lockstep", use_sim_time);
  const auto names = parameters.texts("participants", std::vector<std::string>{});
  ack_timeout_ = parameters.number("ack_timeout", Range{0.1, 3600.0}, 10.0);
  start_timeout_ = parameters.number("start_timeout", Range{0.1, 3600.0}, 60.0);
  paused_ = parameters.flag("paused", false);
  real_time_factor_ = parameters.number("real_time_factor", Range{1e-3, 1e3}, 1.0);
  max_offset_ = parameters.number("max_offset", kPositive, 0.1);
  max_rotation_ = parameters.number("max_rotation", Range{0.0, 1.0}, 0.35);
  parameters.refuseUnknown();
  if (use_sim_time && !lockstep_) {
    throw InputError("parameter " + pnh.resolveName("lockstep") +
                     " is false while /use_sim_time is true: nobody would publish /clock, set both "
                     "or neither");
  }

  // the cell: the mechanism of the scenario, which must be the one of the robot description
  scenario_ = loadScenario(file, overrides);
  X_HB_ = carrierBase(scenario_);
  description_ = loadCellDescription(Parameters(nh).text("robot_description"));
  checkAgainst(description_, scenario_.mechanism, scenario_.name);
  pairParts();
  cell_parameters_.X_AH = description_.X_AH;
  cell_parameters_.hole_block_mass = description_.hole_block_mass;
  cell_parameters_.hole_block_center = description_.hole_block_centre;
  cell_ = std::make_unique<SimulatedCell>(scenario_, cell_parameters_);
  if (lockstep_) {
    for (const auto& name : names) participants_[name];
  }
  epoch_ = lockstep_ ? ros::Time(1, 0) : ros::Time::now();
  figures_start_ = std::chrono::steady_clock::now();

  // latched, so that a participant that connects late doesn't miss the first block
  bridge_a_pub_ = nh.advertise<StrainSamples>("sensor_a/bridge", kQueue, true);
  bridge_b_pub_ = nh.advertise<StrainSamples>("sensor_b/bridge", kQueue, true);
  accelerometers_pub_ = nh.advertise<AccelerometerSamples>("accelerometers", kQueue);
  carrier_pub_ = nh.advertise<geometry_msgs::PoseStamped>("carrier_pose", kQueue, true);
  diagnostics_pub_ = nh.advertise<diagnostic_msgs::DiagnosticArray>("/diagnostics", 10);
  if (lockstep_) clock_pub_ = nh.advertise<rosgraph_msgs::Clock>("/clock", 10, true);
  if (publish_truth_) {
    truth_pose_pub_ = nh.advertise<geometry_msgs::PoseStamped>("truth/pose", 10, true);
    truth_contacts_pub_ = nh.advertise<ContactArray>("truth/contacts", 10);
  }
  publishStaticFrames();

  const auto hints = ros::TransportHints().tcpNoDelay();
  command_sub_ = nh.subscribe<geometry_msgs::PoseStamped>(
      "carrier_command", kQueue,
      boost::function<void(const ros::MessageEvent<geometry_msgs::PoseStamped const>&)>(
          [this](const auto& event) { onCarrierCommand(event); }),
      ros::VoidConstPtr(), hints);
  exciter_sub_ =
      nh.subscribe<Exciter>("exciter", kQueue,
                            boost::function<void(const ros::MessageEvent<Exciter const>&)>(
                                [this](const auto& event) { onExciter(event); }),
                            ros::VoidConstPtr(), hints);
  if (lockstep_) subscribeToAcks();
  pause_srv_ = pnh.advertiseService("pause", &SimulatorNode::onPause, this);
  step_srv_ = pnh.advertiseService("step", &SimulatorNode::onStep, this);
  reset_srv_ = pnh.advertiseService("reset", &SimulatorNode::onReset, this);
  set_state_srv_ = pnh.advertiseService("set_state", &SimulatorNode::onSetState, this);
  diagnostics_timer_ = nh.createWallTimer(
      ros::WallDuration(1.0), [this](const ros::WallTimerEvent&) { publishDiagnostics(); });

  ROS_INFO("%s: scenario %s, %s, %zu participants", pnh.getNamespace().c_str(), file.c_str(),
           lockstep_ ? "lockstep" : "paced by the wall clock", participants_.size());
  thread_ = std::thread([this] { loop(); });
}

// Parts that can't meet while the carrier keeps to ~max_offset and to the tilts of an alignment are
// never searched for contact.
void SimulatorNode::pairParts() {
  CarrierTravel travel;
  travel.lateral = max_offset_;
  bool peg_meets_hole = false;
  for (const PartPair& pair : canMeet(description_, travel)) {
    if (pair == PartPair{"peg", "hole"}) {
      peg_meets_hole = true;
    } else {
      ROS_WARN_NAMED("simulator",
                     "%s and %s can meet, but only peg and hole are searched for contact",
                     pair.first.c_str(), pair.second.c_str());
    }
  }
  if (!peg_meets_hole) {
    ROS_INFO_NAMED("simulator", "peg and hole can't meet: no contact search");
    scenario_.contact.law = ContactLaw::kNone;
  }
}

SimulatorNode::~SimulatorNode() {
  {
    std::lock_guard<std::mutex> lock(mutex_);
    quit_ = true;
  }
  changed_.notify_all();
  thread_.join();
}

// ---- the loop ----

void SimulatorNode::loop() {
  publishState();
  while (true) {
    std::deque<std::packaged_task<void()>> tasks;
    {
      std::unique_lock<std::mutex> lock(mutex_);
      changed_.wait(lock, [this] {
        return quit_ || !tasks_.empty() || (stopped_.empty() && (!paused_ || steps_ > 0));
      });
      if (quit_) {
        tasks_.clear();
        return;
      }
      tasks.swap(tasks_);
    }
    if (tasks.empty()) {
      stepBlock();
    } else {
      for (auto& task : tasks) task();
      pace_time_ = -1.0;
    }
  }
}

void SimulatorNode::stepBlock() {
  applyCommands();
  const StopReason reason = cell_->next(block_, accelerometers_pub_.getNumSubscribers() > 0);
  const std::uint32_t sequence = sequence_;
  if (reason == StopReason::kOk) {
    publishBlock();
    publishState();
    ++sequence_;
    if (lockstep_) {
      waitForAcks(sequence);
    } else {
      pace();
    }
  } else {
    ROS_ERROR("simulation stopped at %.6f s: %s; call ~reset to start anew",
              cell_->simulation().time(), toString(reason));
  }
  std::lock_guard<std::mutex> lock(mutex_);
  if (reason != StopReason::kOk) stopped_ = toString(reason);
  if (steps_ > 0) --steps_;
  changed_.notify_all();
}

void SimulatorNode::applyCommands() {
  std::optional<Pose> command;
  std::optional<Exciter> exciter;
  {
    std::lock_guard<std::mutex> lock(mutex_);
    command.swap(carrier_command_);
    exciter.swap(exciter_);
  }
  Simulation& simulation = cell_->simulation();
  if (command) simulation.setRestTarget(restFromPose(X_HB_ * *command));
  if (exciter) {
    ExciterParameters drive;
    drive.amplitude = exciter->on ? exciter->amplitude : 0.0;
    drive.frequency = exciter->frequency;
    drive.phase = exciter->phase;
    drive.direction = exciter->direction;
    // no stamp: from the coming block's start
    double t_ref = simulation.time();
    if (!exciter->header.stamp.isZero()) t_ref = (exciter->header.stamp - epoch_).toSec() - base_;
    simulation.setExciter(drive, t_ref);
  }
}

void SimulatorNode::restart(const Scenario& scenario) {
  auto cell = std::make_unique<SimulatedCell>(scenario, cell_parameters_);
  // the clock goes on
  base_ += cell_->simulation().time();
  cell_ = std::move(cell);
  {
    std::lock_guard<std::mutex> lock(mutex_);
    carrier_command_.reset();
    exciter_.reset();
    stopped_.clear();
  }
  publishState();
}

void SimulatorNode::subscribeToAcks() {
  ack_sub_.shutdown();
  ack_sub_ = nh_.subscribe<Ack>("ack", kQueue,
                                boost::function<void(const ros::MessageEvent<Ack const>&)>(
                                    [this](const auto& event) { onAck(event); }),
                                ros::VoidConstPtr(), ros::TransportHints().tcpNoDelay());
}

void SimulatorNode::waitForAcks(std::uint32_t sequence) {
  std::unique_lock<std::mutex> lock(mutex_);
  const auto missing = [this, sequence] {
    std::string list;
    for (const auto& [name, participant] : participants_) {
      // answered for this block, and all it had sent before has come in
      const auto sender = senders_.find(participant.publisher);
      const std::uint32_t received = sender == senders_.end() ? 0 : sender->second.commands;
      if (participant.answered && participant.sequence >= sequence &&
          received >= participant.commands) {
        continue;
      }
      list += (list.empty() ? "" : ", ") + name;
      if (!participant.answered) {
        list += " (never answered)";
      } else if (participant.sequence >= sequence) {
        list += " (commands lost)";
      }
    }
    return list;
  };
  bool first = false;
  for (const auto& entry : participants_) first |= !entry.second.answered;
  const double timeout = first ? start_timeout_ : ack_timeout_;
  const auto deadline =
      std::chrono::steady_clock::now() + std::chrono::nanoseconds(nanoseconds(timeout));
  const auto answered = [&] { return quit_ || missing().empty(); };
  while (true) {
    const auto check = std::chrono::steady_clock::now() + kConnectionCheck;
    if (changed_.wait_until(lock, std::min(check, deadline), answered)) return;
    if (std::chrono::steady_clock::now() >= deadline) break;
    // a connection that was never made isn't tried again by ROS: answers are latched, ask anew
    lock.unlock();
    subscribeToAcks();
    lock.lock();
  }
  ROS_FATAL(
      "no answer to block %u within %g s of wall time from %s: is it running, with ~lockstep?",
      sequence, timeout, missing().c_str());
  exit_code_ = 1;
  quit_ = true;
  ros::requestShutdown();
}

void SimulatorNode::pace() {
  const auto now = std::chrono::steady_clock::now();
  if (pace_time_ < 0.0) {
    pace_start_ = now;
    pace_time_ = now_;
  }
  const double ahead = (now_ - pace_time_) / real_time_factor_ - seconds(now - pace_start_);
  if (ahead < -1.0) {
    ROS_WARN_THROTTLE(10.0, "simulation is %.1f s behind the wall clock: lower ~real_time_factor",
                      -ahead);
    pace_time_ = -1.0;
  } else if (ahead > 0.0) {
    std::unique_lock<std::mutex> lock(mutex_);
    changed_.wait_for(lock, std::chrono::nanoseconds(nanoseconds(ahead)), [this] { return quit_; });
  }
}

ros::Time SimulatorNode::stampAt(double cell_time) const {
  ros::Time stamp;
  stamp.fromNSec(epoch_.toNSec() + static_cast<std::uint64_t>(nanoseconds(base_ + cell_time)));
  return stamp;
}

// ---- what goes out ----

void SimulatorNode::publishBlock() {
  StrainSamples a = strainMessage(block_, block_.volts_a, block_.saturated_a);
  StrainSamples b = strainMessage(block_, block_.volts_b, block_.saturated_b);
  a.header.stamp = b.header.stamp = stampAt(block_.time);
  a.header.frame_id = "sensor_a";
  b.header.frame_id = "sensor_b";
  a.sequence = b.sequence = sequence_;
  bridge_a_pub_.publish(a);
  bridge_b_pub_.publish(b);
  if (!block_.accelerations.empty()) {
    AccelerometerSamples felt;
    felt.header = b.header;
    felt.header.frame_id = "peg";
    felt.period = b.period;
    felt.sequence = sequence_;
    felt.acceleration = block_.accelerations;
    accelerometers_pub_.publish(felt);
  }

  geometry_msgs::PoseStamped carrier;
  carrier.header.stamp = stampAt(cell_->simulation().time());
  carrier.header.frame_id = kCarrierBaseFrame;
  carrier.pose = toPose(inverse(X_HB_) * cell_->simulation().carrierPose());
  carrier_pub_.publish(carrier);
}

// Where a person believes the carrier to be: upright over the hole's middle. Where it is belongs to
// the truth.
void SimulatorNode::publishStaticFrames() {
  const Pose X_HB{Eigen::Matrix3d::Identity(), Eigen::Vector3d(0.0, 0.0, scenario_.rest.z)};
  std::vector<geometry_msgs::TransformStamped> frames = {transformStamped(
      kWorldFrame, kCarrierBaseFrame, description_.X_WA * description_.X_AH * X_HB, epoch_)};
  if (publish_truth_) {
    frames.push_back(transformStamped(kCarrierBaseFrame, kHoleTruthFrame, inverse(X_HB_), epoch_));
  }
  static_tf_.sendTransform(frames);
}

void SimulatorNode::publishState() {
  Simulation& simulation = cell_->simulation();
  const ros::Time stamp = stampAt(simulation.time());
  now_ = base_ + simulation.time();

  tf_.sendTransform(transformStamped(kCarrierBaseFrame, kCarrierFrame,
                                     inverse(X_HB_) * simulation.carrierPose(), stamp));

  if (publish_truth_) {
    const Pose X_HP = simulation.pegPose();
    geometry_msgs::PoseStamped peg;
    peg.header.stamp = stamp;
    peg.header.frame_id = kHoleTruthFrame;
    peg.pose = toPose(X_HP);
    truth_pose_pub_.publish(peg);
    tf_.sendTransform(transformStamped(kHoleTruthFrame, kPegTruthFrame, X_HP, stamp));
  }
  if (publish_truth_ && truth_contacts_pub_.getNumSubscribers() > 0) {
    ContactArray contacts;
    contacts.header.stamp = stamp;
    contacts.header.frame_id = kHoleTruthFrame;
    for (const auto& report : simulation.contacts()) {
      if (!report.valid || !report.force.allFinite() || !report.normal.allFinite()) continue;
      Contact contact;
      contact.feature = report.feature;
      contact.position = toPoint(report.point);
      contact.normal = toVector3(report.normal);
      contact.force = toVector3(report.force);
      contact.gap = report.gap;
      contact.state = report.state;
      contacts.contacts.push_back(contact);
    }
    truth_contacts_pub_.publish(contacts);
  }
  if (lockstep_) {
    rosgraph_msgs::Clock clock;
    clock.clock = stamp;
    clock_pub_.publish(clock);
  }
}

void SimulatorNode::publishDiagnostics() {
  const auto now = std::chrono::steady_clock::now();
  const double time = now_;
  const double wall = seconds(now - figures_start_);
  const double factor = wall > 0.0 ? (time - figures_time_) / wall : 0.0;
  figures_start_ = now;
  figures_time_ = time;

  diagnostic_msgs::DiagnosticStatus status;
  status.name = ros::this_node::getName().substr(1) + ": simulation";
  status.hardware_id = "simulation";
  status.level = diagnostic_msgs::DiagnosticStatus::OK;
  {
    std::lock_guard<std::mutex> lock(mutex_);
    status.message = paused_ ? "paused" : "running";
    if (!stopped_.empty()) {
      status.level = diagnostic_msgs::DiagnosticStatus::ERROR;
      status.message = "stopped: " + stopped_;
    }
  }
  status.values.push_back(keyValue("Simulated time [s]", std::to_string(time)));
  status.values.push_back(keyValue("Real-time factor", std::to_string(factor)));
  status.values.push_back(keyValue("Commands refused", std::to_string(refused_)));
  diagnostic_msgs::DiagnosticArray array;
  array.header.stamp = ros::Time::now();
  array.status.push_back(status);
  diagnostics_pub_.publish(array);
}

// ---- what comes in ----

bool SimulatorNode::countCommand(const std::string& publisher, const std::string& topic,
                                 const std_msgs::Header& header) {
  Sender& sender = senders_[publisher];
  const std::pair<std::uint32_t, ros::Time> mark(header.seq, header.stamp);
  const auto last = sender.last.find(topic);
  if (last != sender.last.end() && last->second == mark) return false;
  sender.last[topic] = mark;
  ++sender.commands;
  return true;
}

std::optional<std::string> SimulatorNode::refusal(const geometry_msgs::PoseStamped& command) const {
  if (command.header.frame_id != kCarrierBaseFrame) {
    return "frame_id is \"" + command.header.frame_id + "\": give " + kCarrierBaseFrame;
  }
  Pose X;
  try {
    X = fromPose(command.pose, "pose");
  } catch (const InputError& error) {
    return error.what();
  }
  // far from the scenario's rest pose is a mistake of unit or frame
  const Pose start = inverse(X_HB_) * poseFromRest(scenario_.rest);
  if ((X.p - start.p).norm() > max_offset_) {
    return "position " + describe(X.p) + " is more than " + std::to_string(max_offset_) +
           " m from the scenario's rest position " + describe(start.p) + ": see ~max_offset";
  }
  const double angle = Eigen::AngleAxisd(start.R.transpose() * X.R).angle();
  if (angle > max_rotation_) {
    return "orientation is " + std::to_string(angle) + " rad, more than " +
           std::to_string(max_rotation_) + " rad, from the scenario's rest: see ~max_rotation";
  }
  return std::nullopt;
}

void SimulatorNode::onCarrierCommand(
    const ros::MessageEvent<geometry_msgs::PoseStamped const>& event) {
  const geometry_msgs::PoseStamped& command = *event.getConstMessage();
  const auto why = refusal(command);
  if (why) {
    ++refused_;
    ROS_WARN("carrier_command of %s refused: %s", event.getPublisherName().c_str(), why->c_str());
  }
  std::lock_guard<std::mutex> lock(mutex_);
  const bool fresh = countCommand(event.getPublisherName(), "carrier_command", command.header);
  if (fresh && !why) carrier_command_ = fromPose(command.pose, "pose");
  changed_.notify_all();
}

void SimulatorNode::onExciter(const ros::MessageEvent<Exciter const>& event) {
  const Exciter& exciter = *event.getConstMessage();
  const bool good = std::isfinite(exciter.amplitude) && exciter.amplitude >= 0.0 &&
                    std::isfinite(exciter.frequency) && exciter.frequency >= 0.0 &&
                    std::isfinite(exciter.phase) && std::abs(exciter.direction) == 1;
  if (!good) {
    ++refused_;
    ROS_WARN(
        "exciter of %s refused: amplitude %g, frequency %g, phase %g, direction %d: give finite "
        "numbers, amplitude and frequency not negative, direction 1 or -1",
        event.getPublisherName().c_str(), exciter.amplitude, exciter.frequency, exciter.phase,
        exciter.direction);
  }
  std::lock_guard<std::mutex> lock(mutex_);
  const bool fresh = countCommand(event.getPublisherName(), "exciter", exciter.header);
  if (fresh && good) exciter_ = exciter;
  changed_.notify_all();
}

void SimulatorNode::onAck(const ros::MessageEvent<Ack const>& event) {
  const Ack& ack = *event.getConstMessage();
  std::lock_guard<std::mutex> lock(mutex_);
  const auto found = participants_.find(ack.node);
  if (found == participants_.end()) {
    ROS_WARN_ONCE("ack of %s, which is not in ~participants", ack.node.c_str());
    return;
  }
  found->second = {true, ack.sequence, ack.commands, event.getPublisherName()};
  changed_.notify_all();
}

// ---- services ----

void SimulatorNode::betweenBlocks(const std::function<void()>& task) {
  std::future<void> done;
  {
    std::lock_guard<std::mutex> lock(mutex_);
    if (quit_) throw InputError("the simulator is shutting down");
    tasks_.emplace_back(task);
    done = tasks_.back().get_future();
  }
  changed_.notify_all();
  // bounded: the loop waits for participants at most ~ack_timeout, then drops its tasks
  done.get();
}

bool SimulatorNode::onPause(std_srvs::SetBool::Request& request,
                            std_srvs::SetBool::Response& response) {
  try {
    betweenBlocks([this, &request] {
      std::lock_guard<std::mutex> lock(mutex_);
      paused_ = request.data;
    });
    response.success = true;
    response.message =
        std::string(request.data ? "paused" : "running") + " at " + std::to_string(now_) + " s";
  } catch (const std::exception& error) {
    response.message = error.what();
  }
  return true;
}

bool SimulatorNode::onStep(Step::Request& request, Step::Response& response) {
  std::unique_lock<std::mutex> lock(mutex_);
  if (!paused_) {
    response.message = "not paused: call ~pause with data: true first";
  } else if (request.blocks == 0) {
    response.message = "blocks is 0: give the number of blocks to advance";
  } else if (!stopped_.empty()) {
    response.message = "the simulation has stopped (" + stopped_ + "): call ~reset first";
  } else if (steps_ > 0) {
    response.message = "another ~step is under way";
  } else {
    steps_ = request.blocks;
    changed_.notify_all();
    const auto done = [this] { return quit_ || steps_ == 0 || !stopped_.empty(); };
    while (ros::ok() && !done()) changed_.wait_for(lock, std::chrono::milliseconds(100), done);
    response.success = steps_ == 0 && stopped_.empty();
    response.message = "at " + std::to_string(now_) + " s";
    if (!stopped_.empty()) response.message += ", stopped: " + stopped_;
    steps_ = 0;
  }
  return true;
}

bool SimulatorNode::onReset(std_srvs::Trigger::Request&, std_srvs::Trigger::Response& response) {
  try {
    betweenBlocks([this] { restart(scenario_); });
    response.success = true;
    response.message =
        "at the scenario's start, the clock goes on at " + std::to_string(now_) + " s";
  } catch (const std::exception& error) {
    response.message = error.what();
  }
  return true;
}

bool SimulatorNode::onSetState(SetState::Request& request, SetState::Response& response) {
  try {
    // the scenario with another start, at rest
    Scenario scenario = scenario_;
    const Pose X_HP = fromPose(request.peg, "peg");
    scenario.rest = restFromPose(fromPose(request.carrier, "carrier"));
    scenario.initial = InitialState{};
    scenario.initial.position = X_HP.p + scenario.mechanism.peg.half_height * X_HP.R.col(2);
    scenario.initial.euler = eulerFromRotation(X_HP.R);
    scenario.initial.carrier_x = scenario.rest.x;
    scenario.initial.carrier_y = scenario.rest.y;
    scenario.initial.carrier_yaw = scenario.rest.yaw;
    betweenBlocks([this, &scenario] { restart(scenario); });
    response.success = true;
    response.message = "state set at " + std::to_string(now_) + " s";
  } catch (const std::exception& error) {
    response.message = error.what();
  }
  return true;
}

}  // namespace assembly_cell::ros_bridge
