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
// Ranks are clear: no result changes at half or twice of any of these.
constexpr double kRank = 1e-10;       // relative pivots below this are redundant rows
constexpr double kPainleve = 1e-3;    // of 1/mass: normal response to the force of a slipping point
constexpr double kAmple = 0.1;        // a determinant over this is far from zero
constexpr double kRedundant = 1e-9;   // below this so is what friction makes of it
constexpr double kCoincident = 1e-9;  // points closer than this are one [m]

// the response of all force components at s: 1/m − [r] B [s]
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

// a slipping point's direction, or its normal beyond Painlevé's bound
Vec3 slipDirection(const Body& b, const Constraint& c) {
  const double own = c.normal.dot(response(b, c.r, c.r, c.direction));
  return own > kPainleve / b.mass ? c.direction : c.normal;
}

void oneSlip(const Body& b, Constraint& c) {
  const Vec3 d = slipDirection(b, c);
  c.force = c.normal.dot(c.change) / c.normal.dot(response(b, c.r, c.r, d)) * d;
}

// true: far from wedging each other
bool twoSlips(const Body& b, Constraint& one, Constraint& two) {
  const Vec3 d1 = slipDirection(b, one), d2 = slipDirection(b, two);
  const double a11 = one.normal.dot(response(b, one.r, one.r, d1));
  const double a12 = one.normal.dot(response(b, one.r, two.r, d2));
  const double a21 = two.normal.dot(response(b, two.r, one.r, d1));
  const double a22 = two.normal.dot(response(b, two.r, two.r, d2));
  const double c1 = one.normal.dot(one.change), c2 = two.normal.dot(two.change);
  const double determinant = a11 * a22 - a12 * a21;
  if (std::abs(determinant) < kRank * a11 * a22) {
    // the same row twice: each carries half
    one.force = c1 / (a11 + a12) * d1;
    two.force = c2 / (a21 + a22) * d2;
    return true;
  }
  one.force = (c1 * a22 - a12 * c2) / determinant * d1;
  two.force = (a11 * c2 - a21 * c1) / determinant * d2;
  return determinant > kAmple * a11 * a22;
}

void stickAndSlip(const Body& b, Constraint& stick, Constraint& slip) {
  const Vec3 d = slipDirection(b, slip);
  const Mat3 W = influence(b, stick.r, stick.r).inverse();
  const Vec3 on_stick = W * response(b, stick.r, slip.r, d), alone = W * stick.change;
  const double self = slip.normal.dot(response(b, slip.r, slip.r, d));
  const double left = self - slip.normal.dot(response(b, slip.r, stick.r, on_stick));
  const double asked =
      slip.normal.dot(slip.change) - slip.normal.dot(response(b, slip.r, stick.r, alone));
  const double N = std::abs(left) > kRank * std::abs(self) ? asked / left : 0.0;
  slip.force = N * d;
  stick.force = alone - N * on_stick;
}

Vec3 angularMomentum(const Body& b, const Vec3& angular) {
  return b.inertia_transverse * angular +
         (b.inertia_axial - b.inertia_transverse) * b.axis.dot(angular) * b.axis;
}

// two sticking points leave one freedom, the turn about the line through them
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
  // angular change across the line from the difference of the two points, along it from the
  // balance of moments: contact forces have none about the line
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

