// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/ros/simulation/report_program.h"

#include <std_msgs/String.h>
#include <std_srvs/SetBool.h>
#include <yaml-cpp/yaml.h>

#include <algorithm>
#include <atomic>
#include <boost/algorithm/string/replace.hpp>
#include <cmath>
#include <iostream>
#include <memory>
#include <stdexcept>
#include <utility>

#include "assembly_cell/align/align.h"
#include "assembly_cell/align/outcome.h"
#include "assembly_cell/base/fields.h"
#include "assembly_cell/base/files.h"
#include "assembly_cell/base/input_error.h"
#include "assembly_cell/base/text.h"
#include "assembly_cell/description/cell_description.h"
#include "assembly_cell/mismatch/mismatch.h"
#include "assembly_cell/ros/bridge/conversions.h"
#include "assembly_cell/ros/bridge/parameters.h"
#include "assembly_cell/ros/bridge/service_call.h"
#include "assembly_cell/ros/process/command_line.h"
#include "assembly_cell/ros/process/process_start.h"

namespace assembly_cell::ros_bridge {

namespace {

constexpr double kTruthTimeout = 10.0;       // wall [s]
constexpr double kLostAfter = 1.0;           // without the server's connections, wall [s]
constexpr double kRounding = 0.001;          // well below a block [s]
constexpr double kEndTimeout = 1.0;          // of ROS's own end, wall [s]
constexpr std::size_t kTruthMemory = 50000;  // blocks, 1000 s

Eigen::Vector2d vector(const boost::array<double, 2>& v) { return {v[0], v[1]}; }

// of the bore, where its tilt was drawn
double reachAtEnd(const ReportDetails& details) {
  Eigen::Vector2d lean = Eigen::Vector2d::Zero();
  if (!details.mismatch.empty()) {
    const YAML::Node tilt = YAML::Load(details.mismatch)["hole"]["bore_tilt"];
    if (tilt) lean = boreLean({tilt[0].as<double>(), tilt[1].as<double>()});
  }
  return edgeReach(shoulderPose(*details.truth_end, details.chamfer_height), details.peg_radius,
                   lean);
}

}  // namespace

void addTruth(AlignmentReport& report, const ReportDetails& details) {
  report.truth_known = details.truth_start && details.truth_end;
  if (!report.truth_known) return;
  const Eigen::Vector2d tilt = tiltOf(*details.truth_start);
  for (int i = 0; i < 2; ++i) {
    const auto k = static_cast<std::size_t>(i);
    report.true_offset[k] = -details.truth_start->p(i);
    report.true_tilt[k] = tilt(i);
  }
}

bool verdict(const AlignmentReport& report, const ReportDetails& details) {
  if (!report.success) return false;
  if (!details.truth_end) return true;
  return inPlace(*details.truth_end, details.chamfer_height + details.chamfer_depth,
                 reachAtEnd(details), details.peg_radius, details.hole_radius, details.insert);
}

std::string whereTheEdgeIs(double reach, const ReportDetails& details) {
  if (reach <= details.hole_radius) return "inside\n";
  const double greatest =
      details.insert > 0.0
          ? reachInBore(details.peg_radius, details.hole_radius)
          : greatestReach(*details.truth_end, details.chamfer_height + details.chamfer_depth,
                          details.peg_radius, details.hole_radius);
  const bool leans = reach <= greatest;
  return leans ? "inside, on its wall\n" : "NOT inside\n";
}

std::string table(const AlignmentReport& report, const ReportDetails& details) {
  const Eigen::Vector2d offset = 1e3 * vector(report.estimated_offset);
  const Eigen::Vector2d tilt = 180.0 / M_PI * vector(report.estimated_tilt);
  const Eigen::Vector2d true_offset = 1e3 * vector(report.true_offset);
  const Eigen::Vector2d true_tilt = 180.0 / M_PI * vector(report.true_tilt);
  std::string out;
  const auto row = [&out](const std::string& name, const std::string& a, const std::string& b,
                          const std::string& c) {
    out += text("  %-22s %20s %20s %10s\n", name.c_str(), a.c_str(), b.c_str(), c.c_str());
  };
  const char* pair = "%8.3f %8.3f";
  const bool known = report.truth_known, estimated = report.estimate_known;
  const char* not_done = details.insert > 0.0 ? "not inserted: " : "not aligned: ";
  out += report.success ? "aligned\n" : not_done + report.reason + "\n";
  if (!report.success && report.simulated_time == 0.0) return out;  // refused: nothing moved
  row("at the start", known ? "true" : "true (unknown)", "estimated", "error");
  row("offset x, y [mm]", known ? text(pair, true_offset.x(), true_offset.y()) : "-",
      estimated ? text(pair, offset.x(), offset.y()) : "-",
      known && estimated ? text("%.3f", (offset - true_offset).norm()) : "-");
  row("tilt x, y [deg]", known ? text(pair, true_tilt.x(), true_tilt.y()) : "-",
      estimated ? text(pair, tilt.x(), tilt.y()) : "-",
      known && estimated ? text("%.3f", (tilt - true_tilt).norm()) : "-");
  if (report.success && !estimated) {
    out += "  no estimate: the peg was in the hole already, and this strategy states none then\n";
  }
  if (details.truth_end) {
    const double reach = reachAtEnd(details);
    out += text(
               "  peg's edge at the end: farthest point %.3f mm from the hole's axis, "
               "hole's radius %.3f mm: ",
               1e3 * reach, 1e3 * details.hole_radius) +
           whereTheEdgeIs(reach, details);
  }
  if (details.insert > 0.0) {
    out += text("  inserted: %.2f mm measured of %.2f mm requested, largest force %.1f N",
                1e3 * details.depth, 1e3 * details.insert, details.force);
    if (details.truth_end) out += text("; truly %.2f mm", -1e3 * details.truth_end->p.z());
    out += "\n";
  }
  if (report.clearance_sd > 0.0) {
    out += text("  clearance: %.3f +- %.3f mm, drawn %.3f mm\n", 1e3 * report.clearance,
                1e3 * report.clearance_sd, 1e3 * (details.hole_radius - details.peg_radius));
  }
  out += "  contacts measured: " + std::to_string(report.contacts) + "\n";
  out +=
      text("  time: %.2f s simulated, %.2f s wall clock", report.simulated_time, report.wall_time) +
      text(" (%.1f times real time)\n",
           report.wall_time > 0.0 ? report.simulated_time / report.wall_time : 0.0);
  if (report.record != 0) {
    out += "  record " + std::to_string(report.record) + ": " + report.verdict + "\n";
  }
  return out;
}

std::string yaml(const AlignmentReport& report, const ReportDetails& details) {
  YAML::Emitter out;
  out.SetDoublePrecision(17);
  const auto pair = [&out](const char* key, double x, double y, bool known) {
    out << YAML::Key << key << YAML::Value;
    if (known) {
      out << YAML::Flow << YAML::BeginSeq << x << y << YAML::EndSeq;
    } else {
      out << YAML::Null;
    }
  };
  const auto pose = [&out](const char* key, const geometry_msgs::Pose& p) {
    out << YAML::Key << key << YAML::Value << YAML::BeginMap;
    out << YAML::Key << "position" << YAML::Value << YAML::Flow << YAML::BeginSeq << p.position.x
        << p.position.y << p.position.z << YAML::EndSeq;
    out << YAML::Key << "quaternion" << YAML::Value << YAML::Flow << YAML::BeginSeq
        << p.orientation.x << p.orientation.y << p.orientation.z << p.orientation.w << YAML::EndSeq
        << YAML::EndMap;
  };
  const bool known = report.truth_known, estimated = report.estimate_known;
  out << YAML::BeginMap;
  out << YAML::Key << "success" << YAML::Value << static_cast<bool>(report.success);
  out << YAML::Key << "reason" << YAML::Value << report.reason;
  out << YAML::Key << "strategy" << YAML::Value << details.strategy;
  out << YAML::Key << "truth_known" << YAML::Value << known;
  pair("true_offset", report.true_offset[0], report.true_offset[1], known);
  pair("estimated_offset", report.estimated_offset[0], report.estimated_offset[1], estimated);
  pair("true_tilt", report.true_tilt[0], report.true_tilt[1], known);
  pair("estimated_tilt", report.estimated_tilt[0], report.estimated_tilt[1], estimated);
  const auto number = [&out](const char* key, double value, bool is_known) {
    out << YAML::Key << key << YAML::Value;
    is_known ? out << value : out << YAML::Null;
  };
  number("clearance", report.clearance, report.clearance_sd > 0.0);
  number("clearance_sd", report.clearance_sd, report.clearance_sd > 0.0);
  out << YAML::Key << "contacts" << YAML::Value << report.contacts;
  out << YAML::Key << "simulated_time" << YAML::Value << report.simulated_time;
  out << YAML::Key << "wall_time" << YAML::Value << report.wall_time;
  if (estimated) pose("estimated_pose", report.estimated_pose);
  if (details.insert > 0.0) {
    out << YAML::Key << "insertion" << YAML::Value << YAML::Flow << YAML::BeginMap;
    out << YAML::Key << "asked" << YAML::Value << details.insert;
    out << YAML::Key << "depth" << YAML::Value << details.depth;
    out << YAML::Key << "force" << YAML::Value << details.force;
    out << YAML::Key << "floor" << YAML::Value << details.floor;
    out << YAML::Key << "profile" << YAML::Value << YAML::BeginSeq;
    for (const BoreReading& row : details.profile) {
      out << YAML::BeginSeq << row.depth << row.along << row.sideways << row.moment << YAML::EndSeq;
    }
    out << YAML::EndSeq << YAML::EndMap;
  }
  out << YAML::Key << "peg_radius" << YAML::Value << details.peg_radius;
  out << YAML::Key << "hole_radius" << YAML::Value << details.hole_radius;
  if (known) {
    pose("true_pose_start", toPose(*details.truth_start));
    pose("true_pose", toPose(*details.truth_end));
    out << YAML::Key << "edge_reach" << YAML::Value << reachAtEnd(details);
  }
  if (!details.mismatch.empty()) {
    out << YAML::Key << "mismatch" << YAML::Value << YAML::Load(details.mismatch);
  }
  out << YAML::Key << "verdict" << YAML::Value << verdict(report, details);
  out << YAML::EndMap;
  return "# Alignment, as msg/AlignmentReport.msg and more, see docs/reference/files.md. [m] "
         "[rad] "
         "[s]\n" +
         std::string(out.c_str()) + "\n";
}

// ---- the program ----

namespace {

// A result comes without the master.
std::atomic<bool> needs_master{true};

// `rosrun … _insert:=0.04` leaves its parameter on the server: the next call doesn't use it.
class Forgotten {
 public:
  explicit Forgotten(std::string name) : name_(std::move(name)) {}
  ~Forgotten() { ros::param::del(name_); }
  Forgotten(const Forgotten&) = delete;
  Forgotten& operator=(const Forgotten&) = delete;

