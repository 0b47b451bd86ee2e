// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include <Eigen/LU>
#include <algorithm>
#include <cmath>

#include "contact/contact_solver.h"
#include "contact/contact_tolerances.h"
#include "impact.h"

namespace assembly_cell {
namespace {

using Vec3 = Eigen::Vector3d;
constexpr int kPasses = 24;
// Post-impact slip below which the direction is undefined. Half: no result changes; twice: one of
// 400 random scenes.
constexpr double kSlipTolerance = 1e-12;  // [m/s]
constexpr int kTurns = 40, kStarts = 24;  // limits of the iteration for friction directions
// Step of difference quotients (root of the rounding); target accuracy; accepted accuracy. Half and
// twice: 18 and 14, 13 and 12, none of 400 random scenes end elsewhere, by rounding in many
// impacts.
constexpr double kTurn = 1e-7, kDirection = 1e-13, kAccepted = 1e-9;  // [rad]
// Newton iteration of a single direction: maximum step, and the step that ends it (quadratic
// convergence).
constexpr double kLongest = 0.5, kLastStep = 1e-9;  // [rad]

// Plastic impact with Coulomb friction: all points stick at first; the one with the largest
// violation changes until none is left.
class PlasticImpact {
 public:
  PlasticImpact(const System& s, ContactSlotMask points, Evaluation& e)
      : e_(e),
        s_(s),
        body_(bodyOf(s, e.k)),
        points_(points & e.valid()),
        mu_(s.scenario.mechanism.friction.sliding_coefficient) {
    kind_.fill(Kind::kNone);
    for (const std::size_t i : Slots(points_)) kind_[i] = Kind::kStick;
    friction_.fill(Vec3::Zero());
    impulse_.fill(Vec3::Zero());
  }

  void solve() {
    for (int pass = 0; pass < kPasses; ++pass) {
      slips_ = acting_ = 0;
      for (const std::size_t i : Slots(points_)) {
        if (kind_[i] != Kind::kNone) ++acting_;
        if (kind_[i] == Kind::kSlip) slipping_[slips_++] = i;
      }
      if (!findImpulses()) break;
      if (slips_ > 0 && mu_ > 0.0) solveDirections();
      if (!release() && !(pass < kPasses / 2 && rejoin())) break;
    }
  }

  ForceMoment total() const {
    ForceMoment sum;
    for (const std::size_t i : Slots(points_)) {
      if (kind_[i] != Kind::kNone) sum.add(e_.contacts[i].r, impulse_[i]);
    }
    return sum;
  }
  const Vec3& impulse(std::size_t i) const { return impulse_[i]; }

 private:
  enum class Kind { kNone, kStick, kSlip };
  using Angles = Eigen::Matrix<double, Eigen::Dynamic, 1, 0, kSlots, 1>;
  using Slopes = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, 0, kSlots, kSlots>;

  // impulses for the present modes and friction directions; false if no point is left
  bool findImpulses() {
    Constraints rows;
    ContactSlotMask sticking = 0;
    for (const std::size_t i : Slots(points_)) {
      impulse_[i].setZero();
      if (kind_[i] == Kind::kNone) continue;
      Constraint& row = rows.add(i, e_.contacts[i].r, e_.point(i).normal);
      row.stick = kind_[i] == Kind::kStick;
      if (row.stick) sticking |= 1u << i;
      row.direction = row.normal + mu_ * friction_[i];
      row.change = -e_.contacts[i].velocity;
    }
    if (rows.n == 0) return false;
    solveConstraints(body_, rows);
    for (const Constraint& row : rows) {
      impulse_[row.slot] = e_.contacts[row.slot].force = row.force;
      e_.contacts[row.slot].normal_force = row.normal.dot(row.force);
    }
    if (__builtin_popcount(sticking) == 2) {
      shareInternalForces(s_, sticking, kLoads, e_);
      for (const std::size_t i : Slots(sticking)) impulse_[i] = e_.contacts[i].force;
    }
    return true;
  }

