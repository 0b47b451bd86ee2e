// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/arm/arm_kinematics.h"

#include <urdf_parser/urdf_parser.h>

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <kdl/chain.hpp>
#include <kdl/chainfksolverpos_recursive.hpp>
#include <kdl/chainjnttojacsolver.hpp>
#include <limits>

#include "assembly_cell/base/input_error.h"
#include "assembly_cell/base/text.h"
#include "assembly_cell/description/joint_chain.h"

namespace assembly_cell {
namespace {

constexpr double kLever = 0.1;        // metres per radian, to weight rotations [m]
constexpr double kNear = 0.02;        // singular value below which it is damped [m/rad]
constexpr double kDamping = 0.05;     // at the singularity [m/rad]
constexpr double kReached = 1e-9;     // [m], and divided by kLever [rad]
constexpr double kGoodEnough = 1e-7;  // the same where steps no longer improve
constexpr double kMaxStep = 0.2;      // of a joint in one iteration [rad]
constexpr int kSteps = 200;
// Tolerance of a joint beyond its limit, for rounding of encoders and of limits in degrees. The
// pose for the joint at its limit is then within 10 µm up to a reach of 2 m. [rad], [m]
constexpr double kLimitTolerance = 5e-6;
using Jacobian = Eigen::Matrix<double, 6, Eigen::Dynamic>;

KDL::Vector kdl(const Eigen::Vector3d& v) { return {v.x(), v.y(), v.z()}; }
KDL::Frame kdl(const Pose& X) {
  const Eigen::Matrix3d& R = X.R;
  return {KDL::Rotation(R(0, 0), R(0, 1), R(0, 2), R(1, 0), R(1, 1), R(1, 2), R(2, 0), R(2, 1),
                        R(2, 2)),
          kdl(X.p)};
}

KDL::Chain kdl(const JointChain& chain) {
  KDL::Chain out;
  for (const JointChain::Joint& joint : chain.joints) {
    const auto type = joint.slides ? KDL::Joint::TransAxis : KDL::Joint::RotAxis;
    const Eigen::Vector3d axis = joint.before.R * joint.axis;
    out.addSegment(KDL::Segment(joint.name,
                                KDL::Joint(joint.name, kdl(joint.before.p), kdl(axis), type),
                                kdl(joint.before)));
  }
  out.addSegment(KDL::Segment("end", KDL::Joint(KDL::Joint::Fixed), kdl(chain.end)));
  return out;
}

JointLimits limitsOf(const urdf::ModelInterface& model, const JointChain& chain,
                     const std::string& source) {
  const auto n = static_cast<Eigen::Index>(chain.joints.size());
  JointLimits limits{JointVector(n), JointVector(n), JointVector(n)};
  for (Eigen::Index k = 0; k < n; ++k) {
    const std::string& name = chain.joints[static_cast<std::size_t>(k)].name;
    const urdf::JointConstSharedPtr joint = model.getJoint(name);
    if (!joint->limits || !(joint->limits->velocity > 0.0)) {
      throw InputError(source + ": joint " + name + ": has no limit of its velocity: give one");
    }
    constexpr double kAny = std::numeric_limits<double>::infinity();
    const bool continuous = joint->type == urdf::Joint::CONTINUOUS;
    limits.lower(k) = continuous ? -kAny : joint->limits->lower;
    limits.upper(k) = continuous ? kAny : joint->limits->upper;
    limits.speed(k) = joint->limits->velocity;
    if (limits.lower(k) < limits.upper(k)) continue;
    throw InputError(source + ": joint " + name + ": lower limit not below the upper one");
  }
  return limits;
}

Vector6 weighted(const Vector6& v) {
  Vector6 out = v;
  out.tail<3>() *= kLever;
  return out;
}

// Joint rates for the weighted twist v, damped where the smallest singular value is small.
JointVector dampedRates(Jacobian J, const Vector6& v) {
  J.bottomRows<3>() *= kLever;
  Matrix6 M = J * J.transpose();
  const double sigma = std::sqrt(std::max(
      0.0, Eigen::SelfAdjointEigenSolver<Matrix6>(M, Eigen::EigenvaluesOnly).eigenvalues()(0)));
  if (sigma < kNear) {
    const double share = 1.0 - sigma / kNear;
    M.diagonal().array() += kDamping * kDamping * share * share;
  }
  // full rank by the damping
  return J.transpose() * Eigen::LLT<Matrix6>(M).solve(v);
}

}  // namespace

struct ArmKinematics::Chain {
  JointChain joints;
  KDL::Chain chain;
  JointLimits limits;
  std::vector<std::string> names;
  std::string base;
  mutable KDL::ChainFkSolverPos_recursive position;
  mutable KDL::ChainJntToJacSolver rates;
  mutable KDL::JntArray q;
  mutable KDL::Jacobian jacobian;

