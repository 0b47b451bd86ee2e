// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/align/align.h"

#include "assembly_cell/align/search/search.h"
#include "assembly_cell/base/input_error.h"

namespace assembly_cell {
namespace {

using Strategy = AlignResult (*)(Plant&, const Mechanism&, const AlignParameters&,
                                 const std::function<void(const AlignProgress&)>&);
struct NamedStrategy {
  const char* name;
  Strategy run;
};
constexpr NamedStrategy kStrategies[] = {{"single_contact", singleContact},
                                         {"double_contact", doubleContact},
                                         {"twin_force", twinForce},
                                         {"vibratory", vibratory},
                                         {"touch", touchSearch},
                                         {"auto", autoSearch},
                                         {"spiral", spiralSearch},
                                         {"passive", passiveAssembly}};

constexpr double kSameDepth = 1e-3;  // as felt on different ways down [m]
// What a depth may be felt wrong by, and a hole may be deeper than the peg that fills it [m].
constexpr double kTopMargin = 1e-3;

Strategy strategyOf(const std::string& name) {
  std::string known;
  for (const NamedStrategy& strategy : kStrategies) {
    if (strategy.name == name) return strategy.run;
    known += (known.empty() ? "" : ", ") + std::string(strategy.name);
  }
  throw InputError("strategy: " + name + " is not available; use one of " + known);
}

void check(bool good, const char* name, double value, const char* remedy) {
  if (!good) throw InputError(std::string(name) + text(": %g: ", value) + remedy);
}

// What strategies were shown with: radius, 2 to 60 mm, and mass are what a press or a sensor says.
constexpr double kLoosest = 0.6, kBluntest = 0.9, kWidest = 1.0;  // in radii

void checkParts(const Mechanism& m) {
  const double r = m.peg.radius;
  if (!(m.hole.radius > r)) {
    throw InputError("hole.radius: " + text("%g m", m.hole.radius) +
                     " is not larger than the peg's; the peg can't enter");
  }
  check(m.hole.radius - r <= kLoosest * r, "hole.radius", m.hole.radius,
        text("the clearance is more than %g of the peg's radius; that is no fit to look for",
             kLoosest)
            .c_str());
  check(m.peg.chamfer_width <= kBluntest * r, "peg.chamfer.width", m.peg.chamfer_width,
        text("must be at most %g of the peg's radius", kBluntest).c_str());
  check(m.hole.chamfer_width <= kWidest * r, "hole.chamfer.width", m.hole.chamfer_width,
        text("must be at most the peg's radius, %g m", r).c_str());
}

// The peg's top stays above the mouth of a hole that is deeper than the peg is long.
void checkTop(const Mechanism& mechanism, const InsertParameters& insert) {
  const double length = 2.0 * mechanism.peg.half_height, most = length - kTopMargin;
  if (mechanism.hole.depth <= length + kTopMargin) return;
  if (insert.floor) {
    throw InputError(text("insert.floor: hole.depth is %g m, the peg is %g m long and its top ",
                          mechanism.hole.depth, length) +
                     text("has to stay out; give insert.depth, at most %g m", most));
  }
  if (insert.depth > most) {
    throw InputError(text("insert.depth: %g m: the peg is %g m long and its top has to stay out; ",
                          insert.depth, length) +
                     text("give at most %g m", most));
  }
}

}  // namespace

void checkParameters(const AlignParameters& p) {
  strategyOf(p.strategy);
  check(p.press_force == 0.0 || (p.press_force >= 2.0 && p.press_force < p.force_limit),
        "press_force", p.press_force,
        "must be at least 2 N and below force_limit, or 0 to choose it");
  check(p.press_tolerance > 0 && p.press_tolerance <= 0.5, "press_tolerance", p.press_tolerance,
        "must lie in (0, 0.5]");
  check(p.force_limit > 0 && p.force_limit <= 1000, "force_limit", p.force_limit,
        "must lie in (0, 1000] N");
  check(p.descent_limit > 0 && p.descent_limit <= 1, "descent_limit", p.descent_limit,
        "must lie in (0, 1] m");
  check(p.approach_step > 0 && p.approach_step <= 1e-2, "approach_step", p.approach_step,
        "must lie in (0, 0.01] m");
  check(p.exciter_amplitude >= 0 && p.exciter_amplitude <= 1000, "exciter_amplitude",
        p.exciter_amplitude, "must lie in [0, 1000] N; 0 chooses it");
  check(p.exciter_frequency >= 0 && p.exciter_frequency <= 1e5, "exciter_frequency",
        p.exciter_frequency, "must lie in [0, 1e5] rad/s; 0 chooses it");
  check(p.exciter_direction == 1 || p.exciter_direction == -1, "exciter_direction",
        p.exciter_direction, "must be 1 or -1");
  check(p.shake >= 1 && p.shake <= 5, "shake", p.shake, "must lie in 1 to 5");
  check(p.settle >= 0 && p.settle <= 60, "settle", p.settle, "must lie in [0, 60] s");
  check(p.window > 0 && p.window <= 60, "window", p.window, "must lie in (0, 60] s");
  check(p.sweep_tilt > 0 && p.sweep_tilt <= 0.14, "sweep_tilt", p.sweep_tilt,
        "must lie in (0, 0.14] rad");
  check(p.sweep_readings >= 8 && p.sweep_readings <= 360, "sweep_readings", p.sweep_readings,
        "must lie in 8 to 360");
  check(p.direction_limit > 0 && p.direction_limit <= 1, "direction_limit", p.direction_limit,
        "must lie in (0, 1] rad");
  check(p.lift > 0 && p.lift <= 0.01, "lift", p.lift, "must lie in (0, 0.01] m");
  check(p.insertion_depth > 0 && p.insertion_depth <= 0.01, "insertion_depth", p.insertion_depth,
        "must lie in (0, 0.01] m");
  check(p.insertion_force > 0 && p.insertion_force < p.force_limit, "insertion_force",
        p.insertion_force, "must be above 0 and below force_limit");
  check(p.contact_force >= 2.0 && p.contact_force < p.force_limit, "contact_force", p.contact_force,
        "must be at least 2 N and below force_limit");
  check(p.contact_tilt >= 0.02 && p.contact_tilt <= 0.14, "contact_tilt", p.contact_tilt,
        "must lie in 0.02 to 0.14 rad");
  check(p.contact_window >= 0.02 && p.contact_window <= 60, "contact_window", p.contact_window,
        "must lie in 0.02 to 60 s");
  check(p.settled_force > 0 && p.settled_force <= 10, "settled_force", p.settled_force,
        "must lie in (0, 10] N");
  check(p.fewest_contacts >= 2 && p.fewest_contacts <= 30, "fewest_contacts", p.fewest_contacts,
        "must lie in 2 to 30");
  check(p.most_contacts >= p.fewest_contacts && p.most_contacts <= 30, "most_contacts",
        p.most_contacts, "must lie between fewest_contacts and 30");
  check(p.required_position > 0 && p.required_position <= 0.01, "required_position",
        p.required_position, "must lie in (0, 0.01] m");
  check(p.required_rotation > 0 && p.required_rotation <= 0.1, "required_rotation",
        p.required_rotation, "must lie in (0, 0.1] rad");
  check(p.insert.depth >= 0 && p.insert.depth <= 1, "insert.depth", p.insert.depth,
        "must lie in [0, 1] m");
  check(p.insert.force >= 2 && p.insert.force < p.force_limit, "insert.force", p.insert.force,
        "must be at least 2 N and below force_limit");
  check(p.insert.speed > 0 && p.insert.speed <= 0.1, "insert.speed", p.insert.speed,
        "must lie in (0, 0.1] m/s");
  check(p.insert.exciter >= 0 && p.insert.exciter <= 1000, "insert.exciter", p.insert.exciter,
        "must lie in [0, 1000] N; 0 is off");
  check(p.inserted >= 0 && p.inserted <= 1, "inserted", p.inserted, "must lie in [0, 1] m");
  check(!(p.insert.depth > 0) || p.insert.depth > p.inserted - kSameDepth, "insert.depth",
        p.insert.depth, text("the peg is %g m deep already; retreat first", p.inserted).c_str());
  check(p.rounds >= 1 && p.rounds <= 10, "rounds", p.rounds, "must lie in 1 to 10");
}

void checkGoal(const Mechanism& mechanism, const AlignParameters& parameters) {
  checkParameters(parameters);
  checkParts(mechanism);
  if (parameters.insert.floor && !std::isfinite(mechanism.hole.depth)) {
    throw InputError(
        "align: insert.floor: hole.depth isn't given; give it, or a depth to insert to");
  }
  if (parameters.insert.floor && parameters.insert.depth > 0.0) {
    throw InputError("insert.depth: " + text("%g m", parameters.insert.depth) +
                     " with insert.floor; leave one of them out");
  }
  if (parameters.insert.depth > 0.0 && !(parameters.insert.depth < mechanism.hole.depth)) {
    throw InputError("insert.depth: " + text("%g m", parameters.insert.depth) +
                     text(" is not less than hole.depth, %g m; give less", mechanism.hole.depth));
  }
  checkTop(mechanism, parameters.insert);
}

AlignResult align(Plant& plant, const Mechanism& mechanism, const AlignParameters& parameters,
                  const std::function<void(const AlignProgress&)>& progress) {
  checkGoal(mechanism, parameters);
  return strategyOf(parameters.strategy)(plant, mechanism, parameters, progress);
}

}  // namespace assembly_cell
