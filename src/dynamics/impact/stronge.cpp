// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "stronge.h"

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <algorithm>
#include <array>
#include <cmath>

#include "assembly_cell/math/roots.h"

#include "integration/tableaus.h"

namespace assembly_cell {
namespace {

using Mat3 = Eigen::Matrix3d;
using Vec3 = Eigen::Vector3d;
// Relative tolerance of a step; logarithm of initial over final slip at its end, e^-34.5 = 1e-15.
// Half and twice change roundings only: 4 of 400 random scenes end elsewhere, by up to 7 um.
constexpr double kTolerance = 1e-14, kSlipEnd = 34.5;
constexpr int kMaxSteps = 4000, kDirections = 180, kHalvings = 60;

// Slip in polar coordinates (speed, phi) over a parameter tau with d(normal impulse) = speed dtau:
// the equations are smooth at the end of slip, at infinite tau.
struct Slip {
  Mat3 W;
  Vec3 n, t1, t2;
  double mu;

  Vec3 along(double phi) const { return std::cos(phi) * t1 + std::sin(phi) * t2; }
  Vec3 across(double phi) const { return std::cos(phi) * t2 - std::sin(phi) * t1; }
  // impulse per unit of normal impulse while the point slips along phi
  Vec3 ray(double phi) const { return n - mu * along(phi); }
  double swerve(double phi) const { return across(phi).dot(W * ray(phi)); }
  double stretch(double phi) const { return along(phi).dot(W * ray(phi)); }
};

// Logarithm of the slip speed, its direction, normal velocity, work of the normal force, normal
// impulse.
enum Component { kLog, kPhi, kNormal, kWork, kImpulse };
using Path = Eigen::Matrix<double, 7, 1>;

Path slope(const Slip& slip, const Path& x) {
  const double speed = std::exp(x(kLog));
  const Vec3 ray = slip.ray(x(kPhi)), change = slip.W * ray;
  Path d;
  d << slip.along(x(kPhi)).dot(change), slip.across(x(kPhi)).dot(change),
      speed * slip.n.dot(change), speed * x(kNormal), speed * ray;
  return d;
}

// One step of order eight; returns the largest error over `scale`.
double step(const Slip& slip, const Path& x, double h, const Path& scale, Path& end) {
  std::array<Path, Dop853::kStages + 1> k;
  k[0] = slope(slip, x);
  for (std::size_t i = 1; i < k.size(); ++i) {
    Path sum = Path::Zero();
    for (std::size_t j = 0; j < i; ++j) sum += Dop853::a[i][j] * k[j];
    end = x + h * sum;
    k[i] = slope(slip, end);
  }
  Path fifth = Path::Zero();
  for (std::size_t i = 0; i < k.size(); ++i) fifth += Dop853::e[i] * k[i];
  return (h * fifth).cwiseQuotient(scale).cwiseAbs().maxCoeff<Eigen::PropagateNaN>();
}

// Constant direction of slip that restarts after its end.
double newDirection(const Slip& slip, double phi) {
  double best = phi, largest = 0.0;
  for (int i = 0; i < kDirections; ++i) {
    const double from = phi + 2 * M_PI * i / kDirections,
                 to = phi + 2 * M_PI * (i + 1) / kDirections;
    const bool rises = slip.swerve(from) < 0.0;
    if (rises == (slip.swerve(to) < 0.0)) continue;
    const auto before = [&](double x) { return (slip.swerve(x) < 0.0) == rises; };
    const double turn = bisect(from, to, before, 0.0, kHalvings).low;
    if (slip.stretch(turn) > largest) {
      largest = slip.stretch(turn);
      best = turn;
    }
  }
  return best;
}

// One impact: compression and restitution, with slip and after its end.
class StrongeImpact {
 public:
  StrongeImpact(const Slip& slip, const Vec3& v, const FrictionParameters& friction,
                double restitution)
      : slip_(slip),
        v_(v),
        holding_(friction.static_coefficient),
        restitution_(restitution),
        arrival_(-v.dot(slip.n)) {
    const Eigen::Vector2d start(v.dot(slip.t1), v.dot(slip.t2));
    const double speed = start.norm(), impulse = arrival_ / slip.n.dot(slip.W * slip.n);
    x_(kLog) = speed > 0.0 ? std::log(speed) : -HUGE_VAL;
    x_(kPhi) = std::atan2(start(1), start(0));
    x_(kNormal) = -arrival_;
    end_of_slip_ = std::log(std::max(speed, 1e-6 * arrival_)) - kSlipEnd;
    work_ = arrival_ * impulse;
    scale_ << 1.0, 1.0, arrival_, work_, impulse, impulse, impulse;
    scale_ *= kTolerance;
  }

