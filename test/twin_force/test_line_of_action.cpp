// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
// Line of action, Rodrigues vectors, advice on the next contact.
#include <gtest/gtest.h>

#include <random>

#include "assembly_cell/base/input_error.h"
#include "assembly_cell/twin_force/line_of_action.h"
#include "assembly_cell/twin_force/next_contact.h"
#include "ground_truth.h"
#include "thesis_forms.h"

namespace assembly_cell {
namespace {

using namespace twin_truth;

TEST(LineOfAction, PointsOfTheLineGiveTheMoment) {
  const Vector3d point(0.03, -0.02, 0.05), force(3, -4, 12);
  Vector6 w = onLine(point, force);
  w.tail<3>() += 0.7 * force.normalized();  // a couple along the force moves no line
  const auto line = lineOfAction(w);
  ASSERT_TRUE(line);
  EXPECT_NEAR(line->force, 13, 1e-13);
  EXPECT_NEAR(line->couple, 0.7, 1e-14);
  EXPECT_NEAR(line->point.dot(line->direction), 0, 1e-16);
  EXPECT_LT((point - line->point).cross(line->direction).norm(), 1e-16);
  EXPECT_FALSE(lineOfAction(Vector6::Zero()));
  EXPECT_FALSE(lineOfAction(Vector6::Constant(NAN)));
}

TEST(LineOfAction, CrossingAndItsSlopes) {
  Vector6 w = onLine({0.03, -0.02, 0.05}, {3, -4, 12});
  w.tail<3>() += 0.7 * Vector3d(3, -4, 12) / 13;
  for (int axis = 0; axis < 3; ++axis) {
    const auto at = lineCrossing(w, axis, Vector3d(0.03, -0.02, 0.05)[axis]);
    ASSERT_TRUE(at);
    EXPECT_LT((at->point - Vector3d(0.03, -0.02, 0.05)).norm(), 1e-15);
    for (int k = 0; k < 6; ++k) {
      Vector6 up = w, down = w;
      up[k] += 1e-5;
      down[k] -= 1e-5;
      const double h = Vector3d(0.03, -0.02, 0.05)[axis];
      const Vector3d slope =
          (lineCrossing(up, axis, h)->point - lineCrossing(down, axis, h)->point) / 2e-5;
      // rounding 1e-17/1e-5 and the third derivative
      EXPECT_LT((at->slope.col(k) - slope).norm(), 1e-9) << axis << k;
    }
  }
  // corrected 10.13 for a force along x3, absolute values added
  Vector6 error;
  error << 0.05, 0.04, 0.03, 2e-3, 3e-3, 1e-3;
  const Vector6 press = onLine({0.03, -0.02, 0}, {0, 0, 20});
  const double x3 = 0.05, F3 = 20;
  const auto at = lineCrossing(press, 2, x3);
  const Vector3d b = crossingBound(*at, error);
  EXPECT_NEAR(b.x(), (x3 * 0.05 + 0.03 * 0.03 + 3e-3) / F3, 1e-17);
  EXPECT_NEAR(b.y(), (x3 * 0.04 + 0.02 * 0.03 + 2e-3) / F3, 1e-17);
  EXPECT_EQ(b.z(), 0.0);
  const Matrix6 c = error.cwiseAbs2().asDiagonal();
  EXPECT_LT(std::sqrt(crossingCovariance(*at, c)(0, 0)), b.x());
  EXPECT_FALSE(lineCrossing(onLine({0, 0, 0.01}, {1, 0, 0}), 2, 0.0));
}

TEST(LineOfAction, RuleOfThePoseError) {
  // 10.14 at 90°: σ_M = x σ_F
  const auto rule = poseErrorRule(20, 0.05, 0.005, M_PI / 2);
  EXPECT_NEAR(rule.position, 2.8 * 0.1 * 0.05 / 20, 1e-12);
  EXPECT_NEAR(rule.rotation, 2.0 * 0.05 / 20, 1e-12);
  EXPECT_NEAR(poseErrorRule(20, 0.05, 0.005, M_PI / 6).position / rule.position, 4.0, 1e-12);
}

TEST(Rodrigues, TwoVectorsOfOneRotation) {
  const Vector3d n = Vector3d(1, -2, 0.5).normalized();
  for (const double angle : {0.0, 1e-8, 0.17, 2.0, M_PI - 1e-6}) {
    const Matrix3d R = rotation(angle * n);
    const GibbsVector g = gibbsFromRotation(R);
    const RodriguesVector l = rodriguesFromRotation(R);
    const double t = std::tan(angle / 2);
    EXPECT_LT((g.value - t * n).norm(), 1e-15 * (1 + t * t) * 10) << angle;
    EXPECT_LT((l.value - 2 * g.value).norm(), 1e-15);
    EXPECT_LT((rotationFromGibbs(g) - R).cwiseAbs().maxCoeff(), 1e-14);
    EXPECT_LT((rotationFromRodrigues(l) - R).cwiseAbs().maxCoeff(), 1e-14);
  }
  // the printed mix of the two halves the angle: 10° becomes 5.01°
  const GibbsVector ten = gibbsFromRotation(rotation(10 * M_PI / 180 * n));
  const Eigen::AngleAxisd mixed(rotationFromRodrigues({ten.value}));
  EXPECT_NEAR(mixed.angle() * 180 / M_PI, 5.01, 0.005);
  EXPECT_THROW(gibbsFromRotation(rotation(M_PI * n)), std::domain_error);
}

TEST(NextContact, TurnsAwayFromTheLinesThereAre) {
  Scene s = begin("near parallel", Matrix3d::Identity(), {0.08, -0.06, 0.1});
  press(s, {0, 0.03, 0.02}, {0, 0, -20});
  press(s, {0, -0.03, 0.02}, -20 * Vector3d(std::sin(0.1), 0, std::cos(0.1)));
  TwinForceWorkspace workspace(4);
  TwinForceOptions options;
  const auto& e = estimatePose(measure(s), options, workspace);
  ASSERT_EQ(e.status, TwinForceStatus::kWeak);
  std::vector<ContactCandidate> two(2);
  ContactCandidate &along = two[0], &across = two[1];
  along.covariance_a = across.covariance_a = s.covariance_a;
  along.covariance_b = across.covariance_b = s.covariance_b;
  along.point = Vector3d(-0.08, 0.09, -0.08);  // the first contact's line again
  across.point = Vector3d(-0.05, 0.06, -0.1);
  along.force = Vector3d(0, 0, -20);
  across.force = Vector3d(-20, 0, 0);
  // a parallel line gains almost nothing, a perpendicular one much
  EXPECT_LT(adviseNextContact(e, {along}, options).smallest_eigenvalue, 2 * e.eigenvalues[0]);
  EXPECT_GT(adviseNextContact(e, {across}, options).smallest_eigenvalue, 0.5);
  const ContactAdvice advice = adviseNextContact(e, {along, across, along}, options);
  EXPECT_EQ(advice.candidate, 1);
  EXPECT_EQ(adviseNextContact(e, {}, options).candidate, -1);
  EXPECT_THROW(adviseNextContact(e, {ContactCandidate()}, options), InputError);

  // what is predicted is the bound once the contact is made
  Scene after = s;
  press(after, s.X_AB.R * across.point + s.X_AB.p, s.X_AB.R * across.force);
  const Matrix6 P = bound(after);
  EXPECT_NEAR(advice.position_sd, std::sqrt(P.diagonal().head<3>().sum()),
              1e-4 * advice.position_sd);
  EXPECT_NEAR(advice.rotation_sd, std::sqrt(P.diagonal().tail<3>().sum()),
              1e-4 * advice.rotation_sd);

  // parallel lines: the default plan ends the degeneracy
  Scene parallel = begin("parallel", Matrix3d::Identity(), {0.08, -0.06, 0.1});
  press(parallel, {0, 0.03, 0.02}, {0, 0, -20});
  press(parallel, {0, -0.03, 0.02}, {0, 0, -20});
  const auto contacts = measure(parallel);
  const auto& d = estimatePose(contacts, options, workspace);
  ASSERT_EQ(d.status, TwinForceStatus::kDegenerate);
  const auto candidates = defaultCandidates(contacts);
  EXPECT_EQ(candidates.size(), 39u);
  const ContactAdvice best = adviseNextContact(d, candidates, options);
  ASSERT_GE(best.candidate, 0);
  EXPECT_GT(best.smallest_eigenvalue, 1.0);
  const Vector3d u = candidates[static_cast<std::size_t>(best.candidate)].force.normalized();
  EXPECT_LT(std::abs(u.z()), 0.71);
}

}  // namespace
}  // namespace assembly_cell
