// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "cell_link.h"

#include <diagnostic_msgs/DiagnosticArray.h>
#include <geometry_msgs/PoseStamped.h>
#include <geometry_msgs/WrenchStamped.h>
#include <ros/callback_queue.h>
#include <ros/ros.h>
#include <std_srvs/SetBool.h>
#include <std_srvs/Trigger.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <limits>
#include <mutex>
#include <utility>
#include <vector>

#include "assembly_cell/AlignPegAction.h"
#include "assembly_cell/AlignmentReport.h"
#include "assembly_cell/AssemblePegAction.h"
#include "assembly_cell/LocusEstimate.h"
#include "assembly_cell/MoveToContactAction.h"
#include "assembly_cell/RetreatAction.h"
#include "assembly_cell/SensorCalibration.h"
#include "assembly_cell/Step.h"
#include "assembly_cell/SupervisorState.h"
#include "assembly_cell/TwinForceState.h"
#include "assembly_cell/align/outcome.h"
#include "assembly_cell/base/text.h"
#include "assembly_cell/ros/bridge/conversions.h"
#include "assembly_cell/ros/bridge/guarded_spinner.h"
#include "assembly_cell/ros/bridge/message_guard.h"
#include "assembly_cell/ros/process/node_watch.h"
#include "calibration_link.h"
#include "errands.h"
#include "node_roll.h"
#include "service_errand.h"
#include "widgets/truth_trail.h"

namespace assembly_cell::panel {

namespace {

using namespace ros_bridge;

constexpr auto kPatience = std::chrono::seconds(60);  // for the answer of a service
constexpr double kLook = 1.0;                         // between two looks at silent nodes [s]
constexpr double kAnswerWithin = 0.5;                 // of a node that isn't frozen [s]
constexpr double kFullScale = 5.0;                    // of the converters, ± [V]
constexpr auto kReadingLife = std::chrono::seconds(2);
constexpr char kSupervisor[] = "assembly_supervisor";

double finite(double value) { return std::isfinite(value) ? value : 0.0; }

Pair pairOf(const boost::array<double, 2>& values) { return {values[0], values[1]}; }

// load along or about each axis alone at which the first channel leaves its range
bool loadLimits(const SensorCalibration& calibration, std::array<double, 6>& limit) {
  using RowMajor = Eigen::Matrix<double, 6, 6, Eigen::RowMajor>;
  const Eigen::FullPivLU<Matrix6> map(Matrix6(RowMajor(calibration.volts_to_wrench.data())));
  if (!map.isInvertible()) return false;
  const Matrix6 volts = map.inverse();
  for (int axis = 0; axis < 6; ++axis) {
    double least = std::numeric_limits<double>::infinity();
    for (int channel = 0; channel < 6; ++channel) {
      const double zero = calibration.zero_volts[static_cast<std::size_t>(channel)];
      const double room = kFullScale - std::abs(zero);
      least = std::min(least, room / std::abs(volts(channel, axis)));
    }
    limit[static_cast<std::size_t>(axis)] = least;
  }
  return std::all_of(limit.begin(), limit.end(),
                     [](double value) { return std::isfinite(value) && value > 0.0; });
}

std::string describe(const LocusEstimate& locus) {
  static const std::array<const char*, 5> modes = {"no contact", "segment", "ellipse", "circle",
                                                   "undecided"};
  std::string out = "locus: ";
  out += locus.mode < modes.size() ? modes[locus.mode] : "?";
  out += text(" %.1f x %.1f um", 1e6 * locus.semi_major, 1e6 * locus.semi_minor);
  if (!locus.hypothesis_direction.empty()) {
    out += text(", contact at %.1f +- %.1f deg", locus.hypothesis_direction[0] * 180.0 / M_PI,
                locus.direction_sd * 180.0 / M_PI);
  }
  return out;
}

std::string describe(const TwinForceState& state) {
  std::string out =
      text("twin force: %zu contacts, %s", state.contacts.size(), state.status.c_str());
  if (state.pose_known) {
    out +=
        text(", sd %.3f mm, %.3f deg", 1e3 * state.position_sd, state.rotation_sd * 180.0 / M_PI);
  }
  return out;
}

double numberOf(const std::string& text) { return finite(std::atof(text.c_str())); }

ros::NodeHandle handle(ros::CallbackQueue& queue) {
  ros::NodeHandle nh;
  nh.setCallbackQueue(&queue);
  return nh;
}

GoalView::Outcome outcomeOf(std::uint8_t status) {
  if (status == actionlib_msgs::GoalStatus::SUCCEEDED) return GoalView::Outcome::kSuccess;
  const bool cancelled = status == actionlib_msgs::GoalStatus::PREEMPTED ||
                         status == actionlib_msgs::GoalStatus::RECALLED;
  return cancelled ? GoalView::Outcome::kCancelled : GoalView::Outcome::kFailure;
}

}  // namespace

class CellLink::Implementation {
 public:
  Implementation() : nh_(handle(queue_)), calibration_(nh_, errands_), spinner_(1, &queue_) {
    hearSensors();
    hearGoals();
    hearOthers();
    calibration_.begin();
    align_pub_ = nh_.advertise<AlignPegActionGoal>("align/goal", 1);
    assemble_pub_ = nh_.advertise<AssemblePegActionGoal>("assemble/goal", 1);
    retreat_pub_ = nh_.advertise<RetreatActionGoal>("retreat/goal", 1);
    for (const char* action : {"align", "assemble", "retreat", "move_to_contact"}) {
      cancel_pubs_.push_back(
          nh_.advertise<actionlib_msgs::GoalID>(std::string(action) + "/cancel", 1));
    }
    timer_ = nh_.createWallTimer(ros::WallDuration(kLook),
                                 [this](const ros::WallTimerEvent&) { look(); });
    spinner_.start();
  }

