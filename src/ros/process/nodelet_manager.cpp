// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/ros/process/nodelet_manager.h"

#include <exception>
#include <sstream>
#include <vector>

#include "assembly_cell/base/input_error.h"
#include "assembly_cell/base/text.h"
#include "assembly_cell/ros/bridge/parameters.h"
#include "assembly_cell/ros/process/hosted_nodes.h"

namespace assembly_cell::ros_bridge {

NodeletLine parseNodeletLine(const std::string& line, const std::string& parameter) {
  NodeletLine out;
  std::istringstream words(line);
  words >> out.type >> out.name;
  bool good = !out.name.empty() && out.name.find(":=") == std::string::npos;
  for (std::string word; words >> word;) {
    const std::size_t sign = word.find(":=");
    good = good && sign != std::string::npos && sign > 0 && sign + 2 < word.size();
    if (good) out.remappings[word.substr(0, sign)] = word.substr(sign + 2);
  }
  if (good) return out;
  throw InputError("parameter " + parameter + ": '" + printable(line) +
                   "' is no nodelet: give TYPE NAME [FROM:=TO ...]");
}

NodeletManager::NodeletManager(ros::NodeHandle& nh, ros::NodeHandle& pnh) : loader_(pnh) {
  Parameters parameters(pnh);
  std::vector<NodeletLine> lines;
  for (const std::string& line : parameters.texts("nodelets")) {
    lines.push_back(parseNodeletLine(line, pnh.resolveName("nodelets")));
  }
  parameters.refuseUnknown({"num_worker_threads"});  // of the loader
  HostedNodes& hosted = HostedNodes::ofThisProcess();
  for (const NodeletLine& line : lines) {
    std::string why = "can't be loaded, see above";
    bool loaded = false;
    try {
      loaded = loader_.load(nh.resolveName(line.name, false), line.type, line.remappings, {});
    } catch (const std::exception& error) {
      why = printable(error.what(), 1000);
    }
    if (!loaded) hosted.fail(line.name, "nodelet " + line.type + ": " + why);
    if (hosted.failed()) return;
  }
  ROS_INFO("%s: %zu nodes in one process", pnh.getNamespace().c_str(), lines.size());
}

void NodeletManager::stop() {
  HostedNodes::ofThisProcess().stopAll();
  // their last messages are being sent
  if (ros::ok()) ros::WallDuration(0.1).sleep();
  loader_.clear();
}

int NodeletManager::exitCode() const { return HostedNodes::ofThisProcess().exitCode(); }

}  // namespace assembly_cell::ros_bridge
