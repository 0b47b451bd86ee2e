// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/align/align.h"

#include <algorithm>
#include <iterator>

#include "assembly_cell/align/search/carrier_delay.h"
#include "assembly_cell/align/search/scale.h"
#include "assembly_cell/align/search/step.h"
#include "assembly_cell/align/strategies/edge_search.h"
#include "assembly_cell/align/strategies/strategies.h"
#include "assembly_cell/base/input_error.h"
#include "assembly_cell/base/text.h"

namespace assembly_cell {
namespace {

using Strategy = AlignResult (*)(Plant&, const Mechanism&, const AlignParameters&,
                                 const ProgressCallback&);
struct NamedStrategy {
  const char* name;
  Strategy run;
  double time_limit;  // default of the default cell [s]
};
// A vibrated search has four attempts of about a minute; the whole spiral takes three hours in a
// clearance of 0.02 mm.
constexpr NamedStrategy kStrategies[] = {{"single_contact", singleContact, 300.0},
                                         {"double_contact", doubleContact, 300.0},
                                         {"twin_force", twinForce, 60.0},
                                         {"vibratory", vibratory, 600.0},
                                         {"touch", touchSearch, 60.0},
                                         {"auto", autoSearch, 60.0},
                                         {"spiral", spiralSearch, 12000.0},
                                         {"passive", passiveAssembly, 60.0}};
constexpr double kInsertTime = 30.0;  // least default limit of an insertion [s]

// Error of a measured depth, and of the depth of a hole that its peg fills [m].
constexpr double kTopMargin = 1e-3;

void require(bool good, const char* name, double value, const char* remedy) {
  if (!good) throw InputError(std::string(name) + text(": %g: ", value) + remedy);
}

// Largest clearance, peg chamfer and hole chamfer that the strategies were tested with, in radii.
// The press and the sensor limit radius, 2 to 60 mm, and mass.
constexpr double kMaxClearance = 0.6, kMaxPegChamfer = 0.9, kMaxHoleChamfer = 1.0;
// A press goes down by 0.1 mm a block, 5 mm/s: a slower carrier lags behind its commands, and one
// that brakes for longer presses on after a contact. With these values 16 of 16 goals of touch and
// twin_force aligned; at 3 mm/s or 0.02 m/s² they ended with force_limit, which blames the contact.
constexpr double kMinCarrierSpeed = 5e-3;        // [m/s]
constexpr double kMinCarrierAcceleration = 0.1;  // [m/s²]

void checkParts(const Mechanism& m) {
  const double r = m.peg.radius;
  if (!(m.hole.radius > r)) {
    throw InputError("hole.radius: " + text("%g m", m.hole.radius) +
                     " is not larger than the peg's; the peg can't enter");
  }
  require(m.carrier.max_speed >= kMinCarrierSpeed, "carrier.max_speed", m.carrier.max_speed,
          text("the strategies need a carrier of %g m/s or more", kMinCarrierSpeed).c_str());
  require(
      m.carrier.max_acceleration >= kMinCarrierAcceleration, "carrier.max_acceleration",
      m.carrier.max_acceleration,
      text("the strategies need a carrier of %g m/s2 or more", kMinCarrierAcceleration).c_str());
  require(m.hole.radius - r <= kMaxClearance * r, "hole.radius", m.hole.radius,
          text("the clearance is more than %g of the peg's radius; that is no fit to look for",
               kMaxClearance)
              .c_str());
  require(m.peg.chamfer_width <= kMaxPegChamfer * r, "peg.chamfer.width", m.peg.chamfer_width,
          text("must be at most %g of the peg's radius", kMaxPegChamfer).c_str());
  require(m.hole.chamfer_width <= kMaxHoleChamfer * r, "hole.chamfer.width", m.hole.chamfer_width,
          text("must be at most the peg's radius, %g m", r).c_str());
}

// The peg's top stays above the mouth of a hole that is deeper than the peg is long.
void checkTop(const Mechanism& mechanism, const InsertParameters& insert) {
  const double length = 2.0 * mechanism.peg.half_height, max_depth = length - kTopMargin;
  if (mechanism.hole.depth <= length + kTopMargin) return;
  if (insert.floor) {
    throw InputError(text("insert.floor: hole.depth is %g m, the peg is %g m long and its top ",
                          mechanism.hole.depth, length) +
                     text("has to stay out; give insert.depth, at most %g m", max_depth));
  }
  if (insert.depth > max_depth) {
    throw InputError(text("insert.depth: %g m: the peg is %g m long and its top has to stay out; ",
                          insert.depth, length) +
                     text("give at most %g m", max_depth));
  }
}

// An alignment ends with the edge between walls, under both chamfers.
void checkDepth(const Mechanism& mechanism, double insertion_depth) {
  const double needed =
      insertion_depth + chamferDepth(mechanism.hole) + chamferHeight(mechanism.peg);
  require(!(mechanism.hole.depth <= needed), "hole.depth", mechanism.hole.depth,
          text("an alignment ends %g m deep, under both chamfers: give more, or a smaller "
               "insertion_depth",
               needed)
              .c_str());
}

// Part of the force limit that a touch may reach at an arm. Of ten runs each with the emulated one
// (make_peg 0.010 1e-5, --coupling 2, 8, 14, 20) 10, 7, 1 and 0 aligned, at 0.11, 0.43, 0.75 and
// 1.07 of it; the others were held by the arm's guard, or ended with force_limit.
constexpr double kLargestTouch = 0.45;

// Delay of the arm, as given or else as identified. [s]
double armDelay(const Mechanism& mechanism, const AlignParameters& p) {
  return p.arm_delay > 0.0 ? p.arm_delay : mechanism.arm.delay;
}

// With the arm's delay, and descents as slow as its mount needs.
AlignParameters withArm(const Mechanism& mechanism, const AlignParameters& parameters) {
  AlignParameters p = parameters;
  p.arm_delay = armDelay(mechanism, parameters);
  if (p.arm_delay > 0.0) p.approach_step *= armTouch(mechanism, parameters).slower;
  return p;
}

// Refuses a mount that is too stiff for an arm, before anything moves: the ends of its moves push
// with more than a light touch, or a light touch is too much already.
void checkMount(const Mechanism& mechanism, const AlignParameters& p) {
  if (p.arm_delay == 0.0) return;
  const double stiffness = mechanism.coupling.stiffness.diagonal(0);
  const double least = kLanding / kMaxTouchForce;
  if (stiffness * least > 1.0) {
    throw InputError(
        text("coupling.stiffness: the mount yields %.3g um/N along the peg: an arm's "
             "moves that end %.2g um apart push with %.2g N, more than ",
             1e6 / stiffness, kLanding * 1e6, kLanding * stiffness) +
        text("a touch of %.2g N; give it %.3g um/N or more", kMaxTouchForce, least * 1e6));
  }
  const double touch = kTouchForce * scaleOf(mechanism).force;
  if (touch < kLargestTouch * p.force_limit) return;
  throw InputError(
      text("force_limit: %g N: a light touch is %.2g N, and at an arm must be below "
           "%g of the limit; give %.3g N or more",
           p.force_limit, touch, kLargestTouch, 1.5 * touch / kLargestTouch));
}

// Time limits where none are given: those of the strategy, in the time scale of the peg and with
// its longer moves.
void chooseTimeLimits(const NamedStrategy& strategy, const Mechanism& mechanism,
                      AlignParameters& p) {
  const Scale scale = scaleOf(mechanism);
  p.default_time = strategy.time_limit * scale.time * scale.travel * moreDrops(mechanism);
  p.default_insert_time = kInsertTime * scale.time;
}

}  // namespace

// A touch of force F at speed v reaches F + K v T + K v²/(2 a), after a delay T.
ArmTouch armTouch(const Mechanism& mechanism, const AlignParameters& parameters) {
  const double delay = armDelay(mechanism, parameters);
  const double identified = mechanism.arm.stiffness;
  const double stiffness = identified > 0.0 ? identified : 1.0 / pressCompliance(mechanism);
  const Scale scale = scaleOf(mechanism);
  const double a = mechanism.carrier.max_acceleration, stop = a * delay,
               light = kTouchForce * scale.force;
  const double speed =
      parameters.approach_step / kStepTime * scale.step * CarrierDelay::ofArm(delay).slowing();
  const double way = std::max(0.0, kLargestTouch * parameters.force_limit - light) / stiffness;
  const double allowed = std::sqrt(stop * stop + 2.0 * a * way) - stop;
  ArmTouch touch;
  touch.slower = std::min(1.0, allowed / speed);
  touch.speed = touch.slower * speed;
  touch.force = light + stiffness * touch.speed * (delay + 0.5 * touch.speed / a);
  return touch;
}

std::vector<std::string> strategyNames() {
  std::vector<std::string> names;
  for (const NamedStrategy& strategy : kStrategies) names.emplace_back(strategy.name);
  return names;
}

void checkGoal(const Mechanism& mechanism, const AlignParameters& parameters, Sensors sensors) {
  checkParameters(parameters);
  if (sensors == Sensors::kB && parameters.strategy == "twin_force") {
    throw InputError(
        "strategy: twin_force: it measures contacts by sensor_a, too, and the cell has sensor_b "
        "alone; give auto or touch");
  }
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
  checkMount(mechanism, withArm(mechanism, parameters));
  checkTop(mechanism, parameters.insert);
  checkDepth(mechanism, parameters.insertion_depth);
}

AlignResult align(Plant& plant, const Mechanism& mechanism, const AlignParameters& parameters,
                  const std::function<void(const AlignProgress&)>& progress) {
  checkGoal(mechanism, parameters, plant.twinForce() != nullptr ? Sensors::kBoth : Sensors::kB);
  const auto* strategy =
      std::find_if(std::begin(kStrategies), std::end(kStrategies),
                   [&](const NamedStrategy& one) { return parameters.strategy == one.name; });
  AlignParameters limited = withArm(mechanism, parameters);
  chooseTimeLimits(*strategy, mechanism, limited);
  return strategy->run(plant, mechanism, limited, progress);
}

}  // namespace assembly_cell
