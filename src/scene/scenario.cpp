// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/scene/scenario.h"

#include <algorithm>
#include <cmath>
#include <iterator>

#include "yaml_section.h"

namespace assembly_cell {
namespace {

using yaml::Range;
using yaml::Section;
using yaml::shown;

// the Euler angles are singular at sin(theta) = 0: peg horizontal
constexpr double kSmallestSinTheta = 0.1;
// rounding of k² against the product of its diagonal entries
constexpr double kDefiniteRounding = 1e-12;
// beyond these a number is a slip of the pen, and a run with it would not end
constexpr double kLargestLength = 1e3;     // [m]
constexpr double kLargestAngle = 1e3;      // [rad]
constexpr double kLargestFrequency = 1e6;  // [rad/s]
constexpr double kMostSteps = 1e10;

double withinSize(const Section& in, const std::string& key, double value, double largest) {
  if (std::abs(value) > largest) {
    in.refuse(in.at(key), value, "give at most " + shown(largest) + " in size, SI units");
  }
  return value;
}

double readLength(Section& in, const std::string& key, Range range) {
  return withinSize(in, key, in.number(key, range), kLargestLength);
}

double readAngle(Section& in, const std::string& key) {
  return withinSize(in, key, in.number(key, Range::kAny), kLargestAngle);
}

Eigen::Vector3d readTriple(Section& in, const std::string& key, double largest) {
  const Eigen::Vector3d values = in.numbers<3>(key, Range::kAny);
  for (int i = 0; i < 3; ++i) {
    withinSize(in, key + "[" + std::to_string(i) + "]", values[i], largest);
  }
  return values;
}

PegParameters readPeg(Section in) {
  PegParameters peg;
  peg.radius = readLength(in, "radius", Range::kPositive);
  peg.half_height = readLength(in, "half_height", Range::kPositive);
  peg.mass = in.number("mass", Range::kPositive);
  peg.inertia_transverse = in.number("inertia_transverse", Range::kPositive);
  peg.inertia_axial = in.number("inertia_axial", Range::kPositive);
  peg.coupling_height = readLength(in, "coupling_height", Range::kAny);
  peg.exciter_height = readLength(in, "exciter_height", Range::kAny);
  in.finish();
  // no body has more inertia about an axis than the sum about the two across
  if (peg.inertia_axial > 2.0 * peg.inertia_transverse) {
    in.refuse(in.at("inertia_axial"), peg.inertia_axial,
              "no body has more than twice inertia_transverse (" + shown(peg.inertia_transverse) +
                  "), correct one of them");
  }
  return peg;
}

HoleParameters readHole(Section in) {
  HoleParameters hole;
  hole.radius = readLength(in, "radius", Range::kPositive);
  hole.depth = in.number("depth", Range::kPositive, hole.depth);
  in.finish();
  return hole;
}

CarrierParameters readCarrier(Section in, RestPose& rest) {
  CarrierParameters carrier;
  carrier.mass = in.number("mass", Range::kPositive);
  carrier.inertia = in.number("inertia", Range::kPositive);
  carrier.stiffness = in.numbers<3>("stiffness", Range::kNotNegative);
  carrier.damping = in.numbers<3>("damping", Range::kNotNegative);
  carrier.max_speed = in.number("max_speed", Range::kPositive, carrier.max_speed);
  carrier.max_acceleration =
      in.number("max_acceleration", Range::kPositive, carrier.max_acceleration);
  Section in_rest = in.section("rest");
  rest.x = readLength(in_rest, "x", Range::kAny);
  rest.y = readLength(in_rest, "y", Range::kAny);
  rest.yaw = readAngle(in_rest, "yaw");
  in_rest.finish();
  in.finish();
  return carrier;
}

// Diagonal and the two cross terms, named with the letter k or c; positive semidefinite.
CouplingMatrix readCouplingMatrix(Section in, const std::string& letter) {
  CouplingMatrix matrix;
  matrix.diagonal = in.numbers<6>("diagonal", Range::kNotNegative);
  matrix.k26 = in.number(letter + "26", Range::kAny);
  matrix.k35 = in.number(letter + "35", Range::kAny);
  in.finish();
  const auto check = [&](const std::string& key, double cross, int i, int j) {
    const double limit = matrix.diagonal[i] * matrix.diagonal[j];
    if (cross * cross > limit * (1.0 + kDefiniteRounding)) {
      in.refuse(in.at(key), cross,
                "the matrix is not positive semidefinite, give at most sqrt(diagonal[" +
                    std::to_string(i) + "] * diagonal[" + std::to_string(j) +
                    "]) = " + shown(std::sqrt(limit)) + " in size");
    }
  };
  check(letter + "26", matrix.k26, 1, 5);
  check(letter + "35", matrix.k35, 2, 4);
  return matrix;
}

void checkTheta(const Section& in, const std::string& key, double theta) {
  // reversed axes (theta outside 0..pi) name the same poses a second time
  if (!(theta > 0.0 && theta < M_PI && std::sin(theta) >= kSmallestSinTheta)) {
    in.refuse(key, theta, "give an angle with sin(theta) >= 0.1 between 0 and pi, upright is pi/2");
  }
}

CouplingParameters readCoupling(Section in, RestPose& rest) {
  CouplingParameters coupling;
  coupling.stiffness = readCouplingMatrix(in.section("stiffness"), "k");
  coupling.damping = readCouplingMatrix(in.section("damping"), "c");
  Section in_rest = in.section("rest");
  rest.z = readLength(in_rest, "z", Range::kAny);
  rest.theta = readAngle(in_rest, "theta");
  rest.phi = readAngle(in_rest, "phi");
  in_rest.finish();
  checkTheta(in_rest, in_rest.at("theta"), rest.theta);
  in.finish();
  return coupling;
}

ExciterParameters readExciter(Section in) {
  ExciterParameters exciter;
  exciter.amplitude = in.number("amplitude", Range::kNotNegative);
  exciter.frequency =
      withinSize(in, "frequency", in.number("frequency", Range::kNotNegative), kLargestFrequency);
  exciter.phase = in.optional("phase") ? readAngle(in, "phase") : 0.0;
  const double direction = in.number("direction", Range::kAny, 1.0);
  in.finish();
  if (std::abs(direction) != 1.0) {
    in.refuse(in.at("direction"), direction, "give 1 (anticlockwise from above) or -1 (clockwise)");
  }
  exciter.direction = direction > 0.0 ? 1 : -1;
  return exciter;
}

FrictionParameters readFriction(Section in) {
  FrictionParameters friction;
  friction.static_coefficient = in.number("static", Range::kNotNegative);
  friction.sliding_coefficient = in.number("sliding", Range::kNotNegative);
  in.finish();
  if (friction.sliding_coefficient > friction.static_coefficient) {
    in.refuse(in.at("sliding"), friction.sliding_coefficient,
              "give at most friction.static (" + shown(friction.static_coefficient) + ")");
  }
  return friction;
}

ContactFeatures readFeatures(const Section& in, const YAML::Node& node) {
  struct Name {
    const char* text;
    bool ContactFeatures::*admitted;
  };
  constexpr Name kNames[] = {{"edge_edge", &ContactFeatures::edge_edge},
                             {"edge_plane", &ContactFeatures::edge_plane},
                             {"edge_wall", &ContactFeatures::edge_wall},
                             {"rim_side", &ContactFeatures::rim_side},
                             {"rim_face", &ContactFeatures::rim_face}};
  const std::string path = in.at("features");
  const std::string available =
      "available are edge_edge, edge_plane, edge_wall, rim_side and rim_face";
  if (!node.IsSequence()) in.refuse(path, shown(node), "give a list of names, " + available);
  ContactFeatures features{false, false, false, false, false};
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
  solver.tolerance = in.number("tolerance", Range::kPositive, solver.tolerance);
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
  scenario.gravity = in.number("gravity", Range::kNotNegative);
  scenario.peg = readPeg(in.section("peg"));
  scenario.hole = readHole(in.section("hole"));
  scenario.carrier = readCarrier(in.section("carrier"), scenario.rest);
  scenario.coupling = readCoupling(in.section("coupling"), scenario.rest);
  if (in.optional("exciter")) scenario.exciter = readExciter(in.section("exciter"));
  scenario.push = in.vector("push");
  scenario.friction = readFriction(in.section("friction"));
  scenario.contact = readContact(in.section("contact"));
  scenario.thesis = readThesis(in);
  const YAML::Node initial =
      in.optional("initial") ? in.required("initial", "") : YAML::Node(YAML::NodeType::Map);
  scenario.initial = readInitial(initial, source, scenario.rest, scenario.peg.coupling_height);
  if (in.optional("solver")) scenario.solver = readSolver(in.section("solver"));
  in.finish();
  const double longest_step = std::min(
      scenario.solver.max_step, scenario.solver.step > 0.0 ? scenario.solver.step : HUGE_VAL);
  if (scenario.duration > kMostSteps * longest_step) {
    in.refuse("duration", scenario.duration,
              "more than " + shown(kMostSteps) + " steps of solver.max_step or solver.step (" +
                  shown(longest_step) + "), give a shorter time or longer steps");
  }
  return scenario;
}

}  // namespace

Scenario parseScenario(const std::string& text, const std::string& source,
                       const std::vector<std::string>& overrides) {
  YAML::Node root = yaml::loadYaml(text, source);
  if (!root.IsMap()) {
    yaml::refuse(source, "file", shown(root), "give a mapping of keys, see docs/interfaces.md");
  }
  for (const std::string& change : overrides) root.reset(yaml::withOverride(root, change));
  return readScenario(root, source);
}

Scenario loadScenario(const std::string& path, const std::vector<std::string>& overrides) {
  return parseScenario(yaml::fileText(path, "scenario"), path, overrides);
}

}  // namespace assembly_cell
