// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
// Cost of the closed forms [ns each] and of a design map of 500 × 500 points [s], one core.

#include <algorithm>
#include <chrono>
#include <cstdio>

#include "assembly_cell/vibration/bounce.h"
#include "assembly_cell/vibration/inertia.h"
#include "assembly_cell/vibration/locus_model.h"
#include "assembly_cell/vibration/rig.h"
#include "assembly_cell/vibration/single_dof.h"
#include "assembly_cell/vibration/sliding.h"
#include "assembly_cell/vibration/steady_state.h"

namespace {

using namespace assembly_cell;

volatile double sink = 0.0;  // keeps results alive

// best of seven rounds
template <typename Function>
double seconds(int count, const Function& f) {
  double best = 1e300;
  for (int round = 0; round < 7; ++round) {
    const auto start = std::chrono::steady_clock::now();
    double sum = 0.0;
    for (int i = 0; i < count; ++i) sum += f(i);
    sink = sink + sum;
    const std::chrono::duration<double> time = std::chrono::steady_clock::now() - start;
    best = std::min(best, time.count());
  }
  return best;
}

template <typename Function>
void report(const char* name, const Function& f) {
  constexpr int kCount = 200000;
  std::printf("%-28s %7.1f ns\n", name, 1e9 * seconds(kCount, f) / kCount);
}

}  // namespace

int main() {
  const double I = chordInertia(.766, 25, 25, 12.5);
  SingleDof free{I, 1e7, 0, 75000, 1000, -9e4, 60, 0, .01, .2}, damped = free;
  damped.c = 2e3;
  SingleDof heavy = free;
  heavy.c = 1.5e5;
  report("sdof", [&](int i) { return singleDof(free, 5e-5 * i).theta; });
  report("sdof, light damping", [&](int i) { return singleDof(damped, 5e-5 * i).theta; });
  report("sdof, heavy damping", [&](int i) { return singleDof(heavy, 5e-5 * i).theta; });
  report("inertia", [](int i) { return contactInertia(.766, 25, 25 + 1e-5 * i).Iy; });
  report("single contact", [](int i) {
    return singleContact({.766, 25, 25, 1e7, 1500, 60, .3}, 1e-4 * i).theta_x;
  });
  report("double contact", [&](int i) { return doubleContact(1500, 25, 1e7, I, 60, 1e-4 * i); });
  const SlidingCase sliding{1e7, I, 50, 25, 1280, 12.5, .766, 9806.6, .1, .02, 12.5};
  report("sliding ratio, both forms", [&](int i) {
    SlidingCase s = sliding;
    s.w = 1e-3 * i;
    return slidingRatio(s).D;
  });
  const FreeFlight flight{.766, 279.27, 1280, 6e5, 25, 12.5, 25, 6.4, 9806.6};
  report("free flight", [&](int i) { return freeFlight(flight, 1e-6 * i).X; });
  report("locus isotropic", [](int i) {
    return isotropicLocus({.766, 25, 25, 1500, 1e-3 * i, .7}, 1e7, 2e3).a;
  });
  report("locus transverse", [](int i) {
    return transverseLocus({.766, 25, 25, 1500, 1e-3 * i, .7}, 1e7, 1e7, 2e3, 2e3).a;
  });
  SupportMatrix K6 = SupportMatrix::Zero(), C6 = SupportMatrix::Zero();
  K6.diagonal() << 300, 500, 400, 8e6, 9e6, 7e6;
  C6.diagonal() << 3, 5, 4, 8e3, 9e3, 7e3;
  report("locus general (3x3 solve)", [&](int i) {
    return generalLocus({.766, 25, 25, 1500, 1e-3 * i, .7}, 12.5, 50, 9806.6, K6, C6).a;
  });
  report("rig, one slide (iterative)", [](int i) { return rigSlide(.02 + 2e-6 * i, .0233).x; });
  const DesignCase design{.766, 25, 25, 9806.6, 1e7, 1280, 12.5, 12.5, .1, .2, true};
  std::printf("%-28s %7.4f s\n", "design map 500 x 500", seconds(250000, [&](int i) {
                return designPoint(design, .4 * (1 + i / 500), 6.0 * (i % 500)).theta;
              }));
  return 0;
}
