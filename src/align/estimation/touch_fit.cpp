// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/align/estimation/touch_fit.h"

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <algorithm>
#include <array>
#include <cmath>

#include "assembly_cell/base/input_error.h"
#include "assembly_cell/math/least_squares.h"
#include "assembly_cell/math/roots.h"

namespace assembly_cell {
namespace {

using Vec2 = Eigen::Vector2d;
using Vec3 = Eigen::Vector3d;

// slope x, y of the plane; height; centre x, y; the hole's radius less the drawn one; offset of
// points x, y
constexpr int kUnknowns = 8;
constexpr int kRadius = 5, kOfHole = 6;  // that of the radius; those before the offset
using Unknowns = Eigen::Matrix<double, kUnknowns, 1>;
using Square = Eigen::Matrix<double, kUnknowns, kUnknowns>;

constexpr int kMarch = 36;                // steps of half the edge, for where it crosses the rim
constexpr double kCrossing = 1e-10;       // tolerance of that [rad]
constexpr int kLune = 24;                 // of the part below the plane
constexpr int kGrid = 15, kMaxGrid = 97;  // start centres per axis: these at least
constexpr double kGridStep = 0.25;        // and so many radii between them at most
constexpr int kStarts = 5;                // of these climbed
constexpr double kAzimuth = 1e-9;         // tolerance of a contact on a chamfer [rad]
constexpr double kSteep = 100.0;          // a wall up from the bore's end, for that search
constexpr double kSlack = 1e-9;           // within the bore that is on its end [m]
constexpr double kGridReach = 2.0;        // of the prior's deviations
constexpr int kIterations = 40;
constexpr int kCircles = 4;          // steps up the peg's chamfer, for which touches
constexpr double kCircle = 1e-3;     // and the tolerance of its circle
constexpr int kHeldBisections = 14;  // of a step, for the highest circle inside the bore
constexpr double kNowhere = 1e9;     // gap of a circle that touches nothing [m]
constexpr double kTouchSd = 5.5e-6;  // of a touch from above, at any carrier pose [m]
// Prior of where moves end: standard deviation [m], and the number of moves that it counts as. A
// few touches have hardly a degree of freedom; without the prior the stated variance of the centre
// is two thirds of its error's at level 2.
constexpr double kMoveSd = 3e-5, kPriorMoves = 3.0;
constexpr double kSecondSd = 1e-4;  // of the heights of two points that a peg rests on [m]
constexpr double kOutlier = 16.0;   // squared residual beyond which a reading counts less

// Direction from the peg's axis to a point of its edge, peg axes.
using Direction = Vec2;
Direction direction(double azimuth) { return {std::cos(azimuth), std::sin(azimuth)}; }
Direction turned(const Direction& a, const Direction& by) {
  return {a.x() * by.x() - a.y() * by.y(), a.x() * by.y() + a.y() * by.x()};
}

struct Hole {
  Vec3 normal, center;
  double radius;
};

// The peg's edge over a hole: heights and distances as functions of the azimuth. Of a chamfered peg
// the circle that is a part `up` of the height from the bottom edge to the shoulder.
struct Edge {
  Edge(const TouchModel& model, const Pose& X_SP, const Hole& hole, double up)
      : r(tipRadius(model.peg) + up * model.peg.chamfer_width),
        R(hole.radius),
        width(model.hole.chamfer_width),
        deep(chamferDepth(model.hole)) {
    const Vec3 from = X_SP.p + up * chamferHeight(model.peg) * X_SP.R.col(2) - hole.center;
    const Vec3& normal = hole.normal;
    middle = normal.dot(from);
    const Vec3 x = X_SP.R.col(0), y = X_SP.R.col(1);
    rise << normal.dot(x), normal.dot(y);
    p = from - normal * middle;
    ex = x - normal * rise.x();
    ey = y - normal * rise.y();
    low = std::atan2(-rise.y(), -rise.x());
    lowest = direction(low);
  }
  double height(const Direction& a) const { return middle + r * a.dot(rise); }
  double beyond(const Direction& a) const { return place(a).norm() - R; }
  bool inside(const Direction& a) const { return place(a).squaredNorm() < R * R; }
  // Distance beyond the wall at its height: the chamfer widens the bore. [m]
  double beyondWall(const Direction& a) const {
    const double out = beyond(a);
    return width > 0.0 ? out - width * std::clamp(1.0 + height(a) / deep, 0.0, 1.0) : out;
  }
  // Height over face and chamfer; over the bore as over a steep wall up. [m]
  double over(double azimuth) const {
    const Direction a = direction(azimuth);
    if (!(width > 0.0)) return height(a);
    const double out = beyond(a);
    if (out < 0.0) return height(a) + deep - kSteep * out;
    return height(a) + deep * std::max(0.0, 1.0 - out / width);
  }

