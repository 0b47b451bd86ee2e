// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <string>

#include "assembly_cell/base/yaml_section.h"
#include "assembly_cell/mechanism/mechanism.h"

// The mechanism's keys of a scenario or mechanism file. All throw InputError.
namespace assembly_cell::mechanism_file {

// beyond these a number is a slip of the pen, and a run with it would not end
constexpr double kLargestLength = 1e3;     // [m]
constexpr double kLargestAngle = 1e3;      // [rad]
constexpr double kLargestFrequency = 1e6;  // [rad/s]

double readLength(yaml::Section& in, const std::string& key, yaml::Range range);
double readAngle(yaml::Section& in, const std::string& key);
Eigen::Vector3d readTriple(yaml::Section& in, const std::string& key, double largest);
/// Refuses a theta near the singularity of the Euler angles.
void checkTheta(const yaml::Section& in, const std::string& key, double theta);

/// gravity, peg, hole, carrier, coupling, exciter and friction. The rest pose in carrier.rest and
/// coupling.rest is read where it is asked for, otherwise it may be left out.
Mechanism readMechanism(yaml::Section& in, RestPose* rest);

}  // namespace assembly_cell::mechanism_file
