// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
// Cost of the twin-force estimators [µs], one core, best of many; beside it a marker: one 6×6
// Cholesky solve, to compare machines and loads.

#include <Eigen/Cholesky>
#include <algorithm>
#include <chrono>
#include <cstdio>
#include <random>

#include "../src/twin_force/closed_forms.h"
#include "../test/twin_force/ground_truth.h"
#include "assembly_cell/twin_force/next_contact.h"
#include "assembly_cell/twin_force/pose_estimate.h"

namespace {

using namespace assembly_cell;

volatile double sink = 0.0;  // keeps results alive

// least of 300 rounds of 50 calls
template <typename Function>
double microseconds(const Function& f) {
  double best = 1e300;
  for (int round = 0; round < 300; ++round) {
    const auto start = std::chrono::steady_clock::now();
    double sum = 0.0;
    for (int i = 0; i < 50; ++i) sum += f();
    sink = sink + sum;
    const std::chrono::duration<double> time = std::chrono::steady_clock::now() - start;
    best = std::min(best, 1e6 * time.count() / 50);
  }
  return best;
}

template <typename Function>
void report(const char* name, double marker, double limit, const Function& f) {
  const double time = microseconds(f);
  std::printf("%-52s %8.3f us %8.1f markers", name, time, time / marker);
  if (limit > 0) std::printf("   limit %g us", limit);
  std::printf("\n");
}

}  // namespace

int main() {
  using namespace twin_truth;
  std::mt19937_64 random(1);
  Scene scene = geometries().front();
  scene.name = "four contacts";
  press(scene, {0.01, -0.04, 0.03}, {4, 14, -14}, {rotation({0.1, 0.2, 0}), {0.01, 0, 0.02}});
  press(scene, {-0.03, 0.02, 0.03}, {-14, 4, -14}, {rotation({0, -0.2, 0.1}), {0, 0.01, 0.02}});
  const std::vector<TwinContact> four = measure(scene, &random);
  const std::vector<TwinContact> two(four.begin(), four.begin() + 2);
  TwinForceWorkspace workspace(16);

  Matrix6 A = scene.covariance_a + Matrix6::Identity();
  Vector6 b = Vector6::Ones();
  const double marker = microseconds([&] {
    A(0, 0) += 1e-9;
    return Eigen::LLT<Matrix6>(A).solve(b).sum();
  });
  std::printf("%-52s %8.3f us\n", "marker: 6x6 Cholesky solve", marker);
  report("thesis form with its covariance, 2 contacts", marker, 0.5, [&] {
    Pose pose;
    Eigen::Matrix<double, 6, 12> slope;
    twin_force::solveThesis(twin_force::bareTerm(two[0]), twin_force::bareTerm(two[1]), pose,
                            slope);
    return pose.p.x() + slope(0, 0);
  });
  std::vector<twin_force::Term> terms;
  const std::vector<int> used = {0, 1, 2, 3};
  for (const TwinContact& contact : four) terms.push_back(twin_force::makeTerm(contact));
  report("robust form without its likelihood step, 4 contacts", marker, 5,
         [&] { return twin_force::solveRobust(terms, used, Pose()).pose.p.x(); });
  const auto whole = [&](const char* name, double limit, const std::vector<TwinContact>& contacts,
                         const TwinForceOptions& options) {
    report(name, marker, limit,
           [&] { return estimatePose(contacts, options, workspace).pose.p.x(); });
  };
  TwinForceOptions options;
  options.method = TwinForceMethod::kThesis;
  whole("estimatePose thesis: checks, covariance, chi2", 0, two, options);
  options.method = TwinForceMethod::kRobust;
  whole("estimatePose robust, 4 contacts, all included", 0, four, options);
  options.method = TwinForceMethod::kMaximumLikelihood;
  whole("estimatePose ML, 4 contacts, all included", 20, four, options);
  whole("estimatePose ML, 2 contacts", 0, two, options);
  options.prior = defaultPrior(scene.X_AB);
  whole("estimatePose ML, 4 contacts, prior", 0, four, options);
  options.prior.reset();
  Matrix12 tare = Matrix12::Zero();
  tare.diagonal().setConstant(1e-4);
  options.tare_covariance = tare;
  whole("estimatePose ML, 4 contacts, tare offset", 0, four, options);
  options.tare_covariance.reset();
  std::vector<TwinContact> bad = four;
  bad[2].wrench_a[0] += 3;
  whole("estimatePose ML, 4 contacts, one an outlier", 0, bad, options);
  return 0;
}