  ~Implementation() {
    spinner_.stop();
    timer_.stop();
  }

  CellView view() {
    const Clock::time_point now = Clock::now();
    CellView out;
    {
      const std::lock_guard<std::mutex> lock(mutex_);
      out = view_;
      out.nodes = roll_.view(now);
      if (now - reading_heard_ > kReadingLife) out.reading.clear();
    }
    for (std::size_t i = 0; i < 2; ++i)
      out.sensors[i].there = wrench_subs_[i].getNumPublishers() > 0;
    out.estimate.truth_there = truth_sub_.getNumPublishers() > 0;
    out.goal.there = align_pub_.getNumSubscribers() > 0;
    if (!out.goal.there) out.goal.goal.clear();
    const auto simulator = std::find_if(out.nodes.begin(), out.nodes.end(), [](const NodeView& n) {
      return n.node == knownNodes().front().name;
    });
    out.simulator.message = simulator->reason;
    out.simulator.paused = simulator->reason == "paused";
    out.simulator.there = simulator->light != Light::kNotThere && !simulator->silent;
    out.calibration = calibration_.view();
    out.answers = errands_.answers();
    return out;
  }

  void start(const GoalRequest& request) {
    {
      const std::lock_guard<std::mutex> lock(mutex_);
      view_.estimate = EstimateView();
    }
    if (!request.insert) {
      AlignPegActionGoal goal;
      goal.goal.strategy = request.strategy;
      send(align_pub_, goal);
      return;
    }
    AssemblePegActionGoal goal;
    goal.goal.strategy = request.strategy;
    goal.goal.floor = request.floor;
    goal.goal.depth = request.floor ? 0.0 : request.depth;
    send(assemble_pub_, goal);
  }

  void cancel() {
    // no id, no time: all goals
    for (const ros::Publisher& pub : cancel_pubs_) pub.publish(actionlib_msgs::GoalID());
  }

  void retreat() { send(retreat_pub_, RetreatActionGoal()); }

  template <class Service>
  void call(const std::string& label, const std::string& service,
            const typename Service::Request& request = {}) {
    beginServiceErrand<Service>(errands_, label, nh_.resolveName(service), request);
  }