 private:
  const std::string name_;
};

}  // namespace

ReportSettings::ReportSettings() : strategy(AlignParameters().strategy) {}

void fields(FieldList& f, ReportSettings& s) {
  f.text("strategy", s.strategy, "Strategy of the alignment.");
  f.text("report_file", s.report_file, "YAML file that the report is written to; empty: none.");
  f.text("simulator", s.simulator, "Node with the service ~pause.");
  f.flag(
      "unpause", s.unpause,
      "Calls ~pause of the simulator with false once the goal is accepted; not in a cell without "
      "one: no parameters and no service of that name.");
  f.number("timeout", s.timeout, positive("s"), "Longest wait for the result, wall clock.");
  f.number("start_timeout", s.start_timeout, positive("s"),
           "Longest wait for supervisor and simulator to be there, wall clock.");
}

ReportProgram::ReportProgram(ros::NodeHandle& nh, ros::NodeHandle& pnh) : nh_(nh) {
  const Forgotten forgotten(pnh.getNamespace());
  Parameters parameters(pnh);
  parameters.read(fieldsOf(settings_));
  details_.strategy = settings_.strategy;
  std::string word;
  details_.floor = pnh.getParam("insert", word);
  if (!details_.floor) details_.insert = parameters.number("insert", kAny, 0.0);
  const double depth = details_.insert;
  if (details_.floor ? word != "floor" : depth < 0.0 || depth > 1.0) {
    throw InputError(pnh.resolveName("insert") + ": value " +
                     (details_.floor ? word : text("%g", depth)) +
                     ": give a depth of 0 to 1 m, or floor");
  }
  parameters.markKnown("insert");
  parameters.refuseUnknown();
  if (details_.floor || details_.insert > 0.0) {
    assemble_ = std::make_unique<Client<AssemblePegAction>>(nh, "assemble", false);
  } else {
    align_ = std::make_unique<Client<AlignPegAction>>(nh, "align", false);
  }
  // the launch file may still be setting parameters
  waitForCell("parameter robot_description", [this] { return nh_.hasParam("robot_description"); });
  const CellDescription description =
      loadCellDescription(Parameters(nh_).text("robot_description"));
  details_.peg_radius = description.peg.radius;
  details_.chamfer_height = chamferHeight(description.peg);
  details_.hole_radius = description.hole.radius;
  details_.chamfer_depth = chamferDepth(description.hole);
  if (details_.floor) details_.insert = description.hole.depth;
}

bool ReportProgram::waitFor(const std::string& what, double timeout,
                            const std::function<bool()>& ready) const {
  const ros::WallTime deadline = ros::WallTime::now() + ros::WallDuration(timeout);
  while (ros::ok()) {
    if (ready()) return true;
    if (ros::WallTime::now() > deadline) {
      ROS_ERROR("report: no %s within %g s", what.c_str(), timeout);
      return false;
    }
    ros::WallDuration(0.01).sleep();
  }
  return false;
}

// Before the goal only the cell's master shows that it has ended.
bool ReportProgram::waitForCell(const std::string& what, const std::function<bool()>& ready) const {
  ros::WallTime asked = ros::WallTime::now();
  return waitFor(what, settings_.start_timeout, [&] {
    if (ros::WallTime::now() - asked > ros::WallDuration(kLostAfter)) {
      asked = ros::WallTime::now();
      if (!ros::master::check()) {
        throw std::runtime_error("server lost: no ROS master at " + ros::master::getURI() +
                                 " any more; has the launch ended?");
      }
    }
    return ready();
  });
}

std::optional<Pose> ReportProgram::truthAt(const ros::Time& stamp) const {
  std::lock_guard<std::mutex> lock(mutex_);
  if (stamp.isZero() && !truth_.empty()) return fromPose(truth_.back()->pose, "truth/pose");
  for (const auto& truth : truth_) {
    if (truth->header.stamp >= stamp) return fromPose(truth->pose, "truth/pose");
  }
  return std::nullopt;
}

bool ReportProgram::readTruth(const ros::Time& stamp, std::optional<Pose>& truth) const {
  return !truth_published_ || waitFor("message on truth/pose", kTruthTimeout, [&] {
    truth = truthAt(stamp);
    return truth.has_value();
  });
}

bool ReportProgram::othersAreThere() {
  if (!waitForCell("action server (is the supervisor running?)",
                   [this] { return serverIsThere(); })) {
    return false;
  }
  const std::string pause = settings_.simulator + "/pause";
  const auto is_there = [&pause] { return ros::service::exists(pause, false); };
  // the launch file of a simulated cell sets the simulator's parameters before any node starts
  settings_.unpause = settings_.unpause && (ros::param::has(settings_.simulator) || is_there());
  if (settings_.unpause &&
      !waitForCell("service " + pause + " (is the simulator running?)", is_there)) {
    return false;
  }
  ros::master::V_TopicInfo topics;
  ros::master::getTopics(topics);
  const std::string topic = nh_.resolveName("truth/pose");
  const auto published = [&topics](const std::string& name) {
    return std::any_of(topics.begin(), topics.end(),
                       [&name](const auto& info) { return info.name == name; });
  };
  truth_published_ = published(topic);
  // latched from the start
  return !published(nh_.resolveName("truth/mismatch")) ||
         waitFor("message on truth/mismatch", kTruthTimeout, [this] {
           std::lock_guard<std::mutex> lock(mutex_);
           return !details_.mismatch.empty();
         });
}

template <class ActionClient, class Goal, class Result>
bool ReportProgram::carryOut(ActionClient& client, const Goal& goal, Result& result) {
  const auto locked = [this](const bool& flag) {
    return [this, &flag] {
      std::lock_guard<std::mutex> lock(mutex_);
      return flag;
    };
  };
  // first the goal, then the clock: so the run starts with the first block
  client.sendGoal(
      goal,
      [this, &result](const actionlib::SimpleClientGoalState&, const Result& ended) {
        std::lock_guard<std::mutex> lock(mutex_);
        result = ended;
        active_ = done_ = true;
      },
      [this] {
        std::lock_guard<std::mutex> lock(mutex_);
        active_ = true;
      });
  // the server's connections end with it
  ros::WallTime there = ros::WallTime::now();
  const auto lost = [&] {
    if (client.isServerConnected()) there = ros::WallTime::now();
    return ros::WallTime::now() - there > ros::WallDuration(kLostAfter);
  };
  const auto isLost = [&](bool is_lost) {
    if (is_lost) ROS_ERROR("report: server lost: its node has gone; is the supervisor running?");
    return is_lost;
  };
  const auto accepted = locked(active_);
  if (!waitFor("acceptance of the goal", settings_.start_timeout,
               [&] { return accepted() || lost(); }) ||
      isLost(!accepted())) {
    return false;
  }
  if (settings_.unpause) {
    std_srvs::SetBool run;
    run.request.data = false;
    if (!callService(settings_.simulator + "/pause", run) || !run.response.success) {
      ROS_ERROR("report: %s/pause failed: %s", settings_.simulator.c_str(),
                run.response.message.c_str());
      return false;
    }
  }
  const auto done = locked(done_);
  needs_master = false;
  if (!waitFor("result of the goal", settings_.timeout, [&] { return done() || lost(); })) {
    client.cancelGoal();
    return false;
  }
  if (isLost(!done())) return false;
  if (!result) ROS_ERROR("report: the goal ended without a result");
  return result != nullptr;
}

bool ReportProgram::serverIsThere() const {
  return align_ ? align_->isServerConnected() : assemble_->isServerConnected();
}

bool ReportProgram::carryOut() {
  if (align_) {
    AlignPegGoal goal;
    goal.strategy = details_.strategy;
    AlignPegResultConstPtr result;
    if (!carryOut(*align_, goal, result)) return false;
    result_ = result->report;
    return true;
  }
  AssemblePegGoal goal;
  goal.strategy = details_.strategy;
  goal.floor = details_.floor;
  goal.depth = details_.floor ? 0.0 : details_.insert;
  AssemblePegResultConstPtr result;
  if (!carryOut(*assemble_, goal, result)) return false;
  result_ = result->report;
  details_.depth = result->depth;
  details_.force = result->force;
  for (std::size_t i = 0; i < result->profile_depth.size(); ++i) {
    BoreReading reading;
    reading.depth = result->profile_depth[i];
    reading.along = result->profile_along.at(i);
    reading.sideways = result->profile_sideways.at(i);
    reading.moment = result->profile_moment.at(i);
    details_.profile.push_back(reading);
  }
  return true;
}

int ReportProgram::run() {
  truth_sub_ = nh_.subscribe<geometry_msgs::PoseStamped>(
      "truth/pose", kTruthMemory, [this](const geometry_msgs::PoseStamped::ConstPtr& message) {
        std::lock_guard<std::mutex> lock(mutex_);
        truth_.push_back(message);
        if (truth_.size() > kTruthMemory) truth_.pop_front();
      });
  mismatch_sub_ = nh_.subscribe<std_msgs::String>(
      "truth/mismatch", 1, [this](const std_msgs::String::ConstPtr& message) {
        std::lock_guard<std::mutex> lock(mutex_);
        details_.mismatch = message->data;
      });
  // the truth before anything moves
  if (!othersAreThere() || !readTruth(ros::Time(), details_.truth_start) || !carryOut()) return 1;

  // the truth at the end of the last block that the supervisor used
  AlignmentReport report = result_;
  if (!readTruth(report.header.stamp, details_.truth_end)) return 1;
  // estimates refer to the peg hanging at rest; a little earlier, as stamps are rounded
  if (!report.reference.isZero() &&
      !readTruth(report.reference - ros::Duration(kRounding), details_.truth_start)) {
    return 1;
  }
  addTruth(report, details_);
  std::cout << table(report, details_) << std::flush;
  bool written = std::cout.good();
  if (!written) ROS_ERROR("report: can't write to standard output: is its disk full?");
  try {
    const std::string& path = settings_.report_file;
    if (!path.empty()) {
      writeFileAtomically(path, yaml(report, details_), "~report_file '" + printable(path) + "'");
    }
  } catch (const InputError& error) {
    ROS_ERROR("report: %s", error.what());
    written = false;
  }
  return written && verdict(report, details_) ? 0 : 1;
}

namespace {

// Without the number that makes this node's name its own.
std::string asGiven(std::string text) {
  const std::string name = ros::this_node::getName();
  const std::size_t end = name.rfind("/report_");
  if (end == std::string::npos) return text;
  boost::algorithm::replace_all(text, name, name.substr(0, end) + "/report");
  return text;
}

}  // namespace

int runReport(int argc, char** argv) {
  if (const auto answered = answerCommandLine(argc, argv, "report")) return *answered;
  // outlives the try block: with its last handle gone ROS shuts down and logs nothing any more
  std::unique_ptr<ros::NodeHandle> nh;
  try {
    if (const auto why = prepareProcess()) throw std::runtime_error(*why);
    // roscpp's own patience with a master that isn't there, or has gone, has no end
    ros::master::setRetryTimeout(ros::WallDuration(kLostAfter));
    // a name of its own, by which two goals have two names also while the cell's clock is stopped
    ros::init(argc, argv, "report", ros::init_options::AnonymousName);
    // a node handle would wait for the master for ever
    if (!ros::master::check()) {
      throw std::runtime_error("no ROS master at " + ros::master::getURI() +
                               ": start the cell first, or set ROS_MASTER_URI");
    }
    watchMaster("report", needs_master);
    nh = std::make_unique<ros::NodeHandle>();
    ros::NodeHandle pnh("~");
    ros::AsyncSpinner spinner(2);
    spinner.start();
    ReportProgram program(*nh, pnh);
    return endWithin(kEndTimeout, program.run());
  } catch (const InputError& error) {
    ROS_FATAL("report: %s", asGiven(error.what()).c_str());
    return endWithin(kEndTimeout, 2);
  } catch (const std::exception& error) {
    ROS_FATAL("report: %s", error.what());
    return endWithin(kEndTimeout, 1);
  }
}

}  // namespace assembly_cell::ros_bridge
