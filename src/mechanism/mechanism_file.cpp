// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/mechanism/mechanism_file.h"

#include <cmath>

namespace assembly_cell {
namespace mechanism_file {

using yaml::Range;
using yaml::Section;
using yaml::shown;

namespace {

// the Euler angles are singular at sin(theta) = 0: peg horizontal
constexpr double kSmallestSinTheta = 0.1;
// rounding of k² against the product of its diagonal entries
constexpr double kDefiniteRounding = 1e-12;
constexpr double kLargestPart = 1.0;  // of a radius or a height [m]
double withinSize(const Section& in, const std::string& key, double value, double largest) {
  if (std::abs(value) > largest) {
    in.refuse(in.at(key), value, "give at most " + shown(largest) + " in size, SI units");
  }
  return value;
}

double readSize(Section& in, const std::string& key) {
  const double value = in.number(key, Range::kPositive);
  if (value > kLargestPart) {
    in.refuse(in.at(key), value,
              "give at most " + shown(kLargestPart) + " m, lengths are in metres");
  }
  return value;
}

}  // namespace

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

void checkTheta(const Section& in, const std::string& key, double theta) {
  // reversed axes (theta outside 0..pi) name the same poses a second time
  if (!(theta > 0.0 && theta < M_PI && std::sin(theta) >= kSmallestSinTheta)) {
    in.refuse(key, theta, "give an angle with sin(theta) >= 0.1 between 0 and pi, upright is pi/2");
  }
}

namespace {

// beyond it, what is computed from it overflows sooner or later
double readMass(Section& in) {
  constexpr double kLargest = 1e4;  // [kg]
  const double mass = in.number("mass", Range::kPositive);
  if (mass > kLargest) in.refuse(in.at("mass"), mass, "give at most 10000 kg");
  return mass;
}

// of peg and hole alike
void readChamfer(Section in, double& width, double& angle) {
  width = readLength(in, "width", Range::kNotNegative);
  angle = in.number("angle", kLeastChamferAngle, kMostChamferAngle, angle);
  in.finish();
}

PegParameters readPeg(Section in) {
  PegParameters peg;
  peg.radius = readSize(in, "radius");
  peg.half_height = readSize(in, "half_height");
  peg.mass = readMass(in);
  peg.inertia_transverse = in.number("inertia_transverse", Range::kPositive);
  peg.inertia_axial = in.number("inertia_axial", Range::kPositive);
  peg.coupling_height = readLength(in, "coupling_height", Range::kAny);
  peg.exciter_height = readLength(in, "exciter_height", Range::kAny);
  if (in.optional("chamfer")) {
    readChamfer(in.section("chamfer"), peg.chamfer_width, peg.chamfer_angle);
    if (!(tipRadius(peg) > 0.0)) {
      in.refuse(in.at("chamfer.width"), peg.chamfer_width,
                "the peg's radius is " + shown(peg.radius) + " m; give less");
    }
    if (!(chamferHeight(peg) < 2.0 * peg.half_height)) {
      in.refuse(in.at("chamfer.width"), peg.chamfer_width,
                "the chamfer goes " + shown(chamferHeight(peg)) + " m up, the peg is " +
                    shown(2.0 * peg.half_height) + " long; give less");
    }
  }
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
  hole.radius = readSize(in, "radius");
  hole.depth = in.number("depth", Range::kPositive, hole.depth);
  if (in.optional("chamfer")) {
    readChamfer(in.section("chamfer"), hole.chamfer_width, hole.chamfer_angle);
    if (!(mouthRadius(hole) < blockRadius(hole))) {
      in.refuse(
          in.at("chamfer.width"), hole.chamfer_width,
          "the block's wall is " + shown(blockRadius(hole) - hole.radius) + " m wide; give less");
    }
    if (!(chamferDepth(hole) < hole.depth)) {
      in.refuse(in.at("chamfer.width"), hole.chamfer_width,
                "the chamfer goes " + shown(chamferDepth(hole)) + " m deep, the hole " +
                    shown(hole.depth) + "; give less");
    }
  }
  in.finish();
  return hole;
}

CarrierParameters readCarrier(Section in, RestPose* rest) {
  CarrierParameters carrier;
  carrier.mass = readMass(in);
  carrier.inertia = in.number("inertia", Range::kPositive);
  carrier.stiffness = in.numbers<3>("stiffness", Range::kNotNegative);
  carrier.damping = in.numbers<3>("damping", Range::kNotNegative);
  carrier.max_speed = in.number("max_speed", Range::kPositive, carrier.max_speed);
  carrier.max_acceleration =
      in.number("max_acceleration", Range::kPositive, carrier.max_acceleration);
  if (rest || in.optional("rest")) {
    Section in_rest = in.section("rest");
    RestPose unused;
    RestPose& to = rest ? *rest : unused;
    to.x = readLength(in_rest, "x", Range::kAny);
    to.y = readLength(in_rest, "y", Range::kAny);
    to.yaw = readAngle(in_rest, "yaw");
    in_rest.finish();
  }
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

CouplingParameters readCoupling(Section in, RestPose* rest) {
  CouplingParameters coupling;
  coupling.stiffness = readCouplingMatrix(in.section("stiffness"), "k");
  coupling.damping = readCouplingMatrix(in.section("damping"), "c");
  if (in.optional("axes") && in.choice("axes", {"hole", "carrier"}) == "carrier") {
    coupling.axes = CouplingAxes::kCarrier;
  }
  if (rest || in.optional("rest")) {
    Section in_rest = in.section("rest");
    RestPose unused;
    RestPose& to = rest ? *rest : unused;
    to.z = readLength(in_rest, "z", Range::kAny);
    to.theta = readAngle(in_rest, "theta");
    to.phi = readAngle(in_rest, "phi");
    in_rest.finish();
    checkTheta(in_rest, in_rest.at("theta"), to.theta);
  }
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

}  // namespace

Mechanism readMechanism(Section& in, RestPose* rest) {
  Mechanism mechanism;
  mechanism.gravity = in.number("gravity", Range::kNotNegative);
  mechanism.peg = readPeg(in.section("peg"));
  mechanism.hole = readHole(in.section("hole"));
  mechanism.carrier = readCarrier(in.section("carrier"), rest);
  mechanism.coupling = readCoupling(in.section("coupling"), rest);
  if (in.optional("exciter")) mechanism.exciter = readExciter(in.section("exciter"));
  mechanism.friction = readFriction(in.section("friction"));
  return mechanism;
}

}  // namespace mechanism_file

Pose poseFromRest(const RestPose& rest) {
  return {rotationFromEuler({rest.phi, rest.theta, rest.yaw}),
          Eigen::Vector3d(rest.x, rest.y, rest.z)};
}

RestPose restFromPose(const Pose& pose) {
  const EulerAngles angles = eulerFromRotation(pose.R);
  return {pose.p.x(), pose.p.y(), pose.p.z(), angles.psi, angles.theta, angles.phi};
}

Matrix6 couplingStiffness(const CouplingParameters& coupling) {
  const Vector6& k = coupling.stiffness.diagonal;  // order z, x, y, about z, x, y
  Matrix6 K = Matrix6::Zero();
  K.diagonal() << k(1), k(2), k(0), k(4), k(5), k(3);
  K(0, 4) = K(4, 0) = coupling.stiffness.k26;
  K(1, 3) = K(3, 1) = coupling.stiffness.k35;
  return K;
}

Mechanism loadMechanism(const std::string& path, const std::vector<std::string>& overrides) {
  return parseMechanism(yaml::fileText(path, "mechanism"), path, overrides);
}

Mechanism parseMechanism(const std::string& text, const std::string& source,
                         const std::vector<std::string>& overrides) {
  yaml::Section in(yaml::loadMapping(text, source, overrides, yaml::FileKind::kMechanism), "",
                   source);
  const Mechanism mechanism = mechanism_file::readMechanism(in, nullptr);
  // what a scenario says beside
  for (const char* key : {"name", "duration", "push", "contact", "initial", "solver",
                          "identification", "thesis_moments", "thesis_cross_stiffness",
                          "thesis_creep", "thesis_no_centripetal", "thesis_sign_flip"}) {
    in.optional(key);
  }
  in.finish();
  return mechanism;
}

}  // namespace assembly_cell
