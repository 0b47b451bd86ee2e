// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "stronge.h"

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <algorithm>
#include <array>
#include <cmath>

#include "tableaus.h"

namespace assembly_cell {
namespace {

using Mat3 = Eigen::Matrix3d;
using Vec3 = Eigen::Vector3d;
constexpr double kTolerance = 1e-14;  // of a step, relative
constexpr double kSlipEnd = 34.5;     // slip has ended at its start's e^-34.5 = 1e-15
constexpr int kMostSteps = 4000, kDirections = 180, kHalvings = 60;

// Slip in polar coordinates along a path tau with d(normal impulse) = speed dtau: smooth through
// the end of slip, which tau never reaches.
struct Slip {
  Mat3 W;
  Vec3 n, t1, t2;
  double mu;

  Vec3 along(double phi) const { return std::cos(phi) * t1 + std::sin(phi) * t2; }
  Vec3 across(double phi) const { return std::cos(phi) * t2 - std::sin(phi) * t1; }
  // impulse a unit of normal impulse while the point slips along phi
  Vec3 ray(double phi) const { return n - mu * along(phi); }
  double swerve(double phi) const { return across(phi).dot(W * ray(phi)); }
};

// logarithm of the slip's speed, its direction, normal velocity, work of the normal force, impulse
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

// one step of order eight; the largest error over `scale`
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

// the direction that slip keeps once it has begun anew
double newDirection(const Slip& slip, double phi) {
  double best = phi, most = 0.0;
  for (int i = 0; i < kDirections; ++i) {
    double low = phi + 2 * M_PI * i / kDirections, high = phi + 2 * M_PI * (i + 1) / kDirections;
    const bool rises = slip.swerve(low) < 0.0;
    if (rises == (slip.swerve(high) < 0.0)) continue;
    for (int k = 0; k < kHalvings; ++k) {
      const double middle = 0.5 * (low + high);
      ((slip.swerve(middle) < 0.0) == rises ? low : high) = middle;
    }
    const double stretch = slip.along(low).dot(slip.W * slip.ray(low));
    if (stretch > most) {
      most = stretch;
      best = low;
    }
  }
  return best;
}

}  // namespace

Vec3 strongeImpulse(const Mat3& W, const Vec3& n, const Vec3& v, const FrictionParameters& friction,
                    double restitution) {
  const Vec3 t1 = n.unitOrthogonal();
  const Slip slip{W, n, t1, n.cross(t1), friction.sliding_coefficient};
  Eigen::Matrix2d Wt;
  Wt << t1.dot(W * t1), t1.dot(W * slip.t2), slip.t2.dot(W * t1), slip.t2.dot(W * slip.t2);
  const Eigen::Vector2d hold = -Wt.inverse() * Eigen::Vector2d(t1.dot(W * n), slip.t2.dot(W * n));

  const Eigen::Vector2d start(v.dot(t1), v.dot(slip.t2));
  const double speed = start.norm(), arrival = -v.dot(n);
  Path x = Path::Zero();
  x(kLog) = speed > 0.0 ? std::log(speed) : -HUGE_VAL;
  x(kPhi) = std::atan2(start(1), start(0));
  x(kNormal) = -arrival;
  const double end_of_slip = std::log(std::max(speed, 1e-6 * arrival)) - kSlipEnd;
  const double impulse = arrival / n.dot(W * n), work = arrival * impulse;
  Path scale;
  scale << 1.0, 1.0, arrival, work, impulse, impulse, impulse;
  scale *= kTolerance;

  // the phases end where this is zero
  bool restoring = false;
  double owed = 0.0;
  Vec3 compressed = Vec3::Zero();
  const auto left = [&](const Path& at) { return restoring ? owed - at(kWork) : -at(kNormal); };
  const auto restore = [&] {
    restoring = true;
    owed = x(kWork) * (1.0 - restitution * restitution);
    compressed = x.tail<3>();
  };
  bool done = false;
  const double rate = slip.swerve(x(kPhi)), shrink = slip.along(x(kPhi)).dot(W * slip.ray(x(kPhi)));
  double h = 0.1 / std::max({std::abs(rate), std::abs(shrink), 1e-300});
  for (int i = 0; i < kMostSteps && !done && x(kLog) > end_of_slip; ++i) {
    Path end;
    const double error = step(slip, x, h, scale, end);
    const double factor = std::clamp(0.9 * std::pow(std::max(error, 1e-10), -0.125), 0.2, 3.0);
    if (!(error <= 1.0)) {
      h *= std::isfinite(error) ? factor : 0.2;
      continue;
    }
    if (left(end) > 0.0) {
      x = end;
      h *= factor;
      continue;
    }
    // shortened to the end of the phase: secant steps kept in the bracket
    double low = 0.0, high = h, f_low = left(x), f_high = left(end);
    Path at = end;
    for (int k = 0; k < kHalvings && high - low > 1e-16 * h; ++k) {
      double middle =
          k % 3 == 2 ? 0.5 * (low + high) : low + (high - low) * f_low / (f_low - f_high);
      middle = std::clamp(middle, low, high);
      step(slip, x, middle, scale, at);
      const double f = left(at);
      if (f > 0.0) {
        low = middle;
        f_low = f;
      } else {
        high = middle;
        f_high = f;
      }
      if (std::abs(f) <= 1e-16 * (restoring ? work : arrival)) break;
    }
    x = at;
    done = restoring;
    if (!restoring) restore();
  }
  // slip has ended: rest, or slip anew in one direction; straight from here
  if (!done) {
    const bool holds = hold.norm() <= friction.static_coefficient;
    const Vec3 ray =
        holds ? Vec3(n + hold(0) * t1 + hold(1) * slip.t2) : slip.ray(newDirection(slip, x(kPhi)));
    const double gain = n.dot(W * ray);
    const auto go = [&](double p) {
      x(kWork) += p * (x(kNormal) + 0.5 * gain * p);
      x(kNormal) += gain * p;
      x.tail<3>() += p * ray;
    };
    if (gain > 0.0) {
      if (!restoring) {
        go(-x(kNormal) / gain);
        restore();
      }
      const double now = std::max(0.0, x(kNormal));
      go((-now + std::sqrt(now * now + 2.0 * gain * std::max(0.0, owed - x(kWork)))) / gain);
    }
  }

  // kinetic energy changes by P · (v + v+)/2: rounding may not make it grow
  Vec3 P = x.tail<3>();
  const auto energy = [&](const Vec3& total) { return total.dot(v + 0.5 * (W * total)); };
  if (energy(P) > 0.0) {
    double low = 0.0, high = 1.0;
    for (int k = 0; k < kHalvings; ++k) {
      const double middle = 0.5 * (low + high);
      (energy(compressed + middle * (P - compressed)) > 0.0 ? high : low) = middle;
    }
    P = compressed + low * (P - compressed);
  }
  return P;
}

}  // namespace assembly_cell