  // Azimuth of the lowest point over the block; nothing where the whole edge is in the bore. [rad]
  std::optional<double> touch() const {
    if (beyond(lowest) >= width) return low;
    return width > 0.0 ? touchOnChamfer() : touchOnRim();
  }

  // The first point outside the rim, from the lowest one on. [rad]
  std::optional<double> touchOnRim() const {
    static const Direction step = direction(M_PI / kMarch), step_back = direction(-M_PI / kMarch);
    Direction ahead = lowest, back = lowest;
    for (int i = 1; i <= kMarch; ++i) {
      ahead = turned(ahead, step);
      back = turned(back, step_back);
      const bool out_ahead = !inside(ahead), out_back = !inside(back);
      if (!out_ahead && !out_back) continue;
      constexpr double none = 2.0 * M_PI;
      const double a = out_ahead ? crossing(1, i) : none, b = out_back ? crossing(-1, i) : none;
      return low + (b < a ? -b : a);
    }
    return {};
  }

  // Height of the second of two points on the rim over the first, on both sides of the lowest one.
  // On the face there is one: as if the second were at the height of the axis. [m]
  double second() const {
    const double none = r * rise.norm();
    if (!inside(lowest)) return none;
    std::array<double, 2> heights{};
    for (const int side : {1, -1}) {
      int i = 1;
      while (i < kMarch && inside(direction(low + side * M_PI * i / kMarch))) ++i;
      if (i == kMarch) return none;
      heights[side > 0 ? 0 : 1] = height(direction(low + side * crossing(side, i)));
    }
    return std::abs(heights[0] - heights[1]);
  }

  std::optional<double> touchOnChamfer() const {
    const auto on = [this](double a) { return over(a); };
    // both sides of the lowest point may be nearly as low
    double lowest_at = low, height = 1e9;
    for (const double side : {1.0, -1.0}) {
      double best = low, min_height = over(low);
      for (int i = 1; i <= kMarch; ++i) {
        const double a = low + side * M_PI * i / kMarch, here = over(a);
        if (here < min_height) {
          min_height = here;
          best = a;
        }
      }
      best = leastIn(best - M_PI / kMarch, best + M_PI / kMarch, on, kAzimuth);
      if (over(best) >= height) continue;
      height = over(best);
      lowest_at = best;
    }
    if (beyond(direction(lowest_at)) < -kSlack) return {};
    return lowest_at;
  }

