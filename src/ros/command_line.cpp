// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/ros/command_line.h"

#include <cstdio>

namespace assembly_cell::ros_bridge {

std::optional<int> answerCommandLine(int argc, char** argv, const std::string& node) {
  for (int i = 1; i < argc; ++i) {
    const std::string argument = argv[i];
    if (argument.find(":=") != std::string::npos) continue;
    if (argument == "--help" || argument == "-h") {
      std::printf(
          "usage: rosrun assembly_cell %s [_PARAMETER:=VALUE ...] [TOPIC:=NAME ...]\n"
          "Its parameters, topics and services: docs/interfaces.md of the package.\n",
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
