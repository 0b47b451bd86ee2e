// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/ros/simulation/simulator_node.h"

#include <diagnostic_msgs/DiagnosticArray.h>
#include <rosgraph_msgs/Clock.h>
#include <std_msgs/String.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include "assembly_cell/ContactArray.h"
#include "assembly_cell/base/input_error.h"
#include "assembly_cell/base/text.h"
#include "assembly_cell/cell/start.h"
#include "assembly_cell/description/part_pairs.h"
#include "assembly_cell/mismatch/mismatch.h"
#include "assembly_cell/ros/bridge/conversions.h"
#include "assembly_cell/ros/bridge/diagnostics.h"
#include "assembly_cell/ros/bridge/message_guard.h"
#include "assembly_cell/ros/bridge/parameters.h"
#include "assembly_cell/ros/bridge/publish_shared.h"
#include "assembly_cell/sensor/bridge.h"

namespace assembly_cell::ros_bridge {

namespace {

// A report looks for the truth at a certain time; a lockstep of short blocks doesn't wait for it.
constexpr int kTruthQueue = 5000;

std::int64_t nanoseconds(double seconds) {
  return static_cast<std::int64_t>(std::llround(seconds * 1e9));
}

void checkCarrier(const CarrierParameters& carrier, double max_speed, double max_acceleration) {
  if (carrier.max_speed > max_speed) {
    throw InputError(text("scenario: carrier.max_speed: %g m/s, ~max_speed allows %g m/s",
                          carrier.max_speed, max_speed));
  }
  if (carrier.max_acceleration > max_acceleration) {
    throw InputError(
        text("scenario: carrier.max_acceleration: %g m/s2, ~max_acceleration allows "
             "%g m/s2",
             carrier.max_acceleration, max_acceleration));
  }
}

double seconds(std::chrono::steady_clock::duration duration) {
  return std::chrono::duration<double>(duration).count();
}

}  // namespace

SimulatorNode::SimulatorNode(ros::NodeHandle& nh, ros::NodeHandle& pnh)
    : nh_(nh), name_(pnh.getNamespace()) {
  readParameters(pnh);
  cell_ = std::make_unique<SimulatedCell>(scenario_, cell_parameters_, X_HB_);
  guard_ = plantGuard(limits_, lease_mode_, lockstep_);
  guard_.braking = braking_;
  guard_.start = inverse(cell_->carrier().base()) * poseFromRest(scenario_.rest);
  epoch_ = lockstep_ ? ros::Time(1, 0) : ros::Time::now();
  figures_start_ = std::chrono::steady_clock::now();
  advertise(pnh);
  ROS_INFO("%s: scenario %s, %s, %zu participants", pnh.getNamespace().c_str(), file_.c_str(),
           lockstep_ ? "lockstep" : "paced by the wall clock", participants_.size());
  thread_ = std::thread([this] { loop(); });
  service_spinner_.start();
}

void SimulatorNode::readParameters(ros::NodeHandle& pnh) {
  Parameters parameters(pnh);
  file_ = parameters.text("scenario");
  const auto overrides = parameters.texts("overrides", std::vector<std::string>{});
  const std::string mismatch = parameters.text("mismatch", "");
  CellParameters& cell = cell_parameters_;
  cell.seed = static_cast<std::uint64_t>(parameters.integer("seed", 0, 2147483647, 1));
  cell.bits = parameters.integer("bits", 1, 64, 16);
  checkBits(cell.bits, "parameter " + pnh.resolveName("bits") + " is ");
  cell.block_size = parameters.integer("block_size", 5, 100, 100);
  cell.noise = parameters.number("noise", Range{0.0, 10.0}, 0.5e-3);
  cell.accelerometer_noise = parameters.number("accelerometer_noise", Range{0.0, 1e3}, 0.02);
  cell.accelerometer_height = parameters.number("accelerometer_height", Range{-1.0, 1.0}, 0.0);
  cell.bridge_nonlinearity = parameters.number("nonlinearity", Range{0.0, 1.0}, 0.0);
  cell.bridge_drift = parameters.number("drift", Range{-100.0, 100.0}, 0.0);
  cell.world = parseWorld(parameters.text("world", "exact"), pnh.resolveName("world"));
  publish_truth_ = parameters.flag("publish_truth", true);
  bool use_sim_time = false;
  ros::param::get("/use_sim_time", use_sim_time);
  lockstep_ = parameters.flag("lockstep", use_sim_time);
  const auto names = parameters.texts("participants", std::vector<std::string>{});
  if (lockstep_) participants_ = Participants(names, nh_.getNamespace());
  ack_timeout_ = parameters.number("ack_timeout", Range{0.1, 3600.0}, 10.0);
  start_timeout_ = parameters.number("start_timeout", Range{0.1, 3600.0}, 60.0);
  paused_ = parameters.flag("paused", false);
  real_time_factor_ = parameters.number("real_time_factor", Range{1e-3, 1e3}, 1.0);
  follows_ = parameters.flag("follow_motion", false);
  readGuard(parameters);
  parameters.refuseUnknown();
  if (use_sim_time && !lockstep_) {
    throw InputError("parameter " + pnh.resolveName("lockstep") +
                     " is false while /use_sim_time is true: nobody would publish /clock, set both "
                     "or neither");
  }

  // the mechanism of the scenario must be the one of the robot description
  scenario_ = loadScenario(file_, overrides);
  believed_height_ = scenario_.rest.z;
  const Mechanism& mechanism = scenario_.mechanism;
  checkCarrier(mechanism.carrier, max_speed_, max_acceleration_);
  braking_ = {couplingStiffness(mechanism.coupling), mechanism.carrier.max_acceleration,
              mechanism.peg.coupling_height + mechanism.peg.half_height};
  description_ = loadCellDescription(Parameters(nh_).text("robot_description"));
  checkAgainst(description_, scenario_.mechanism, scenario_.name);
  pairParts();
  cell.X_AH = description_.X_AH;
  cell.hole_block_mass = description_.hole_block_mass;
  cell.hole_block_center = description_.hole_block_centre;
  if (!mismatch.empty()) drawMismatch(mismatch);
  X_HB_ = carrierBase(scenario_);
}

void SimulatorNode::drawMismatch(const std::string& file) {
  const Mismatch mismatch = loadMismatch(file);
  const Truth truth = drawTruth(mismatch, cell_parameters_.seed);
  scenario_ = trueScenario(scenario_, truth, file);
  cell_parameters_.truth = truth.cell;
  mismatch_ = truthText(truth);
}

void SimulatorNode::advertise(ros::NodeHandle& pnh) {
  // In lockstep a participant that connects late doesn't miss the first block. It may get the
  // latest one before those that are still queued, which paced samples must not: there the next
  // block comes by itself.
  bridge_a_pub_ = {nh_, "sensor_a/bridge", kQueue, lockstep_};
  bridge_b_pub_ = {nh_, "sensor_b/bridge", kQueue, lockstep_};
  accelerometers_pub_ = nh_.advertise<AccelerometerSamples>("accelerometers", kQueue);
  carrier_pub_ = {nh_, "carrier_pose", kQueue};
  plant_state_pub_ = nh_.advertise<PlantState>("plant_state", 10, true);
  diagnostics_pub_ = nh_.advertise<diagnostic_msgs::DiagnosticArray>("/diagnostics", 10);
  if (lockstep_) clock_pub_ = nh_.advertise<rosgraph_msgs::Clock>("/clock", 10, true);
  if (publish_truth_) {
    truth_pose_pub_ = nh_.advertise<geometry_msgs::PoseStamped>("truth/pose", kTruthQueue, true);
    truth_contacts_pub_ = nh_.advertise<ContactArray>("truth/contacts", 10);
  }
  if (publish_truth_ && !mismatch_.empty()) {
    truth_mismatch_pub_ = nh_.advertise<std_msgs::String>("truth/mismatch", 1, true);
    std_msgs::String drawn;
    drawn.data = mismatch_;
    truth_mismatch_pub_.publish(drawn);
    ROS_INFO("the truth differs from the files by %s", mismatch_.c_str());
  }
  publishStaticFrames();

  findEarlierPublishers();
  lease_sub_ = nh_.subscribe("lease", kQueue, &SimulatorNode::onLease, this,
                             ros::TransportHints().tcpNoDelay());
  if (follows_) {
    motion_sub_ = subscribeStream<CarrierMotion>(
        nh_, "carrier_motion", kQueue, [this](const auto& m) { onCarrierMotion(*m); }, nullptr,
        lockstep_);
  } else {
    command_sub_ = nh_.subscribe("carrier_command", kQueue, &SimulatorNode::onCarrierCommand, this,
                                 ros::TransportHints().tcpNoDelay());
  }
  exciter_sub_ = nh_.subscribe("exciter", kQueue, &SimulatorNode::onExciter, this,
                               ros::TransportHints().tcpNoDelay());
  if (lockstep_) subscribeToAcks();
  ros::NodeHandle service_nh(pnh);
  service_nh.setCallbackQueue(&service_queue_);
  pause_srv_ = service_nh.advertiseService("pause", &SimulatorNode::onPause, this);
  step_srv_ = service_nh.advertiseService("step", &SimulatorNode::onStep, this);
  reset_srv_ = service_nh.advertiseService("reset", &SimulatorNode::onReset, this);
  set_state_srv_ = service_nh.advertiseService("set_state", &SimulatorNode::onSetState, this);
  diagnostics_timer_ = nh_.createWallTimer(
      ros::WallDuration(1.0), [this](const ros::WallTimerEvent&) { publishDiagnostics(); });
}

// Parts that can't meet while the carrier keeps to ~max_offset and to the tilts of an alignment are
// never searched for contact.
void SimulatorNode::pairParts() {
  CarrierTravel travel;
  travel.lateral = std::max(
      {-limits_.box_min.x(), limits_.box_max.x(), -limits_.box_min.y(), limits_.box_max.y()});
  travel.lowest = -scenario_.mechanism.peg.half_height;
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
  stepped_.notify_all();
  thread_.join();
  nh_.getCallbackQueue()->removeByID(removalId(go_on_));
  service_spinner_.stop();
}

// ---- the loop ----

void SimulatorNode::loop() {
  publishState();
  publishPlantState();
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
      runBlock();
    } else {
      for (auto& task : tasks) task();
      pace_time_ = -1.0;
    }
  }
}