  // Reach of the edge below the plane beyond the wall. [m]
  double reach() const {
    const double slope = r * rise.norm();
    const double half = std::acos(std::clamp(middle / std::max(slope, 1e-12), -1.0, 1.0));
    double best = -1e9;
    int at = 0;
    std::array<double, kLune + 1> values{};
    const Direction step = direction(2.0 * half / kLune);
    Direction a = turned(lowest, direction(-half));
    for (int i = 0; i <= kLune; ++i, a = turned(a, step)) {
      const auto k = static_cast<std::size_t>(i);
      values[k] = beyondWall(a);
      if (values[k] > best) {
        best = values[k];
        at = i;
      }
    }
    if (at == 0 || at == kLune) return best;
    if (width > 0.0) {  // it may be at a kink
      const auto short_of = [this](double azimuth) { return -beyondWall(direction(azimuth)); };
      const double from = low + half * (2.0 * (at - 1) / kLune - 1.0);
      return -short_of(leastIn(from, from + 4.0 * half / kLune, short_of, kAzimuth));
    }
    // parabola through the three about the maximum
    const auto k = static_cast<std::size_t>(at);
    const double before = values[k - 1], here = values[k], after = values[k + 1];
    const double bend = before - 2 * here + after;
    return bend < 0.0 ? here - (after - before) * (after - before) / (8 * bend) : here;
  }

  double r, R, width, deep, middle = 0.0, low = 0.0;
  Direction lowest;
  Vec2 rise;
  Vec3 p, ex, ey;

 private:
  Vec3 place(const Direction& a) const { return p + r * (a.x() * ex + a.y() * ey); }

  // Azimuth from the lowest point to the crossing of the rim in a step of the march. [rad]
  double crossing(int side, int step) const {
    const auto value = [&](double away) {
      return place(turned(lowest, direction(side * away))).squaredNorm() - R * R;
    };
    const double from = M_PI * (step - 1) / kMarch, to = M_PI * step / kMarch;
    // by rounding the march may have seen an end on the other side
    if (!(value(from) < 0.0)) return from;
    if (!(value(to) > 0.0)) return to;
    return rootIn(from, to, value, kCrossing).high;
  }
};

// A touch against a hole: its residual [m], and where on the peg it would be.
struct Expected {
  double residual, azimuth, radius;
  bool rests = true;
  double height = 0.0;  // over the peg's bottom
  double second = 0.0;  // see Edge::second(), of a touch on two points
};

Expected expectedOf(const TouchReading& reading, const Edge& edge) {
  if (reading.kind == TouchReading::kWall) return {edge.reach(), edge.low, edge.r};
  const std::optional<double> at = edge.touch();
  // an edge inside the bore doesn't rest: as if on its highest point
  const double gap = at ? edge.over(*at) : edge.height(-edge.lowest);
  if (reading.kind == TouchReading::kFree)
    return {std::min({0.0, gap, -edge.reach()}), 0.0, edge.r, at.has_value()};
  Expected found{gap, at.value_or(edge.low), edge.r, at.has_value()};
  if (reading.on_two) found.second = edge.second();
  return found;
}

// By the circle of the peg's chamfer that is nearest to the block. All of its circles are on the
// cone, which is as near as the nearest of them.
Expected expectedOnChamfer(const TouchModel& model, const TouchReading& reading, const Hole& hole) {
  const auto at = [&](double up) { return Edge(model, reading.X_SP, hole, up); };
  const Edge bottom = at(0.0);
  const bool wall = reading.kind == TouchReading::kWall;
  double highest = 1.0;
  if (wall) {
    // only the part of a circle below the plane is against the wall
    const auto lowest = [](const Edge& edge) { return edge.middle - edge.r * edge.rise.norm(); };
    const double low = lowest(bottom), high = lowest(at(1.0));
    if (!(low < 0.0)) return expectedOf(reading, bottom);
    if (high > 0.0) highest = low / (low - high);
  } else if (bottom.beyond(bottom.lowest) >= bottom.width) {
    return expectedOf(reading, bottom);  // on the face
  }
  const auto expected = [&](double up) {
    const Edge edge = at(up);
    Expected found = expectedOf(reading, edge);
    found.height = up * chamferHeight(model.peg);
    // a circle inside the bore doesn't rest: one higher up does
    if (!found.rests) {
      const bool edges = reading.kind == TouchReading::kEdge;
      found.residual = edges ? kNowhere : std::min(0.0, -edge.reach());
    }
    return found;
  };
  const auto distance = [wall](const Expected& f) { return wall ? -f.residual : f.residual; };
  double best = 0.0;
  Expected nearest = expected(0.0);
  double held = nearest.rests ? -1.0 : 0.0;  // the highest circle inside the bore
  for (int i = 1; i <= kCircles; ++i) {
    const double up = highest * i / kCircles;
    const Expected here = expected(up);
    if (!here.rests) held = up;
    if (distance(here) >= distance(nearest)) continue;
    nearest = here;
    best = up;
  }
  const double step = highest / kCircles;
  double from = std::max(0.0, best - step), to = std::min(highest, best + step);
  // the first circle that rests above it may be the nearest, or that is between it and the next one
  if (held >= 0.0 && held < highest) {
    const double next = held + step;
    double rests = next;
    for (int i = 0; i < kHeldBisections; ++i) {
      const double up = 0.5 * (held + rests);
      (at(up).touch() ? rests : held) = up;
    }
    const Expected here = expected(rests);
    from = std::max(from, rests);
    if (distance(here) < distance(nearest)) {
      nearest = here;
      from = rests;
      to = next;
    }
  }
  const Expected refined = expected(leastIn(
      from, to, [&](double up) { return distance(expected(up)); }, kCircle));
  if (distance(refined) < distance(nearest)) nearest = refined;
  return nearest.residual < kNowhere ? nearest : expectedOf(reading, at(1.0));
}

Expected residualOf(const TouchModel& model, const TouchReading& reading, const Hole& hole) {
  if (model.peg.chamfer_width > 0.0) return expectedOnChamfer(model, reading, hole);
  return expectedOf(reading, Edge(model, reading.X_SP, hole, 0.0));
}

Hole holeOf(const TouchModel& model, const Unknowns& x) {
  const Vec3 normal = Vec3(-x(0), -x(1), 1.0).normalized();
  return {normal, Vec3(x(3), x(4), x(2) + x(0) * x(3) + x(1) * x(4)),
          model.hole.radius + x(kRadius)};
}

class Posterior {
 public:
  Posterior(const TouchModel& model, const std::vector<TouchReading>& readings, double height)
      : model_(model), readings_(readings), height_(height) {
    count_ = kUnknowns;
    for (const TouchReading& r : readings) count_ += residualsOf(r);
  }
  int count() const { return count_; }

