// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
// Each refusal and status, outliers, reversed signs, properties, no allocation.
#include <gtest/gtest.h>

#include <limits>

#include "allocations.h"
#include "assembly_cell/base/input_error.h"
#include "assembly_cell/twin_force/contact_checks.h"
#include "ground_truth.h"

namespace assembly_cell {
namespace {

using namespace twin_truth;
constexpr double kNan = std::numeric_limits<double>::quiet_NaN();

// n contacts pressed from all sides
Scene many(int n) {
  Scene s = begin("many", rotation({0.3, -0.2, 0.5}), {0.08, -0.06, 0.1});
  std::mt19937_64 random(3);
  std::normal_distribution<double> normal;
  for (int i = 0; i < n; ++i) {
    const Vector3d u = Vector3d(normal(random), normal(random), normal(random)).normalized();
    const Vector3d p = 0.06 * Vector3d(normal(random), normal(random), normal(random)).normalized();
    const Vector3d t(normal(random), normal(random), normal(random));
    press(s, p, 20 * u, {rotation(0.3 * t), 0.02 * t});
  }
  return s;
}

std::vector<TwinContact> sample(int n, unsigned seed = 1) {
  std::mt19937_64 random(seed);
  return measure(many(n), &random);
}

TEST(Decisions, OkWeakDegenerate) {
  TwinForceWorkspace workspace(8);
  TwinForceOptions options;
  EXPECT_EQ(estimatePose(sample(4), options, workspace).status, TwinForceStatus::kOk);
  options.required_position = 1e-5;
  const auto& weak = estimatePose(sample(4), options, workspace);
  EXPECT_EQ(weak.status, TwinForceStatus::kWeak);
  EXPECT_LT(weak.eigenvalues[0], 1.0);
  EXPECT_NEAR(weak.weak_direction.norm(), 1.0, 1e-12);
  // the variance along the weak direction is 1/λ requirements²
  Vector6 s;
  s << Vector3d::Constant(1e-5), Vector3d::Constant(1e-2);
  const Vector6 v = weak.weak_direction.cwiseQuotient(s);
  EXPECT_NEAR(v.dot(weak.covariance * v) * weak.eigenvalues[0], 1.0, 1e-6);
}

TEST(Decisions, RefusesContactsThatCannotCount) {
  TwinForceWorkspace workspace(8);
  TwinForceOptions options;
  options.oldest_tare = 600;
  const auto refused = [&](const std::vector<TwinContact>& contacts, const char* reason) {
    const auto& e = estimatePose(contacts, options, workspace);
    EXPECT_EQ(e.status, TwinForceStatus::kRefuse) << reason;
    EXPECT_NE(std::string(e.reason).find(reason), std::string::npos) << e.reason;
    EXPECT_EQ(e.culprit, 1);
    EXPECT_FALSE(hasPose(e.status));
  };
  for (const double bad : {kNan, std::numeric_limits<double>::infinity()}) {
    auto c = sample(3);
    c[1].wrench_a[4] = bad;
    refused(c, "not finite");
    c = sample(3);
    c[1].wrench_b[0] = bad;
    refused(c, "not finite");
    c = sample(3);
    c[1].move.p.x() = bad;
    refused(c, "not finite");
  }
  auto c = sample(3);
  c[1].move.R *= 1.1;
  refused(c, "not a rotation");
  c = sample(3);
  c[1].saturated = true;
  refused(c, "saturated");
  c = sample(3);
  c[1].tare_age = 601;
  refused(c, "tare");
  c = sample(3);
  c[1].time_difference = -0.021;
  refused(c, "simultaneous");
  c[1].time_difference = 0.019;
  EXPECT_EQ(estimatePose(c, options, workspace).status, TwinForceStatus::kOk);
  c[1].moving = true;
  refused(c, "simultaneous");
  c[1].time_difference = 0.0009;
  EXPECT_EQ(estimatePose(c, options, workspace).status, TwinForceStatus::kOk);
}

TEST(Decisions, RefusesTooFew) {
  TwinForceWorkspace workspace(8);
  EXPECT_EQ(estimatePose({}, {}, workspace).status, TwinForceStatus::kRefuseTooFew);
  EXPECT_EQ(estimatePose(sample(1), {}, workspace).status, TwinForceStatus::kRefuseTooFew);
  auto c = sample(2);
  // 20 sd of 0.05 N is 1 N, on either sensor
  c[1].wrench_b.head<3>() *= 0.9 / c[1].wrench_b.head<3>().norm();
  const auto& e = estimatePose(c, {}, workspace);
  EXPECT_EQ(e.status, TwinForceStatus::kRefuseTooFew);
  EXPECT_EQ(e.too_light, std::vector<int>{1});
}

TEST(Decisions, RefusesBadCovariancesByName) {
  TwinForceWorkspace workspace(8);
  const auto says = [&](const std::vector<TwinContact>& contacts, const TwinForceOptions& options,
                        const std::string& name, const std::string& fault) {
    try {
      estimatePose(contacts, options, workspace);
      ADD_FAILURE() << name << " accepted";
    } catch (const InputError& error) {
      EXPECT_EQ(std::string(error.what()).rfind(name + ": value " + fault, 0), 0u) << error.what();
    }
  };
  const auto with = [](auto change) {
    auto c = sample(3);
    change(c[2]);
    return c;
  };
  says(with([](auto& c) { c.covariance_b(3, 3) = kNan; }), {}, "contacts[2].covariance_b",
       "not finite");
  says(with([](auto& c) { c.covariance_a(0, 3) = 1e-5; }), {}, "contacts[2].covariance_a",
       "asymmetric");
  says(with([](auto& c) { c.covariance_a(0, 0) = -1; }), {}, "contacts[2].covariance_a",
       "indefinite");
  says(with([](auto& c) { c.covariance_b(0, 1) = c.covariance_b(1, 0) = 0.0026; }), {},
       "contacts[2].covariance_b", "indefinite");
  says(with([](auto& c) { c.covariance_a.setZero(); }), {}, "contacts[2].covariance_a", "singular");
  says(with([](auto& c) {
         c.move_covariance = Matrix6::Identity();
         (*c.move_covariance)(5, 5) = -1e-9;
       }),
       {}, "contacts[2].move_covariance", "indefinite");
  TwinForceOptions options;
  options.prior = defaultPrior({});
  options.prior->covariance(0, 0) = kNan;
  says(sample(3), options, "prior.covariance", "not finite");
  options.prior.reset();
  options.tare_covariance = -Matrix12::Identity();
  says(sample(3), options, "tare_covariance", "indefinite");
  // what doesn't vary is allowed for moves and tare
  options.tare_covariance = Matrix12::Zero();
  auto c = sample(3);
  c[1].move_covariance = Matrix6::Zero();
  EXPECT_EQ(estimatePose(c, options, workspace).status, TwinForceStatus::kOk);
  says(sample(9), {}, "contacts", "9 contacts");
}

TEST(Decisions, OutliersAreFoundAndNeverBelowTwo) {
  TwinForceWorkspace workspace(8);
  int found = 0, false_alarms = 0;
  for (unsigned seed = 0; seed < 100; ++seed) {
    auto c = sample(6, seed);
    if (!estimatePose(c, {}, workspace).rejected.empty()) ++false_alarms;
    const std::size_t bad = seed % 6;
    c[bad].wrench_a.head<3>() += Vector3d(1, -2, 2);
    c[bad].wrench_a.tail<3>() += Vector3d(0.06, 0.06, -0.05);
    const auto& e = estimatePose(c, {}, workspace);
    if (hasPose(e.status) && e.rejected == std::vector<int>{static_cast<int>(bad)}) ++found;
    EXPECT_FALSE(e.unconfirmed);
  }
  // 100 of 100 were found; a false alarm has probability 10⁻³ a run, more than 2 in 100
  // 2·10⁻⁴
  EXPECT_GE(found, 99);
  EXPECT_LE(false_alarms, 2);
  // three contacts: two are left, nothing confirms them
  auto c = sample(3);
  c[1].wrench_a.head<3>() += Vector3d(1, -2, 2);
  const auto& three = estimatePose(c, {}, workspace);
  EXPECT_EQ(three.status, TwinForceStatus::kWeak);
  EXPECT_TRUE(three.unconfirmed);
  EXPECT_EQ(three.rejected.size(), 1u);
  // two: refused, not repaired
  c = sample(2);
  c[1].wrench_a.head<3>() += Vector3d(1, -2, 2);
  const auto& two = estimatePose(c, {}, workspace);
  EXPECT_EQ(two.status, TwinForceStatus::kRefuseInconsistent);
  EXPECT_TRUE(two.rejected.empty());
  EXPECT_LT(two.p, 1e-3);
  // not asked to: refused
  TwinForceOptions keep;
  keep.remove_outliers = false;
  c = sample(6);
  c[1].wrench_a.head<3>() += Vector3d(1, -2, 2);
  EXPECT_EQ(estimatePose(c, keep, workspace).status, TwinForceStatus::kRefuseInconsistent);
}

TEST(Decisions, ReversedSensor) {
  TwinForceWorkspace workspace(8);
  const auto reversed = [](int n) {
    auto c = sample(n);
    for (auto& x : c) x.wrench_b = -x.wrench_b;
    return c;
  };
  for (const int n : {3, 4, 6}) {
    const auto& e = estimatePose(reversed(n), {}, workspace);
    EXPECT_EQ(e.status, TwinForceStatus::kRefuseInconsistent);
    EXPECT_TRUE(e.opposed_signs);
    EXPECT_EQ(checkSigns(reversed(n)), SignVerdict::kReversed);
    EXPECT_EQ(checkSigns(sample(n)), SignVerdict::kRight);
  }
  // also with an outlier besides
  auto c = reversed(5);
  c[1].wrench_a.head<3>() += Vector3d(1, -2, 2);
  EXPECT_TRUE(estimatePose(c, {}, workspace).opposed_signs);
  // two contacts can't tell: half a turn off with a perfect χ²; a prior can
  const auto& two = estimatePose(reversed(2), {}, workspace);
  EXPECT_TRUE(hasPose(two.status));
  EXPECT_NEAR(errorOf(many(2).X_AB, two.pose).tail<3>().norm(), M_PI, 0.05);
  EXPECT_EQ(checkSigns(reversed(2)), SignVerdict::kUndecided);
  TwinForceOptions options;
  options.prior = defaultPrior({rotation({0.3, -0.2, 0.45}), {0.08, -0.06, 0.1}});
  const auto& known = estimatePose(reversed(2), options, workspace);
  EXPECT_EQ(known.status, TwinForceStatus::kRefuseInconsistent);
  EXPECT_TRUE(known.opposed_signs);

  // start-up check from one press along a known direction; nominal orientation off by 0.5 rad
  const Scene s = many(2);
  const TwinContact good = measure(s)[0];
  const Vector3d expected = s.w_b[0].head<3>();
  const Matrix3d nominal = rotation({0.4, 0.2, 0.2}) * s.X_AB.R;
  const auto check = [&](double sign_a, double sign_b, const Vector3d& direction) {
    TwinContact x = good;
    x.wrench_a *= sign_a;
    x.wrench_b *= sign_b;
    return checkSigns(x, nominal, direction);
  };
  EXPECT_EQ(check(1, 1, expected).a, SignVerdict::kRight);
  EXPECT_EQ(check(1, 1, expected).b, SignVerdict::kRight);
  EXPECT_EQ(check(1, 1, expected).pair, SignVerdict::kRight);
  EXPECT_EQ(check(-1, 1, expected).a, SignVerdict::kReversed);
  EXPECT_EQ(check(-1, 1, expected).pair, SignVerdict::kReversed);
  EXPECT_EQ(check(1, -1, expected).b, SignVerdict::kReversed);
  EXPECT_EQ(check(-1, -1, expected).pair, SignVerdict::kRight);
  EXPECT_EQ(check(1, -1, Vector3d::Zero()).b, SignVerdict::kUndecided);
  EXPECT_EQ(check(1, -1, Vector3d::Zero()).pair, SignVerdict::kReversed);
  EXPECT_EQ(check(1e-2, 1, expected).a, SignVerdict::kUndecided);
}

TEST(Decisions, PairInvariantsNeedNoPose) {
  // each of the numbers has unit variance: six of N = 2 make up χ²
  double sum = 0.0;
  constexpr int kRuns = 1000;
  for (unsigned seed = 0; seed < kRuns; ++seed) {
    const auto c = sample(2, seed);
    for (const auto& m : {pairMisfit(c[0], c[0]), pairMisfit(c[1], c[1]), pairMisfit(c[0], c[1])}) {
      sum += m.force * m.force + m.reciprocal * m.reciprocal;
    }
  }
  EXPECT_NEAR(sum / kRuns / 6.0, 1.0, 3 * std::sqrt(2.0 / (6.0 * kRuns)));
  auto c = sample(2);
  c[0].wrench_a[0] += 3;
  EXPECT_GT(std::abs(pairMisfit(c[0], c[0]).force) + std::abs(pairMisfit(c[0], c[1]).force), 10.0);
}

TEST(Decisions, InvariantUnderOriginsAndAxes) {
  TwinForceWorkspace workspace(8);
  const auto c = sample(4);
  const TwinForceEstimate e = estimatePose(c, {}, workspace);
  const Pose X_PA{rotation({0.5, -1, 2}), {0.1, 0.2, -0.1}},
      X_BQ{rotation({-1, 0.3, 0.4}), {0, 0.1, 0.2}};
  // w_P = Φ(X_PA) w_A, w_q = Φ(X_QB) w_b, X_Qq = X_QB X_Bb X_BQ
  auto moved = c;
  const Matrix6 on_p = wrenchTransform(X_PA), on_q = wrenchTransform(inverse(X_BQ));
  for (auto& x : moved) {
    x.wrench_a = on_p * x.wrench_a;
    x.covariance_a = on_p * x.covariance_a * on_p.transpose();
    x.wrench_b = on_q * x.wrench_b;
    x.covariance_b = on_q * x.covariance_b * on_q.transpose();
    x.move = inverse(X_BQ) * x.move * X_BQ;
  }
  const auto& f = estimatePose(moved, {}, workspace);
  const Pose back = inverse(X_PA) * f.pose * inverse(X_BQ);
  // steps end at 1e-12; rounding of covariances through 0.3 m of lever
  EXPECT_LT(errorOf(e.pose, back).cwiseAbs().maxCoeff(), 1e-9);
  EXPECT_NEAR(f.chi2, e.chi2, 1e-6);
}

TEST(Decisions, InvariantUnderUnitsOfForceAndOrder) {
  TwinForceWorkspace workspace(8);
  auto c = sample(4);
  const TwinForceEstimate e = estimatePose(c, {}, workspace);
  // a contact's wrenches and their sd doubled: the same information
  c[1].wrench_a *= 2;
  c[1].wrench_b *= 2;
  c[1].covariance_a *= 4;
  c[1].covariance_b *= 4;
  const TwinForceEstimate f = estimatePose(c, {}, workspace);
  EXPECT_LT(errorOf(e.pose, f.pose).cwiseAbs().maxCoeff(), 1e-11);
  EXPECT_NEAR(f.chi2, e.chi2, 1e-9);
  std::swap(c[0], c[3]);
  EXPECT_LT(errorOf(e.pose, estimatePose(c, {}, workspace).pose).cwiseAbs().maxCoeff(), 1e-11);
}

TEST(Decisions, AllocatesNothing) {
  TwinForceWorkspace workspace(8);
  auto good = sample(6), bad = sample(6), reversed = sample(4), light = sample(2);
  bad[2].wrench_a[0] += 3;
  for (auto& x : reversed) x.wrench_b = -x.wrench_b;
  light[0].wrench_b *= 0.01;
  Scene lines = begin("parallel", Matrix3d::Identity(), {0.08, -0.06, 0.1});
  press(lines, {0, 0.03, 0.02}, {0, 0, -20});
  press(lines, {0, -0.03, 0.02}, {0, 0, -20});
  const auto parallel = measure(lines);
  TwinForceOptions options;
  const auto runs = [&] {
    for (const auto method : {TwinForceMethod::kMaximumLikelihood, TwinForceMethod::kRobust,
                              TwinForceMethod::kThesis}) {
      options.method = method;
      for (const std::vector<TwinContact>* c :
           std::initializer_list<const std::vector<TwinContact>*>{&good, &bad, &reversed, &light,
                                                                  &parallel}) {
        estimatePose(*c, options, workspace);
      }
    }
  };
  const std::uint64_t before = test::allocationsOfThisThread();
  runs();
  options.prior = defaultPrior({});
  options.tare_covariance = Matrix12(1e-4 * Matrix12::Identity());
  runs();
  EXPECT_EQ(test::allocationsOfThisThread(), before);
  // the counter counts; called by name, no compiler may leave it out
  ::operator delete(::operator new(1));
  EXPECT_EQ(test::allocationsOfThisThread(), before + 1);
}

}  // namespace
}  // namespace assembly_cell
