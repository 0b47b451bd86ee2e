// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/align/estimation/hole_fit.h"

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>

#include "assembly_cell/math/least_squares.h"

namespace assembly_cell {
namespace {

constexpr double kHeightFloor = 3e-5;  // heights within this always agree [m]
constexpr double kHeightSd = 5e-6;     // of a contact besides its direction's [m]
constexpr double kLowTolerance =
    0.05;                             // a contact this near the lowest point is on the plane [rad]
constexpr double kMinScatter = 0.25;  // residuals are never taken for less than 0.5 sd, squared
constexpr double kPointFloor = 3e-6;  // sd of a contact's place besides its direction [m]
constexpr double kDirectionFloor = 1e-3;   // sd of a direction, model included [rad]
constexpr double kBranchDirection = 0.02;  // sd of a direction where centres compete [rad]
constexpr double kExplained = 0.008;       // off an expected direction by less is no error [rad]
constexpr std::size_t kMinReadings = 5;    // for a plane, with two to spare
using Vec2 = Eigen::Vector2d;
using Vec3 = Eigen::Vector3d;
using Mat3 = Eigen::Matrix3d;

// Weight of a contact's height: an error of its direction moves it up or down the peg's tilted edge
double heightWeight(const HoleReading& r, double radius, const Vec3& normal) {
  const Vec3 along = r.X_SP.R * Vec3(-std::sin(r.alpha), std::cos(r.alpha), 0.0);
  return 1.0 / (1.0 + std::pow(radius * normal.dot(along) * r.sd / kHeightSd, 2));
}

double wrapPi(double a) { return std::remainder(a, 2 * M_PI); }

Vec3 contactPoint(const HoleReading& r, double radius, double alpha) {
  return r.X_SP.R * Vec3(radius * std::cos(alpha), radius * std::sin(alpha), 0.0) + r.X_SP.p;
}

// Azimuth of the lowest edge point, peg axes. [rad]
double lowest(const HoleReading& r, const Vec3& normal) {
  return std::atan2(-r.X_SP.R.col(1).dot(normal), -r.X_SP.R.col(0).dot(normal));
}

// A contact on the rim, in plane coordinates.
struct RimPoint {
  Vec2 p;        // [m]
  Vec2 tangent;  // derivative of the point by its direction on the edge [m/rad]
  double sd;     // of the direction [rad]
};

struct CircleFit {
  Vec2 center{0, 0};
  Eigen::Matrix2d covariance = Eigen::Matrix2d::Zero();
  double cost = 1e300;
};

// Centre of a circle of given radius through points with robust weights, for minimise(). An error
// of the direction moves a point along the peg's edge: for its distance from the centre only the
// part across the rim counts, little where both circles are almost parallel.
class CircleProblem {
 public:
  CircleProblem(const std::vector<RimPoint>& points, const std::vector<Vec2>& outside,
                double radius)
      : points_(points), outside_(outside), radius_(radius) {}

  void linearise(const Vec2& center) {
    H_.setZero();
    g_.setZero();
    double cost = 0.0, squares = 0.0;
    for (const RimPoint& point : points_) {
      const Vec2 d = center - point.p;
      const double distance = std::max(d.norm(), 1e-9);
      const double along = d.dot(point.tangent) / distance * point.sd;
      const double sd = std::sqrt(kPointFloor * kPointFloor + along * along);
      const double z = (distance - radius_) / sd;
      // Geman–McClure beyond a few sd; the likelihood's log sd counts when centres compete
      const double w = 1.0 / std::pow(1.0 + z * z / 16.0, 2);
      const Vec2 row = d / (distance * sd);
      H_ += w * row * row.transpose();
      g_ += w * row * z;
      cost += z * z / (1.0 + z * z / 16.0) + 2.0 * std::log(sd / kPointFloor);
      squares += w * z * z;
    }
    // a contact on the plane can't lie in the hole
    for (const Vec2& p : outside_) {
      const double inside = radius_ - 2e-4 - (p - center).norm();
      if (inside > 0.0) cost += std::pow(inside / 2e-4, 2);
    }
    const auto n = static_cast<double>(points_.size());
    fit.cost = cost;
    H_.diagonal().array() += 1e-9 * H_.trace();
    // the scatter about the circle is the measure; the readings' sd only weighs them
    fit.covariance = H_.inverse() * std::max(kMinScatter, squares / std::max(1.0, n - 2));
  }
  Vec2 step(double /*damping*/) const { return -H_.ldlt().solve(g_); }
  bool small(const Vec2& step) const { return step.norm() < 1e-10; }

  CircleFit fit;  // cost and covariance at the start of the last step

