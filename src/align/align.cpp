// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/align/align.h"

#include <algorithm>
#include <iterator>

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
};
constexpr NamedStrategy kStrategies[] = {{"single_contact", singleContact},
                                         {"double_contact", doubleContact},
                                         {"twin_force", twinForce},
                                         {"vibratory", vibratory},
                                         {"touch", touchSearch},
                                         {"auto", autoSearch},
                                         {"spiral", spiralSearch},
                                         {"passive", passiveAssembly}};

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

}  // namespace

std::vector<std::string> strategyNames() {
  std::vector<std::string> names;
  for (const NamedStrategy& strategy : kStrategies) names.emplace_back(strategy.name);
  return names;
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
  checkDepth(mechanism, parameters.insertion_depth);
}

AlignResult align(Plant& plant, const Mechanism& mechanism, const AlignParameters& parameters,
                  const std::function<void(const AlignProgress&)>& progress) {
  checkGoal(mechanism, parameters);
  const auto* strategy =
      std::find_if(std::begin(kStrategies), std::end(kStrategies),
                   [&](const NamedStrategy& one) { return parameters.strategy == one.name; });
  return strategy->run(plant, mechanism, parameters, progress);
}

}  // namespace assembly_cell