  Vec3 velocityAfter(std::size_t i) const {
    Vec3 v = e_.contacts[i].velocity;
    for (const std::size_t j : Slots(points_)) {
      if (kind_[j] == Kind::kNone) continue;
      v += response(body_, e_.contacts[i].r, e_.contacts[j].r, impulse_[j]);
    }
    return v;
  }

  void turn(std::size_t i, double angle) {
    const Vec3& f = friction_[i];
    friction_[i] =
        (std::cos(angle) * f + std::sin(angle) * e_.point(i).normal.cross(f)).normalized();
  }

  // Angles in the contact planes between friction and the direction opposite to post-impact slip.
  Angles errors() {
    findImpulses();
    Angles angles(slips_);
    for (std::size_t j = 0; j < slips_; ++j) {
      const Vec3& normal = e_.point(slipping_[j]).normal;
      Vec3 slip = velocityAfter(slipping_[j]);
      slip -= normal * normal.dot(slip);
      const Vec3& f = friction_[slipping_[j]];
      angles(j) =
          slip.norm() > kSlipTolerance ? std::atan2(-normal.dot(f.cross(slip)), -f.dot(slip)) : 0.0;
    }
    return angles;
  }

  // Jacobian of the errors e by difference quotients; the directions are restored
  Slopes slopes(const Angles& e) {
    Slopes slope(e.size(), e.size());
    const auto from = friction_;
    for (std::size_t j = 0; j < slips_; ++j) {
      turn(slipping_[j], kTurn);
      slope.col(j) = (errors() - e) / kTurn;
      friction_ = from;
    }
    return slope;
  }

  // Broyden's method from the present directions, restarted where it fails; returns the error
  double converge() {
    Angles e = errors();
    Slopes slope;
    bool measured = false;
    for (int step = 0; step < kTurns && e.cwiseAbs().maxCoeff() > kDirection; ++step) {
      const bool restart = !measured;
      if (restart) slope = slopes(e);
      const auto from = friction_;
      const Angles full = -slope.partialPivLu().solve(e);
      // line search
      bool better = false;
      double part = std::min(1.0, 1.0 / full.cwiseAbs().maxCoeff());
      for (; part > 1e-3 && !better; part /= 2) {
        const Angles by = part * full;
        for (std::size_t j = 0; j < slips_; ++j) turn(slipping_[j], by(j));
        const Angles next = errors();
        better = next.norm() < e.norm();
        if (better) {
          slope += (next - e - slope * by) * by.transpose() / by.squaredNorm();
          e = next;
        } else {
          friction_ = from;
          if (!restart) break;
        }
      }
      if (!better && restart) break;
      measured = better;
    }
    return e.cwiseAbs().maxCoeff();
  }

  // Newton's method for a single slipping point: zero of the component of post-impact slip across
  // the direction, in closed form.
  void solveSingle(std::size_t i) {
    const Vec3 &n = e_.point(i).normal, &r = e_.contacts[i].r, &v = e_.contacts[i].velocity;
    const Vec3 first = friction_[i], second = n.cross(first);
    const Vec3 by_n = response(body_, r, r, n), by_1 = response(body_, r, r, first),
               by_2 = response(body_, r, r, second);
    const auto along = [&](const Vec3& u) { return Eigen::Vector2d(first.dot(u), second.dot(u)); };
    const Eigen::Vector2d slip = along(v), from_n = along(by_n);
    const Eigen::Vector2d to_n(n.dot(by_1), n.dot(by_2));
    const double own = n.dot(by_n), stop = -n.dot(v);
    Eigen::Matrix2d across;
    across << along(by_1), along(by_2);
    Eigen::Vector2d f(1.0, 0.0);
    for (int step = 0; step < kTurns; ++step) {
      const Eigen::Vector2d g(-f(1), f(0));  // df/dangle
      // post-impact slip times the denominator of the normal impulse, and its derivative
      const Eigen::Vector2d after =
          (own + mu_ * to_n.dot(f)) * slip + stop * (from_n + mu_ * across * f);
      const Eigen::Vector2d change = mu_ * (to_n.dot(g) * slip + stop * across * g);
      const double slope = g.dot(change) - f.dot(after);
      const double by = std::clamp(-g.dot(after) / slope, -kLongest, kLongest);
      if (!std::isfinite(by)) return;
      f = (f + by * g).normalized();
      if (std::abs(by) < kLastStep) {
        const bool opposed = f.dot(after) < 0.0 && own + mu_ * to_n.dot(f) > 0.0;
        if (opposed) friction_[i] = f(0) * first + f(1) * second;
        return;
      }
    }
  }

