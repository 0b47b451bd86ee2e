// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "node_link.h"

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <vector>

#include "assembly_cell/base/text.h"
#include "assembly_cell/ros/process/node_watch.h"

namespace assembly_cell::panel {

namespace {

using namespace ros_bridge;

constexpr auto kTimeout = std::chrono::seconds(60);  // for the answer of a service
constexpr double kCheckPeriod = 1.0;                 // [s]
constexpr double kAnswerTime = 0.5;                  // of a node that isn't frozen [s]

double finite(double value) { return std::isfinite(value) ? value : 0.0; }
double numberOf(const std::string& text) { return finite(std::atof(text.c_str())); }

}  // namespace

NodeLink::NodeLink(const ros::NodeHandle& nh, AsyncRequests& requests)
    : requests_(requests), topics_{nh, mutex_} {
  diagnostics_sub_ = topics_.subscribe<diagnostic_msgs::DiagnosticArray>(
      "/diagnostics", [this](const diagnostic_msgs::DiagnosticArray& array) { update(array); });
  timer_ = topics_.nh.createWallTimer(ros::WallDuration(kCheckPeriod),
                                      [this](const ros::WallTimerEvent&) { check(); });
}

void NodeLink::show(CellView& view) const {
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    view.nodes = registry_.view(Clock::now());
    view.simulator = simulator_;
    view.goal_force_limit = force_limit_;
  }
  const auto simulator = std::find_if(view.nodes.begin(), view.nodes.end(), [](const NodeView& n) {
    return n.node == knownNodes().front().name;
  });
  view.simulator.message = simulator->reason;
  view.simulator.paused = simulator->reason == "paused";
  view.simulator.there = simulator->light != Light::kNotThere && !simulator->silent;
}

void NodeLink::update(const diagnostic_msgs::DiagnosticArray& array) {
  // "/" or "/cell_1"; names of nodes have no first slash
  std::string prefix = topics_.nh.getNamespace().substr(1);
  if (!prefix.empty()) prefix += "/";
  for (const auto& status : array.status) {
    const std::size_t colon = status.name.find(": ");
    if (colon == std::string::npos || status.name.compare(0, prefix.size(), prefix) != 0) continue;
    const std::string node = status.name.substr(prefix.size(), colon - prefix.size());
    registry_.update(node, printable(status.name.substr(colon + 2)), status.level,
                     printable(status.message, 300), Clock::now());
    if (node != knownNodes().front().name) continue;
    for (const auto& value : status.values) {
      if (value.key == "Simulated time [s]") simulator_.time = numberOf(value.value);
      if (value.key == "Real-time factor") simulator_.real_time_factor = numberOf(value.value);
    }
  }
}

void NodeLink::check() {
  requests_.abandonAfter(kTimeout);
  std::vector<std::string> silent;
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    silent = registry_.silent(Clock::now());
  }
  requests_.start(
      "check",
      [this, silent] {
        for (const std::string& node : silent) checkSilent(node);
        double limit = 0.0;
        topics_.nh.getParam("assembly_supervisor/force_limit", limit);
        std::string sensors;
        topics_.nh.getParam("assembly_supervisor/sensors", sensors);
        const std::lock_guard<std::mutex> lock(mutex_);
        force_limit_ = finite(limit);
        registry_.setOneSensor(sensors == "b");
        return Answer{Answer::State::kGood, "", {}, 0};
      },
      nullptr, true);
}

void NodeLink::checkSilent(const std::string& node) {
  const auto known = std::find_if(knownNodes().begin(), knownNodes().end(),
                                  [&node](const KnownNode& k) { return node == k.name; });
  if (known == knownNodes().end() || *known->topic == '\0') return;
  const auto found = publishersOf({topics_.nh.resolveName(known->topic)}, kAnswerTime);
  using ExitState = NodeRegistry::ExitState;
  ExitState state = ExitState::kEnded;
  for (const TopicPublisher& publisher : found) {
    if (publisher.presence == NodePresence::kGone) state = ExitState::kGone;
    if (publisher.presence == NodePresence::kMute) state = ExitState::kFrozen;
    if (publisher.presence == NodePresence::kListening) state = ExitState::kUnknown;
  }
  const std::lock_guard<std::mutex> lock(mutex_);
  registry_.setExitState(node, state);
}

}  // namespace assembly_cell::panel
