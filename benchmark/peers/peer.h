// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
// A scene for the package and for other engines: what all of them start from, what acts on their
// bodies, and their error measures.
#pragma once

#include <array>
#include <functional>
#include <limits>
#include <string>
#include <vector>

#include "assembly_cell/dynamics/simulation.h"

namespace assembly_cell::peers {

constexpr int kChecks = 6;  ///< times at which positions are compared
/// Centre of mass in thesis axes at the checks [m].
using Path = std::array<Eigen::Vector3d, kChecks>;

struct Scene {
  std::string name;
  Scenario scenario;
  Scenario bare;  ///< the same bodies with nothing that acts on them
  State start;
  double duration = 0.0;  ///< [s]
  bool touching = true;   ///< false: no contact, whatever the peg does
  Path truth{};           ///< of an extended-precision simulation that shares no code
  double truth_sd = 0.0;  ///< difference of two of its tolerances [m]

  double check(int i) const { return duration * (i + 1) / kChecks; }
};

/// Forces and torques of coupling, carrier springs, weight and exciter by the package's equations,
/// on bodies whose inertia is an engine's own matter. Axes of `hole`, about the centre of mass.
struct Applied {
  Eigen::Vector3d force, torque;
  Eigen::Vector3d carrier;  ///< x, y, yaw [N], [N m]
};

/// Where an engine's bodies are: the peg's centre of mass, and the carrier's x, y, yaw.
struct Bodies {
  Eigen::Matrix3d R;
  Eigen::Vector3d p, v, omega;  ///< axes of `hole`
  Eigen::Vector3d carrier, carrier_rate;
};
Bodies bodiesOf(const State& state);
State stateOf(const Bodies& bodies);
Applied applied(const Scene& scene, const Bodies& bodies, double t);

/// One way to run a scene.
struct Setting {
  std::string engine, how;  ///< package or peer, its integrator and setting
  /// A whole run: positions at the checks; counts steps.
  using Run = std::function<Path(long& steps)>;
  /// Bodies at their initial state, for each call; not part of the time.
  std::function<Run()> prepare;
};

struct Outcome {
  std::string engine, how;
  double error = std::numeric_limits<double>::infinity();  ///< largest at a check [m]
  double seconds = 0.0;  ///< of CPU time per simulated second, fastest of the repeats
  long steps = 0;
};
Outcome measure(const Scene& scene, const Setting& setting, int repeats);

/// Throws InputError where a scene's file can't be read.
std::vector<Scene> scenes();

std::vector<Setting> packageSettings(const Scene& scene);
std::vector<Setting> odeintSettings(const Scene& scene);
std::vector<Setting> mujocoSettings(const Scene& scene);  ///< built where it is installed
std::vector<Setting> odeSettings(const Scene& scene);     ///< built where it is installed

}  // namespace assembly_cell::peers
