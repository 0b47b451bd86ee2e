// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
// Windows of force over depth, as monitors of press fits have them.
#pragma once

#include <limits>
#include <string>

#include "assembly_cell/base/yaml_section.h"
#include "assembly_cell/records/run.h"

namespace assembly_cell {

struct CurveBox {
  enum class Kind { kPass, kRange, kMaximum, kEnd };
  enum class Side { kLeft, kRight, kTop, kBottom, kInside, kAny };
  std::string name;
  Kind kind = Kind::kRange;
  std::string quantity;
  bool over_time = false;
  double from = -std::numeric_limits<double>::infinity();  // of the path [m] or [s]
  double to = std::numeric_limits<double>::infinity();
  double low = -std::numeric_limits<double>::infinity();
  double high = std::numeric_limits<double>::infinity();
  Side entry = Side::kAny, exit = Side::kAny;
};

/// Throws InputError.
CurveBox readBox(yaml::Section section);

RunVerdict evaluateBox(const CurveBox& box, const Curve& curve);

}  // namespace assembly_cell
