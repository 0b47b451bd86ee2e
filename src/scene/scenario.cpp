// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/scene/scenario.h"

#include <algorithm>
#include <cmath>
#include <iterator>

#include "assembly_cell/mechanism/mechanism_file.h"

namespace assembly_cell {
namespace {

using mechanism_file::checkTheta;
using mechanism_file::kLargestAngle;
using mechanism_file::kLargestLength;
using mechanism_file::readAngle;
using mechanism_file::readLength;
using mechanism_file::readTriple;
using yaml::Range;
using yaml::Section;
using yaml::shown;

constexpr double kMaxSteps = 1e10;  // a run with more would not end
// of a step [m]: below, rounding of positions of 0.1 m is seen as error and no step is short
// enough; above, an error as large as a clearance passes
constexpr double kFinestTolerance = 1e-14, kCoarsestTolerance = 1e-3;

ContactFeatures readFeatures(const Section& in, const YAML::Node& node) {
  struct Name {
    const char* text;
    bool ContactFeatures::*admitted;
  };
  constexpr Name kNames[] = {
      {"edge_edge", &ContactFeatures::edge_edge}, {"edge_plane", &ContactFeatures::edge_plane},
      {"edge_wall", &ContactFeatures::edge_wall}, {"rim_side", &ContactFeatures::rim_side},
      {"rim_face", &ContactFeatures::rim_face},   {"edge_cone", &ContactFeatures::edge_cone},
      {"rim_cone", &ContactFeatures::rim_cone}};
  const std::string path = in.at("features");
  const std::string available =
      "available are edge_edge, edge_plane, edge_wall, rim_side, rim_face, edge_cone and rim_cone";
  if (!node.IsSequence()) in.refuse(path, shown(node), "give a list of names, " + available);
  ContactFeatures features{false, false, false, false, false, false, false};
  for (std::size_t i = 0; i < node.size(); ++i) {
    const std::string entry = path + "[" + std::to_string(i) + "]";
    const std::string text = node[i].IsScalar() ? node[i].Scalar() : "";
    const auto* name = std::find_if(std::begin(kNames), std::end(kNames),
                                    [&](const Name& n) { return text == n.text; });
    if (name == std::end(kNames)) in.refuse(entry, shown(node[i]), "unknown contact, " + available);
    bool& admitted = features.*(name->admitted);
    if (admitted) in.refuse(entry, text, "named twice, keep one of them");
    admitted = true;
  }
  return features;
}

ThesisSwitches readThesis(Section& in) {
  ThesisSwitches thesis;
  thesis.moments = in.flag("thesis_moments", false);
  thesis.cross_stiffness = in.flag("thesis_cross_stiffness", false);
  thesis.creep = in.flag("thesis_creep", false);
  thesis.no_centripetal = in.flag("thesis_no_centripetal", false);
  thesis.sign_flip = in.flag("thesis_sign_flip", false);
  return thesis;
}

ContactParameters readContact(Section in) {
  ContactParameters contact;
  const std::string law = in.text("law", "give none, spring_dashpot, viscous or rigid");
  if (law == "none") {
    contact.law = ContactLaw::kNone;
  } else if (law == "spring_dashpot") {
    contact.law = ContactLaw::kSpringDashpot;
  } else if (law == "viscous") {
    contact.law = ContactLaw::kViscous;
  } else if (law == "rigid") {
    contact.law = ContactLaw::kRigid;
  } else {
    in.refuse(in.at("law"), law, "give none, spring_dashpot, viscous or rigid");
  }

  contact.regularisation_speed =
      in.number("regularisation_speed", Range::kPositive, contact.regularisation_speed);
  contact.stationary_rows = in.flag("stationary_rows", contact.stationary_rows);

  // what the law cannot do without must be there
  if (contact.law == ContactLaw::kSpringDashpot) {
    contact.stiffness = in.number("stiffness", Range::kPositive);
    contact.damping = in.number("damping", Range::kNotNegative);
  } else {
    contact.stiffness = in.number("stiffness", Range::kNotNegative, contact.stiffness);
    contact.damping = in.number("damping", Range::kNotNegative, contact.damping);
  }
  contact.rate = contact.law == ContactLaw::kViscous
                     ? in.number("rate", Range::kPositive)
                     : in.number("rate", Range::kNotNegative, contact.rate);
  contact.pull_back = in.number("pull_back", Range::kNotNegative, contact.pull_back);
  contact.restitution = in.number("restitution", Range::kNotNegative, contact.restitution);
  if (contact.restitution > 1.0) {
    in.refuse(in.at("restitution"), contact.restitution, "give a number from 0 to 1");
  }
  if (in.optional("features")) {
    contact.features = readFeatures(in, in.required("features", ""));
  }
  in.finish();
  return contact;
}

// Absent parts start at rest: the carrier at its rest pose, the peg hanging stress-free from it.
InitialState readInitial(const YAML::Node& node, const std::string& source, const RestPose& rest,
                         double coupling_height) {
  Section in(node, "initial", source);
  InitialState initial;
  initial.close = in.flag("close", initial.close);

  initial.carrier_x = rest.x;
  initial.carrier_y = rest.y;
  initial.carrier_yaw = rest.yaw;
  if (in.optional("carrier")) {
    Section carrier = in.section("carrier");
    initial.carrier_x = readLength(carrier, "x", Range::kAny);
    initial.carrier_y = readLength(carrier, "y", Range::kAny);
    initial.carrier_yaw = readAngle(carrier, "yaw");
    initial.carrier_velocity = carrier.vector("velocity");
    carrier.finish();
  }

  initial.euler = {rest.phi, rest.theta, initial.carrier_yaw};
  const Eigen::Vector3d axis = rotationFromEuler(initial.euler).col(2);
  initial.position =
      Eigen::Vector3d(initial.carrier_x, initial.carrier_y, rest.z) - coupling_height * axis;
  if (in.optional("peg")) {
    Section peg = in.section("peg");
    initial.position = readTriple(peg, "position", kLargestLength);
    const Eigen::Vector3d euler = readTriple(peg, "euler", kLargestAngle);
    initial.euler = {euler[0], euler[1], euler[2]};
    initial.velocity = peg.vector("velocity");
    initial.euler_rates = peg.vector("euler_rates");
    peg.finish();
    checkTheta(peg, peg.at("euler") + "[1]", initial.euler.theta);
  }
  in.finish();
  return initial;
}

SolverParameters readSolver(Section in) {
  SolverParameters solver;
  if (in.optional("integrator")) {
    solver.integrator = in.text("integrator", "give the name of an integrator, such as dopri5");
  }
  solver.tolerance = in.number("tolerance", kFinestTolerance, kCoarsestTolerance, solver.tolerance);
  solver.max_step = in.number("max_step", Range::kPositive, solver.max_step);
  solver.step = in.number("step", Range::kPositive, solver.step);
  in.finish();
  return solver;
}

Scenario readScenario(const YAML::Node& root, const std::string& source) {
  Section in(root, "", source);
  Scenario scenario;
  scenario.name = in.text("name", "give the scenario a name");
  scenario.duration = in.number("duration", Range::kNotNegative);
  scenario.mechanism = mechanism_file::readMechanism(in, &scenario.rest);
  scenario.push = in.vector("push");
  scenario.contact = readContact(in.section("contact"));
  scenario.thesis = readThesis(in);
  if (scenario.thesis.cross_stiffness &&
      scenario.mechanism.coupling.axes == CouplingAxes::kCarrier) {
    in.refuse("thesis_cross_stiffness", "true", "the thesis's coupling has coupling.axes: hole");
  }
  const YAML::Node initial =
      in.optional("initial") ? in.required("initial", "") : YAML::Node(YAML::NodeType::Map);
  scenario.initial =
      readInitial(initial, source, scenario.rest, scenario.mechanism.peg.coupling_height);
  if (in.optional("solver")) scenario.solver = readSolver(in.section("solver"));
  in.finish();
  const double longest_step = std::min(
      scenario.solver.max_step, scenario.solver.step > 0.0 ? scenario.solver.step : HUGE_VAL);
  if (scenario.duration > kMaxSteps * longest_step) {
    in.refuse("duration", scenario.duration,
              "more than " + shown(kMaxSteps) + " steps of solver.max_step or solver.step (" +
                  shown(longest_step) + "), give a shorter time or longer steps");
  }
  return scenario;
}

}  // namespace

Scenario parseScenario(const std::string& text, const std::string& source,
                       const std::vector<std::string>& overrides) {
  return readScenario(yaml::loadMapping(text, source, overrides, yaml::FileKind::kScenario),
                      source);
}

Scenario loadScenario(const std::string& path, const std::vector<std::string>& overrides) {
  return parseScenario(yaml::fileText(path, "scenario"), path, overrides);
}

}  // namespace assembly_cell
