// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "contact_algebra.h"

#include <Eigen/LU>
#include <Eigen/QR>
#include <algorithm>

#include "assembly_cell/geometry/spatial.h"

namespace assembly_cell {
namespace {

using Mat3 = Eigen::Matrix3d;
using Vec3 = Eigen::Vector3d;
// No result changes at half or twice of any of these.
constexpr double kRank = 1e-10;      // relative pivots below this are redundant rows
constexpr double kClear = 1e-6;      // relative pivots above this: full rank, whatever the pivoting
constexpr double kPainleve = 1e-3;   // of 1/mass: normal response to the force of a slipping point
constexpr double kAmple = 0.1;       // determinants above this are far from zero
constexpr double kRedundant = 1e-9;  // determinant below which the slipping points are redundant
constexpr double kCoincident = 1e-9;  // points closer than this are one [m]

// Influence matrix: acceleration at r by a force at s, 1/m − [r] B [s].
Mat3 influence(const Body& b, const Vec3& r, const Vec3& s) {
  if (!b.symmetric) {
    return Mat3::Identity() / b.mass - skew(r) * b.inverse_inertia * skew(s);
  }
  const double it = 1.0 / b.inertia_transverse, ia = 1.0 / b.inertia_axial - it;
  const Vec3 ra = r.cross(b.axis), sa = s.cross(b.axis);
  // −[r](it 1 + ia a aᵀ)[s] = −it [r][s] + ia (r×a)(s×a)ᵀ, and [r][s] = s rᵀ − (r·s) 1
  Mat3 m = ia * ra * sa.transpose() - it * s * r.transpose();
  m.diagonal().array() += 1.0 / b.mass + it * r.dot(s);
  return m;
}

// Linear and angular acceleration by a force.
struct Answer {
  Answer() = default;
  Answer(const Body& b, const Vec3& r, const Vec3& force)
      : linear(force / b.mass), angular(b.inverse_inertia * r.cross(force)) {}
  Vec3 linear, angular;
};

// A direction at a point, and the component of the point's acceleration along it: n² responses of n
// points from n accelerations of the body.
struct Axis {
  Axis() = default;
  Axis(const Vec3& r, const Vec3& along_it) : along(along_it), moment(r.cross(along_it)) {}
  double of(const Answer& answer) const {
    return along.dot(answer.linear) + moment.dot(answer.angular);
  }
  Vec3 along, moment;
};

// A slipping point: its row, and the acceleration of the body by a force along its direction, or
// along its normal beyond Painlevé's bound.
struct Slip {
  Slip() = default;
  Slip(const Body& b, const Constraint& c)
      : row(c.r, c.normal), direction(c.direction), answer(b, c.r, c.direction) {
    own = row.of(answer);
    if (own > kPainleve / b.mass) return;
    direction = c.normal;
    answer = Answer(b, c.r, c.normal);
    own = row.of(answer);
  }
  Axis row;
  Vec3 direction;
  Answer answer;
  double own;
};

void oneSlip(const Body& b, Constraint& c) {
  const Slip slip(b, c);
  c.force = c.normal.dot(c.change) / slip.own * slip.direction;
}

// True if the two are far from Painlevé's paradox.
bool twoSlips(const Body& b, Constraint& one, Constraint& two) {
  const Slip s1(b, one), s2(b, two);
  const Vec3 &d1 = s1.direction, &d2 = s2.direction;
  const double a11 = s1.own, a12 = s1.row.of(s2.answer);
  const double a21 = s2.row.of(s1.answer), a22 = s2.own;
  const double c1 = one.normal.dot(one.change), c2 = two.normal.dot(two.change);
  const double determinant = a11 * a22 - a12 * a21;
  if (std::abs(determinant) < kRank * a11 * a22) {
    // identical rows: half each
    one.force = c1 / (a11 + a12) * d1;
    two.force = c2 / (a21 + a22) * d2;
    return true;
  }
  one.force = (c1 * a22 - a12 * c2) / determinant * d1;
  two.force = (a11 * c2 - a21 * c1) / determinant * d2;
  return determinant > kAmple * a11 * a22;
}

void stickAndSlip(const Body& b, Constraint& stick, Constraint& slip) {
  const Slip s(b, slip);
  const Mat3 W = influence(b, stick.r, stick.r).inverse();
  const Vec3 at_stick = s.answer.linear + s.answer.angular.cross(stick.r);
  const Vec3 on_stick = W * at_stick, alone = W * stick.change;
  const double left = s.own - s.row.of(Answer(b, stick.r, on_stick));
  const double asked = slip.normal.dot(slip.change) - s.row.of(Answer(b, stick.r, alone));
  const double N = std::abs(left) > kRank * std::abs(s.own) ? asked / left : 0.0;
  slip.force = N * s.direction;
  stick.force = alone - N * on_stick;
}

Vec3 angularMomentum(const Body& b, const Vec3& angular) {
  return b.inertia_transverse * angular +
         (b.inertia_axial - b.inertia_transverse) * b.axis.dot(angular) * b.axis;
}

// Two sticking points leave one degree of freedom, the rotation about the line through them.
void hinge(const Body& b, Constraint& one, Constraint& two) {
  const Vec3 apart = two.r - one.r, middle = 0.5 * (one.r + two.r);
  const double square = apart.squaredNorm();
  const Vec3 mean = 0.5 * (one.change + two.change);
  if (square < kCoincident * kCoincident) {
    const Vec3 force = influence(b, middle, middle).inverse() * mean;
    one.force = two.force = 0.5 * force;
    return;
  }
  const Vec3 along = apart / std::sqrt(square);
  const auto inertia = [&b](const Vec3& angular) { return angularMomentum(b, angular); };
  // angular acceleration normal to the line from the difference of the two points, along it from
  // the balance of moments: contact forces have no moment about the line
  const Vec3 across = apart.cross(two.change - one.change) / square;
  const Vec3 middle_cross = middle.cross(along);  // = −(along × middle)
  const double free = along.dot(inertia(along)) + b.mass * middle_cross.squaredNorm();
  const Vec3 linear0 = mean - across.cross(middle);
  const double moment = along.dot(inertia(across)) - b.mass * along.dot(one.r.cross(linear0));
  const Vec3 angular = across - moment / free * along;
  const Vec3 force = b.mass * (mean - angular.cross(middle));
  const Vec3 about_one = inertia(angular) - one.r.cross(force);
  two.force = about_one.cross(apart) / square + 0.5 * along.dot(force) * along;
  one.force = force - two.force;
}

// Three and more sticking points determine the motion of the body: least-squares acceleration, then
// the minimum-norm forces that cause it. False for collinear points.
bool held(const Body& b, Constraints& all) {
  const double part = 1.0 / static_cast<double>(all.n);
  Vec3 middle = Vec3::Zero(), mean = Vec3::Zero(), turning = Vec3::Zero();
  for (const Constraint& c : all) {
    middle += part * c.r;
    mean += part * c.change;
  }
  Mat3 spread = Mat3::Zero();
  for (const Constraint& c : all) {
    const Vec3 arm = c.r - middle;
    spread += arm.squaredNorm() * Mat3::Identity() - arm * arm.transpose();
    turning += arm.cross(c.change);
  }
  const double size = spread.trace();
  if (!(spread.determinant() > kRank * size * size * size)) return false;
  const Mat3 inverse = spread.inverse();
  const Vec3 angular = inverse * turning;
  const Vec3 force = b.mass * (mean - angular.cross(middle));
  const Vec3 around = inverse * (angularMomentum(b, angular) - middle.cross(force));
  for (Constraint& c : all) c.force = part * force + around.cross(c.r - middle);
  return true;
}

// n points that all slip; false if they are redundant, or nearly.
template <int n>
bool onlySlips(const Body& b, Constraints& all) {
  std::array<Slip, n> slips;
  Eigen::Matrix<double, n, n> A;
  Eigen::Matrix<double, n, 1> y;
  for (int i = 0; i < n; ++i) slips[i] = Slip(b, all.rows[i]);
  for (int i = 0; i < n; ++i) {
    y(i) = slips[i].row.along.dot(all.rows[i].change);
    for (int j = 0; j < n; ++j) A(i, j) = slips[i].row.of(slips[j].answer);
  }
  const Eigen::PartialPivLU<Eigen::Matrix<double, n, n>> factors(A);
  const auto pivots = factors.matrixLU().diagonal().cwiseAbs();
  if (!(pivots.minCoeff() > kClear * pivots.maxCoeff())) return false;
  const Eigen::Matrix<double, n, 1> x = factors.solve(y);
  for (int i = 0; i < n; ++i) all.rows[i].force = x(i) * slips[i].direction;
  return true;
}

bool onlySlips(const Body& b, Constraints& all) {
  switch (all.n) {
    case 3:
      return onlySlips<3>(b, all);
    case 4:
      return onlySlips<4>(b, all);
    case 5:
      return onlySlips<5>(b, all);
    default:
      return false;
  }
}

constexpr int kMaxRows = 3 * kContactSlots;
template <int kRows, int kColumns>
using Bounded = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, 0, kRows, kColumns>;
template <int kRows>
using BoundedVector = Eigen::Matrix<double, Eigen::Dynamic, 1, 0, kRows, 1>;

void general(const Body& b, Constraints& all) {
  struct Column {
    Constraint* at;
    Vec3 direction;
    Axis row;
    Answer answer;
  };
  std::array<Column, kMaxRows> columns;
  std::size_t m = 0;
  for (Constraint& c : all) {
    if (c.stick) {
      for (int axis = 0; axis < 3; ++axis) {
        const Vec3 unit = Vec3::Unit(axis);
        columns[m++] = {&c, unit, Axis(c.r, unit), Answer(b, c.r, unit)};
      }
    } else {
      const Slip slip(b, c);
      columns[m++] = {&c, slip.direction, slip.row, slip.answer};
    }
    c.force.setZero();
  }
  Bounded<kMaxRows, kMaxRows> A(m, m);
  BoundedVector<kMaxRows> y(m);
  for (std::size_t i = 0; i < m; ++i) {
    const Column& ci = columns[i];
    y(i) = ci.row.along.dot(ci.at->change);
    for (std::size_t j = 0; j < m; ++j) A(i, j) = ci.row.of(columns[j].answer);
  }
  BoundedVector<kMaxRows> x;
  Eigen::FullPivLU<decltype(A)> full(m, m);
  full.setThreshold(kRank);
  // a body has six degrees of freedom
  const bool may_be_regular = m <= 6;
  if (may_be_regular) full.compute(A);
  if (may_be_regular && full.isInvertible()) {
    x = full.solve(y);
  } else {
    Eigen::CompleteOrthogonalDecomposition<decltype(A)> least_norm(m, m);
    least_norm.setThreshold(kRank);
    least_norm.compute(A);
    x = least_norm.solve(y);
  }
  for (std::size_t i = 0; i < m; ++i) columns[i].at->force += x(i) * columns[i].direction;
}

// Determinant of the equations of the slipping points' normals with the sticking points held, each
// row over its diagonal element; without friction, positive off-diagonal elements are left out.
double slipDeterminant(const Body& b, const Constraints& all, bool friction) {
  std::array<const Constraint*, kContactSlots> sticks{};
  std::array<Slip, kContactSlots> slips;
  std::size_t m = 0, held = 0;
  for (const Constraint& c : all) {
    if (c.stick) {
      sticks[held++] = &c;
    } else {
      slips[m] = Slip(b, c);
      if (!friction) slips[m].answer = Answer(b, c.r, c.normal);
      ++m;
    }
  }
  Bounded<kContactSlots, kContactSlots> left(m, m);
  BoundedVector<kContactSlots> own(m);
  for (std::size_t i = 0; i < m; ++i) {
    for (std::size_t j = 0; j < m; ++j) left(i, j) = slips[i].row.of(slips[j].answer);
    own(i) = left(i, i);
  }
  if (held > 0) {
    Bounded<kMaxRows, kMaxRows> W(3 * held, 3 * held);
    Bounded<kMaxRows, kContactSlots> moved(3 * held, m);
    Bounded<kContactSlots, kMaxRows> moves(m, 3 * held);
    for (std::size_t i = 0; i < held; ++i) {
      const Vec3& at = sticks[i]->r;
      for (std::size_t j = 0; j < held; ++j) {
        W.block<3, 3>(3 * i, 3 * j) = influence(b, at, sticks[j]->r);
      }
      for (std::size_t j = 0; j < m; ++j) {
        const auto& [linear, angular] = slips[j].answer;
        moved.block<3, 1>(3 * i, j) = linear + angular.cross(at);
        const Axis& row = slips[j].row;
        moves.block<1, 3>(j, 3 * i) =
            row.along / b.mass + (b.inverse_inertia.transpose() * row.moment).cross(at);
      }
    }
    Eigen::CompleteOrthogonalDecomposition<decltype(W)> least_norm(3 * held, 3 * held);
    least_norm.setThreshold(kRank);
    least_norm.compute(W);
    left -= moves * least_norm.solve(moved);
  }
  for (std::size_t i = 0; i < m; ++i) {
    left.row(i) /= own(i);
    for (std::size_t j = 0; j < m && !friction; ++j) {
      if (j != i) left(i, j) = std::max(0.0, left(i, j));
    }
  }
  return left.determinant();
}

}  // namespace

double wedgeMargin(const Body& body, const Constraints& all) {
  const auto sticks = [](const Constraint& one) { return one.stick; };
  if (all.n < 2 || std::all_of(all.begin(), all.end(), sticks)) return 1.0;
  const double wedged = slipDeterminant(body, all, true);
  if (wedged > kAmple) return 1.0;
  const double free = slipDeterminant(body, all, false);
  if (std::abs(wedged) < kRedundant && free < kRedundant) return 1.0;
  return wedged / std::max(free, kRedundant);
}

bool solveConstraints(const Body& body, Constraints& all) {
  auto& c = all.rows;
  const auto sticks = [](const Constraint& one) { return one.stick; };
  const auto sticking = std::count_if(all.begin(), all.end(), sticks);
  if (all.n >= 3 && sticking == static_cast<long>(all.n) && body.symmetric && held(body, all)) {
    return false;
  }
  if (all.n == 1 && c[0].stick) {
    c[0].force = influence(body, c[0].r, c[0].r).inverse() * c[0].change;
  } else if (all.n == 1) {
    oneSlip(body, c[0]);
  } else if (all.n == 2 && c[0].stick && c[1].stick && body.symmetric) {
    hinge(body, c[0], c[1]);
  } else if (all.n == 2 && c[0].stick != c[1].stick) {
    stickAndSlip(body, c[c[0].stick ? 0 : 1], c[c[0].stick ? 1 : 0]);
  } else if (all.n == 2 && !c[0].stick) {
    return twoSlips(body, c[0], c[1]);
  } else if (all.n > 0 && (sticking > 0 || !onlySlips(body, all))) {
    general(body, all);
  }
  return all.n < 2;
}

}  // namespace assembly_cell
