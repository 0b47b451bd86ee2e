// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/arm/arm_point.h"

#include <cmath>

#include "assembly_cell/base/text.h"

namespace assembly_cell {

JointPoint jointPoint(const ArmKinematics& kinematics, const CellPlace& place,
                      const CommandMotion& motion, const JointVector& before) {
  JointPoint point;
  JointVector& q = point.q = before;
  std::string& why = point.why;
  const JointSolution solution = kinematics.solve(place.flangeOf(motionPose(motion)), q);
  if (!solution.reached) {
    why = text("the joints get no nearer than %g m and %g rad", solution.distance, solution.turn);
    if (solution.at_limit >= 0) {
      why += ": " + kinematics.names()[static_cast<std::size_t>(solution.at_limit)] +
             " is at its limit";
    }
  }
  const JointVector max_step = motion.period * kinematics.limits().speed;
  for (Eigen::Index k = 0; k < q.size(); ++k) {
    if (std::abs(q(k) - before(k)) <= max_step(k)) continue;
    const double rate = std::abs(q(k) - before(k)) / motion.period;
    q(k) = before(k) + std::copysign(max_step(k), q(k) - before(k));
    if (why.empty()) {
      why = text("joint %s would have to turn by %g rad/s, allowed are %g rad/s",
                 kinematics.names()[static_cast<std::size_t>(k)].c_str(), rate,
                 kinematics.limits().speed(k));
    }
  }
  point.rates = (q - before) / motion.period;
  return point;
}

Vector6 flangeTwist(const CellPlace& place, const CommandMotion& motion, const Vector6& measured,
                    double gain) {
  const Pose now = place.flangeOf(motionPose(motion));
  const Pose before = place.flangeOf(poseOfCoordinates(motion.previous));
  const Pose there = place.flangeOf(poseOfCoordinates(measured));
  const auto turn = [](const Pose& from, const Pose& to) {
    return Eigen::Vector3d(vectorFromRotation(to.R * from.R.transpose()).value);
  };
  const double rate = 1.0 / motion.period;
  Vector6 twist;
  twist << rate * (now.p - before.p) + gain * (now.p - there.p),
      rate * turn(before, now) + gain * turn(there, now);
  return twist;
}

}  // namespace assembly_cell
