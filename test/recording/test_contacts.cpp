// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/recording/contacts.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>

#include "assembly_cell/base/input_error.h"

namespace assembly_cell {
namespace {

using Eigen::Vector3d;

constexpr double kLever = 0.0594;

// A peg held by a hand: moved free under tilt, pressed on one corner and rocked there, then on two
// faces of a hole; sensor z down the peg, force zeroed at the start, moment never.
struct Hand {
  WrenchRecording recording;
  std::vector<ContactKind> truth;
  std::mt19937 random{11};

  explicit Hand(double rate = 100.0, double seconds = 24.0) {
    std::normal_distribution<double> normal;
    const Vector3d weight(0.0, 0.0, -1.2), centre(0.0, 0.0, 0.02);
    Vector6 zero;
    zero << 0.1, 0.3, 1.2, 0.03, 0.42, 0.02;
    for (int k = 0; k < static_cast<int>(rate * seconds); ++k) {
      const double t = k / rate;
      Pose pose;
      const double tilt = t < 8.0 ? 0.5 * std::cos(0.7 * t) : 0.05;
      pose.R = (Eigen::AngleAxisd(M_PI, Vector3d::UnitX()) *
                Eigen::AngleAxisd(tilt, Vector3d(std::cos(t), std::sin(t), 0.0)))
                   .toRotationMatrix();
      pose.p = {0.5 + 0.05 * std::sin(t), 0.0, t < 8.0 ? 0.3 - 0.02 * t : 0.14};
      Vector6 w = zero;
      const Vector3d load = pose.R.transpose() * weight;
      w.head<3>() += load;
      w.tail<3>() += centre.cross(load);
      ContactKind kind = ContactKind::kFree;
      const auto push = [&](const Vector3d& at, const Vector3d& force) {
        w.head<3>() += force;
        w.tail<3>() += at.cross(force);
      };
      const Vector3d across(8.0 * std::sin(5.0 * t), 6.0 * std::cos(3.0 * t), 0.0);
      if (t >= 9.0 && t < 16.0) {
        kind = ContactKind::kOne;
        push({t < 12.0 ? 0.003 : -0.003, t < 14.0 ? 0.0075 : -0.0075, kLever},
             across + Vector3d(0.0, 0.0, -15.0));
      } else if (t >= 17.0) {
        kind = ContactKind::kSeveral;
        push({0.003, 0.0075, kLever}, Vector3d(0.0, 9.0, -4.0));
        push({-0.003, -0.0075, kLever - 0.03}, Vector3d(7.0, -5.0, 0.0));
      }
      for (int i = 0; i < 6; ++i) w[i] += (i < 3 ? 0.02 : 0.001) * normal(random);
      recording.t.push_back(t);
      recording.wrench.push_back(w);
      recording.pose.push_back(pose);
      truth.push_back(kind);
    }
  }
};

TEST(Contacts, LeverBiasAndPayloadAreFound) {
  const Hand hand;
  const ContactAnalysis a = findContacts(hand.recording, {});
  EXPECT_NEAR(a.lever, kLever, 4.0 * a.lever_sd);
  EXPECT_LT(a.lever_sd, 1e-3);
  EXPECT_NEAR(a.payload.weight, 1.2, 5.0 * a.payload.weight_sd + 1e-3);
  EXPECT_NEAR(a.bias[4], 0.42, 0.003);
  EXPECT_GT(a.footprint, 0.0081);
  EXPECT_LT(a.footprint, 0.014);
}

TEST(Contacts, OneIsDistinguishedFromSeveral) {
  const Hand hand;
  const ContactAnalysis a = findContacts(hand.recording, {});
  std::size_t right = 0;
  for (std::size_t i = 0; i < hand.truth.size(); ++i) right += a.samples[i].kind == hand.truth[i];
  EXPECT_GT(static_cast<double>(right), 0.98 * static_cast<double>(hand.truth.size()));
  ASSERT_EQ(a.segments.size(), 2u);
  EXPECT_EQ(a.segments[0].kind, ContactKind::kOne);
  EXPECT_EQ(a.segments[1].kind, ContactKind::kSeveral);
  EXPECT_LT(a.segments[0].pitch, 3e-4);
  EXPECT_GT(a.segments[1].pitch, 5e-3);
}

TEST(Contacts, PointsHaveTheirCovariance) {
  const Hand hand;
  const ContactAnalysis a = findContacts(hand.recording, {});
  double chi2 = 0.0;
  int count = 0;
  for (std::size_t i = 930; i < 1170; ++i) {  // one corner
    const ContactSample& s = a.samples[i];
    ASSERT_EQ(s.kind, ContactKind::kOne);
    const Eigen::Vector2d e = s.line.cut - Eigen::Vector2d(0.003, 0.0075);
    EXPECT_LT(e.norm(), 1.5e-3);
    chi2 += e.dot(s.line.cut_covariance.inverse() * e);
    ++count;
  }
  EXPECT_GT(chi2 / (2 * count), 0.3);
  EXPECT_LT(chi2 / (2 * count), 6.0);  // bias and lever are common to all
}

// The hand presses the tip on a face and then slides the peg's side down an edge of the hole.
WrenchRecording slid(double pressed, double deepest) {
  WrenchRecording r = Hand(100.0, 20.0).recording;
  std::mt19937 random(5);
  std::normal_distribution<double> normal;
  for (std::size_t i = 900; i < r.t.size(); ++i) {
    const double t = r.t[i];
    const bool face = t < 9.0 + pressed;
    const double depth = face ? 0.0 : std::min(deepest, 0.004 * (t - 9.0 - pressed));
    r.pose[i] = r.pose[900];
    r.pose[i].p.z() -= depth;
    const Vector3d load = r.pose[i].R.transpose() * Vector3d(0.0, 0.0, -1.2);
    const Vector3d across(8.0 * std::sin(5.0 * t), 6.0 * std::cos(3.0 * t), 0.0);
    const Vector3d force = face ? Vector3d(0.2 * across + Vector3d(0.0, 0.0, -15.0))
                                : Vector3d(across + Vector3d(0.0, 0.0, 2.0 * std::sin(7.0 * t)));
    const Vector3d at(0.003, 0.0075, kLever - depth);
    Vector6 w;
    w << 0.1, 0.3, 1.2, 0.03, 0.42, 0.02;
    w.head<3>() += load + force;
    w.tail<3>() += Vector3d(0.0, 0.0, 0.02).cross(load) + at.cross(force);
    for (int k = 0; k < 6; ++k) w[k] += (k < 3 ? 0.02 : 0.001) * normal(random);
    r.wrench[i] = w;
  }
  return r;
}

TEST(Contacts, SidesAlongAnEdgeAreNotTakenForTheTip) {
  for (const double deepest : {0.03, 0.02}) {
    const ContactAnalysis a = findContacts(slid(1.0, deepest), {});
    EXPECT_NEAR(a.lever, kLever, 2e-3) << deepest;
    EXPECT_LT(a.lever_sd, 2.5e-3);
    EXPECT_NEAR(a.lever, kLever, 3.0 * a.lever_sd);
  }
}

// One depth only: the side and the tip of a shorter tool look alike.
TEST(Contacts, AnEdgeAtOneDepthIsRefusedOrCovered) {
  WrenchRecording r = slid(0.6, 0.012);
  // lifted off while it descends
  for (std::size_t i = 960; i < 1300; ++i) r.wrench[i] = r.wrench[i % 700];
  try {
    const ContactAnalysis a = findContacts(r, {});
    EXPECT_NEAR(a.lever, kLever, 3.0 * a.lever_sd);
  } catch (const InputError& error) {
    EXPECT_NE(std::string(error.what()).find("give --lever"), std::string::npos) << error.what();
  }
}

TEST(Contacts, RecordingsWithoutFreePartOrTooSlowAreRefused) {
  const auto refusal = [](const WrenchRecording& recording) {
    try {
      findContacts(recording, {});
    } catch (const InputError& error) {
      return std::string(error.what());
    }
    return std::string();
  };
  Hand pressed;
  WrenchRecording& r = pressed.recording;
  const long from = 1700;
  r.t.erase(r.t.begin(), r.t.begin() + from);
  r.wrench.erase(r.wrench.begin(), r.wrench.begin() + from);
  r.pose.assign(r.t.size(), r.pose.back());
  EXPECT_NE(refusal(r).find("free of contact"), std::string::npos) << refusal(r);
  EXPECT_NE(refusal(Hand(10.0).recording).find("a sample every"), std::string::npos);
  EXPECT_NE(refusal(Hand(100.0, 1.0).recording).find("record for some seconds"), std::string::npos);
}

}  // namespace
}  // namespace assembly_cell
