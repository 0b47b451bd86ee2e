// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "peer.h"

#include <algorithm>
#include <cmath>
#include <ctime>
#include <memory>

#include "../support/reference_mechanism.h"
#include "assembly_cell/base/input_error.h"

namespace assembly_cell::peers {
namespace {

using Eigen::Vector3d;

constexpr double kLong = 1.0;  // a run that takes longer is not repeated [s]

double cpuSeconds() {
  std::timespec now{};
  clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &now);
  return static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec);
}

Path referencePath(const Scene& scene, long double tolerance) {
  reference::Mechanism<long double> mechanism(
      scene.scenario, tolerance, {reference::Meeting::kEdgeEdge, reference::Meeting::kEdgeEdge});
  Path path;
  for (int i = 0; i < kChecks; ++i) {
    if (!mechanism.advance(static_cast<long double>(scene.duration) * (i + 1) / kChecks)) {
      throw InputError("scene " + scene.name + ": its reference ends before its time");
    }
    const auto& y = mechanism.state();
    path[static_cast<std::size_t>(i)] << static_cast<double>(y[0]), static_cast<double>(y[1]),
        static_cast<double>(y[2]);
  }
  return path;
}

double difference(const Path& a, const Path& b) {
  double worst = 0.0;
  for (std::size_t i = 0; i < kChecks; ++i) {
    const double here = (a[i] - b[i]).cwiseAbs().maxCoeff();
    worst = std::isfinite(here) ? std::max(worst, here) : INFINITY;
  }
  return worst;
}

Scene make(const std::string& name, const std::string& file, double duration,
           std::vector<std::string> overrides) {
  Scene scene;
  scene.name = name;
  scene.duration = duration;
  overrides.push_back("solver.max_step=1e-3");  // only errors bound the steps
  scene.scenario = loadScenario(
      std::string(ASSEMBLY_CELL_SOURCE_DIR) + "/config/scenarios/" + file + ".yaml", overrides);
  scene.touching = scene.scenario.contact.law != ContactLaw::kNone;
  scene.bare = scene.scenario;
  Mechanism& bare = scene.bare.mechanism;
  bare.gravity = 0.0;
  bare.coupling = CouplingParameters{};
  bare.carrier.stiffness.setZero();
  bare.carrier.damping.setZero();
  scene.bare.push.setZero();
  scene.start = Simulation(scene.scenario).state();
  scene.truth = referencePath(scene, 1e-17L);
  scene.truth_sd = difference(scene.truth, referencePath(scene, 1e-16L));
  return scene;
}

}  // namespace

Bodies bodiesOf(const State& state) {
  const Kinematics k = kinematics(state);
  return {rotationFromEuler({state.q(3), state.q(4), state.q(5)}),
          fromThesisAxes(k.x),
          fromThesisAxes(k.v),
          fromThesisAxes(k.omega),
          state.q.tail<3>(),
          state.v.tail<3>()};
}

State stateOf(const Bodies& b) {
  State state;
  const EulerAngles angles = eulerFromRotation(b.R);
  state.q << toThesisAxes(b.p), angles.phi, angles.theta, angles.psi, b.carrier;
  const Kinematics k = kinematics(state);
  state.v << toThesisAxes(b.v), k.Re.inverse() * toThesisAxes(b.omega), b.carrier_rate;
  return state;
}

Applied applied(const Scene& scene, const Bodies& bodies, double t) {
  const State state = stateOf(bodies);
  const Kinematics k = kinematics(state);
  const RestMotion rest = restMotion(restProfile(scene.scenario.rest), t);
  FreeMotion all, inertia;
  freeMotion(scene.scenario, k, state, rest,
             exciterForce(Drive{scene.scenario.mechanism.exciter, 0.0}, t), all);
  freeMotion(scene.bare, k, state, rest, Eigen::Vector2d::Zero(), inertia);
  const Vector9 f = all.force - inertia.force;
  return {fromThesisAxes(f.head<3>()), fromThesisAxes(k.Re.transpose().inverse() * f.segment<3>(3)),
          f.tail<3>()};
}

Outcome measure(const Scene& scene, const Setting& setting, int repeats) {
  Outcome out;
  out.engine = setting.engine;
  out.how = setting.how;
  out.seconds = std::numeric_limits<double>::infinity();
  for (int i = 0; i < repeats; ++i) {
    out.steps = 0;
    const Setting::Run run = setting.prepare();
    const double begin = cpuSeconds();
    const Path path = run(out.steps);
    const double took = cpuSeconds() - begin;
    out.error = difference(path, scene.truth);
    out.seconds = std::min(out.seconds, took / scene.duration);
    if (took > kLong) break;
  }
  return out;
}

std::vector<Scene> scenes() {
  return {make("smooth", "chapter8_damping_one_high", 0.06,
               {"contact.law=none", "initial.close=false"}),
          make("two points slide", "sliding", 0.05, {"contact.law=rigid", "initial.close=true"}),
          make("two points rattle", "chapter8_force_two_10N", 0.03, {"contact.law=rigid"})};
}

std::vector<Setting> packageSettings(const Scene& scene) {
  std::vector<Setting> all;
  for (const char* integrator : {"dopri5", "dop853"}) {
    for (const double tolerance : {1e-4, 1e-5, 1e-6, 1e-7, 1e-8, 1e-9, 1e-10, 1e-11, 1e-12}) {
      char how[64];
      std::snprintf(how, sizeof how, "%s, tolerance %.0e m", integrator, tolerance);
      Scenario s = scene.scenario;
      s.solver.integrator = integrator;
      s.solver.tolerance = tolerance;
      all.push_back({"assembly_cell", how, [&scene, s] {
                       const auto sim = std::make_shared<Simulation>(s);
                       return [&scene, sim](long& steps) {
                         Path path;
                         for (int i = 0; i < kChecks; ++i) {
                           const bool ok = sim->advance(scene.check(i)) == StopReason::kOk;
                           path[static_cast<std::size_t>(i)] =
                               ok ? Vector3d(sim->state().q.head<3>()) : Vector3d::Constant(NAN);
                         }
                         steps = static_cast<long>(sim->counts().steps);
                         return path;
                       };
                     }});
    }
  }
  return all;
}

}  // namespace assembly_cell::peers
