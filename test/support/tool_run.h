// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <sys/wait.h>

#include <cstdlib>
#include <fstream>
#include <iterator>
#include <string>

#include "temporary_folder.h"

namespace assembly_cell::test {

inline std::string textOf(const std::string& path) {
  std::ifstream file(path);
  return {std::istreambuf_iterator<char>(file), {}};
}

struct ToolRun {
  int code = -1;
  std::string out, error;

  std::string text() const { return out + error; }
};

/// Runs a tool of the package by its shell command, in `folder`; empty: in the present one.
inline ToolRun runTool(const std::string& command, const std::string& folder = "") {
  const TemporaryFolder streams;
  const std::string line = (folder.empty() ? "" : "cd " + folder + " && ") +
                           std::string(ASSEMBLY_CELL_BIN_DIR "/") + command + " >" +
                           (streams / "out") + " 2>" + (streams / "error");
  const int status = std::system(line.c_str());
  return {WIFEXITED(status) ? WEXITSTATUS(status) : -1, textOf(streams / "out"),
          textOf(streams / "error")};
}

}  // namespace assembly_cell::test