  CalibrationLink& calibration() { return calibration_; }

 private:
  // A callback with the view's mutex held; an exception ends nothing.
  template <class Message, class Callback>
  ros::Subscriber hear(const std::string& topic, Callback callback) {
    return nh_.subscribe<Message>(
        topic, 50,
        boost::function<void(const boost::shared_ptr<const Message>&)>(
            [this, topic, callback](const boost::shared_ptr<const Message>& message) {
              guarded(topic, [&] {
                const std::lock_guard<std::mutex> lock(mutex_);
                callback(*message);
              });
            }));
  }

  // The same of what check() passes.
  template <class Message, class Callback>
  ros::Subscriber hearChecked(const std::string& topic, Callback callback) {
    return subscribeChecked<Message>(
        nh_, topic, 50, [this, callback](const boost::shared_ptr<const Message>& message) {
          const std::lock_guard<std::mutex> lock(mutex_);
          callback(*message);
        });
  }

  void hearSensors() {
    for (std::size_t i = 0; i < 2; ++i) {
      const std::string name = kSensorNames[i];
      wrench_subs_[i] = hearChecked<geometry_msgs::WrenchStamped>(
          name + "/wrench", [this, i](const geometry_msgs::WrenchStamped& message) {
            Vector6::Map(view_.sensors[i].wrench.data()) = fromWrench(message.wrench);
          });
      subs_.push_back(hearChecked<SensorCalibration>(
          name + "/calibration", [this, i](const SensorCalibration& message) {
            view_.sensors[i].calibration = message.id;
            view_.sensors[i].limit_known = loadLimits(message, view_.sensors[i].limit);
          }));
    }
  }

  template <class Result>
  void hearResult(const std::string& action) {
    subs_.push_back(hear<Result>(action + "/result", [this](const Result& message) {
      // of a goal that another one has taken the place of
      if (view_.goal.asked && message.status.goal_id.id != sent_id_) return;
      view_.goal.asked = false;
      view_.goal.outcome = outcomeOf(message.status.status);
      view_.goal.outcome_text = printable(message.status.text, 300);
    }));
  }

  void hearGoals() {
    hearResult<AlignPegActionResult>("align");
    hearResult<AssemblePegActionResult>("assemble");
    hearResult<RetreatActionResult>("retreat");
    hearResult<MoveToContactActionResult>("move_to_contact");
    subs_.push_back(hearChecked<AlignPegActionFeedback>(
        "align/feedback",
        [this](const AlignPegActionFeedback& message) { progress(message.feedback); }));
    subs_.push_back(hearChecked<AssemblePegActionFeedback>(
        "assemble/feedback", [this](const AssemblePegActionFeedback& message) {
          progress(message.feedback);
          view_.goal.inserting = message.feedback.depth > 0.0;
          view_.goal.depth = message.feedback.depth;
          view_.goal.force = message.feedback.force;
          view_.goal.walls = message.feedback.walls;
        }));
    subs_.push_back(hearChecked<SupervisorState>(
        std::string(kSupervisor) + "/state", [this](const SupervisorState& state) {
          if (!state.goal.empty() && state.goal != view_.goal.goal) {
            newGoal();
            if (state.goal == "align" || state.goal == "assemble") view_.estimate = EstimateView();
          }
          GoalView& goal = view_.goal;
          goal.goal = state.goal;
          goal.in_contact = state.in_contact;
          goal.stuck = state.stuck;
          goal.reason = printable(state.reason, 300);
        }));
    subs_.push_back(hearChecked<AlignmentReport>(
        "report", [this](const AlignmentReport& report) { conclude(report); }));
  }

