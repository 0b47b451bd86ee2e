// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "assembly_cell/records/run.h"

namespace assembly_cell {

struct Band;

/// The rules of all programs, as files say: boxes and bands. Read once, constant.
class RunRules {
 public:
  RunRules();
  ~RunRules();
  /// paths: YAML files, or folders of them (*.yaml). Throws InputError naming the file: what isn't
  /// readable as a rule, two bands for one program, a curve quantity that doesn't exist.
  explicit RunRules(const std::vector<std::string>& paths);

  /// What the rules for the run's program state of its curve; none for a program without rules.
  std::vector<RunVerdict> evaluate(const Run& run) const;
  /// The band for a program, to show; null: none.
  const Band* band(const std::string& program) const;

 private:
  struct Data;
  std::shared_ptr<const Data> data_;
};

}  // namespace assembly_cell