  Vec3 impulse() {
    slide();
    if (!done_) goStraight();
    return withoutGain();
  }

 private:
  // zero at the end of the present phase
  double left(const Path& at) const { return restoring_ ? owed_ - at(kWork) : -at(kNormal); }
  void restore() {
    restoring_ = true;
    owed_ = x_(kWork) * (1.0 - restitution_ * restitution_);
    compressed_ = x_.tail<3>();
  }

  void slide() {
    const double phi = x_(kPhi), rate = slip_.swerve(phi), shrink = slip_.stretch(phi);
    double h = 0.1 / std::max({std::abs(rate), std::abs(shrink), 1e-300});
    for (int i = 0; i < kMaxSteps && !done_ && x_(kLog) > end_of_slip_; ++i) {
      Path end;
      const double error = step(slip_, x_, h, scale_, end);
      const double factor = std::clamp(0.9 * std::pow(std::max(error, 1e-10), -0.125), 0.2, 3.0);
      if (!(error <= 1.0)) {
        h *= std::isfinite(error) ? factor : 0.2;
      } else if (left(end) > 0.0) {
        x_ = end;
        h *= factor;
      } else {
        x_ = endOfPhase(h, end);
        done_ = restoring_;
        if (!restoring_) restore();
      }
    }
  }

  // shortens a step that passes the end of a phase: bracketed secant method
  Path endOfPhase(double h, const Path& end) const {
    double low = 0.0, high = h, f_low = left(x_), f_high = left(end);
    Path at = end;
    for (int k = 0; k < kHalvings && high - low > 1e-16 * h; ++k) {
      double middle =
          k % 3 == 2 ? 0.5 * (low + high) : low + (high - low) * f_low / (f_low - f_high);
      middle = std::clamp(middle, low, high);
      step(slip_, x_, middle, scale_, at);
      const double f = left(at);
      if (f > 0.0) {
        low = middle;
        f_low = f;
      } else {
        high = middle;
        f_high = f;
      }
      if (std::abs(f) <= 1e-16 * (restoring_ ? work_ : arrival_)) break;
    }
    return at;
  }

  // after the end of slip: stick, or slip in a constant direction, in closed form
  void goStraight() {
    const Mat3& W = slip_.W;
    const Vec3 &n = slip_.n, &t1 = slip_.t1, &t2 = slip_.t2;
    Eigen::Matrix2d Wt;
    Wt << t1.dot(W * t1), t1.dot(W * t2), t2.dot(W * t1), t2.dot(W * t2);
    const Eigen::Vector2d hold = -Wt.inverse() * Eigen::Vector2d(t1.dot(W * n), t2.dot(W * n));
    const Vec3 ray = hold.norm() <= holding_ ? Vec3(n + hold(0) * t1 + hold(1) * t2)
                                             : slip_.ray(newDirection(slip_, x_(kPhi)));
    const double gain = n.dot(W * ray);
    if (!(gain > 0.0)) return;
    const auto go = [&](double p) {
      x_(kWork) += p * (x_(kNormal) + 0.5 * gain * p);
      x_(kNormal) += gain * p;
      x_.tail<3>() += p * ray;
    };
    if (!restoring_) {
      go(-x_(kNormal) / gain);
      restore();
    }
    const double now = std::max(0.0, x_(kNormal));
    go((-now + std::sqrt(now * now + 2.0 * gain * std::max(0.0, owed_ - x_(kWork)))) / gain);
  }

  // the change of kinetic energy P · (v + v+)/2 must not be positive by rounding
  Vec3 withoutGain() const {
    const Vec3 P = x_.tail<3>();
    const auto energy = [&](const Vec3& total) { return total.dot(v_ + 0.5 * (slip_.W * total)); };
    if (!(energy(P) > 0.0)) return P;
    const auto part = [&](double x) { return Vec3(compressed_ + x * (P - compressed_)); };
    const auto loses = [&](double x) { return !(energy(part(x)) > 0.0); };
    return part(bisect(0.0, 1.0, loses, 0.0, kHalvings).low);
  }

  const Slip& slip_;
  const Vec3 v_;
  const double holding_, restitution_, arrival_;
  double work_, end_of_slip_;
  Path x_ = Path::Zero(), scale_;
  bool restoring_ = false, done_ = false;
  double owed_ = 0.0;
  Vec3 compressed_ = Vec3::Zero();
};

}  // namespace

Vec3 strongeImpulse(const Mat3& W, const Vec3& n, const Vec3& v, const FrictionParameters& friction,
                    double restitution) {
  const Vec3 t1 = n.unitOrthogonal();
  const Slip slip{W, n, t1, n.cross(t1), friction.sliding_coefficient};
  return StrongeImpact(slip, v, friction, restitution).impulse();
}

}  // namespace assembly_cell
