// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <string>

#include "assembly_cell/AssemblyRecord.h"
#include "assembly_cell/RuleVerdict.h"
#include "assembly_cell/records/run.h"

namespace assembly_cell::ros_bridge {

// A run and its message. The message leaves out what the recorder adds: id, station, simulation,
// verdicts.
AssemblyRecord toMessage(const Run& run);
/// The message has passed its check. Its scenario is not read.
Run fromMessage(const AssemblyRecord& message);

}  // namespace assembly_cell::ros_bridge
