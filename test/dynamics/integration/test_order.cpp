// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
// Error of the position against tolerance and evaluations through impact, stick and slip under the
// rigid law, against the independent simulation in extended precision: falls as the method's
// order. Prints the slopes for the two scenes.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <string>
#include <vector>

#include "../../../benchmark/support/reference_mechanism.h"
#include "assembly_cell/dynamics/simulation.h"
#include "scenarios.h"

namespace assembly_cell {
namespace {

struct Point {
  double tolerance, error, evaluations;
};

// error of the peg's position at three times
std::vector<Point> errors(Scenario s, double end, const std::string& integrator,
                          const std::vector<double>& tolerances,
                          const std::vector<Eigen::Vector3d>& truth) {
  s.solver.integrator = integrator;
  std::vector<Point> points;
  for (const double tolerance : tolerances) {
    s.solver.tolerance = tolerance;
    Simulation sim(s);
    double error = 0.0;
    for (std::size_t i = 0; i < truth.size(); ++i) {
      const double t = end * static_cast<double>(i + 1) / static_cast<double>(truth.size());
      EXPECT_EQ(sim.advance(t), StopReason::kOk) << integrator << " " << tolerance;
      error = std::max(error, (sim.state().q.head<3>() - truth[i]).cwiseAbs().maxCoeff());
    }
    points.push_back({tolerance, error, static_cast<double>(sim.counts().evaluations)});
  }
  return points;
}

// least-squares slope of log(error) over log(evaluations), of errors above rounding
double slope(const std::vector<Point>& points, double floor) {
  double n = 0, x = 0, y = 0, xx = 0, xy = 0;
  for (const Point& p : points) {
    if (p.error < floor) continue;
    const double a = std::log(p.evaluations), b = std::log(p.error);
    n += 1, x += a, y += b, xx += a * a, xy += a * b;
  }
  return n < 3 ? NAN : (n * xy - x * y) / (n * xx - x * x);
}

void check(const char* title, const std::string& file, double end) {
  Scenario s = load(file, {"contact.law=rigid", "solver.max_step=1e-3"});
  reference::Mechanism<long double> mechanism(s, 1e-16L);
  std::vector<Eigen::Vector3d> truth;
  for (int i = 1; i <= 3; ++i) {
    ASSERT_TRUE(mechanism.advance(static_cast<long double>(end) * i / 3));
    const auto& y = mechanism.state();
    truth.emplace_back(static_cast<double>(y[0]), static_cast<double>(y[1]),
                       static_cast<double>(y[2]));
  }
  EXPECT_GT(mechanism.events(), 1);
  const struct {
    const char* integrator;
    double order;
  } methods[] = {{"dopri5", 5.0}, {"dop853", 8.0}};
  std::printf("%s, %ld events: error [m] by tolerance\n", title, mechanism.events());
  for (const auto& m : methods) {
    const std::vector<Point> points =
        errors(s, end, m.integrator, {1e-8, 1e-9, 1e-10, 1e-11, 1e-12, 1e-13}, truth);
    std::printf("  %-8s", m.integrator);
    for (const Point& p : points) std::printf("  %.0e: %.1e", p.tolerance, p.error);
    const double fall = slope(points, 1e-14);
    std::printf("  ~ evaluations^%.1f\n", fall);
    // a method may be steeper: events and the largest step bound what loose tolerances do
    EXPECT_LT(fall, 0.5 - m.order) << title << " " << m.integrator;
    // and no error above the tolerance, down to 1e-12 m (1e-9 mm)
    for (const Point& p : points) {
      EXPECT_LT(p.error, std::max(p.tolerance, 2e-13)) << m.integrator << " " << p.tolerance;
    }
  }
}

TEST(Order, ThroughAnImpact) { check("impact", "impact", 0.05); }

TEST(Order, ThroughStickAndSlip) { check("stick-slip", "chapter8_force_one_3N", 0.03); }

// a run in pieces has the same bits
TEST(Order, PiecesOfAnAdvanceGiveTheSameBits) {
  for (const std::string integrator : {"dopri5", "dop853", "hamming"}) {
    const Scenario s = load("chapter8_force_two_10N", {"solver.integrator=" + integrator});
    Simulation whole(s), pieces(s);
    ASSERT_EQ(whole.advance(0.02), StopReason::kOk);
    int looks = 0;
    while (pieces.time() < 0.02) {
      ASSERT_EQ(pieces.advance(0.02, 7), StopReason::kOk);
      ++looks;
    }
    EXPECT_GT(looks, 10);
    EXPECT_EQ(pieces.state().q, whole.state().q) << integrator;
    EXPECT_EQ(pieces.counts().evaluations, whole.counts().evaluations) << integrator;
  }
}

}  // namespace
}  // namespace assembly_cell