  // Variance of where moves end: residuals of touches from above less their own error, by their
  // degrees of freedom; z and J are those of the solution. Walls are measured less exactly. [m²]
  double placeVariance(const Eigen::VectorXd& z, const Eigen::MatrixXd& J,
                       const Square& covariance) const {
    double squares = 0.0, free = 0.0;
    int n = 0;
    for (const TouchReading& reading : readings_) {
      if (reading.kind == TouchReading::kEdge) {
        squares += std::pow(z(n) * reading.sd, 2);
        free += 1.0 - (J.row(n) * covariance * J.row(n).transpose()).value();
      }
      n += residualsOf(reading);
    }
    // the mean of 1/χ² is that of two degrees of freedom less
    const double of_moves = std::max(0.0, squares - free * kTouchSd * kTouchSd);
    return (of_moves + kPriorMoves * kMoveSd * kMoveSd) / std::max(1.0, free + kPriorMoves - 2.0);
  }

  std::vector<Expected> expected(const Unknowns& x) const {
    const Hole hole = holeOf(model_, x);
    std::vector<Expected> out;
    out.reserve(readings_.size());
    for (const TouchReading& r : readings_) {
      out.push_back(residualOf(model_, r, hole));
    }
    return out;
  }

  // Residuals over their deviations; those of readings that don't fit have less weight.
  Eigen::VectorXd operator()(const Unknowns& x) const { return residuals(x, expected(x)); }

