// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
// Times of the calibration: one sample, its covariance, the solution. Least of many repetitions.
#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <tuple>

#include "assembly_cell/calibration/two_sensor/force.h"
#include "assembly_cell/calibration/two_sensor/plan.h"
#include "assembly_cell/calibration/two_sensor/rig.h"
#include "assembly_cell/sensor/calibration.h"

using namespace assembly_cell;

namespace {

double sink = 0.0;

template <typename Work>
double leastNanoseconds(int inner, int outer, const Work& work) {
  double least = HUGE_VAL;
  for (int i = 0; i < outer; ++i) {
    const auto start = std::chrono::steady_clock::now();
    for (int k = 0; k < inner; ++k) work(k);
    const std::chrono::duration<double, std::nano> time = std::chrono::steady_clock::now() - start;
    least = std::min(least, time.count() / inner);
  }
  return least;
}

void samples(const char* name, const Calibration& c) {
  Vector6 v = Vector6::Constant(1.0);
  const Matrix6 noise = 2.5e-7 * Matrix6::Identity();
  const auto load = [&](int k) -> const Vector6& {
    v[k % 6] = 1e-3 * k;
    return v;
  };
  const double values = leastNanoseconds(1000, 200, [&](int k) {
    sink += wrenchFromVolts(c, load(k))[0] + displacementFromVolts(c, v)[1];
  });
  const double covariance =
      leastNanoseconds(100, 200, [&](int k) { sink += wrenchCovariance(c, load(k), noise)(0, 0); });
  std::printf("%s: wrench and displacement %.0f ns, covariance of the wrench %.0f ns\n", name,
              values, covariance);
}

ObservationSet measured(PlanName name, double nonlinearity) {
  RigSettings settings;
  settings.nonlinearity = nonlinearity;
  CalibrationRig rig(settings);
  ObservationSet set = rig.description();
  for (const LoadRequest& request : makePlan(name, set)) {
    set.observations.push_back(rig.measure(request));
  }
  return set;
}

}  // namespace

int main() {
  for (const auto& [text, name, nonlinearity] :
       {std::tuple{"recommended", PlanName::kRecommended, 0.0},
        std::tuple{"quadratic", PlanName::kQuadratic, 1.0}}) {
    const ObservationSet set = measured(name, nonlinearity);
    const ForceSolution s = solveForce(set);
    Calibration c;
    applyForce(s, set, Side::kA, c);
    c.quadratic_displacement = c.quadratic_wrench;
    c.displacement_products = c.wrench_products;
    samples(text, c);
    ForceSettings bare;
    bare.hold_out = 0.0;
    const int repeats = s.quadratic ? 2 : 30;
    const double with = leastNanoseconds(1, repeats, [&](int) { sink += solveForce(set).chi2; });
    const double without =
        leastNanoseconds(1, repeats, [&](int) { sink += solveForce(set, bare).chi2; });
    std::printf(
        "%s: %d equations solved with covariance and gates in %.2f ms, without hold-out "
        "%.2f ms\n",
        text, s.equations, 1e-6 * with, 1e-6 * without);
  }
  return std::isfinite(sink) ? 0 : 1;
}