  void hearOthers() {
    using Truth = geometry_msgs::PoseStamped;
    truth_sub_ = hearChecked<Truth>("truth/pose", [this](const Truth& message) {
      const Pose X_HP = fromPose(message.pose, "truth/pose");
      const Eigen::Vector2d tilt = tiltOf(X_HP);
      truth_.add({message.header.stamp.toSec(), {-X_HP.p.x(), -X_HP.p.y()}, {tilt.x(), tilt.y()}});
    });
    subs_.push_back(hearChecked<LocusEstimate>("locus", [this](const LocusEstimate& locus) {
      view_.reading = describe(locus);
      reading_heard_ = Clock::now();
    }));
    subs_.push_back(
        hearChecked<TwinForceState>("twin_force/status", [this](const TwinForceState& state) {
          if (state.contacts.empty()) return;
          view_.reading = describe(state);
          reading_heard_ = Clock::now();
        }));
    subs_.push_back(hear<diagnostic_msgs::DiagnosticArray>(
        "/diagnostics", [this](const diagnostic_msgs::DiagnosticArray& array) { inspect(array); }));
  }

  template <class Feedback>
  void progress(const Feedback& feedback) {
    GoalView& goal = view_.goal;
    goal.asked = false;
    goal.step = printable(feedback.state);
    goal.message = printable(feedback.message, 300);
    goal.contacts = feedback.contacts;
    goal.time = feedback.time;
    goal.position_sd = feedback.position_sd;
    goal.rotation_sd = feedback.rotation_sd;
  }

  // what was said of the last one counts no more; the peg is where it is
  void newGoal() {
    GoalView next;
    next.goal = view_.goal.goal;
    next.in_contact = view_.goal.in_contact;
    next.stuck = view_.goal.stuck;
    next.reason = view_.goal.reason;
    view_.goal = next;
  }

  void conclude(const AlignmentReport& report) {
    EstimateView estimate;
    view_.goal.contacts = report.contacts;
    estimate.known = report.estimate_known;
    estimate.offset = pairOf(report.estimated_offset);
    estimate.tilt = pairOf(report.estimated_tilt);
    estimate.position_sd = view_.goal.position_sd;
    estimate.rotation_sd = view_.goal.rotation_sd;
    if (!report.reference.isZero()) {
      if (const auto peg = truth_.at(report.reference.toSec())) {
        estimate.truth_known = true;
        estimate.true_offset = peg->offset;
        estimate.true_tilt = peg->tilt;
      }
    }
    view_.estimate = estimate;
  }

  void inspect(const diagnostic_msgs::DiagnosticArray& array) {
    // "/" or "/cell_1"; names of nodes come without the first slash
    std::string prefix = nh_.getNamespace().substr(1);
    if (!prefix.empty()) prefix += "/";
    for (const auto& status : array.status) {
      const std::size_t colon = status.name.find(": ");
      if (colon == std::string::npos || status.name.compare(0, prefix.size(), prefix) != 0)
        continue;
      const std::string node = status.name.substr(prefix.size(), colon - prefix.size());
      roll_.hear(node, printable(status.name.substr(colon + 2)), status.level,
                 printable(status.message, 300), Clock::now());
      if (node != knownNodes().front().name) continue;
      for (const auto& value : status.values) {
        if (value.key == "Simulated time [s]") view_.simulator.time = numberOf(value.value);
        if (value.key == "Real-time factor")
          view_.simulator.real_time_factor = numberOf(value.value);
      }
    }
  }

  // once a second: what has become of silent nodes, which calls take too long, limits
  void look() {
    errands_.abandonAfter(kPatience);
    std::vector<std::string> silent;
    {
      const std::lock_guard<std::mutex> lock(mutex_);
      silent = roll_.silent(Clock::now());
    }
    errands_.begin(
        "look",
        [this, silent] {
          for (const std::string& node : silent) lookAt(node);
          double limit = 0.0;
          nh_.getParam(std::string(kSupervisor) + "/force_limit", limit);
          const std::lock_guard<std::mutex> lock(mutex_);
          view_.goal_force_limit = finite(limit);
          return Answer{Answer::State::kGood, "", {}, 0};
        },
        nullptr, true);
  }

