// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <cmath>

#include "assembly_cell/base/fields.h"
#include "assembly_cell/base/text.h"
#include "assembly_cell/base/yaml_section.h"
#include "assembly_cell/mechanism/mechanism.h"
#include "fit.h"

namespace assembly_cell {

using yaml::shown;

namespace {

// beyond these a number is a slip of the pen, and a run with it would not end
constexpr Range kLength{-1e3, 1e3, "m"};
constexpr Range kAngle{-1e3, 1e3, "rad"};
constexpr Range kSize = positive("m", 1.0);
constexpr Range kMass = positive("kg", 1e4);
constexpr Range kInertia = positive("kg m2");

// the Euler angles are singular at sin(theta) = 0: peg horizontal
constexpr double kMinSinTheta = 0.1;
// rounding of k² against the product of its diagonal entries
constexpr double kDefiniteRounding = 1e-12;
// of a compliance: rounding of entries that are written with seven digits, and least eigenvalue of
// one whose inverse keeps six digits
constexpr double kSymmetricRounding = 1e-6, kLeastDefinite = 1e-9;

std::optional<MechanismProblem> problemOf(const std::string& part, double radius,
                                          const RadiusTolerance& tolerance) {
  const auto [low, high] = tolerance;
  if (low > high) {
    return MechanismProblem{
        part + ".radius_tolerance[0]", low,
        "give the smaller radius first, then the larger; the second is " + shown(high)};
  }
  if (radius < low || radius > high) {
    return MechanismProblem{part + ".radius", radius,
                            "not within " + part + ".radius_tolerance, " + shown(low) + " to " +
                                shown(high) + " m; correct one of them"};
  }
  return {};
}

std::optional<MechanismProblem> problemOf(const PegParameters& peg) {
  if (auto problem = problemOf("peg", peg.radius, peg.radius_tolerance)) return problem;
  // no body has more inertia about an axis than the sum about the two across
  if (peg.inertia_axial > 2.0 * peg.inertia_transverse) {
    return MechanismProblem{"peg.inertia_axial", peg.inertia_axial,
                            "no body has more than twice inertia_transverse (" +
                                shown(peg.inertia_transverse) + "), correct one of them"};
  }
  if (!(tipRadius(peg) > 0.0)) {
    return MechanismProblem{"peg.chamfer.width", peg.chamfer_width,
                            "the peg's radius is " + shown(peg.radius) + " m; give less"};
  }
  if (!(chamferHeight(peg) < 2.0 * peg.half_height)) {
    return MechanismProblem{"peg.chamfer.width", peg.chamfer_width,
                            "the chamfer goes " + shown(chamferHeight(peg)) + " m up, the peg is " +
                                shown(2.0 * peg.half_height) + " long; give less"};
  }
  return {};
}

std::optional<MechanismProblem> problemOf(const HoleParameters& hole) {
  if (auto problem = problemOf("hole", hole.radius, hole.radius_tolerance)) return problem;
  if (!(mouthRadius(hole) < blockRadius(hole))) {
    return MechanismProblem{
        "hole.chamfer.width", hole.chamfer_width,
        "the block's wall is " + shown(blockRadius(hole) - hole.radius) + " m wide; give less"};
  }
  if (!(chamferDepth(hole) < hole.depth)) {
    return MechanismProblem{"hole.chamfer.width", hole.chamfer_width,
                            "the chamfer goes " + shown(chamferDepth(hole)) + " m deep, the hole " +
                                shown(hole.depth) + "; give less"};
  }
  return {};
}

// Row of the thesis order that a row x, y, z, about x, y, z has, and the other way round.
constexpr int kThesisOfWrench[] = {1, 2, 0, 4, 5, 3}, kWrenchOfThesis[] = {2, 0, 1, 5, 3, 4};

Matrix6 reordered(const Matrix6& matrix, const int (&row)[6]) {
  Matrix6 out;
  for (int i = 0; i < 6; ++i) {
    for (int j = 0; j < 6; ++j) out(i, j) = matrix(row[i], row[j]);
  }
  return out;
}

double leastEigenvalue(const Matrix6& symmetric) {
  return Eigen::SelfAdjointEigenSolver<Matrix6>(symmetric, Eigen::EigenvaluesOnly)
      .eigenvalues()
      .minCoeff();
}

// Checks a matrix with cross terms besides k26 and k35. Each entry is divided by the roots of its
// two diagonal entries, so that units don't count.
std::optional<MechanismProblem> indefinite(const CouplingMatrix& stiffness) {
  if (stiffness.cross.isZero(0.0)) return {};
  const Vector6 size = stiffness.diagonal.cwiseSqrt();
  const Matrix6 full = fullMatrix(stiffness);
  Matrix6 relative;
  for (int i = 0; i < 6; ++i) {
    for (int j = 0; j < 6; ++j) {
      if (full(i, j) != 0.0 && size(i) * size(j) == 0.0) {
        return MechanismProblem{"coupling.stiffness.cross", full(i, j),
                                "a row without stiffness has no cross terms; give 0"};
      }
      relative(i, j) = full(i, j) == 0.0 ? 0.0 : full(i, j) / (size(i) * size(j));
    }
  }
  const double least = leastEigenvalue(relative);
  if (least > -kDefiniteRounding) return {};
  return MechanismProblem{"coupling.stiffness.cross", least,
                          "lowest eigenvalue of the matrix, entries divided by the roots of their "
                          "diagonal entries; give smaller cross terms"};
}

std::optional<MechanismProblem> indefinite(const CouplingMatrix& matrix, const char* key, int i,
                                           int j, double cross) {
  const double limit = matrix.diagonal[i] * matrix.diagonal[j];
  if (!(cross * cross > limit * (1.0 + kDefiniteRounding))) return {};
  return MechanismProblem{key, cross,
                          "the matrix is not positive semidefinite, give at most sqrt(diagonal[" +
                              std::to_string(i) + "] * diagonal[" + std::to_string(j) +
                              "]) = " + shown(std::sqrt(limit)) + " in size"};
}

}  // namespace

// not in an unnamed namespace, which FieldList::section() doesn't see

// Chamfer of the peg or of the hole.
static void chamferFields(FieldList& f, double& width, double& angle) {
  f.group("chamfer",
          [&](FieldList& g) {
            g.number("width", width, notNegative("m", kLength.high),
                     "Radial width of the edge's chamfer; 0: sharp.")
                .required();
            g.number("angle", angle, {kMinChamferAngle, kMaxChamferAngle, "rad"},
                     "Angle between the chamfer's face and the axis.");
          })
      .flow()
      .written(width > 0.0);
}

// Radius of the peg or of the hole.
static void radiusFields(FieldList& f, double& radius, RadiusTolerance& tolerance,
                         const char* description) {
  Field& field = f.number("radius", radius, kSize, description).required();
  if (tolerance == kNoTolerance) field.independent();
  f.numbers("radius_tolerance", tolerance.data(), 2, kSize,
            "Smallest and largest radius by the drawing [m]: what is known of the clearance.")
      .row("the smallest and the largest radius")
      .derived("none")
      .written(tolerance != kNoTolerance);
}

static void fields(FieldList& f, PegParameters& p) {
  radiusFields(f, p.radius, p.radius_tolerance, "Radius of the peg.");
  f.number("half_height", p.half_height, kSize,
           "Distance from the centre of mass to the bottom edge.")
      .required();
  f.number("mass", p.mass, kMass, "Mass of the peg.").required().independent();
  f.number("inertia_transverse", p.inertia_transverse, kInertia,
           "Inertia about a transverse axis through the centre of mass.")
      .required();
  f.number("inertia_axial", p.inertia_axial, kInertia,
           "Inertia about the peg's axis, at most twice inertia_transverse.")
      .required();
  f.number("coupling_height", p.coupling_height, kLength,
           "Distance along the axis from the centre of mass to the coupling.")
      .required();
  f.number("exciter_height", p.exciter_height, kLength,
           "Distance along the axis from the centre of mass to the exciting force.")
      .required()
      .independent();
  chamferFields(f, p.chamfer_width, p.chamfer_angle);
}

static void fields(FieldList& f, HoleParameters& p, PegParameters& peg) {
  radiusFields(f, p.radius, p.radius_tolerance, "Radius of the hole.");
  f.other(
      "fit", [&p, &peg](yaml::Section& in) { readFit(in, p, peg); },
      "Fit by ISO 286, such as H7/g6, in place of both tolerances. Equal radii of hole and peg are "
      "the nominal one: the parts then have the middle of their zones.");
  f.number("depth", p.depth, positive("m"), "Depth of the hole; missing: infinite.")
      .written(std::isfinite(p.depth));
  chamferFields(f, p.chamfer_width, p.chamfer_angle);
}

static void fields(FieldList& f, CarrierParameters& p, RestPose& rest, bool in_scenario) {
  f.number("mass", p.mass, kMass, "Mass of the carrier.").required().independent();
  f.number("inertia", p.inertia, kInertia, "Inertia of the carrier about z.")
      .required()
      .independent();
  f.numbers("stiffness", p.stiffness.data(), 3, Range::kNotNegative,
            "Stiffness along x, y [N/m] and about z [N m/rad].")
      .required();
  f.numbers("damping", p.damping.data(), 3, Range::kNotNegative,
            "Damping along x, y [N s/m] and about z [N m s/rad].")
      .required();
  f.number("max_speed", p.max_speed, positive("m/s"), "Largest speed of the commanded rest pose.")
      .independent();
  f.number("max_acceleration", p.max_acceleration, positive("m/s2"),
           "Largest acceleration of the commanded rest pose.");
  f.group("rest",
          [&](FieldList& g) {
            g.number("x", rest.x, kLength, "Rest position.").required();
            g.number("y", rest.y, kLength, "Rest position.").required();
            g.number("yaw", rest.yaw, kAngle, "Rest angle about z.").required();
          })
      .required(in_scenario)
      .written(in_scenario);
}

// `letter` of the two cross terms: k or c
static void couplingMatrixFields(FieldList& f, CouplingMatrix& m, bool stiffness) {
  Field& group = f.group(stiffness ? "stiffness" : "damping", [&](FieldList& g) {
    g.numbers("diagonal", m.diagonal.data(), 6, Range::kNotNegative,
              stiffness ? "Stiffness along z, x, y [N/m], about z, x, y [N m/rad]."
                        : "Damping along z, x, y [N s/m], about z, x, y [N m s/rad].")
        .required();
    g.number(stiffness ? "k26" : "c26", m.k26, Range::kAny,
             "Cross term of x with the rotation about y.")
        .required();
    g.number(stiffness ? "k35" : "c35", m.k35, Range::kAny,
             "Cross term of y with the rotation about x.")
        .required();
    if (!stiffness) return;
    g.numbers("cross", m.cross.data(), 13, Range::kAny,
              "The other entries above the diagonal, row by row: z with x is the first.")
        .derived("zeros")
        .written(!m.cross.isZero(0.0));
  });
  group.flow();
  if (stiffness) {
    group.requiredUnless("compliance");
  } else {
    group.required();
  }
}

static void readCompliance(yaml::Section& in, CouplingMatrix& stiffness) {
  const std::string key = "compliance", path = in.at(key);
  const Eigen::Matrix<double, 36, 1> rows = in.numbers<36>(key, Range::kAny);
  if (in.optional("stiffness")) {
    in.refuse(path, "36 numbers", "coupling.stiffness is given, too; leave one of them out");
  }
  const auto C = [&](int i, int j) { return rows(6 * i + j); };
  Matrix6 relative;  // of its diagonal, without units
  Vector6 size;
  for (int i = 0; i < 6; ++i) {
    if (!(C(i, i) > 0.0)) {
      in.refuse(
          path, C(i, i),
          text("entry (%d, %d) is not above 0; give a positive definite matrix", i + 1, i + 1));
    }
    size(i) = std::sqrt(C(i, i));
  }
  for (int i = 0; i < 6; ++i) {
    for (int j = 0; j < 6; ++j) {
      if (std::abs(C(i, j) - C(j, i)) > kSymmetricRounding * size(i) * size(j)) {
        in.refuse(path, C(i, j),
                  text("entry (%d, %d) differs from (%d, %d), ", i + 1, j + 1, j + 1, i + 1) +
                      shown(C(j, i)) + "; give a symmetric matrix, the mean of both");
      }
      relative(i, j) = 0.5 * (C(i, j) + C(j, i)) / (size(i) * size(j));
    }
  }
  const double least = leastEigenvalue(relative);
  if (!(least > kLeastDefinite)) {
    in.refuse(path, least,
              "lowest eigenvalue, each entry divided by the roots of its two diagonal entries; "
              "give a positive definite matrix");
  }
  const Matrix6 scale = size.cwiseInverse().asDiagonal();
  const Matrix6 K = scale * relative.inverse() * scale;
  stiffness = couplingMatrix(reordered(0.5 * (K + K.transpose()), kWrenchOfThesis));
}

static void fields(FieldList& f, CouplingParameters& p, RestPose& rest, bool in_scenario) {
  couplingMatrixFields(f, p.stiffness, true);
  f.other(
       "compliance", [&p](yaml::Section& in) { readCompliance(in, p.stiffness); },
       "In place of stiffness: 36 numbers, row by row, displacement by wrench, both x, y, z, about "
       "x, y, z of the carrier [m/N, rad/N, m/(N m), rad/(N m)].")
      .derived("none")
      .written(false);
  couplingMatrixFields(f, p.damping, false);
  f.choice("axes", p.axes, {"hole", "carrier"},
           "Axes of springs and dampers: those of the frame hole, or of the carrier.")
      .written(p.axes != CouplingAxes::kHole);
  f.group("rest",
          [&](FieldList& g) {
            g.number("z", rest.z, kLength, "Rest height of the coupling point.").required();
            g.number("theta", rest.theta, kAngle, "Rest angle, upright: pi/2.").required();
            g.number("phi", rest.phi, kAngle, "Rest angle.").required();
          })
      .required(in_scenario)
      .written(in_scenario);
}

static void fields(FieldList& f, ExciterParameters& p) {
  f.number("amplitude", p.amplitude, notNegative("N"), "Amplitude of the rotating force; 0: off.")
      .required()
      .independent();
  f.number("frequency", p.frequency, notNegative("rad/s", 1e6),
           "Angular frequency of the rotating force.")
      .required()
      .independent();
  f.number("phase", p.phase, kAngle, "Phase of the rotating force at time 0.").independent();
  f.integer("direction", p.direction, -1, 1,
            "Rotation of the force; 1: anticlockwise from above, -1: clockwise.");
}

static void fields(FieldList& f, FrictionParameters& p) {
  f.number("static", p.static_coefficient, Range::kNotNegative, "Friction coefficient at rest.")
      .required();
  f.number("sliding", p.sliding_coefficient, Range::kNotNegative,
           "Friction coefficient while sliding, at most static.")
      .required();
}

static void fields(FieldList& f, ArmResponse& p) {
  f.number("delay", p.delay, notNegative("s", 0.5),
           "From a command of the arm to its effect in the force; 0: not known.");
  f.number("delay_sd", p.delay_sd, notNegative("s", 0.5),
           "Its standard deviation; 0: goals don't check the delay.");
  f.number("stiffness", p.stiffness, notNegative("N/m"),
           "Of arm, mount and contact in series, at the peg's edge; 0: that of the coupling.");
  f.number("stiffness_sd", p.stiffness_sd, notNegative("N/m"), "Its standard deviation.");
}

void fields(FieldList& f, Mechanism& m, RestPose& rest, bool in_scenario) {
  f.number("gravity", m.gravity, notNegative("m/s2"),
           "Along -z of the hole, or a vector in the hole for a cell that isn't upright.")
      .orVector(m.up.data())
      .required()
      .independent();
  f.section("peg", m.peg).required();
  f.group("hole", [&](FieldList& g) { fields(g, m.hole, m.peg); }).required();
  f.group("carrier", [&](FieldList& g) { fields(g, m.carrier, rest, in_scenario); }).required();
  f.group("coupling", [&](FieldList& g) { fields(g, m.coupling, rest, in_scenario); }).required();
  f.section("exciter", m.exciter).flow();
  f.section("friction", m.friction).required().flow();
  const ArmResponse& arm = m.arm;
  f.section("arm", m.arm).flow().written(arm.delay > 0.0 || arm.stiffness > 0.0);
}

std::optional<MechanismProblem> problemOf(const Mechanism& m) {
  if (auto problem = problemOf(m.peg)) return problem;
  if (auto problem = problemOf(m.hole)) return problem;
  const CouplingMatrix &k = m.coupling.stiffness, &c = m.coupling.damping;
  if (auto problem = indefinite(k, "coupling.stiffness.k26", 1, 5, k.k26)) return problem;
  if (auto problem = indefinite(k, "coupling.stiffness.k35", 2, 4, k.k35)) return problem;
  if (auto problem = indefinite(k)) return problem;
  if (auto problem = indefinite(c, "coupling.damping.c26", 1, 5, c.k26)) return problem;
  if (auto problem = indefinite(c, "coupling.damping.c35", 2, 4, c.k35)) return problem;
  if (m.exciter.direction == 0) {
    return MechanismProblem{"exciter.direction", 0.0,
                            "give 1 (anticlockwise from above) or -1 (clockwise)"};
  }
  if (m.friction.sliding_coefficient > m.friction.static_coefficient) {
    return MechanismProblem{
        "friction.sliding", m.friction.sliding_coefficient,
        "give at most friction.static (" + shown(m.friction.static_coefficient) + ")"};
  }
  return {};
}

std::optional<MechanismProblem> problemOfTheta(const std::string& key, double theta) {
  // reversed axes (theta outside 0..pi) name the same poses a second time
  if (theta > 0.0 && theta < M_PI && std::sin(theta) >= kMinSinTheta) return {};
  return MechanismProblem{key, theta,
                          "give an angle with sin(theta) >= 0.1 between 0 and pi, upright is pi/2"};
}

Pose poseFromRest(const RestPose& rest) {
  return {rotationFromEuler({rest.phi, rest.theta, rest.yaw}),
          Eigen::Vector3d(rest.x, rest.y, rest.z)};
}

RestPose restFromPose(const Pose& pose) {
  const EulerAngles angles = eulerFromRotation(pose.R);
  return {pose.p.x(), pose.p.y(), pose.p.z(), angles.psi, angles.theta, angles.phi};
}

Matrix6 couplingStiffness(const CouplingParameters& coupling) {
  return reordered(fullMatrix(coupling.stiffness), kThesisOfWrench);
}

Matrix6 fullMatrix(const CouplingMatrix& matrix) {
  Matrix6 full = matrix.diagonal.asDiagonal();
  int next = 0;
  for (int i = 0; i < 6; ++i) {
    for (int j = i + 1; j < 6; ++j) {
      const bool is26 = i == 1 && j == 5, is35 = i == 2 && j == 4;
      full(i, j) = full(j, i) = is26 ? matrix.k26 : is35 ? matrix.k35 : matrix.cross(next++);
    }
  }
  return full;
}

CouplingMatrix couplingMatrix(const Matrix6& full) {
  CouplingMatrix matrix{full.diagonal(), full(1, 5), full(2, 4)};
  int next = 0;
  for (int i = 0; i < 6; ++i) {
    for (int j = i + 1; j < 6; ++j) {
      if ((i == 1 && j == 5) || (i == 2 && j == 4)) continue;
      matrix.cross(next++) = full(i, j);
    }
  }
  return matrix;
}

void scaleRows(CouplingMatrix& matrix, const Vector6& factors) {
  Matrix6 full = fullMatrix(matrix);
  for (int i = 0; i < 6; ++i) {
    full(i, i) *= factors(i);
    for (int j = i + 1; j < 6; ++j) full(i, j) *= std::sqrt(factors(i) * factors(j));
  }
  matrix = couplingMatrix(full);
}

Mechanism loadMechanism(const std::string& path, const std::vector<std::string>& overrides) {
  return parseMechanism(yaml::fileText(path, "mechanism"), path, overrides);
}

Mechanism parseMechanism(const std::string& text, const std::string& source,
                         const std::vector<std::string>& overrides) {
  yaml::Section in(yaml::loadMapping(text, source, overrides, yaml::FileKind::kMechanism), "",
                   source);
  Mechanism mechanism;
  RestPose rest;
  FieldList list;
  fields(list, mechanism, rest, false);
  in.read(list);
  // other keys of a scenario
  for (const char* key : {"name", "duration", "push", "contact", "initial", "solver",
                          "identification", "thesis_moments", "thesis_cross_stiffness",
                          "thesis_creep", "thesis_no_centripetal", "thesis_sign_flip"}) {
    in.optional(key);
  }
  in.finish();
  auto problem = problemOf(mechanism);
  if (!problem) problem = problemOfTheta("coupling.rest.theta", rest.theta);
  if (problem) in.refuse(problem->key, problem->value, problem->why);
  return mechanism;
}

std::string mechanismText(const Mechanism& mechanism) {
  Mechanism copy = mechanism;
  RestPose rest;
  FieldList list;
  fields(list, copy, rest, false);
  return yamlText(list);
}

}  // namespace assembly_cell
