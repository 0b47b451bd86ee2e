// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "energetic_impact.h"

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <algorithm>
#include <array>
#include <cmath>

#include "tableaus.h"

namespace assembly_cell {
namespace {

using Vec3 = Eigen::Vector3d;
using Flow = Eigen::Matrix<double, 6, 1>;

constexpr double kPrecision = 1e-14;  // of a step, relative
constexpr double kStopped = -40.0;    // logarithm of a slip that has ended, relative
constexpr int kSteps = 4000;          // of the flow at most
constexpr int kRays = 72;             // where the direction of new slip is looked for
constexpr double kTurn = 6.283185307179586;

// The impact as a function of the normal impulse p. Slip of speed s along phi changes by
// W (n − mu slip direction); with dp = s dtau the flow is smooth up to the end of slip, tau -> inf.
class Impact {
 public:
  Impact(const Eigen::Matrix3d& W, const Vec3& n, const Vec3& v, double mu, double mu_hold,
         double e)
      : W_(W), n_(n), one_(n.unitOrthogonal()), two_(n.cross(one_)), mu_(mu), e_(e) {
    approach_ = n.dot(v);
    const Vec3 slip = v - approach_ * n;
    Eigen::Matrix2d Wt;
    Wt << one_.dot(W * one_), one_.dot(W * two_), two_.dot(W * one_), two_.dot(W * two_);
    const Eigen::Vector2d hold = -Wt.inverse() * Eigen::Vector2d(one_.dot(W * n), two_.dot(W * n));
    holds_ = hold.norm() <= mu_hold;
    stick_ = n + hold(0) * one_ + hold(1) * two_;
    if (mu == 0.0) {
      straight(n);
    } else if (slip.norm() == 0.0 ||
               slideOut(slip.norm(), std::atan2(slip.dot(two_), slip.dot(one_)))) {
      straight(afterSlip());
    }
  }
  const Vec3& impulse() const { return impulse_; }

 private:
  Vec3 along(double phi) const { return std::cos(phi) * one_ + std::sin(phi) * two_; }
  Vec3 across(double phi) const { return std::cos(phi) * two_ - std::sin(phi) * one_; }
  Vec3 ray(double phi) const { return n_ - mu_ * along(phi); }

  // the rest of the impact along one direction of impulse, in closed form
  void straight(const Vec3& direction) {
    const double gain = n_.dot(W_ * direction);
    if (!(gain > 0.0)) return;
    if (!back_) {
      const double p = -approach_ / gain;
      impulse_ += p * direction;
      owed_ = e_ * e_ * (taken_ - 0.5 * approach_ * p);
      approach_ = 0.0;
    }
    impulse_ +=
        (std::sqrt(approach_ * approach_ + 2.0 * gain * owed_) - approach_) / gain * direction;
  }

  // rest where friction can hold, else the one direction in which slip grows straight
  Vec3 afterSlip() const {
    if (holds_) return stick_;
    const auto swerve = [&](double phi) { return across(phi).dot(W_ * ray(phi)); };
    for (int i = 0; i < kRays; ++i) {
      double low = kTurn * i / kRays, high = kTurn * (i + 1) / kRays;
      const bool rises = swerve(low) < 0.0;
      if ((swerve(high) < 0.0) == rises || along(low).dot(W_ * ray(low)) < 0.0) continue;
      for (int k = 0; k < 60; ++k) {
        const double middle = 0.5 * (low + high);
        ((swerve(middle) < 0.0) == rises ? low : high) = middle;
      }
      return ray(low);
    }
    return stick_;
  }

  // over tau: ln s, phi, the three parts of the impulse, and the work of the normal force
  Flow rate(const Flow& y) const {
    const double s = std::exp(y(0));
    const Vec3 d = ray(y(1)), gain = W_ * d;
    Flow dy;
    dy << along(y(1)).dot(gain), across(y(1)).dot(gain), s * d, s * approachAt(y);
    return dy;
  }
  double approachAt(const Flow& y) const { return approach_ + n_.dot(W_ * Vec3(y.segment<3>(2))); }

  // one step of Dormand and Prince; the error over what is allowed
  double step(const Flow& y, double h, Flow& end) const {
    std::array<Flow, 7> k;
    for (int i = 0; i < 7; ++i) {
      Flow at = y;
      for (int j = 0; j < i; ++j) at += h * Dopri5::a[i][j] * k[static_cast<std::size_t>(j)];
      k[static_cast<std::size_t>(i)] = rate(at);
      if (i == 6) end = at;
    }
    Flow error = Flow::Zero();
    for (int i = 0; i < 7; ++i) error += h * Dopri5::e[i] * k[static_cast<std::size_t>(i)];
    const double impulse = std::max(std::abs(approach_), std::exp(y(0))) / W_.trace();
    error.segment<3>(2) /= impulse;
    error(5) /= impulse * impulse * W_.trace();
    return error.cwiseAbs().maxCoeff() / kPrecision;
  }

  // Follows the slip to its end; false when the impact is over before.
  bool slideOut(double speed, double phi) {
    Flow y = Flow::Zero(), end;
    y(0) = std::log(speed);
    y(1) = phi;
    const double stopped = y(0) + kStopped, start = approach_;
    double h = 0.1 / (W_.trace() * (1.0 + mu_));
    // below zero while the phase lasts
    const auto over = [&](const Flow& at) { return back_ ? at(5) - owed_ : approachAt(at); };
    for (int i = 0; i < kSteps && y(0) > stopped; ++i) {
      const double error = step(y, h, end);
      if (!(error <= 1.0)) {
        h *= std::max(0.1, 0.9 * std::pow(error, -0.2));
        if (!std::isfinite(h)) break;
        continue;
      }
      if (over(end) < 0.0) {
        y = end;
        h *= std::min(4.0, 0.9 * std::pow(std::max(error, 1e-5), -0.2));
        continue;
      }
      double low = 0.0, high = h;
      for (int k = 0; k < 60 && high - low > 1e-16 * h; ++k) {
        const double middle = 0.5 * (low + high);
        step(y, middle, end);
        (over(end) < 0.0 ? low : high) = middle;
      }
      step(y, high, end);
      y = end;
      if (back_) {
        impulse_ = y.segment<3>(2);
        return false;
      }
      back_ = true;
      owed_ = -e_ * e_ * y(5);
      y(5) = 0.0;
    }
    impulse_ = y.segment<3>(2);
    if (back_) {
      owed_ -= y(5);
    } else {
      taken_ = -y(5);
    }
    approach_ = start + n_.dot(W_ * impulse_);
    return true;
  }

  Eigen::Matrix3d W_;
  Vec3 n_, one_, two_, stick_ = Vec3::Zero(), impulse_ = Vec3::Zero();
  double mu_, e_;
  double approach_ = 0.0;            // n · v
  double taken_ = 0.0, owed_ = 0.0;  // work of compression, and what is left to give back [J]
  bool holds_ = false, back_ = false;
};

}  // namespace

Vec3 energeticImpulse(const Eigen::Matrix3d& mobility, const Vec3& normal, const Vec3& velocity,
                      double sliding_friction, double static_friction, double restitution) {
  return Impact(mobility, normal, velocity, sliding_friction, static_friction, restitution)
      .impulse();
}

}  // namespace assembly_cell
