// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/ros/process/command_line.h"

#include <ros/names.h>

#include <cstdio>

namespace assembly_cell::ros_bridge {

std::optional<int> answerCommandLine(int argc, char** argv, const std::string& node) {
  for (int i = 1; i < argc; ++i) {
    const std::string argument = argv[i];
    if (const std::size_t at = argument.find(":="); at != std::string::npos) {
      // ROS's own error for such a name has no remedy
      std::string why;
      if (argument[0] == '_' || ros::names::validate(argument.substr(at + 2), why)) continue;
      std::fprintf(stderr,
                   "%s: '%s' would rename a topic, to what is no name: a parameter has an "
                   "underscore before it, _%s\n",
                   node.c_str(), argument.c_str(), argument.c_str());
      return 2;
    }
    if (argument == "--help" || argument == "-h") {
      std::printf(
          "usage: rosrun assembly_cell %s [_PARAMETER:=VALUE ...] [TOPIC:=NAME ...]\n"
          "Its parameters, topics and services: docs/reference/interfaces.md of the package and "
          "the page "
          "that it has for each.\n",
          node.c_str());
      return 0;
    }
    std::fprintf(stderr,
                 "%s: unknown argument '%s': parameters are given as _NAME:=VALUE, see --help\n",
                 node.c_str(), argument.c_str());
    return 2;
  }
  return std::nullopt;
}

}  // namespace assembly_cell::ros_bridge