  Eigen::MatrixXd slope(const Unknowns& x) const {
    Eigen::MatrixXd J(count_, kUnknowns);
    const double r = model_.peg.radius;
    const std::vector<Expected> here = expected(x);
    for (int i = 0; i < kUnknowns; ++i) {
      const double h = i < 2 ? 1e-6 : 1e-6 * r;
      Unknowns up = x, down = x;
      up(i) += h;
      down(i) -= h;
      // the sensor's offset doesn't move the peg
      J.col(i) =
          i < kOfHole ? (*this)(up) - (*this)(down) : residuals(up, here) - residuals(down, here);
      J.col(i) /= 2 * h;
    }
    return J;
  }

 private:
  static int residualsOf(const TouchReading& r) { return 1 + (r.point ? 2 : 0) + r.on_two; }
  static double robust(double z) { return z / std::sqrt(1.0 + z * z / kOutlier); }

  Eigen::VectorXd residuals(const Unknowns& x, const std::vector<Expected>& expected) const {
    Eigen::VectorXd out(count_);
    int n = 0;
    for (std::size_t i = 0; i < readings_.size(); ++i) {
      const TouchReading& reading = readings_[i];
      const Expected& here = expected[i];
      out(n++) = robust(here.residual / reading.sd);
      if (reading.on_two) out(n++) = robust(here.second / kSecondSd);
      if (!reading.point) continue;
      const Vec2 at = *reading.point + here.height * reading.lean;
      const Vec2 off = at - here.radius * direction(here.azimuth) - x.tail<2>();
      out(n++) = robust(off.x() / model_.point_sd);
      out(n++) = robust(off.y() / model_.point_sd);
    }
    out(n++) = x(0) / model_.tilt_sd;
    out(n++) = x(1) / model_.tilt_sd;
    out(n++) = (x(2) - height_) / model_.peg.radius;
    out(n++) = (x(3) - model_.start.x()) / model_.position_sd;
    out(n++) = (x(4) - model_.start.y()) / model_.position_sd;
    out(n++) = x(kRadius) / model_.radius_sd;
    out(n++) = x(6) / model_.offset_sd;
    out(n) = x(7) / model_.offset_sd;
    return out;
  }

  const TouchModel& model_;
  const std::vector<TouchReading>& readings_;
  double height_;
  int count_ = 0;
};

// The posterior for minimise().
class PosteriorFit {
 public:
  explicit PosteriorFit(const Posterior& posterior) : posterior_(posterior) {}

  double cost(const Unknowns& x) {
    z_ = posterior_(x);
    return z_.squaredNorm();
  }
  void linearise(const Unknowns& x) {
    const Eigen::MatrixXd J = posterior_.slope(x);
    H_ = J.transpose() * J;
    g_ = J.transpose() * z_;
  }
  Unknowns step(double damping) const {
    Square H = H_;
    H.diagonal() *= 1.0 + damping;
    return -H.ldlt().solve(g_);
  }
  bool small(const Unknowns& /*step*/) const { return false; }