void SimulatorNode::runBlock() {
  {
    const std::lock_guard<std::mutex> computing(computing_);
    if (!computeBlock()) return;
  }
  if (lockstep_) {
    waitForAcks();
  } else {
    pace();
  }
  const std::lock_guard<std::mutex> computing(computing_);
  finishBlock();
}

bool SimulatorNode::computeBlock() {
  std::string why;
  try {
    watchPlant();
    applyCommands();
    publishPlantState();
    // first: roscpp's network thread, which keeps others from publishing, sends it meanwhile
    if (lockstep_) publishClock(stampAt(cell_->nextEnd()));
    const StopReason reason = cell_->next(block_, accelerometers_pub_.getNumSubscribers() > 0,
                                          [this](const Vector6& load) { feel(load); });
    if (reason != StopReason::kOk) why = toString(reason);
  } catch (const std::exception& error) {
    why = error.what();
  }
  const bool good = why.empty();
  {
    std::lock_guard<std::mutex> lock(mutex_);
    // answers may come while the block goes out
    awaited_ = sequence_;
    awaiting_ = lockstep_ && good;
    participants_.expect(sequence_);
    now_ = base_ + cell_->world().time();
  }
  publishPlantState();
  if (good) {
    publishBlock();
    publishState();
    std::lock_guard<std::mutex> lock(mutex_);
    tellLoop();  // there may be no participants
    return true;
  }
  ROS_ERROR("simulation stopped at %.6f s: %s; call ~reset to start anew", cell_->world().time(),
            why.c_str());
  std::lock_guard<std::mutex> lock(mutex_);
  stopped_ = why;
  if (steps_ > 0) --steps_;
  stepped_.notify_all();
  return false;
}

