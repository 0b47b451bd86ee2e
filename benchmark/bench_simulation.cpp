// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
// What the mechanism's simulation costs, each time with the error it buys. See benchmark/README.md.
#include <Eigen/Core>
#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <exception>
#include <string>
#include <vector>

#include "../test/geometry/single_slot.h"
#include "assembly_cell/cell/align_trial.h"
#include "assembly_cell/cell/simulated_cell.h"
#include "assembly_cell/cell/start.h"
#include "assembly_cell/dynamics/simulation.h"
#include "marker.h"

namespace assembly_cell {
namespace {

using Eigen::Vector3d;

constexpr double kPi = 3.14159265358979323846;
constexpr int kRepeats = 7;

Scenario load(const std::string& name, const std::vector<std::string>& overrides = {}) {
  return loadScenario(std::string(ASSEMBLY_CELL_SOURCE_DIR) + "/config/scenarios/" + name + ".yaml",
                      overrides);
}

// Bottom edge centre, tilt towards an angle from x; pressed by lowering the coupling's rest.
void place(Scenario& s, const Vector3d& bottom, double tilt, double lean, double press) {
  const Vector3d axis(std::sin(tilt) * std::cos(lean), std::sin(tilt) * std::sin(lean),
                      std::cos(tilt));
  s.initial.close = press > 0.0;
  s.initial.euler = {std::atan2(axis.x(), axis.z()), std::acos(axis.y()), 0.0};
  s.initial.position = bottom + s.mechanism.peg.half_height * axis;
  const Vector3d coupling = s.initial.position + s.mechanism.peg.coupling_height * axis;
  s.initial.carrier_x = coupling.x();
  s.initial.carrier_y = coupling.y();
  s.rest = {coupling.x(), coupling.y(),          coupling.z(),
            0.0,          s.initial.euler.theta, s.initial.euler.phi};
  if (press > 0.0) {
    s.initial.position.z() = Simulation(s).state().q(0);
    s.rest.z = s.initial.position.z() + s.mechanism.peg.coupling_height * axis.z() - press;
    s.initial.close = false;
  }
}

Scenario farAbove() {
  Scenario s = load("cell");
  place(s, {0.004, 0, 0.02}, 0.05, kPi, 0.0);
  return s;
}
Scenario oneOnThePlane() {
  Scenario s = load("cell");
  place(s, {0.05, 0.02, 0.01}, 0.05, 0.0, 1e-4);
  return s;
}
// leaning across the offset one edge crossing carries, leaning towards the hole both do
Scenario oneEdge() {
  Scenario s = load("cell");
  place(s, {0.0032, 0.0050, 0.01}, 0.05, 3.34, 1e-4);
  return s;
}
Scenario twoEdges() {
  Scenario s = load("cell");
  place(s, {0.004, 0, 0.01}, 0.05, kPi, 1e-4);
  return s;
}

struct Run {
  double seconds = 0.0;  // of wall time, the fastest of the repeats
  RunCounts counts;
  State state;
  int closed = 0;
  StopReason reason = StopReason::kOk;
};

// `duration` of simulated time after `settle` of it, in samples of 0.2 ms as those of the cell
Run measure(const Scenario& s, double duration, double settle = 0.0, int repeats = kRepeats) {
  Run run;
  run.seconds = 1e300;
  for (int i = 0; i < repeats; ++i) {
    Simulation sim(s);
    run.reason = sim.advance(settle);
    const RunCounts before = sim.counts();
    const auto samples = static_cast<int>(std::lround(duration / 2e-4));
    const auto start = std::chrono::steady_clock::now();
    for (int k = 1; k <= samples; ++k) run.reason = sim.advance(settle + 2e-4 * k);
    const std::chrono::duration<double> elapsed = std::chrono::steady_clock::now() - start;
    run.seconds = std::min(run.seconds, elapsed.count());
    run.counts = sim.counts();
    run.counts.evaluations -= before.evaluations;
    run.counts.steps -= before.steps;
    run.counts.events -= before.events;
    run.state = sim.state();
    run.closed = 0;
    for (const ContactReport& c : sim.contacts()) {
      run.closed += c.valid && c.state != ContactReport::kOpen ? 1 : 0;
    }
  }
  return run;
}

double nsPerEvaluation(const Run& r) {
  return 1e9 * r.seconds / static_cast<double>(r.counts.evaluations);
}

// largest difference of the three positions of the peg [m]
double error(const Run& r, const Run& reference) {
  return (r.state.q - reference.state.q).head<3>().cwiseAbs().maxCoeff();
}

Run referenceOf(Scenario s, double duration, double settle) {
  s.solver.integrator = "dopri5";
  s.solver.tolerance = 1e-13;
  return measure(s, duration, settle, 1);
}

void printRun(const char* name, const Run& r, double e, double duration) {
  std::printf("%-42s %8.0f %9lld %7lld %6lld %8d %10.1f   %.1e%s%s\n", name, nsPerEvaluation(r),
              static_cast<long long>(r.counts.evaluations), static_cast<long long>(r.counts.steps),
              static_cast<long long>(r.counts.events), r.closed, duration / r.seconds, e,
              r.reason == StopReason::kOk ? "" : "  stopped: ",
              r.reason == StopReason::kOk ? "" : toString(r.reason));
}

void header(const char* title) {
  std::printf("\n%s\n%-42s %8s %9s %7s %6s %8s %10s   %s\n", title, "", "ns/rhs", "rhs", "steps",
              "events", "contacts", "real time", "error [m]");
}

void rightHandSides() {
  const double duration = 0.1, settle = 0.1;
  header("Right-hand side by contact count and law, 0.1 s of the cell with the exciter at 0.1 N");
  struct Case {
    const char* name;
    Scenario scene;
  };
  std::vector<Case> cases = {{"free, law none", farAbove()},
                             {"free, viscous", farAbove()},
                             {"1 edge-plane, viscous, stationary rows", oneOnThePlane()},
                             {"1 edge-plane, viscous, regularised", oneOnThePlane()},
                             {"1 edge-plane, spring_dashpot", oneOnThePlane()},
                             {"1 edge-edge, viscous, stationary rows", oneEdge()},
                             {"1 edge-edge, viscous, regularised", oneEdge()},
                             {"2 edge-edge, viscous, stationary rows", twoEdges()},
                             {"2 edge-edge, viscous, regularised", twoEdges()},
                             {"2 edge-edge, spring_dashpot", twoEdges()},
                             {"1 edge-plane, rigid", oneOnThePlane()},
                             {"1 edge-edge, rigid", oneEdge()},
                             {"2 edge-edge, rigid", twoEdges()}};
  for (Case& c : cases) {
    const std::string name = c.name;
    const auto has = [&](const char* word) { return name.find(word) != std::string::npos; };
    if (has("none")) c.scene.contact.law = ContactLaw::kNone;
    if (has("regularised")) c.scene.contact.stationary_rows = false;
    if (has("rigid")) c.scene.contact.law = ContactLaw::kRigid;
    if (has("spring")) {
      c.scene.contact.law = ContactLaw::kSpringDashpot;
      c.scene.contact.stiffness = 1e5;
      c.scene.contact.damping = 200;
    }
    c.scene.mechanism.exciter.amplitude = 0.1;
    const Run run = measure(c.scene, duration, settle);
    printRun(c.name, run, error(run, referenceOf(c.scene, duration, settle)), duration);
  }
}

// Chapter 8 of the thesis, two points, high stiffness, 0.15 s with the rigid law at 1e-7 m
void vibratedRuns() {
  header("Rigid law, 0.15 s, two points, high stiffness, tolerance 1e-7 m, events included");
  struct Case {
    const char* name;
    double force, rest, across, about;
  };
  for (const Case& c : {Case{"0.3 N, medium damping", 0.3, 0.0, 28, 0.015},
                        Case{"10 N, high damping, x1e = 60 mm", 10, 0.06, 280, 0.15}}) {
    Scenario s = load(
        "sliding",
        {"friction.static=0.35", "friction.sliding=0.35", "push=[0, 0, 0]", "carrier.mass=0.396",
         "carrier.inertia=1.0e-3", "coupling.stiffness.diagonal=[100, 5.0e4, 5.0e4, 50, 50, 50]",
         "coupling.stiffness.k26=158", "coupling.stiffness.k35=-158", "exciter.frequency=1000",
         "exciter.phase=-1.5707963267948966", "solver.max_step=0.002", "solver.tolerance=1e-7"});
    s.mechanism.coupling.damping.diagonal << 0, c.across, c.across, c.about, c.about, c.about;
    s.rest.z = c.rest;
    s.mechanism.exciter.amplitude = c.force;
    double best = 1e300;
    RunCounts counts;
    for (int i = 0; i < 5 * kRepeats; ++i) {
      const auto start = std::chrono::steady_clock::now();
      Simulation sim(s);
      sim.advance(0.15);
      const std::chrono::duration<double> elapsed = std::chrono::steady_clock::now() - start;
      best = std::min(best, elapsed.count());
      counts = sim.counts();
    }
    std::printf("%-42s %8.3f ms, %lld rhs, %lld events, %lld impacts\n", c.name, 1e3 * best,
                static_cast<long long>(counts.evaluations), static_cast<long long>(counts.events),
                static_cast<long long>(counts.impacts));
  }
}

// Two scenes in turn, the fastest of each: what the machine does meanwhile hits both.
struct Pair {
  Run first, second;
  double more() const { return second.seconds / first.seconds - 1.0; }  // of the second
};
Pair compare(const Scenario& first, const Scenario& second, double duration) {
  Pair p;
  for (int i = 0; i < 12 * kRepeats; ++i) {
    const Run a = measure(first, duration, 0.0, 1), b = measure(second, duration, 0.0, 1);
    const double sa = i == 0 ? a.seconds : std::min(a.seconds, p.first.seconds);
    const double sb = i == 0 ? b.seconds : std::min(b.seconds, p.second.seconds);
    p.first = a;
    p.second = b;
    p.first.seconds = sa;
    p.second.seconds = sb;
  }
  return p;
}

double nsPerStep(const Run& r) { return 1e9 * r.seconds / static_cast<double>(r.counts.steps); }

void skipRow(const char* name, const Pair& p) {
  const double ns = nsPerStep(p.second) - nsPerStep(p.first);
  std::printf("%-58s %8.1f %8.1f %7.1f %7.1f %%  %s\n", name, nsPerStep(p.first),
              nsPerStep(p.second), ns, 100 * p.more(),
              p.first.state.q == p.second.state.q ? "same end to the bit" : "");
}

// the carrier's rows of the equations of motion, to the operation
double carrierRows() {
  double best = 1e300;
  volatile double sink = 0.0;
  const Scenario s = load("cell");
  const CarrierParameters& c = s.mechanism.carrier;
  constexpr int n = 20000;
  for (int i = 0; i < 5 * kRepeats; ++i) {
    Vector3d q(1e-3, 2e-3, 3e-3), v(0.1, 0.2, 0.3), a = Vector3d::Zero();
    const auto start = std::chrono::steady_clock::now();
    for (int k = 0; k < n; ++k) {
      a(0) = (v(1) - c.stiffness(0) * (q(0) - s.rest.x) - c.damping(0) * v(0)) / c.mass;
      a(1) = (v(2) - c.stiffness(1) * (q(1) - s.rest.y) - c.damping(1) * v(1)) / c.mass;
      a(2) = (v(0) - c.stiffness(2) * (q(2) - s.rest.yaw) - c.damping(2) * v(2)) / c.inertia;
      q += 1e-9 * v;
      v += 1e-9 * a;
    }
    sink = sink + a.sum();
    const std::chrono::duration<double> elapsed = std::chrono::steady_clock::now() - start;
    best = std::min(best, 1e9 * elapsed.count() / n);
  }
  return best;
}

void skips() {
  const double duration = 0.2;
  std::printf(
      "\nWhat each skip saves, 0.2 s in samples of 0.2 ms, pairs run in turn (fastest of %d)\n"
      "%-58s %8s %8s %7s %9s\n",
      12 * kRepeats, "", "ns/step", "without", "saved", "");
  // no contact search while bounds exclude contact: nothing to search, bounds at work, and a peg
  // that hovers where they can't tell
  Scenario above = farAbove();
  above.contact.law = ContactLaw::kRigid;
  above.initial.velocity = Vector3d(0.01, 0, 0);
  Scenario none = above;
  none.contact.law = ContactLaw::kNone;
  const Pair bound = compare(none, above, duration);
  std::printf(
      "contact-free steps, law none and law rigid above the plane: search costs %.1f %% "
      "(at most 3 %% asked), %.1f ns of %.1f a step; steps %lld and %lld, end %s\n",
      100 * bound.more(), nsPerStep(bound.second) - nsPerStep(bound.first), nsPerStep(bound.second),
      static_cast<long long>(bound.first.counts.steps),
      static_cast<long long>(bound.second.counts.steps),
      bound.first.state.q == bound.second.state.q ? "equal to the bit" : "differs");
  Scenario hovering = twoEdges();
  hovering.contact.law = ContactLaw::kRigid;
  hovering.initial.position.z() += 2e-5;
  hovering.rest.z += 1.2e-4;
  hovering.rest.z += hovering.mechanism.peg.mass * hovering.mechanism.gravity /
                     hovering.mechanism.coupling.stiffness.diagonal(0);
  Scenario unsearched = hovering;
  unsearched.contact.law = ContactLaw::kNone;
  const Pair searched = compare(unsearched, hovering, duration);
  skipRow("no search while bounds exclude contact (hovering 20 um up)", searched);

  // warm starts: what a search costs when the bounds can't answer
  EdgeCircle edge{{0.0, 0.004, 0.0}, Vector3d::Zero(), Vector3d::UnitZ(), 0.025};
  edge.axis0 = Vector3d(std::sin(0.05), std::cos(0.05), 0.0);
  double cold = 1e300, warm = 1e300, sum = 0.0;
  constexpr int n = 20000;
  for (int i = 0; i < kRepeats; ++i) {
    for (const bool use_warm : {false, true}) {
      double t = findEdgeEdge(edge, 0.0251, 0, false, 0.0).t;
      const auto start = std::chrono::steady_clock::now();
      for (int k = 0; k < n; ++k) {
        edge.center(1) = 0.004 + 1e-9 * k;
        const ContactPoint c = findEdgeEdge(edge, 0.0251, 0, use_warm, t);
        t = c.t;
        sum += c.gap;
      }
      const std::chrono::duration<double> elapsed = std::chrono::steady_clock::now() - start;
      double& best = use_warm ? warm : cold;
      best = std::min(best, 1e9 * elapsed.count() / n);
    }
  }
  std::printf("%-58s %8.1f %8.1f %7.1f %7.1f %%  a slot (sum %.1e)\n", "warm-started candidates",
              warm, cold, cold - warm, 100 * (cold / warm - 1), sum);

  // no exciter terms when off
  Scenario on = none;
  on.mechanism.exciter.amplitude = 1e-9;  // moves nothing, costs all
  skipRow("no exciter terms when off", compare(none, on, duration));

  // no friction rows at mu = 0: a point that slides freely has one row, a sticking one three
  Scenario smooth = oneOnThePlane();
  smooth.contact.law = ContactLaw::kRigid;
  smooth.mechanism.friction = {0.0, 0.0};
  Scenario rough = oneOnThePlane();
  rough.contact.law = ContactLaw::kRigid;
  skipRow("no friction rows at mu = 0 (against sticking, mu = 0.2)",
          compare(smooth, rough, duration));
  Scenario pair_smooth = twoEdges(), pair_rough = twoEdges();
  for (Scenario* s : {&pair_smooth, &pair_rough}) s->contact.law = ContactLaw::kRigid;
  pair_smooth.mechanism.friction = {0.0, 0.0};
  skipRow("the same with two points", compare(pair_smooth, pair_rough, duration));

  std::printf("%-58s %8s %8s %7.1f %9s  kept: all scenes have a carrier\n",
              "no carrier equations where the carrier is absent", "", "", carrierRows(), "ns/rhs");
}

struct BlockTime {
  double fastest = 1e300, slowest = 0.0;  // [s]
};

template <class Block>
BlockTime blockTime(const Block& block) {
  for (int k = 0; k < 5; ++k) block();
  BlockTime time;
  for (int k = 0; k < 50; ++k) {
    const auto start = std::chrono::steady_clock::now();
    block();
    const std::chrono::duration<double> elapsed = std::chrono::steady_clock::now() - start;
    time.fastest = std::min(time.fastest, elapsed.count());
    time.slowest = std::max(time.slowest, elapsed.count());
  }
  return time;
}

void realTime() {
  std::printf(
      "\nReal-time factor of the whole cell: both bridges, 5 kHz, blocks of 100 samples; then of "
      "blocks whose samples are not read\n");
  for (const bool vibrated : {false, true}) {
    for (const bool contact : {false, true}) {
      Scenario s = contact ? twoEdges() : farAbove();
      if (vibrated) s.mechanism.exciter.amplitude = 1.0;
      SimulatedCell sampled(s, CellParameters{}), averaged(s, CellParameters{});
      StrainBlock block;
      StrainMeans means;
      const double fastest = vibrated ? s.mechanism.exciter.frequency : 0.0;
      const BlockTime all = blockTime([&] { sampled.next(block); });
      const BlockTime few = blockTime([&] { averaged.average(means, fastest, false); });
      std::printf(
          "  %-12s exciter %-4s fastest block %7.1f x, slowest block %7.1f x; means alone %7.1f x, "
          "%.0f %% less\n",
          contact ? "2 contacts," : "free,", vibrated ? "1 N:" : "off:", 0.02 / all.fastest,
          0.02 / all.slowest, 0.02 / few.fastest, 100 * (1 - few.fastest / all.fastest));
    }
  }
}

// Whole alignments of the default cell from starts around the hole, as the tool `align` runs them.
void alignments() {
  const Scenario scenario = load("cell");
  constexpr int kRuns = 12;
  std::printf("\nAlignments, %d starts each, one thread\n%-16s %8s %22s %14s %20s\n", kRuns,
              "strategy", "aligned", "simulated s per s", "worst off [um]", "marker [ns], mean");
  for (const char* strategy : {"single_contact", "twin_force", "vibratory", "auto"}) {
    double simulated = 0.0, elapsed = 0.0, worst = 0.0, markers = 0.0;
    int aligned = 0;
    for (int k = 0; k < kRuns; ++k) {
      const double a = 2 * M_PI * k / kRuns, turn = 2.4 * k;
      const double offset = 0.003 + 0.001 * k;
      const double tilt = 0.0028 * (k + 1);
      const Scenario start = startAt(scenario, offset * Eigen::Vector2d(std::cos(a), std::sin(a)),
                                     tilt * Eigen::Vector2d(std::cos(turn), std::sin(turn)), 0.003);
      AlignParameters parameters;
      parameters.strategy = strategy;
      CellParameters cell;
      cell.seed = static_cast<std::uint64_t>(k) + 1;
      markers += markerTime() / kRuns;
      const auto begin = std::chrono::steady_clock::now();
      const AlignTrial trial = tryAlignment(start, scenario.mechanism, cell, parameters, {});
      elapsed += std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
      simulated += trial.result.time;
      aligned += trial.success ? 1 : 0;
      if (trial.success) worst = std::max(worst, trial.X_HP.p.head<2>().norm());
    }
    std::printf("%-16s %8d %22.1f %14.1f %20.1f\n", strategy, aligned, simulated / elapsed,
                1e6 * worst, markers);
  }
}

void workPrecision(const char* title, const Scenario& scene, double duration) {
  header(title);
  const Run reference = referenceOf(scene, duration, 0.0);
  for (const double tolerance : {1e-7, 1e-8, 1e-9, 1e-10, 1e-11, 1e-12}) {
    Scenario s = scene;
    s.solver.tolerance = tolerance;
    char name[40];
    std::snprintf(name, sizeof(name), "dopri5, tolerance %.0e", tolerance);
    const Run run = measure(s, duration);
    printRun(name, run, error(run, reference), duration);
  }
  for (const double step : {2e-4, 1e-4, 5e-5, 2e-5, 1e-5}) {
    Scenario s = scene;
    s.solver.integrator = "rk4";
    s.solver.step = step;
    char name[40];
    std::snprintf(name, sizeof(name), "rk4, step %.0e s", step);
    const Run run = measure(s, duration);
    printRun(name, run, error(run, reference), duration);
  }
}

int run() {
  std::printf(
      "times: fastest of %d runs on this machine; error: largest difference of the peg's "
      "position from a run with tolerance 1e-13\n",
      kRepeats);
  std::printf("marker (frozen loop, benchmark/marker.h): %.1f ns\n", markerTime());
  rightHandSides();
  std::printf("marker: %.1f ns\n", markerTime());
  vibratedRuns();
  skips();
  realTime();
  alignments();
  Scenario free = farAbove();
  free.contact.law = ContactLaw::kNone;
  free.mechanism.exciter.amplitude = 1.0;
  workPrecision("Free motion, exciter 1 N, 0.06 s", free, 0.06);
  workPrecision(
      "Two contacts pressed, exciter 0.1 N, 0.06 s",
      [] {
        Scenario s = twoEdges();
        s.mechanism.exciter.amplitude = 0.1;
        return s;
      }(),
      0.06);
  workPrecision("Impact (thesis Fig 7.2, viscous law), 0.03 s", load("impact"), 0.03);
  return 0;
}

}  // namespace
}  // namespace assembly_cell

int main() {
  try {
    return assembly_cell::run();
  } catch (const std::exception& e) {
    std::fprintf(stderr, "bench_simulation: %s\n", e.what());
    return 1;
  }
}
