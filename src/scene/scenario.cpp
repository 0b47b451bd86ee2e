// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/scene/scenario.h"

#include <algorithm>
#include <cmath>
#include <iterator>

#include "assembly_cell/base/fields.h"
#include "assembly_cell/base/yaml_section.h"

namespace assembly_cell {
namespace {

using yaml::Section;
using yaml::shown;

// beyond these a number is a slip of the pen
constexpr Range kLength{-1e3, 1e3, "m"};
constexpr Range kAngle{-1e3, 1e3, "rad"};
constexpr double kMaxSteps = 1e10;  // a run with more would not end
// of a step [m]: below, rounding of positions of 0.1 m is seen as error and no step is short
// enough; above, an error as large as a clearance passes
constexpr double kFinestTolerance = 1e-14, kCoarsestTolerance = 1e-3;

ContactSlotMask readFeatures(Section& in) {
  const YAML::Node node = in.required("features", "");
  const std::string path = in.at("features");
  const std::string available =
      "available are edge_edge, edge_plane, edge_wall, rim_side, rim_face, edge_cone and rim_cone";
  if (!node.IsSequence()) in.refuse(path, shown(node), "give a list of names, " + available);
  ContactSlotMask features = 0;
  for (std::size_t i = 0; i < node.size(); ++i) {
    const std::string entry = path + "[" + std::to_string(i) + "]";
    const std::string text = node[i].IsScalar() ? node[i].Scalar() : "";
    const auto* feature = std::find_if(std::begin(kContactFeatures), std::end(kContactFeatures),
                                       [&](ContactFeature f) { return text == toString(f); });
    if (feature == std::end(kContactFeatures)) {
      in.refuse(entry, shown(node[i]), "unknown contact, " + available);
    }
    const ContactSlotMask slots = slotsOf(*feature);
    if (features & slots) in.refuse(entry, text, "named twice, keep one of them");
    features |= slots;
  }
  return features;
}

}  // namespace

// not in an unnamed namespace, which FieldList::section() doesn't see

static void lawField(FieldList& f, ContactParameters& c) {
  f.choice("law", c.law, {"none", "spring_dashpot", "viscous", "rigid"}, "Contact law.").required();
}

// The law decides which of its parameters are required: it is read first.
static void fields(FieldList& f, ContactParameters& c) {
  const bool spring = c.law == ContactLaw::kSpringDashpot, viscous = c.law == ContactLaw::kViscous;
  lawField(f, c);
  f.number("regularisation_speed", c.regularisation_speed, positive("m/s"),
           "Speed below which friction is regularised.");
  f.flag("stationary_rows", c.stationary_rows, "viscous: discrete stick instead.");
  f.number("stiffness", c.stiffness, spring ? positive("N/m") : notNegative("N/m"),
           "spring_dashpot: stiffness of a contact, required, > 0.")
      .required(spring);
  f.number("damping", c.damping, notNegative("N s/m"),
           "spring_dashpot: damping of a contact, required.")
      .required(spring);
  f.number("rate", c.rate, viscous ? positive("1/s") : notNegative("1/s"),
           "viscous: decay rate of the normal velocity, required, > 0.")
      .required(viscous)
      .independent();
  f.number("pull_back", c.pull_back, notNegative("1/s2"), "viscous: pull-back of a penetration.");
  f.number("restitution", c.restitution, {0.0, 1.0}, "rigid: energetic coefficient, 0: plastic.");
  f.other(
      "features", [&c](Section& in) { c.features = readFeatures(in); },
      "List of the kinds of contact that a run admits; missing: all.");
}

static void fields(FieldList& f, InitialState& s) {
  static_assert(sizeof(EulerAngles) == 3 * sizeof(double), "three numbers in a row");
  f.flag("close", s.close, "Lower the peg until the smallest gap is 0.");
  f.group("carrier", [&](FieldList& g) {
    g.number("x", s.carrier_x, kLength, "Position of the carrier.").required();
    g.number("y", s.carrier_y, kLength, "Position of the carrier.").required();
    g.number("yaw", s.carrier_yaw, kAngle, "Angle of the carrier about z.").required();
    g.numbers("velocity", s.carrier_velocity.data(), 3, Range::kAny,
              "Velocity along x, y [m/s] and about z [rad/s].");
  });
  f.group("peg", [&](FieldList& g) {
    g.numbers("position", s.position.data(), 3, kLength, "Position of the centre of mass.")
        .required();
    g.numbers("euler", &s.euler.phi, 3, kAngle, "Euler angles phi, theta, psi.").required();
    g.numbers("velocity", s.velocity.data(), 3, finite("m/s"), "Velocity of the centre of mass.");
    g.numbers("euler_rates", s.euler_rates.data(), 3, finite("rad/s"), "Rates of phi, theta, psi.");
  });
}

static void fields(FieldList& f, SolverParameters& p) {
  f.choice("integrator", p.integrator, {"dopri5", "dop853", "hamming", "rk4"},
           "Integrator of the equations of motion.");
  f.number("tolerance", p.tolerance, {kFinestTolerance, kCoarsestTolerance, "m"},
           "Absolute error of a position per step; of angles 30 rad/m times that.")
      .independent();
  f.number("max_step", p.max_step, positive("s"), "Longest step of the integrator.").independent();
  f.number("step", p.step, positive("s"), "Step of fixed-step methods.");
}

void fields(FieldList& f, Scenario& s) {
  f.text("name", s.name, "Name of the scenario.").required();
  f.number("duration", s.duration, notNegative("s"), "Duration of the run.")
      .required()
      .independent();
  fields(f, s.mechanism, s.rest, true);
  f.numbers("push", s.push.data(), 3, finite("N"),
            "Constant force in peg axes at the exciter's point.");
  f.section("contact", s.contact).required();
  f.flag("thesis_moments", s.thesis.moments,
         "Moments of exciter and contacts as the thesis prints them.");
  f.flag("thesis_cross_stiffness", s.thesis.cross_stiffness,
         "k26 and k35 count twice; coupling.axes: hole only.");
  f.flag("thesis_creep", s.thesis.creep, "Stationary rows demand no acceleration only.");
  f.flag("thesis_no_centripetal", s.thesis.no_centripetal,
         "Rows without the centripetal terms and the contact's own motion.");
  f.flag("thesis_sign_flip", s.thesis.sign_flip,
         "viscous: a pulling normal force is negated, not released.");
  f.section("initial", s.initial);
  f.section("solver", s.solver);
}

namespace {

// Missing parts start at rest: the carrier at its rest pose, the peg hanging stress-free from it.
void completeInitial(Section& in, Scenario& scenario) {
  bool has_carrier = false, has_peg = false;
  if (in.has("initial")) {
    const Section given = in.section("initial");
    has_carrier = given.has("carrier");
    has_peg = given.has("peg");
  }
  InitialState& initial = scenario.initial;
  const RestPose& rest = scenario.rest;
  if (!has_carrier) {
    initial.carrier_x = rest.x;
    initial.carrier_y = rest.y;
    initial.carrier_yaw = rest.yaw;
  }
  if (has_peg) return;
  initial.euler = {rest.phi, rest.theta, initial.carrier_yaw};
  const Eigen::Vector3d axis = rotationFromEuler(initial.euler).col(2);
  initial.position = Eigen::Vector3d(initial.carrier_x, initial.carrier_y, rest.z) -
                     scenario.mechanism.peg.coupling_height * axis;
}

void check(const Section& in, const Scenario& scenario) {
  auto problem = problemOf(scenario.mechanism);
  if (!problem) problem = problemOfTheta("coupling.rest.theta", scenario.rest.theta);
  if (!problem) problem = problemOfTheta("initial.peg.euler[1]", scenario.initial.euler.theta);
  if (problem) in.refuse(problem->key, problem->value, problem->why);
  if (scenario.thesis.cross_stiffness &&
      scenario.mechanism.coupling.axes == CouplingAxes::kCarrier) {
    in.refuse("thesis_cross_stiffness", "true", "the thesis's coupling has coupling.axes: hole");
  }
  const double longest_step = std::min(
      scenario.solver.max_step, scenario.solver.step > 0.0 ? scenario.solver.step : HUGE_VAL);
  if (scenario.duration > kMaxSteps * longest_step) {
    in.refuse("duration", scenario.duration,
              "more than " + shown(kMaxSteps) + " steps of solver.max_step or solver.step (" +
                  shown(longest_step) + "), give a shorter time or longer steps");
  }
}

Scenario readScenario(const YAML::Node& root, const std::string& source) {
  Section in(root, "", source);
  Scenario scenario;
  if (const YAML::Node contact = root["contact"]) {
    FieldList law;
    lawField(law, scenario.contact);
    Section(contact, "contact", source).read(law);
  }
  in.read(fieldsOf(scenario));
  in.finish();
  completeInitial(in, scenario);
  check(in, scenario);
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