  void lookAt(const std::string& node) {
    const auto known = std::find_if(knownNodes().begin(), knownNodes().end(),
                                    [&node](const KnownNode& k) { return node == k.name; });
    if (known == knownNodes().end() || *known->topic == '\0') return;
    const auto found = publishersOf({nh_.resolveName(known->topic)}, kAnswerWithin);
    NodeRoll::Fate fate = NodeRoll::Fate::kEnded;
    for (const TopicPublisher& publisher : found) {
      if (publisher.presence == NodePresence::kGone) fate = NodeRoll::Fate::kGone;
      if (publisher.presence == NodePresence::kMute) fate = NodeRoll::Fate::kFrozen;
      if (publisher.presence == NodePresence::kListening) fate = NodeRoll::Fate::kUnknown;
    }
    const std::lock_guard<std::mutex> lock(mutex_);
    roll_.tellFate(node, fate);
  }

  template <class Goal>
  void send(const ros::Publisher& pub, Goal goal) {
    goal.header.stamp = goal.goal_id.stamp = ros::Time::now();
    goal.goal_id.id =
        ros::this_node::getName() + "-" + std::to_string(ros::WallTime::now().toNSec());
    {
      const std::lock_guard<std::mutex> lock(mutex_);
      newGoal();
      view_.goal.asked = true;
      sent_id_ = goal.goal_id.id;
    }
    pub.publish(goal);
  }

  std::mutex mutex_;
  CellView view_;
  NodeRoll roll_;
  TruthTrail truth_;
  Clock::time_point reading_heard_;
  std::string sent_id_;  // of the last goal

  ros::CallbackQueue queue_;
  ros::NodeHandle nh_;
  CalibrationLink calibration_;
  Errands errands_;  // after all that they use
  std::array<ros::Subscriber, 2> wrench_subs_;
  ros::Subscriber truth_sub_;
  std::vector<ros::Subscriber> subs_;
  ros::Publisher align_pub_, assemble_pub_, retreat_pub_;
  std::vector<ros::Publisher> cancel_pubs_;
  ros::WallTimer timer_;
  GuardedSpinner spinner_;
};

CellLink::CellLink() : implementation_(std::make_unique<Implementation>()) {}
CellLink::~CellLink() = default;

CellView CellLink::view() { return implementation_->view(); }
void CellLink::start(const GoalRequest& goal) { implementation_->start(goal); }
void CellLink::cancel() { implementation_->cancel(); }
void CellLink::retreat() { implementation_->retreat(); }

void CellLink::zero(Sensor sensor) {
  const std::string name = kSensorNames[sensor];
  implementation_->call<std_srvs::Trigger>(name + " zero", name + "/driver/zero");
}

void CellLink::undoBias(Sensor sensor) {
  const std::string name = kSensorNames[sensor];
  implementation_->call<std_srvs::Trigger>(name + " undo", name + "/driver/undo_bias");
}

void CellLink::pause(bool paused) {
  std_srvs::SetBool::Request request;
  request.data = paused;
  implementation_->call<std_srvs::SetBool>(paused ? "pause" : "run", "peg_hole_simulator/pause",
                                           request);
}

void CellLink::step(std::uint32_t blocks) {
  Step::Request request;
  request.blocks = blocks;
  implementation_->call<Step>("step", "peg_hole_simulator/step", request);
}

void CellLink::reset() {
  implementation_->call<std_srvs::Trigger>("reset", "peg_hole_simulator/reset");
}

void CellLink::askPlan(const std::string& plan) { implementation_->calibration().askPlan(plan); }
void CellLink::beginCalibration(const CalibrationRequest& request) {
  implementation_->calibration().run(request);
}
void CellLink::cancelCalibration() { implementation_->calibration().cancel(); }
void CellLink::confirmLoad(const Measured& measured) {
  implementation_->calibration().confirm(measured);
}
void CellLink::removeLast() { implementation_->calibration().removeLast(); }
void CellLink::askStored() { implementation_->calibration().askStored(); }
void CellLink::loadCalibration(const std::string& id) { implementation_->calibration().load(id); }

}  // namespace assembly_cell::panel
