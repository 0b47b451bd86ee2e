// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "contact_algebra.h"

#include <Eigen/LU>
#include <Eigen/QR>
#include <algorithm>
#include <array>

#include "assembly_cell/dynamics/simulation.h"

namespace assembly_cell {
namespace {

using Mat3 = Eigen::Matrix3d;
using Vec3 = Eigen::Vector3d;
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
  const auto inertia = [&b](const Vec3& angular) -> Vec3 {
    return b.inertia_transverse * angular +
           (b.inertia_axial - b.inertia_transverse) * b.axis.dot(angular) * b.axis;
  };
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

void general(const Body& b, Constraint* c, int n) {
  constexpr int kMost = 3 * kSlots;
  struct Column {
    int point;
    Vec3 row, direction;
  };
  std::array<Column, kMost> columns;
  int m = 0;
  for (int i = 0; i < n; ++i) {
    if (c[i].stick) {
      for (int axis = 0; axis < 3; ++axis) {
        columns[static_cast<std::size_t>(m++)] = {i, Vec3::Unit(axis), Vec3::Unit(axis)};
      }
    } else {
      columns[static_cast<std::size_t>(m++)] = {i, c[i].normal, slipDirection(b, c[i])};
    }
    c[i].force.setZero();
  }
  Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, 0, kMost, kMost> A(m, m);
  Eigen::Matrix<double, Eigen::Dynamic, 1, 0, kMost, 1> y(m);
  for (int i = 0; i < m; ++i) {
    const Column& ci = columns[static_cast<std::size_t>(i)];
    y(i) = ci.row.dot(c[ci.point].change);
    for (int j = 0; j < m; ++j) {
      const Column& cj = columns[static_cast<std::size_t>(j)];
      A(i, j) = ci.row.dot(response(b, c[ci.point].r, c[cj.point].r, cj.direction));
    }
  }
  Eigen::CompleteOrthogonalDecomposition<decltype(A)> least_norm(m, m);
  least_norm.setThreshold(kRank);
  least_norm.compute(A);
  const Eigen::Matrix<double, Eigen::Dynamic, 1, 0, kMost, 1> x = least_norm.solve(y);
  for (int i = 0; i < m; ++i) {
    const Column& ci = columns[static_cast<std::size_t>(i)];
    c[ci.point].force += x(i) * ci.direction;
  }
}

// The equations of the slipping points' normals once the sticking ones are held, rows over their
// own coefficient; without friction less what makes points part when another one is pressed.
using Slips = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, 0, kSlots, kSlots>;
double slipDeterminant(const Body& b, const Constraint* c, int n, bool friction) {
  std::array<const Constraint*, kSlots> slips{}, sticks{};
  Eigen::Index m = 0, held = 0;
  for (int i = 0; i < n; ++i) {
    (c[i].stick ? sticks[static_cast<std::size_t>(held++)] : slips[static_cast<std::size_t>(m++)]) =
        &c[i];
  }
  std::array<Vec3, kSlots> directions;
  for (Eigen::Index i = 0; i < m; ++i) {
    const auto k = static_cast<std::size_t>(i);
    directions[k] = friction ? slipDirection(b, *slips[k]) : slips[k]->normal;
  }
  Slips left(m, m);
  Eigen::Matrix<double, Eigen::Dynamic, 1, 0, kSlots, 1> own(m);
  for (Eigen::Index i = 0; i < m; ++i) {
    const Constraint& row = *slips[static_cast<std::size_t>(i)];
    for (Eigen::Index j = 0; j < m; ++j) {
      const auto k = static_cast<std::size_t>(j);
      left(i, j) = row.normal.dot(response(b, row.r, slips[k]->r, directions[k]));
    }
    own(i) = left(i, i);
  }
  if (held > 0) {
    constexpr int kMost = 3 * kSlots;
    Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, 0, kMost, kMost> W(3 * held, 3 * held);
    Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, 0, kMost, kSlots> moved(3 * held, m);
    Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, 0, kSlots, kMost> moves(m, 3 * held);
    for (Eigen::Index i = 0; i < held; ++i) {
      const Vec3& at = sticks[static_cast<std::size_t>(i)]->r;
      for (Eigen::Index j = 0; j < held; ++j) {
        W.block<3, 3>(3 * i, 3 * j) = influence(b, at, sticks[static_cast<std::size_t>(j)]->r);
      }
      for (Eigen::Index j = 0; j < m; ++j) {
        const auto k = static_cast<std::size_t>(j);
        moved.block<3, 1>(3 * i, j) = response(b, at, slips[k]->r, directions[k]);
        moves.block<1, 3>(j, 3 * i) = slips[k]->normal.transpose() * influence(b, slips[k]->r, at);
      }
    }
    Eigen::CompleteOrthogonalDecomposition<decltype(W)> least_norm(3 * held, 3 * held);
    least_norm.setThreshold(kRank);
    least_norm.compute(W);
    left -= moves * least_norm.solve(moved);
  }
  for (Eigen::Index i = 0; i < m; ++i) {
    left.row(i) /= own(i);
    for (Eigen::Index j = 0; j < m && !friction; ++j) {
      if (j != i) left(i, j) = std::max(0.0, left(i, j));
    }
  }
  return left.determinant();
}

}  // namespace

double wedgeMargin(const Body& body, const Constraint* c, int n) {
  if (n < 2 || std::all_of(c, c + n, [](const Constraint& one) { return one.stick; })) return 1.0;
  const double wedged = slipDeterminant(body, c, n, true);
  if (wedged > kAmple) return 1.0;
  const double free = slipDeterminant(body, c, n, false);
  if (std::abs(wedged) < kRedundant && free < kRedundant) return 1.0;
  return wedged / std::max(free, kRedundant);
}

bool solveConstraints(const Body& body, Constraint* c, int n) {
  if (n == 1 && c[0].stick) {
    c[0].force = influence(body, c[0].r, c[0].r).inverse() * c[0].change;
  } else if (n == 1) {
    oneSlip(body, c[0]);
  } else if (n == 2 && c[0].stick && c[1].stick && body.symmetric) {
    hinge(body, c[0], c[1]);
  } else if (n == 2 && c[0].stick != c[1].stick) {
    stickAndSlip(body, c[c[0].stick ? 0 : 1], c[c[0].stick ? 1 : 0]);
  } else if (n == 2 && !c[0].stick) {
    return twoSlips(body, c[0], c[1]);
  } else if (n > 0) {
    general(body, c, n);
  }
  return n < 2;
}

}  // namespace assembly_cell
