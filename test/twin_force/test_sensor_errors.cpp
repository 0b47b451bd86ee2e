// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
// Errors of the sensors as unknowns: the stated covariance against the bound of the measurement
// equations by differences, and against drawn sensors; what is still refused; the advice; the file.
#include <gtest/gtest.h>

#include <functional>
#include <string>

#include "assembly_cell/base/input_error.h"
#include "assembly_cell/twin_force/contacts_file.h"
#include "assembly_cell/twin_force/next_contact.h"
#include "ground_truth.h"

namespace assembly_cell {
namespace {

using namespace twin_truth;

constexpr int kErrors = 42;  // of a sensor: 36 entries of E, turn, shift

TwinErrors errors() {
  TwinErrors e;
  e.a = {{rotation({0.3, -0.2, 0.1}), {0.02, -0.01, -0.05}}, 0.01, 0.03, 0.01, 3e-4, {}};
  e.b = {{rotation({-0.1, 0.2, 0.4}), {0.01, 0.03, 0.08}}, 0.02, 0.04, 0.005, 5e-4, {}};
  return e;
}

// the same frames with what a calibration says of the matrices: entries that go together, of a
// worse and of b better than above
TwinErrors calibratedErrors() {
  TwinErrors e = errors();
  std::mt19937_64 random(11);
  std::normal_distribution<double> normal;
  for (auto [sensor, size] : {std::pair(&e.a, 0.02), std::pair(&e.b, 0.003)}) {
    MatrixXd root(36, 36);
    for (double& x : root.reshaped()) x = normal(random) / 6.0;
    for (int i = 0; i < 36; ++i) {
      const double arms = (i / 6 < 3 ? 1.0 : 0.03) / (i % 6 < 3 ? 1.0 : 0.03);
      root.row(i) *= size * arms;
    }
    sensor->gain_covariance = root * root.transpose();
  }
  return e;
}

// five contacts in general position with couples and moves
Scene errorScene() {
  Scene s = begin("general", rotation({0.3, -0.2, 0.5}), {0.08, -0.06, 0.1});
  press(s, {0.03, 0.05, 0.02}, {2, -1, -20}, {rotation({0.1, 0.2, -0.3}), {0.02, -0.01, 0.03}});
  press(s, {-0.02, -0.01, 0.05}, {-15, 3, -12}, {rotation({-0.4, 0.1, 0.2}), {-0.01, 0.02, 0}});
  press(s, {0.01, -0.04, 0.03}, {4, 14, -14});
  press(s, {0.04, 0.02, -0.02}, {-6, -11, 15}, {rotation({0.2, 0.3, 0.1}), {0.01, 0.01, -0.02}});
  press(s, {-0.03, 0.02, 0.01}, {12, -12, -8}, {rotation({0.1, -0.3, 0.2}), {0, -0.02, 0.01}});
  s.w_b[0].tail<3>() += Vector3d(0.5, -1, 0.3);
  return s;
}

// entries of E, row after row
VectorXd entriesOf(const SensorErrors& sd, const VectorXd& e) {
  if (sd.gain_covariance.size() > 0) {
    return MatrixXd(sd.gain_covariance.llt().matrixL()) * e.head(36);
  }
  VectorXd out(36);
  for (int i = 0; i < 6; ++i) {
    for (int k = 0; k < 6; ++k) {
      const double arms = (i < 3 ? 1.0 : sd.arm) / (k < 3 ? 1.0 : sd.arm);
      out[6 * i + k] = sd.gain * e[6 * i + k] * arms;
    }
  }
  return out;
}

// Output of a sensor with such errors for a wrench in the datum's axes: w' = (I + E) w in a
// displaced frame; e in standard deviations.
Vector6 sensorOutput(const SensorErrors& sd, const VectorXd& e, const Vector6& w) {
  const Matrix3d dR = rotation(sd.rotation * e.segment<3>(36));
  const Vector3d shift = sd.offset * e.segment<3>(39);
  Vector6 local = seenFrom(inverse(sd.frame), w);
  const Vector3d F = local.head<3>(), M = local.tail<3>();
  local << dR.transpose() * F, dR.transpose() * (M - shift.cross(F));
  Vector6 out = local;
  const VectorXd E = entriesOf(sd, e);
  for (int i = 0; i < 6; ++i) {
    for (int k = 0; k < 6; ++k) out[i] += E[6 * i + k] * local[k];
  }
  return seenFrom(sd.frame, out);
}

// of δ: all wrenches and errors unknown, central differences of the stacked measurements
Matrix6 boundWithErrors(const Scene& s, const TwinErrors& sd) {
  const auto n = static_cast<Eigen::Index>(s.size());
  const Eigen::Index first = 6 + 2 * kErrors, unknowns = first + 6 * n, rows = 12 * n + 2 * kErrors;
  const auto predict = [&](const VectorXd& x) {
    VectorXd y(rows);
    const Pose X{rotation(x.segment<3>(3)) * s.X_AB.R, s.X_AB.p + x.head<3>()};
    for (Eigen::Index i = 0; i < n; ++i) {
      const auto k = static_cast<std::size_t>(i);
      const Vector6 w_b = s.w_b[k] + x.segment<6>(first + 6 * i);
      y.segment<6>(12 * i) =
          sensorOutput(sd.a, x.segment(6, kErrors), -seenFrom(X, seenFrom(s.moves[k], w_b)));
      y.segment<6>(12 * i + 6) = sensorOutput(sd.b, x.segment(6 + kErrors, kErrors), w_b);
    }
    y.tail(2 * kErrors) = x.segment(6, 2 * kErrors);
    return y;
  };
  MatrixXd J(rows, unknowns);
  constexpr double kStep = 1e-5;
  for (Eigen::Index j = 0; j < unknowns; ++j) {
    const VectorXd d = kStep * VectorXd::Unit(unknowns, j);
    J.col(j) = (predict(d) - predict(-d)) / (2 * kStep);
  }
  for (Eigen::Index i = 0; i < n; ++i) {
    J.middleRows<6>(12 * i) = s.covariance_a.llt().matrixL().solve(J.middleRows<6>(12 * i)).eval();
    J.middleRows<6>(12 * i + 6) =
        s.covariance_b.llt().matrixL().solve(J.middleRows<6>(12 * i + 6)).eval();
  }
  const MatrixXd information = J.transpose() * J;
  return information.llt().solve(MatrixXd::Identity(unknowns, 6)).topRows<6>();
}

VectorXd drawn(std::mt19937_64& random) {
  std::normal_distribution<double> normal;
  VectorXd e(kErrors);
  for (double& x : e) x = normal(random);
  return e;
}

std::vector<TwinContact> measureWith(const Scene& s, const TwinErrors& sd,
                                     std::mt19937_64& random) {
  const VectorXd e_a = drawn(random), e_b = drawn(random);
  std::vector<TwinContact> contacts = measure(s);
  for (TwinContact& c : contacts) {
    c.wrench_a = sensorOutput(sd.a, e_a, c.wrench_a) + gaussian(s.covariance_a, random);
    c.wrench_b = sensorOutput(sd.b, e_b, c.wrench_b) + gaussian(s.covariance_b, random);
  }
  return contacts;
}

}  // namespace

class DrawnSensors : public ::testing::TestWithParam<TwinErrors (*)()> {};
INSTANTIATE_TEST_SUITE_P(AsDrawnAndAsCalibrated, DrawnSensors,
                         ::testing::Values(&errors, &calibratedErrors));

TEST_P(DrawnSensors, CovarianceIsTheBoundOfTheMeasurementEquations) {
  const Scene s = errorScene();
  TwinForceWorkspace workspace(8);
  TwinForceOptions options;
  options.errors = GetParam()();
  const auto& e = estimatePose(measure(s), options, workspace);
  ASSERT_TRUE(hasPose(e.status)) << e.reason;
  EXPECT_LT(errorOf(s.X_AB, e.pose).cwiseAbs().maxCoeff(), 1e-12);
  const Matrix6 P = boundWithErrors(s, *options.errors);
  for (int i = 0; i < 6; ++i) {
    for (int j = 0; j < 6; ++j) {
      EXPECT_NEAR(e.covariance(i, j), P(i, j), 1e-5 * std::sqrt(P(i, i) * P(j, j))) << i << j;
    }
  }
  // and the errors matter: without them it would be so many times better
  const Matrix6 alone = bound(s);
  EXPECT_GT(P(0, 0), 4.0 * alone(0, 0));
}

TEST_P(DrawnSensors, StatedAndTrueAgreeOverDrawnSensors) {
  const Scene s = errorScene();
  TwinForceWorkspace workspace(8);
  TwinForceOptions options;
  options.errors = GetParam()();
  std::mt19937_64 random(7);
  constexpr int kRuns = 1000;
  double nees = 0.0, chi2 = 0.0;
  int refused = 0, refused_without = 0, dof = 0;
  for (int i = 0; i < kRuns; ++i) {
    const auto contacts = measureWith(s, *options.errors, random);
    const auto& e = estimatePose(contacts, options, workspace);
    chi2 += e.chi2;
    dof = e.dof;
    if (!hasPose(e.status) || !e.rejected.empty()) ++refused;
    nees += normalisedDistance(e, s.X_AB);
    if (i >= 100) continue;
    const auto& bare = estimatePose(contacts, TwinForceOptions(), workspace);
    if (!hasPose(bare.status)) ++refused_without;
  }
  // three standard errors, and what is of second order: errors of 1 to 2 % of a wrench
  EXPECT_EQ(dof, 24);
  EXPECT_NEAR(nees / kRuns, 6.0, 3.0 * std::sqrt(12.0 / kRuns) + 0.2);
  EXPECT_NEAR(chi2 / kRuns, dof, 3.0 * std::sqrt(2.0 * dof / kRuns) + 0.5);
  // one in a thousand by the limit of p; the same sensors taken for as good as their noise
  EXPECT_LE(refused, 6);
  EXPECT_GT(refused_without, 95);
}

// independent entries of one size are what gain says
TEST(ErrorsOfSensors, GainIsACovarianceOfItsOwn) {
  const Scene s = errorScene();
  TwinForceWorkspace workspace(8);
  std::mt19937_64 random(13);
  TwinForceOptions options;
  options.errors = errors();
  const auto contacts = measureWith(s, *options.errors, random);
  const TwinForceEstimate plain = estimatePose(contacts, options, workspace);
  for (SensorErrors* sensor : {&options.errors->a, &options.errors->b}) {
    VectorXd sd(36);
    for (int i = 0; i < 36; ++i) sd[i] = entriesOf(*sensor, VectorXd::Unit(kErrors, i))[i];
    sensor->gain_covariance = sd.cwiseAbs2().asDiagonal();
    sensor->gain = 1.0;  // doesn't count
  }
  const auto& e = estimatePose(contacts, options, workspace);
  ASSERT_TRUE(hasPose(e.status));
  EXPECT_LT((e.pose.p - plain.pose.p).norm(), 1e-9);
  EXPECT_LT((e.covariance - plain.covariance).norm(), 1e-8 * plain.covariance.norm());
  EXPECT_NEAR(e.chi2, plain.chi2, 1e-8 * plain.chi2);
}

TEST(ErrorsOfSensors, NoneIsWhatNoErrorsAre) {
  const Scene s = errorScene();
  TwinForceWorkspace workspace(8);
  std::mt19937_64 random(3);
  const auto contacts = measure(s, &random);
  TwinForceOptions options;
  Matrix12 tare = Matrix12::Zero();
  tare.diagonal().setConstant(1e-4);
  for (const bool tared : {false, true}) {
    options.errors.reset();
    if (tared) options.tare_covariance = tare;
    const TwinForceEstimate bare = estimatePose(contacts, options, workspace);
    options.errors = TwinErrors();
    const auto& e = estimatePose(contacts, options, workspace);
    EXPECT_LT((e.pose.p - bare.pose.p).norm(), 1e-12);
    EXPECT_LT((e.covariance - bare.covariance).norm(), 1e-9 * bare.covariance.norm());
    EXPECT_NEAR(e.chi2, bare.chi2, 1e-9 * bare.chi2);
    EXPECT_EQ(e.status, bare.status);
    EXPECT_LT((e.tare - bare.tare).norm(), 1e-9);
  }
}

TEST(ErrorsOfSensors, EvidenceIsStillRefused) {
  const Scene s = errorScene();
  TwinForceWorkspace workspace(8);
  TwinForceOptions options;
  options.errors = errors();
  options.remove_outliers = false;
  std::mt19937_64 random(5);
  auto contacts = measureWith(s, *options.errors, random);
  ASSERT_TRUE(hasPose(estimatePose(contacts, options, workspace).status));
  // a second contact measured by one sensor only: ten times the error of a matrix
  contacts[2].wrench_a.head<3>() += Vector3d(2.0, -1.0, 1.0);
  EXPECT_EQ(estimatePose(contacts, options, workspace).status,
            TwinForceStatus::kRefuseInconsistent);
  options.remove_outliers = true;
  const auto& removed = estimatePose(contacts, options, workspace);
  ASSERT_TRUE(hasPose(removed.status));
  EXPECT_EQ(removed.rejected, std::vector<int>{2});
  contacts = measureWith(s, *options.errors, random);
  for (TwinContact& c : contacts) c.wrench_b *= -1.0;
  const auto& reversed = estimatePose(contacts, options, workspace);
  EXPECT_EQ(reversed.status, TwinForceStatus::kRefuseInconsistent);
  EXPECT_TRUE(reversed.opposed_signs);
}

// what a contact is said to bring is what it brings: errors are the same in all
TEST_P(DrawnSensors, AdvicePredictsTheCovariance) {
  const Scene s = errorScene();
  TwinForceWorkspace workspace(8);
  TwinForceOptions options;
  options.errors = GetParam()();
  options.tare_covariance = Matrix12(1e-4 * Matrix12::Identity());
  auto contacts = measure(s);
  const TwinContact last = contacts.back();
  contacts.pop_back();
  ContactCandidate c;
  c.move = last.move;
  c.force = last.wrench_b.head<3>();
  c.point = c.force.cross(Vector3d(last.wrench_b.tail<3>())) / c.force.squaredNorm();
  c.covariance_a = last.covariance_a;
  c.covariance_b = last.covariance_b;
  const TwinForceEstimate before = estimatePose(contacts, options, workspace);
  const ContactAdvice advice = adviseNextContact(before, {c}, options);
  contacts.push_back(last);
  const auto& after = estimatePose(contacts, options, workspace);
  for (int i = 0; i < 6; ++i) {
    EXPECT_NEAR(advice.covariance(i, i), after.covariance(i, i), 1e-6 * after.covariance(i, i));
  }
  EXPECT_GT(advice.smallest_eigenvalue, before.eigenvalues[0]);
}

TEST(ErrorsOfSensors, AreWrittenAndRead) {
  ContactsFile file;
  file.contacts = measure(errorScene());
  const std::string without = contactsYaml(file);
  EXPECT_EQ(without.find("errors"), std::string::npos);
  EXPECT_FALSE(parseContacts(without, "test").errors);
  file.errors = errors();
  const std::string yaml = contactsYaml(file);
  const ContactsFile again = parseContacts(yaml, "test");
  ASSERT_TRUE(again.errors);
  EXPECT_EQ(again.errors->a.gain, file.errors->a.gain);
  EXPECT_EQ(again.errors->b.offset, file.errors->b.offset);
  EXPECT_EQ(again.errors->b.frame.p, file.errors->b.frame.p);
  EXPECT_LT((again.errors->b.frame.R - file.errors->b.frame.R).norm(), 1e-15);
  EXPECT_EQ(again.errors->a.gain_covariance.size(), 0);
  file.errors->b = calibratedErrors().b;
  const ContactsFile calibrated = parseContacts(contactsYaml(file), "test");
  EXPECT_EQ(calibrated.errors->a.gain_covariance.size(), 0);
  EXPECT_EQ(calibrated.errors->b.gain_covariance, file.errors->b.gain_covariance);

  const auto refusal = [&](const std::function<void(TwinErrors&)>& change) {
    TwinForceWorkspace workspace(8);
    TwinForceOptions options;
    options.errors = errors();
    change(*options.errors);
    try {
      estimatePose(file.contacts, options, workspace);
    } catch (const InputError& error) {
      return std::string(error.what());
    }
    return std::string();
  };
  EXPECT_EQ(refusal([](TwinErrors&) {}), "");
  EXPECT_EQ(refusal([](TwinErrors& e) { e.a.gain = -0.01; }),
            "errors.sensor_a.gain: value -0.01: give a finite number >= 0");
  EXPECT_EQ(refusal([](TwinErrors& e) { e.b.arm = 0.0; }),
            "errors.sensor_b.arm: value 0.0: give a finite number > 0");
  EXPECT_EQ(refusal([](TwinErrors& e) { e.a.gain_covariance.setZero(6, 36); }),
            "errors.sensor_a.gain_covariance: value 6 by 36: give 36 by 36");
  EXPECT_EQ(refusal([](TwinErrors& e) { e.a.gain_covariance = -MatrixXd::Identity(36, 36); }),
            "errors.sensor_a.gain_covariance: value indefinite: give a finite, symmetric, positive "
            "semidefinite covariance");
  EXPECT_EQ(refusal([](TwinErrors& e) { e.b.frame.R(0, 1) = 0.1; }),
            "errors.sensor_b: value not a pose: give a finite position and a unit quaternion");
}

}  // namespace assembly_cell