// Goes on, or has done the last of its steps.
void SimulatorNode::finishBlock() {
  std::lock_guard<std::mutex> lock(mutex_);
  if (!stopped_.empty()) return;
  ++sequence_;
  if (steps_ > 0 && --steps_ == 0) stepped_.notify_all();
}

void SimulatorNode::applyCommands() {
  std::optional<Pose> command;
  std::optional<Exciter> exciter;
  std::optional<CarrierMotion> motion;
  GuardAction stop;
  {
    std::lock_guard<std::mutex> lock(mutex_);
    command.swap(carrier_command_);
    exciter.swap(exciter_);
    motion.swap(motion_);
    std::swap(stop, stop_);
  }
  SimulatorBackend& world = cell_->world();
  if (stop.hold) world.stopRest();
  if (stop.exciter_off) world.setExciter(ExciterParameters{}, world.time());
  if (command) cell_->command(*command, speedOf(*command));
  if (follows_) followMotion(motion);
  if (exciter) {
    ExciterParameters drive;
    drive.amplitude = exciter->on ? exciter->amplitude : 0.0;
    drive.frequency = exciter->frequency;
    drive.phase = exciter->phase;
    drive.direction = exciter->direction;
    // no stamp: from the coming block's start
    double t_ref = world.time();
    if (!exciter->header.stamp.isZero()) t_ref = nodeTime(exciter->header.stamp) - base_;
    world.setExciter(drive, t_ref);
  }
}