  explicit Chain(JointChain from)
      : joints(std::move(from)),
        chain(kdl(joints)),
        position(chain),
        rates(chain),
        q(chain.getNrOfJoints()),
        jacobian(chain.getNrOfJoints()) {}
};

ArmKinematics::ArmKinematics(const std::string& urdf, const std::string& tip,
                             const std::string& source)
    : chain_(std::make_unique<Chain>(loadJointChain(urdf, tip, source))) {
  if (chain_->joints.joints.empty()) {
    throw InputError(source + ": link " + tip + ": no joint moves it: give the arm's last link");
  }
  const urdf::ModelInterfaceSharedPtr model = urdf::parseURDF(urdf);
  chain_->base = model->getRoot()->name;
  chain_->limits = limitsOf(*model, chain_->joints, source);
  for (const JointChain::Joint& joint : chain_->joints.joints) {
    chain_->names.push_back(joint.name);
  }
}

ArmKinematics::~ArmKinematics() = default;

bool isAwayFromRoot(const std::string& urdf, const std::string& frame) {
  const urdf::ModelInterfaceSharedPtr model = urdf::parseURDF(urdf);
  if (!model || !model->getLink(frame)) return false;
  const JointChain chain = loadJointChain(urdf, frame, "URDF");
  return !chain.joints.empty() || chain.end.p.norm() > kReached ||
         !chain.end.R.isIdentity(kReached);
}

int ArmKinematics::joints() const { return static_cast<int>(chain_->names.size()); }
const std::vector<std::string>& ArmKinematics::names() const { return chain_->names; }
const std::string& ArmKinematics::base() const { return chain_->base; }
const JointLimits& ArmKinematics::limits() const { return chain_->limits; }

bool ArmKinematics::select(const std::vector<std::string>& names,
                           const std::vector<double>& positions, JointVector& q,
                           std::string& missing) const {
  q.resize(joints());
  for (std::size_t k = 0; k < chain_->names.size(); ++k) {
    const auto found = std::find(names.begin(), names.end(), chain_->names[k]);
    const auto index = static_cast<std::size_t>(found - names.begin());
    if (index >= positions.size()) {
      missing = chain_->names[k];
      return false;
    }
    q(static_cast<Eigen::Index>(k)) = positions[index];
  }
  return true;
}

Pose ArmKinematics::forward(const JointVector& q) const {
  chain_->q.data = q;
  KDL::Frame frame;
  chain_->position.JntToCart(chain_->q, frame);
  Pose X;
  for (int i = 0; i < 3; ++i) {
    X.p(i) = frame.p(i);
    for (int k = 0; k < 3; ++k) X.R(i, k) = frame.M(i, k);
  }
  return X;
}

const Jacobian& ArmKinematics::jacobian(const JointVector& q) const {
  chain_->q.data = q;
  chain_->rates.JntToJac(chain_->q, chain_->jacobian);
  return chain_->jacobian.data;
}

JointVector ArmKinematics::rates(const JointVector& q, const Vector6& v) const {
  const JointLimits& limits = chain_->limits;
  Jacobian J = jacobian(q);
  JointVector dq = dampedRates(J, weighted(v));
  // joints at their limits stay there; the others are solved again without them
  for (int pass = 0; pass < joints(); ++pass) {
    bool changed = false;
    for (Eigen::Index k = 0; k < q.size(); ++k) {
      const bool beyond =
          (q(k) >= limits.upper(k) && dq(k) > 0.0) || (q(k) <= limits.lower(k) && dq(k) < 0.0);
      if (!beyond || J.col(k).isZero(0.0)) continue;
      J.col(k).setZero();
      changed = true;
    }
    if (!changed) break;
    dq = dampedRates(J, weighted(v));
  }
  return dq;
}

std::string ArmKinematics::beyondLimit(const JointVector& q) const {
  const JointLimits& limits = chain_->limits;
  for (Eigen::Index k = 0; k < q.size(); ++k) {
    if (q(k) <= limits.upper(k) + kLimitTolerance && q(k) >= limits.lower(k) - kLimitTolerance) {
      continue;
    }
    const auto index = static_cast<std::size_t>(k);
    const char* const unit = chain_->joints.joints[index].slides ? "m" : "rad";
    return text("joint %s is at %.7g %s, its limits are %.7g to %.7g %s: move it back by hand",
                chain_->names[index].c_str(), q(k), unit, limits.lower(k), limits.upper(k), unit);
  }
  return {};
}

JointSolution ArmKinematics::solve(const Pose& X, JointVector& q) const {
  const JointLimits& limits = chain_->limits;
  q = q.cwiseMax(limits.lower).cwiseMin(limits.upper);
  JointSolution out;
  JointVector best = q;
  double min_distance = std::numeric_limits<double>::infinity();
  for (out.steps = 0; out.steps <= kSteps; ++out.steps) {
    const Pose now = forward(q);
    Vector6 way;
    way << X.p - now.p, now.R * vectorFromRotation(now.R.transpose() * X.R).value;
    const double distance = weighted(way).norm();
    if (distance < min_distance) {
      best = q;
      min_distance = distance;
      out.distance = way.head<3>().norm();
      out.turn = way.tail<3>().norm();
    }
    if (distance < kReached || !std::isfinite(distance)) break;
    JointVector step = rates(q, way);
    const double longest = step.cwiseAbs().maxCoeff();
    if (longest > kMaxStep) step *= kMaxStep / longest;
    const JointVector moved = (q + step).cwiseMax(limits.lower).cwiseMin(limits.upper);
    if ((moved - q).cwiseAbs().maxCoeff() < 1e-15) break;
    q = moved;
  }
  q = best;
  out.reached = min_distance < kGoodEnough;
  for (Eigen::Index k = 0; k < q.size(); ++k) {
    if (q(k) >= limits.upper(k) || q(k) <= limits.lower(k)) out.at_limit = static_cast<int>(k);
  }
  return out;
}

}  // namespace assembly_cell