 private:
  const std::vector<RimPoint>& points_;
  const std::vector<Vec2>& outside_;
  double radius_;
  Eigen::Matrix2d H_;
  Vec2 g_;
};

CircleFit fitCircle(const std::vector<RimPoint>& points, const std::vector<Vec2>& outside,
                    double radius, const Vec2& start) {
  LeastSquaresOptions options;
  options.max_iterations = 60;
  options.max_step = 0.2 * radius;  // the circle is only locally linear
  CircleProblem problem(points, outside, radius);
  problem.fit.center = start;
  minimise<StepControl::kNone>(problem, problem.fit.center, options);
  return problem.fit;
}

// Half of the arc of the peg's edge that is over the hole, and the direction of its middle. All in
// plane coordinates; tilts are small.
struct Arc {
  double toward, half;
};
Arc arcOver(const Vec2& peg, double peg_radius, const Vec2& center, double hole_radius) {
  const Vec2 d = center - peg;
  const double D = d.norm();
  const double c = (peg_radius * peg_radius + D * D - hole_radius * hole_radius) /
                   (2.0 * peg_radius * std::max(D, 1e-9));
  return {std::atan2(d.y(), d.x()), std::acos(std::clamp(c, -1.0, 1.0))};
}

// Direction in the plane where a peg touches: at its lowest edge point, or where its edge
// crosses the rim nearest to it.
double touchDirection(const Arc& arc, double low) {
  const double away = wrapPi(low - arc.toward);
  if (std::abs(away) >= arc.half) return low;
  return arc.toward + (away > 0.0 ? arc.half : -arc.half);
}

// A reading's peg in the plane, and the directions from it to the measured contact and to the
// lowest point of its edge.
struct Sight {
  Vec2 peg;
  double contact, low;
};
Sight sightOf(const HoleReading& r, double radius, const HoleEstimate& e,
              const Eigen::Matrix<double, 3, 2>& axes) {
  const auto direction = [&](double alpha) {
    const Vec2 p = axes.transpose() * (contactPoint(r, radius, alpha) - r.X_SP.p);
    return std::atan2(p.y(), p.x());
  };
  return {axes.transpose() * r.X_SP.p, direction(r.alpha), direction(lowest(r, e.normal))};
}

struct Radii {
  double peg, hole;  // [m]
};

// The circle through two points has two centres: start in every direction around `middle`; of all
// that fit, the one under which the contacts of the sweep would be nearest to the measured ones.
CircleFit bestCircle(const std::vector<RimPoint>& rim, const std::vector<Vec2>& plane,
                     const std::vector<HoleReading>& readings, const std::vector<Sight>& sights,
                     const Radii& radii, const Vec2& middle) {
  CircleFit best;
  double min_cost = 1e300;
  for (int i = 0; i < 24; ++i) {
    for (const double distance : {0.01, 0.1, 0.4, 1.2}) {
      const double a = 2 * M_PI * i / 24.0;
      const Vec2 start = middle + distance * radii.hole * Vec2(std::cos(a), std::sin(a));
      const CircleFit fit = fitCircle(rim, plane, radii.hole, start);
      double cost = 0.0;
      for (std::size_t k = 0; k < readings.size(); ++k) {
        const HoleReading& r = readings[k];
        if (r.kind == HoleReading::kOut) continue;
        const Sight& at = sights[k];
        const Arc arc = arcOver(at.peg, radii.peg, fit.center, radii.hole);
        const double off = wrapPi(at.contact - touchDirection(arc, at.low));
        const double z = off / std::max(kBranchDirection, r.sd);
        cost += z * z / (1.0 + z * z / 16.0);
      }
      // equal but for rounding: the better circle
      if (cost < 0.999 * min_cost || (cost <= 1.001 * min_cost && fit.cost < best.cost)) {
        min_cost = std::min(min_cost, cost);
        best = fit;
      }
    }
  }
  return best;
}

}  // namespace

// Plane through the contacts by least squares; C or C* by which end is at its height.
FitStatus fitPlane(double radius, std::vector<HoleReading>& readings, HoleEstimate& e) {
  double spread = 0.0;
  for (int pass = 0; pass < 15; ++pass) {
    Mat3 A = Mat3::Zero();
    Vec3 b = Vec3::Zero();
    std::size_t n = 0;
    for (HoleReading& r : readings) {
      const double opposite = wrapPi(r.alpha + M_PI);
      const double here = e.normal.dot(contactPoint(r, radius, r.alpha)) - e.height;
      const double there = e.normal.dot(contactPoint(r, radius, opposite)) - e.height;
      const double weight = heightWeight(r, radius, e.normal);  // of either end
      bool take;
      if (pass < 3) {
        // at first only unambiguous contacts: ends of a diameter well down the slope
        if (there < here && !r.end_known) r.alpha = opposite;
        take = std::abs(here - there) > 0.02 * radius;
      } else {
        if (std::abs(there) < std::abs(here) && !r.end_known) r.alpha = opposite;
        const double off = r.end_known ? std::abs(here) : std::min(std::abs(here), std::abs(there));
        take = off * std::sqrt(weight) < std::max(kHeightFloor, 4 * spread);
      }
      r.kind = take ? HoleReading::kPlane : HoleReading::kOut;
      if (!take) continue;
      const Vec3 p = contactPoint(r, radius, r.alpha);
      const Vec3 row(1.0, p.x(), p.y());
      A += weight * row * row.transpose();
      b += weight * row * p.z();
      ++n;
    }
    if (n < kMinReadings) {
      return {AlignFailure::kNoPlaneReading, "fewer than 5 contacts agree on a plane"};
    }
    const Eigen::FullPivLU<Mat3> lu(A);
    if (!lu.isInvertible()) {
      return {AlignFailure::kNoPlaneReading, "the contacts lie on one line"};
    }
    const Vec3 x = lu.solve(b);
    e.normal = Vec3(-x(1), -x(2), 1.0).normalized();
    e.height = x(0) * e.normal.z();
    double sum = 0.0;
    for (const HoleReading& r : readings) {
      if (r.kind == HoleReading::kOut) continue;
      const double d = e.normal.dot(contactPoint(r, radius, r.alpha)) - e.height;
      sum += heightWeight(r, radius, e.normal) * d * d;
    }
    spread = std::sqrt(sum / static_cast<double>(n - 3));
    const Mat3 inverse = lu.inverse();
    e.normal_sd = std::max(spread, 1e-7) * std::sqrt(inverse(1, 1) + inverse(2, 2));
  }
  return {};
}

Eigen::Matrix<double, 3, 2> planeAxes(const Vec3& normal) {
  const Vec3 x = (Vec3::UnitX() - normal * normal.x()).normalized();
  Eigen::Matrix<double, 3, 2> axes;
  axes << x, normal.cross(x);
  return axes;
}

FitStatus fitHole(double peg_radius, double hole_radius, std::vector<HoleReading>& readings,
                  HoleEstimate& e, int min_rim) {
  const FitStatus status = fitPlane(peg_radius, readings, e);
  if (!status.good()) return status;

  // contacts in plane coordinates, sorted into rim and plane by their distance from the lowest
  // point
  const Eigen::Matrix<double, 3, 2> axes = planeAxes(e.normal);
  std::vector<RimPoint> rim;
  std::vector<Vec2> plane;
  std::vector<Sight> sights(readings.size());
  Vec2 middle = Vec2::Zero();
  e.plane_readings = e.rim_readings = 0;
  for (HoleReading& r : readings) {
    if (r.kind == HoleReading::kOut) continue;
    const Vec2 p = axes.transpose() * contactPoint(r, peg_radius, r.alpha);
    middle += axes.transpose() * r.X_SP.p;
    const double away = std::abs(wrapPi(r.alpha - lowest(r, e.normal)));
    if (away > std::max(kLowTolerance, 4 * r.sd)) {
      r.kind = HoleReading::kRim;
      const Vec3 along = contactPoint(r, peg_radius, r.alpha + 0.5 * M_PI) - r.X_SP.p;
      rim.push_back({p, axes.transpose() * along, std::max(kDirectionFloor, r.sd)});
      ++e.rim_readings;
    } else {
      plane.push_back(p);
      ++e.plane_readings;
    }
  }
  middle /= e.plane_readings + e.rim_readings;
  if (e.rim_readings < min_rim) {
    return {AlignFailure::kNoHoleUnderEdge, "too few contacts on the rim"};
  }

  for (std::size_t i = 0; i < readings.size(); ++i) {
    sights[i] = sightOf(readings[i], peg_radius, e, axes);
  }
  const CircleFit best =
      bestCircle(rim, plane, readings, sights, {peg_radius, hole_radius}, middle);
  // a contact that neither the plane nor an edge of this hole explains is an outlier
  for (std::size_t i = 0; i < readings.size(); ++i) {
    HoleReading& r = readings[i];
    r.explained = false;
    if (r.kind == HoleReading::kOut) continue;
    const Sight& at = sights[i];
    const Arc arc = arcOver(at.peg, peg_radius, best.center, hole_radius);
    double off = std::abs(wrapPi(at.contact - at.low));
    for (const double half : {-arc.half, arc.half}) {
      off = std::min(off, std::abs(wrapPi(at.contact - arc.toward - half)));
    }
    r.explained = off < std::max(kExplained, 4 * std::min(r.sd, kExplained));
  }
  e.center = axes * best.center + e.normal * e.height;
  e.center_covariance = best.covariance;
  if (std::sqrt(best.covariance.trace()) > 0.02 * hole_radius) {
    return {AlignFailure::kOneEdgeOnly,
            "the rim was touched on one side only, the centre is not determined"};
  }
  return {};
}

}  // namespace assembly_cell