void SimulatorNode::restart(std::unique_ptr<SimulatedCell> cell) {
  // the clock goes on
  base_ += cell_->world().time();
  cell_ = std::move(cell);
  now_ = base_;
  {
    std::lock_guard<std::mutex> lock(mutex_);
    endSteps("the simulation began anew");
    carrier_command_.reset();
    exciter_.reset();
    stopped_.clear();
    stop_ = GuardAction{};
    guard_.overloaded = guard_.shaking = false;
  }
  // whoever holds the plant must hear of it: nothing is where it was
  beginLife();
  publishState();
  publishPlantState();
}

void SimulatorNode::pace() {
  const auto now = std::chrono::steady_clock::now();
  if (pace_time_ < 0.0) {
    pace_start_ = now;
    pace_time_ = now_;
  }
  const double ahead = (now_ - pace_time_) / real_time_factor_ - seconds(now - pace_start_);
  if (ahead < -1.0) {
    lost_ -= ahead;
    ROS_WARN_THROTTLE(10.0,
                      "simulation has fallen %.1f s behind the wall clock so far: give a lower "
                      "~real_time_factor (real_time_factor:=0.2), or lockstep:=true",
                      lost_);
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

double SimulatorNode::nodeTime(const ros::Time& stamp) const {
  // differences of ros::Time throw where they are large
  return 1e-9 * static_cast<double>(static_cast<std::int64_t>(stamp.toNSec()) -
                                    static_cast<std::int64_t>(epoch_.toNSec()));
}

// ---- what goes out ----

void SimulatorNode::publishBlock() {
  const ros::Time stamp = stampAt(block_.time);
  const auto bridge = [&](auto& pub, const char* sensor, const auto& volts, const auto& saturated) {
    StrainSamples message;
    message.header.stamp = stamp;
    message.header.frame_id = sensor;
    message.period = block_.period;
    message.sequence = sequence_;
    message.temperature = block_.temperature;
    message.volts = volts;
    message.saturated = saturated;
    pub.publish(std::move(message));
  };
  bridge(bridge_a_pub_, "sensor_a", block_.volts_a, block_.saturated_a);
  bridge(bridge_b_pub_, "sensor_b", block_.volts_b, block_.saturated_b);
  if (!block_.accelerations.empty()) {
    AccelerometerSamples felt;
    felt.header.stamp = stamp;
    felt.header.frame_id = kPegFrame;
    felt.period = block_.period;
    felt.sequence = sequence_;
    felt.acceleration = block_.accelerations;
    publishShared(accelerometers_pub_, std::move(felt));
  }

  carrier_pub_.publish(
      poseStamped(kCarrierBaseFrame, cell_->reported(), stampAt(cell_->world().time())));
}

// Where a person believes the carrier to be: upright over the hole's middle. Where it is belongs to
// the truth.
void SimulatorNode::publishStaticFrames() {
  const Pose X_HB{Eigen::Matrix3d::Identity(), Eigen::Vector3d(0.0, 0.0, believed_height_)};
  std::vector<geometry_msgs::TransformStamped> frames = {transformStamped(
      kWorldFrame, kCarrierBaseFrame, description_.X_WA * description_.X_AH * X_HB, epoch_)};
  if (publish_truth_) {
    frames.push_back(transformStamped(kCarrierBaseFrame, kHoleTruthFrame,
                                      inverse(cell_->carrier().base()), epoch_));
  }
  static_tf_.send(frames);
}

void SimulatorNode::publishState() {
  SimulatorBackend& world = cell_->world();
  const ros::Time stamp = stampAt(world.time());

  frames_.assign(1, transformStamped(kCarrierBaseFrame, kCarrierFrame, cell_->reported(), stamp));
  if (publish_truth_) {
    const Pose X_HP = world.pegPose();
    publishShared(truth_pose_pub_, poseStamped(kHoleTruthFrame, X_HP, stamp));
    frames_.push_back(transformStamped(kHoleTruthFrame, kPegTruthFrame, X_HP, stamp));
  }
  tf_.sendTransform(frames_);
  if (publish_truth_ && truth_contacts_pub_.getNumSubscribers() > 0) {
    ContactArray contacts;
    contacts.header.stamp = stamp;
    contacts.header.frame_id = kHoleTruthFrame;
    for (const auto& report : world.contacts()) {
      if (!report.valid || !report.force.allFinite() || !report.normal.allFinite()) continue;
      Contact contact;
      contact.feature = static_cast<std::uint8_t>(report.feature);
      contact.position = toPoint(report.point);
      contact.normal = toVector3(report.normal);
      contact.force = toVector3(report.force);
      contact.gap = report.gap;
      contact.state = report.state;
      contacts.contacts.push_back(contact);
    }
    publishShared(truth_contacts_pub_, std::move(contacts));
  }
  if (lockstep_ && stamp != clock_stamp_) publishClock(stamp);
}

void SimulatorNode::publishDiagnostics() {
  const auto now = std::chrono::steady_clock::now();
  const double time = now_;
  const double wall = seconds(now - figures_start_);
  const double factor = wall > 0.0 ? (time - figures_time_) / wall : 0.0;
  figures_start_ = now;
  figures_time_ = time;

  diagnostic_msgs::DiagnosticStatus status;
  status.name = name_.substr(1) + ": simulation";
  status.hardware_id = "simulation";
  status.level = diagnostic_msgs::DiagnosticStatus::OK;
  std::string holder, refusal;
  {
    std::lock_guard<std::mutex> lock(mutex_);
    status.message = paused_ ? "paused" : "running";
    holder = guard_.owner;
    refusal = refusal_.text;
    if (guard_.expired || guard_.overloaded) {
      status.level = diagnostic_msgs::DiagnosticStatus::WARN;
      status.message = "held: " + stopped_because_;
    }
    if (!stopped_.empty()) {
      status.level = diagnostic_msgs::DiagnosticStatus::ERROR;
      status.message = "stopped: " + stopped_;
    }
  }
  publishStatus(diagnostics_pub_, status,
                {{"Simulated time [s]", std::to_string(time)},
                 {"Real-time factor", std::to_string(factor)},
                 {"Commands refused", std::to_string(refused_)},
                 {"Last refusal", refusal},
                 {"Held by", holder}});
}

}  // namespace assembly_cell::ros_bridge
