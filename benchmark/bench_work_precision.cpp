// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
// Error against time and evaluations, for every contact law and integrator, as CSV on standard
// output. The errors are against an independent extended-precision simulation, see
// support/reference_mechanism.h; what is compared and what is left out: benchmark/README.md.
#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <exception>
#include <string>
#include <vector>

#include "assembly_cell/dynamics/simulation.h"
#include "peers/odeint_peer.h"
#include "support/reference_mechanism.h"

namespace assembly_cell {
namespace {

using Clock = std::chrono::steady_clock;
constexpr int kChecks = 6;       // times at which positions are compared
constexpr double kGiveUp = 2.0;  // a run slower than this is not repeated [s]
constexpr double kPatience =
    20.0;  // and one slower than this is the method's last in its scene [s]

struct Scene {
  std::string name, law, file;
  double duration;
  std::vector<std::string> overrides;
  std::array<reference::Meeting, 2> places{reference::Meeting::kEdgeEdge,
                                           reference::Meeting::kEdgeEdge};
};

struct Path {
  std::array<Eigen::Vector3d, kChecks> x;
  bool complete = false;
};

double difference(const Path& a, const Path& b) {
  double worst = 0.0;
  for (std::size_t i = 0; i < kChecks; ++i) {
    worst = std::max(worst, (a.x[i] - b.x[i]).cwiseAbs().maxCoeff());
  }
  return worst;
}

Scenario load(const Scene& scene) {
  std::vector<std::string> overrides = scene.overrides;
  // only errors bound the steps; contacts start at a gap of exactly zero
  overrides.push_back("solver.max_step=1e-3");
  if (scene.name == "sliding") overrides.push_back("initial.close=true");
  return loadScenario(
      std::string(ASSEMBLY_CELL_SOURCE_DIR) + "/config/scenarios/" + scene.file + ".yaml",
      overrides);
}

Path reference(const Scene& scene, long double tolerance, long& events) {
  Path path;
  reference::Mechanism<long double> mechanism(load(scene), tolerance, scene.places);
  for (int i = 0; i < kChecks; ++i) {
    if (!mechanism.advance(static_cast<long double>(scene.duration) * (i + 1) / kChecks)) {
      return path;
    }
    const auto& y = mechanism.state();
    path.x[static_cast<std::size_t>(i)] << static_cast<double>(y[0]), static_cast<double>(y[1]),
        static_cast<double>(y[2]);
  }
  events = mechanism.events();
  path.complete = true;
  return path;
}

struct Row {
  double error = NAN, seconds = NAN;
  long long evaluations = 0, steps = 0, events = 0;
  std::string status = "ok";
};

void print(const Scene& scene, const std::string& method, double control, const Row& r) {
  std::printf("%s,%s,\"%s\",%.3e,%.4e,%lld,%.4e,%lld,%lld,%s\n", scene.name.c_str(),
              scene.law.c_str(), method.c_str(), control, r.error, r.evaluations, r.seconds,
              r.steps, r.events, r.status.c_str());
  std::fflush(stdout);
}

Row measure(const Scene& scene, const Path& truth, const std::string& integrator, bool fixed,
            double control, int repeats) {
  Row row;
  Scenario s = load(scene);
  s.solver.integrator = integrator;
  (fixed ? s.solver.step : s.solver.tolerance) = control;
  Path path;
  row.seconds = 1e300;
  for (int n = 0; n < repeats; ++n) {
    Simulation sim(s);
    const auto start = Clock::now();
    StopReason reason = StopReason::kOk;
    for (int i = 0; i < kChecks && reason == StopReason::kOk; ++i) {
      reason = sim.advance(scene.duration * (i + 1) / kChecks);
      path.x[static_cast<std::size_t>(i)] = sim.state().q.head<3>();
    }
    const double seconds = std::chrono::duration<double>(Clock::now() - start).count();
    row.seconds = std::min(row.seconds, seconds);
    row.evaluations = sim.counts().evaluations;
    row.steps = sim.counts().steps;
    row.events = sim.counts().events;
    row.status = toString(reason);
    if (reason != StopReason::kOk) return row;
    if (seconds > kGiveUp) break;
  }
  row.error = difference(path, truth);
  return row;
}

// ---- peers: Boost.Odeint on the package's own free equations ----

template <typename Stepper>
Row measurePeer(const Scene& scene, const Path& truth, double tolerance, int repeats) {
  const Scenario s = load(scene);
  Row row;
  row.seconds = 1e300;
  Path path;
  const State start = Simulation(s).state();
  for (int n = 0; n < repeats; ++n) {
    peers::OdeintRun run(s, start);
    const auto begin = Clock::now();
    for (int i = 0; i < kChecks; ++i) {
      path.x[static_cast<std::size_t>(i)] =
          run.advance<Stepper>(scene.duration * (i + 1) / kChecks, tolerance);
    }
    const double seconds = std::chrono::duration<double>(Clock::now() - begin).count();
    row.seconds = std::min(row.seconds, seconds);
    row.evaluations = run.evaluations;
    row.steps = run.steps;
  }
  row.error = difference(path, truth);
  return row;
}

std::vector<Scene> scenes() {
  const std::vector<std::string> spring = {"contact.law=spring_dashpot", "contact.stiffness=1e5",
                                           "contact.damping=200"};
  const std::vector<std::string> viscous = {"contact.law=viscous", "contact.rate=700"};
  const std::vector<std::string> rigid = {"contact.law=rigid"};
  std::vector<Scene> all = {{"free",
                             "none",
                             "chapter8_damping_one_high",
                             0.06,
                             {"contact.law=none", "initial.close=false"}}};
  const struct {
    const char* name;
    const char* file;
    double duration;
  } touching[] = {{"impact", "impact", 0.05},
                  {"sliding", "sliding", 0.05},
                  {"stick-slip", "chapter8_force_one_3N", 0.03},
                  {"rattling", "chapter8_force_two_10N", 0.03},
                  {"insertion", "insertion", 0.03}};
  for (const auto& t : touching) {
    all.push_back({t.name, "spring_dashpot", t.file, t.duration, spring});
    all.push_back({t.name, "viscous", t.file, t.duration, viscous});
    all.push_back({t.name, "rigid", t.file, t.duration, rigid});
  }
  for (Scene& scene : all) {
    if (scene.name != "insertion") continue;
    scene.places = {reference::Meeting::kEdgeWall, reference::Meeting::kRimSide};
  }
  all.push_back({"bouncing",
                 "rigid",
                 "chapter8_force_one_10N",
                 0.03,
                 {"contact.law=rigid", "contact.restitution=0.5"}});
  return all;
}

struct Method {
  const char* name;  // as in the CSV
  const char* integrator;
  bool fixed;
};

int run(int repeats, const std::string& only) {
  const std::vector<Method> methods = {{"dopri5", "dopri5", false},
                                       {"dop853", "dop853", false},
                                       {"hamming", "hamming", false},
                                       {"rk4, fixed", "rk4", true},
                                       {"hamming, fixed", "hamming", true}};
  const std::array<double, 8> tolerances = {1e-7, 1e-8, 1e-9, 1e-10, 1e-11, 1e-12, 1e-13, 1e-14};
  const std::array<double, 8> steps = {1e-3, 5e-4, 2e-4, 1e-4, 5e-5, 2e-5, 1e-5, 5e-6};
  std::printf("scene,law,method,control,error,evaluations,seconds,steps,events,status\n");
  for (const Scene& scene : scenes()) {
    if (!only.empty() && scene.name != only && scene.law != only) continue;
    long events = 0;
    const Path truth = reference(scene, 1e-17L, events);
    const Path check = reference(scene, 1e-16L, events);
    Row own;
    own.events = events;
    own.status = truth.complete && check.complete ? "ok" : "reference_failed";
    own.error = own.status == "ok" ? difference(truth, check) : NAN;
    print(scene, "reference", 1e-17, own);
    if (own.status != "ok") continue;
    for (const Method& m : methods) {
      bool patient = true;
      for (const double control : m.fixed ? steps : tolerances) {
        Row row;
        row.status = "not_run_too_slow";
        if (patient) row = measure(scene, truth, m.integrator, m.fixed, control, repeats);
        patient = patient && !(row.seconds > kPatience);
        print(scene, m.name, control, row);
      }
    }
    if (scene.law != "none") continue;
    for (const double tolerance : tolerances) {
      namespace odeint = boost::numeric::odeint;
      print(scene, "odeint dopri5", tolerance,
            measurePeer<odeint::runge_kutta_dopri5<peers::OdeintState>>(scene, truth, tolerance,
                                                                        repeats));
      print(scene, "odeint rkf78", tolerance,
            measurePeer<odeint::runge_kutta_fehlberg78<peers::OdeintState>>(scene, truth, tolerance,
                                                                            repeats));
    }
  }
  return 0;
}

}  // namespace
}  // namespace assembly_cell

int main(int argc, char** argv) {
  int repeats = 5;
  std::string only;
  for (int i = 1; i < argc; ++i) {
    const std::string argument = argv[i];
    if (argument == "--repeats" && i + 1 < argc) {
      repeats = std::max(1, std::atoi(argv[++i]));
    } else if (argument == "--only" && i + 1 < argc) {
      only = argv[++i];
    } else {
      std::fprintf(stderr,
                   "usage: bench_work_precision [--repeats N] [--only SCENE|LAW] > run.csv\n");
      return argument == "--help" ? 0 : 2;
    }
  }
  try {
    return assembly_cell::run(repeats, only);
  } catch (const std::exception& e) {
    std::fprintf(stderr, "bench_work_precision: %s\n", e.what());
    return 1;
  }
}