 private:
  const Posterior& posterior_;
  Eigen::VectorXd z_;
  Square H_;
  Unknowns g_;
};

// Refines x; returns the sum of squares.
double climb(const Posterior& posterior, Unknowns& x) {
  LeastSquaresOptions options;
  options.max_iterations = kIterations;
  options.accept_equal = false;
  options.min_decrease = 1e-6;
  options.damping.initial = 1e-3;
  options.damping.min = 1e-9;
  options.damping.max = 1e6;
  PosteriorFit fit(posterior);
  return minimise<StepControl::kDamping>(fit, x, options).cost;
}

// Plane through the points of touch, which are on the rim or beside it.
Unknowns planeThrough(const TouchModel& model, const std::vector<TouchReading>& readings) {
  Eigen::Matrix3d A = Eigen::Matrix3d::Zero();
  Vec3 b = Vec3::Zero();
  int n = 0;
  const auto add = [&](const TouchReading& r, const Vec2& toward) {
    const Vec2 on = tipRadius(model.peg) * toward.normalized();
    const Vec3 p = r.X_SP.R * Vec3(on.x(), on.y(), 0.0) + r.X_SP.p;
    const Vec3 row(p.x(), p.y(), 1.0);
    A += row * row.transpose();
    b += row * p.z();
  };
  for (const TouchReading& r : readings) {
    if (r.kind != TouchReading::kEdge || (!r.point && !r.on_two)) continue;
    ++n;
    // the point itself may be off by the sensor's offset: that on the edge next to it
    if (r.point) add(r, *r.point);
    if (!r.on_two) continue;
    // two circles of nearly one size cross at right angles to the lowest point
    const Vec2 side(r.X_SP.R(2, 1), -r.X_SP.R(2, 0));
    add(r, side);
    add(r, -side);
  }
  const Eigen::FullPivLU<Eigen::Matrix3d> lu(A);
  if (n < 3 || !lu.isInvertible()) {
    throw InputError("touches: fewer than 3 that determine a plane; touch at other tilts");
  }
  const Vec3 plane = lu.solve(b);
  Unknowns x = Unknowns::Zero();
  x.head<3>() = plane;
  return x;
}

}  // namespace

double touchResidual(const TouchModel& model, const TouchReading& reading, const Vec3& normal,
                     const Vec3& center) {
  return residualOf(model, reading, {normal, center, model.hole.radius}).residual;
}

TouchFit fitTouches(const TouchModel& model, const std::vector<TouchReading>& readings) {
  const Unknowns plane = planeThrough(model, readings);
  const Posterior posterior(model, readings, plane(2));
  struct Start {
    double cost;
    Unknowns x;
  };
  std::vector<Start> starts;
  const auto start = [&](const Vec2& center) {
    Unknowns x = plane;
    x.segment<2>(3) = center;
    starts.push_back({posterior(x).squaredNorm(), x});
  };
  const double reach = kGridReach * model.position_sd;
  const double steps = 2.0 * reach / (kGridStep * model.peg.radius);
  const int grid = static_cast<int>(std::clamp<double>(std::ceil(steps) + 1, kGrid, kMaxGrid));
  for (int i = 0; i < grid; ++i) {
    for (int k = 0; k < grid; ++k) {
      const Vec2 off(2.0 * i / (grid - 1) - 1.0, 2.0 * k / (grid - 1) - 1.0);
      start(model.start + reach * off);
    }
  }
  // Walls make a minimum that is narrower than the grid, near the peg that touches them.
  for (const TouchReading& r : readings) {
    if (r.kind != TouchReading::kEdge) start(r.X_SP.p.head<2>());
  }
  std::partial_sort(starts.begin(), starts.begin() + kStarts, starts.end(),
                    [](const Start& a, const Start& b) { return a.cost < b.cost; });
  Start best{1e300, plane};
  for (int i = 0; i < kStarts; ++i) {
    Unknowns x = starts[static_cast<std::size_t>(i)].x;
    const double cost = climb(posterior, x);
    if (cost < best.cost) best = {cost, x};
  }

  const Eigen::MatrixXd J = posterior.slope(best.x);
  const Square covariance = (J.transpose() * J).inverse();
  const Hole hole = holeOf(model, best.x);
  TouchFit fit;
  fit.normal = hole.normal;
  fit.center = hole.center;
  fit.height = hole.normal.dot(hole.center);
  fit.center_covariance = covariance.block<2, 2>(3, 3);
  fit.normal_sd = std::sqrt(covariance(0, 0) + covariance(1, 1));
  Unknowns up = Unknowns::Zero();
  up << best.x(3), best.x(4), 1, 0, 0, 0, 0, 0;
  fit.height_sd = std::sqrt(up.dot(covariance * up));
  fit.radius = hole.radius;
  fit.radius_sd = std::sqrt(covariance(kRadius, kRadius));
  fit.place_variance = posterior.placeVariance(posterior(best.x), J, covariance);
  fit.chi2 = best.cost;
  fit.residuals = posterior.count();
  return fit;
}

}  // namespace assembly_cell
