// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
// Contact forces with regularised friction: the direction of each force is known; the normal forces
// are those of springs, or the solution of the linear complementarity problem (LCP) of all active
// contacts. The set of carrying contacts and the branch of friction are frozen within a step, so
// that forces are smooth there and changes are events; an undecided set is found by enumeration.
#include <Eigen/LU>
#include <algorithm>

#include "contact_solver.h"
#include "contact_tolerances.h"

namespace assembly_cell {
namespace {

using Vec3 = Eigen::Vector3d;
using Forces = Eigen::Matrix<double, kSlots, 1>;

// LCP 0 <= A N + b ⟂ N >= 0; subsets of the n points are bits of an unsigned.
struct Complementarity {
  Eigen::Matrix<double, kSlots, kSlots> A;
  Forces b;
  int n = 0;
  double scale = 0.0;  // typical size of b

  double gapAcceleration(int row, const Forces& N) const {
    double w = b(row);
    for (int j = 0; j < n; ++j) w += A(row, j) * N(j);
    return w;
  }
};

// Normal forces with this subset carrying; zero for the others.
Forces solveSubset(const Complementarity& p, unsigned subset) {
  std::array<int, kSlots> index{};
  int m = 0;
  for (int i = 0; i < p.n; ++i) {
    if (subset >> i & 1u) index[m++] = i;
  }
  Forces N = Forces::Zero();
  if (m == 2) {
    const int i = index[0], j = index[1];
    const double d = p.A(i, i) * p.A(j, j) * (1.0 + 2.0 * kShift) - p.A(i, j) * p.A(j, i);
    N(i) = (-p.b(i) * p.A(j, j) + p.A(i, j) * p.b(j)) / d;
    N(j) = (-p.b(j) * p.A(i, i) + p.A(j, i) * p.b(i)) / d;
  } else if (m == 1) {
    N(index[0]) = -p.b(index[0]) / p.A(index[0], index[0]);
  } else if (m > 2) {
    Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, 0, kSlots, kSlots> A(m, m);
    Eigen::Matrix<double, Eigen::Dynamic, 1, 0, kSlots, 1> b(m);
    for (int i = 0; i < m; ++i) {
      b(i) = -p.b(index[i]);
      for (int j = 0; j < m; ++j) A(i, j) = p.A(index[i], index[j]);
      A(i, i) *= 1.0 + kShift;
    }
    const Eigen::Matrix<double, Eigen::Dynamic, 1, 0, kSlots, 1> x = A.partialPivLu().solve(b);
    for (int i = 0; i < m; ++i) N(index[i]) = x(i);
  }
  return N;
}

// Largest violation of the LCP: negative normal force, or acceleration into the block.
double violation(const Complementarity& p, unsigned subset, const Forces& N) {
  double largest = 0.0;
  for (int i = 0; i < p.n; ++i) {
    largest = std::max(largest, -N(i) * p.A(i, i));
    if (!(subset >> i & 1u)) largest = std::max(largest, -p.gapAcceleration(i, N));
  }
  return largest;
}

// Subset with the smallest violation; an exact solution ends the search.
unsigned chooseSubset(const Complementarity& p, Forces& N) {
  double minimum = 1e300;
  unsigned chosen = 0;
  for (unsigned subset = 1u << p.n; subset-- > 0 && minimum > 0.0;) {
    const Forces trial = solveSubset(p, subset);
    double broken = violation(p, subset, trial);
    if (!std::isfinite(broken)) continue;
    if (broken < 1e-13 * p.scale) broken = 0.0;
    if (broken < minimum) {
      minimum = broken;
      N = trial.cwiseMax(0.0);
      chosen = subset;
    }
  }
  return chosen;
}

// Solves for the normal forces N. Returns the carrying subset.
unsigned solve(const Complementarity& p, bool sign_flip, bool choose, unsigned carriers,
               Forces& N) {
  N = Forces::Zero();
  const unsigned subset = sign_flip ? (1u << p.n) - 1 : carriers;
  if (sign_flip || !choose) {
    const Forces trial = solveSubset(p, subset);
    if (std::isfinite(violation(p, subset, trial))) {
      N = sign_flip ? Forces(trial.cwiseAbs()) : trial;
      return subset;
    }
    if (!choose && !sign_flip) return 0;
  }
  return chooseSubset(p, N);
}

}  // namespace

ContactSlotMask regularisedForces(const System& s, const SlotArray& slots, ContactSlotMask carriers,
                                  Evaluation& e) {
  const ContactParameters& law = s.scenario.contact;
  const FrictionParameters& friction = s.scenario.mechanism.friction;
  const bool choose = carriers == kUndecided;
  std::array<std::size_t, kSlots> slot_of{};
  std::array<Vec3, kSlots> direction;
  int n = 0;
  for (const std::size_t i : Slots(e.active())) {
    const Vec3& tangential = e.contacts[i].tangential;
    const double speed = tangential.norm();
    const double mu = slots[i].armed
                          ? friction.sliding_coefficient
                          : friction.static_coefficient * speed / law.regularisation_speed;
    Vec3 d = e.point(i).normal;
    if (speed > 0.0) d -= mu / speed * tangential;
    direction[n] = d;
    slot_of[n++] = i;
  }
  const auto apply = [&](int i, double N) {
    e.contacts[slot_of[i]].normal_force = N;
    e.contacts[slot_of[i]].force = N * direction[i];
  };
  if (law.law == ContactLaw::kSpringDashpot) {
    ContactSlotMask carrying = 0;
    for (int i = 0; i < n; ++i) {
      ContactKinematics& at = e.contacts[slot_of[i]];
      const double N = -law.stiffness * at.gap - law.damping * at.gap_rate;
      if (choose ? N > 0.0 : (carriers >> slot_of[i] & 1u) != 0) {
        carrying |= 1u << slot_of[i];
        apply(i, N);
      } else {
        at.demand = -N / s.scenario.mechanism.peg.mass;
      }
    }
    return carrying;
  }

  const Body body = bodyOf(s, e.k);
  Complementarity p;
  p.n = n;
  unsigned given = 0;
  for (int i = 0; i < n; ++i) {
    const ContactKinematics& at = e.contacts[slot_of[i]];
    const Vec3& normal = e.point(slot_of[i]).normal;
    if (carriers >> slot_of[i] & 1u) given |= 1u << i;
    p.b(i) = normal.dot(at.acceleration) + at.rates.gap_bias + law.rate * at.gap_rate +
             law.pull_back * at.gap;
    p.scale = std::max(p.scale, std::abs(p.b(i)));
    for (int j = 0; j < n; ++j) {
      p.A(i, j) = normal.dot(response(body, at.r, e.contacts[slot_of[j]].r, direction[j]));
    }
  }
  Forces N;
  const unsigned subset = solve(p, s.scenario.thesis.sign_flip, choose, given, N);
  ContactSlotMask carrying = 0;
  for (int i = 0; i < n; ++i) {
    if (subset >> i & 1u) {
      carrying |= 1u << slot_of[i];
      apply(i, N(i));
    } else {
      e.contacts[slot_of[i]].demand = p.gapAcceleration(i, N);
    }
  }
  return carrying;
}

}  // namespace assembly_cell
