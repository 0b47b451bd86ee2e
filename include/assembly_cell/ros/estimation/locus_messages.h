// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <assembly_cell/Exciter.h>
#include <assembly_cell/LocusEstimate.h>

#include "assembly_cell/locus/reading.h"

namespace assembly_cell::ros_bridge {

ExciterParameters exciterOf(const Exciter& message);

/// Message of a measurement, without its header and its refusal (the action's message), and back.
/// frequency: of the exciter [rad/s].
LocusEstimate toLocusEstimate(const LocusReading& reading, double frequency);
LocusReading fromLocusEstimate(const LocusEstimate& message);

}  // namespace assembly_cell::ros_bridge