  // starts: present directions, slip before the impact, for one point equally spaced directions
  void solveDirections() {
    const auto start = friction_;
    if (acting_ == 1) solveSingle(slipping_[0]);
    double minimum = converge();
    auto best = friction_;
    const auto attempt = [&] {
      const double error = converge();
      if (error < minimum) {
        minimum = error;
        best = friction_;
      }
    };
    if (minimum > kAccepted) {
      for (std::size_t j = 0; j < slips_; ++j) {
        const Vec3& before = e_.contacts[slipping_[j]].tangential;
        if (before.norm() > kSlipTolerance) friction_[slipping_[j]] = -before.normalized();
      }
      attempt();
    }
    for (int k = 1; minimum > kAccepted && slips_ == 1 && k < kStarts; ++k) {
      friction_ = start;
      turn(slipping_[0], k * 2.0 * M_PI / kStarts);
      attempt();
    }
    friction_ = best;
    findImpulses();
  }

  // changes the point with the largest violation, pull or else cone excess; false if there is none
  bool release() {
    double total = 0.0;
    for (const std::size_t i : Slots(points_)) total += impulse_[i].norm();
    double excess = 1e-12 * total;
    std::size_t worst = kSlots;
    for (const std::size_t i : Slots(points_)) {
      if (kind_[i] == Kind::kNone) continue;
      const double N = e_.point(i).normal.dot(impulse_[i]);
      if (N < -excess) {
        excess = -N;
        worst = i;
      }
    }
    if (worst < kSlots) {
      // stopping the slip may require a pull: the point slips instead
      const Vec3& slip = e_.contacts[worst].tangential;
      const bool goes_on =
          kind_[worst] == Kind::kStick && slip.norm() > kSlipTolerance && mu_ > 0.0;
      kind_[worst] = goes_on ? Kind::kSlip : Kind::kNone;
      if (goes_on) friction_[worst] = -slip.normalized();
      return true;
    }
    for (const std::size_t i : Slots(points_)) {
      if (kind_[i] != Kind::kStick) continue;
      const double N = e_.point(i).normal.dot(impulse_[i]);
      const Vec3 tangential = impulse_[i] - N * e_.point(i).normal;
      const double size = tangential.norm();
      if (size - mu_ * N > std::max(excess, 1e-12 * size)) {
        excess = size - mu_ * N;
        worst = i;
        friction_[i] = tangential / size;
      }
    }
    if (worst < kSlots) kind_[worst] = Kind::kSlip;
    return worst < kSlots;
  }

  // adds excluded points that approach; false if there is none
  bool rejoin() {
    bool rejoined = false;
    for (const std::size_t i : Slots(points_)) {
      if (kind_[i] != Kind::kNone) continue;
      if (!(e_.point(i).normal.dot(velocityAfter(i)) < -1e-12)) continue;
      kind_[i] = Kind::kStick;
      rejoined = true;
    }
    return rejoined;
  }

  Evaluation& e_;
  const System& s_;
  const Body body_;
  const ContactSlotMask points_;
  const double mu_;
  std::array<Kind, kSlots> kind_;
  std::array<Vec3, kSlots> friction_, impulse_;
  std::array<std::size_t, kSlots> slipping_{};
  std::size_t slips_ = 0, acting_ = 0;  // slipping points, points with an impulse
};

}  // namespace

void plasticImpact(const System& s, ContactSlotMask points, Context& c, Evaluation& e) {
  PlasticImpact p(s, points, e);
  p.solve();
  applyImpulse(s, p.total(), c, e);
  for (std::size_t i = 0; i < kSlots; ++i) e.contacts[i].force = p.impulse(i);
}

}  // namespace assembly_cell