// Three sticking points hold the body: its change by least squares, then the least forces that make
// it. False where they are on a line.
bool held(const Body& b, Constraints& all) {
  Vec3 middle = Vec3::Zero(), mean = Vec3::Zero(), turning = Vec3::Zero();
  for (const Constraint& c : all) {
    middle += c.r / 3.0;
    mean += c.change / 3.0;
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
  for (Constraint& c : all) c.force = force / 3.0 + around.cross(c.r - middle);
  return true;
}

// false where the points are redundant
bool threeSlips(const Body& b, Constraints& all) {
  std::array<Vec3, 3> directions;
  Mat3 A;
  Vec3 y;
  for (int i = 0; i < 3; ++i) directions[i] = slipDirection(b, all.rows[i]);
  for (int i = 0; i < 3; ++i) {
    const Constraint& c = all.rows[i];
    y(i) = c.normal.dot(c.change);
    for (int j = 0; j < 3; ++j) {
      A(i, j) = c.normal.dot(response(b, c.r, all.rows[j].r, directions[j]));
    }
  }
  const double size = A.cwiseAbs().maxCoeff();
  if (!(std::abs(A.determinant()) > kRank * size * size * size)) return false;
  const Vec3 x = A.inverse() * y;
  for (int i = 0; i < 3; ++i) all.rows[i].force = x(i) * directions[i];
  return true;
}

constexpr int kMaxRows = 3 * kContactSlots;
template <int kRows, int kColumns>
using Bounded = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, 0, kRows, kColumns>;
template <int kRows>
using BoundedVector = Eigen::Matrix<double, Eigen::Dynamic, 1, 0, kRows, 1>;

void general(const Body& b, Constraints& all) {
  struct Column {
    Constraint* at;
    Vec3 row, direction;
  };
  std::array<Column, kMaxRows> columns;
  std::size_t m = 0;
  for (Constraint& c : all) {
    if (c.stick) {
      for (int axis = 0; axis < 3; ++axis) {
        columns[m++] = {&c, Vec3::Unit(axis), Vec3::Unit(axis)};
      }
    } else {
      columns[m++] = {&c, c.normal, slipDirection(b, c)};
    }
    c.force.setZero();
  }
  Bounded<kMaxRows, kMaxRows> A(m, m);
  BoundedVector<kMaxRows> y(m);
  for (std::size_t i = 0; i < m; ++i) {
    const Column& ci = columns[i];
    y(i) = ci.row.dot(ci.at->change);
    for (std::size_t j = 0; j < m; ++j) {
      A(i, j) = ci.row.dot(response(b, ci.at->r, columns[j].at->r, columns[j].direction));
    }
  }
  BoundedVector<kMaxRows> x;
  Eigen::FullPivLU<decltype(A)> full(m, m);
  full.setThreshold(kRank);
  full.compute(A);
  if (full.isInvertible()) {
    x = full.solve(y);
  } else {
    Eigen::CompleteOrthogonalDecomposition<decltype(A)> least_norm(m, m);
    least_norm.setThreshold(kRank);
    least_norm.compute(A);
    x = least_norm.solve(y);
  }
  for (std::size_t i = 0; i < m; ++i) columns[i].at->force += x(i) * columns[i].direction;
}

// The equations of the slipping points' normals once the sticking ones are held, rows over their
// own coefficient; without friction less what makes points part when another one is pressed.
double slipDeterminant(const Body& b, const Constraints& all, bool friction) {
  std::array<const Constraint*, kContactSlots> slips{}, sticks{};
  std::array<Vec3, kContactSlots> directions;
  std::size_t m = 0, held = 0;
  for (const Constraint& c : all) {
    if (c.stick) {
      sticks[held++] = &c;
    } else {
      directions[m] = friction ? slipDirection(b, c) : c.normal;
      slips[m++] = &c;
    }
  }
  Bounded<kContactSlots, kContactSlots> left(m, m);
  BoundedVector<kContactSlots> own(m);
  for (std::size_t i = 0; i < m; ++i) {
    for (std::size_t j = 0; j < m; ++j) {
      left(i, j) = slips[i]->normal.dot(response(b, slips[i]->r, slips[j]->r, directions[j]));
    }
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
        moved.block<3, 1>(3 * i, j) = response(b, at, slips[j]->r, directions[j]);
        moves.block<1, 3>(j, 3 * i) = slips[j]->normal.transpose() * influence(b, slips[j]->r, at);
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
  if (all.face) {
    const auto sticks = [](const Constraint& one) { return one.stick; };
    const auto sticking = std::count_if(all.begin(), all.end(), sticks);
    if (sticking == 3 && body.symmetric && held(body, all)) return false;
    if (sticking == 0 && threeSlips(body, all)) return false;
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
  } else if (all.n > 0) {
    general(body, all);
  }
  return all.n < 2;
}

}  // namespace assembly_cell
