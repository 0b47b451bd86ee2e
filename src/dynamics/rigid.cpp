// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
// What the rigid law adds: impacts, and the projection of closed contacts.
#include <algorithm>

#include "assembly_cell/dynamics/simulation.h"
#include "contact_algebra.h"

namespace assembly_cell {
namespace {

using Vec3 = Eigen::Vector3d;
constexpr int kPasses = 24;
constexpr double kSlipTolerance = 1e-12;  // post-impact slip below this has no direction [m/s]

}  // namespace

// impulses at points of the peg change its velocities
void Simulation::applyImpulse(const Kinematics& k, const Vec3& impulse, const Vec3& moment) {
  Vector9 generalised = Vector9::Zero();
  generalised.head<3>() = impulse;
  generalised.segment<3>(3) = k.Re.transpose() * moment;
  state_.v += solveMass(scenario_, k, generalised);
}

// Plastic impact over all closed points: no point approaches afterwards, impulses only push,
// Coulomb's law with the sliding coefficient on the slip after the impact. Points are tried as
// sticking first; the worst offender changes until none is left. Dynamics specification section 4C.
void Simulation::impact() {
  const Kinematics k = kinematics(state_);
  locate(k, slots_);
  enum class Kind { kNone, kStick, kSlip };
  std::array<Kind, kSlots> kind{};
  std::array<Vec3, kSlots> friction{}, impulse{};
  for (std::size_t i = 0; i < kSlots; ++i) {
    const Slot& s = slots_[i];
    kind[i] = s.mode != Mode::kApart && s.point.valid ? Kind::kStick : Kind::kNone;
    friction[i].setZero();
  }
  const double mu = scenario_.friction.sliding_coefficient;
  const auto velocityAfter = [&](std::size_t i) {
    Vec3 v = slots_[i].velocity;
    for (std::size_t j = 0; j < kSlots; ++j) {
      if (kind[j] != Kind::kNone) {
        v += influence(scenario_.peg, k.a, slots_[i].r, slots_[j].r) * impulse[j];
      }
    }
    return v;
  };

  for (int pass = 0; pass < kPasses; ++pass) {
    // one unknown for a slipping point, three for a sticking one
    struct Column {
      std::size_t slot;
      Vec3 row, direction;
    };
    std::array<Column, 3 * kSlots> columns;
    int n = 0;
    for (std::size_t i = 0; i < kSlots; ++i) {
      impulse[i].setZero();
      if (kind[i] == Kind::kSlip) {
        const Vec3& normal = slots_[i].point.normal;
        columns[static_cast<std::size_t>(n++)] = {i, normal, normal + mu * friction[i]};
      } else if (kind[i] == Kind::kStick) {
        for (int axis = 0; axis < 3; ++axis) {
          columns[static_cast<std::size_t>(n++)] = {i, Vec3::Unit(axis), Vec3::Unit(axis)};
        }
      }
    }
    if (n == 0) break;
    Small<3 * kSlots> A(n, n);
    SmallVector<3 * kSlots> b(n);
    for (int i = 0; i < n; ++i) {
      const Column& ci = columns[static_cast<std::size_t>(i)];
      b(i) = -ci.row.dot(slots_[ci.slot].velocity);
      for (int j = 0; j < n; ++j) {
        const Column& cj = columns[static_cast<std::size_t>(j)];
        A(i, j) = ci.row.dot(influence(scenario_.peg, k.a, slots_[ci.slot].r, slots_[cj.slot].r) *
                             cj.direction);
      }
    }
    A.diagonal() *= 1.0 + kShift;
    const SmallVector<3 * kSlots> x = A.partialPivLu().solve(b);
    for (int i = 0; i < n; ++i) {
      const Column& c = columns[static_cast<std::size_t>(i)];
      impulse[c.slot] += x(i) * c.direction;
    }

    // pulled, beyond the cone, slip direction wrong, or left out but approaching
    std::size_t worst = kSlots;
    Kind change = Kind::kNone;
    double excess = 0.0;
    for (std::size_t i = 0; i < kSlots; ++i) {
      if (kind[i] == Kind::kNone) continue;
      const double N = slots_[i].point.normal.dot(impulse[i]);
      if (N < -std::max(excess, 1e-15)) {
        excess = -N;
        worst = i;
        change = Kind::kNone;
      }
    }
    bool turned = false;
    if (worst == kSlots) {
      for (std::size_t i = 0; i < kSlots; ++i) {
        const Vec3& normal = slots_[i].point.normal;
        if (kind[i] == Kind::kStick) {
          const double N = normal.dot(impulse[i]);
          const Vec3 tangential = impulse[i] - N * normal;
          if (tangential.norm() - mu * N > std::max(excess, 1e-12 * tangential.norm())) {
            excess = tangential.norm() - mu * N;
            worst = i;
            change = Kind::kSlip;
            friction[i] = tangential.normalized();
          }
        } else if (kind[i] == Kind::kSlip) {
          Vec3 slip = velocityAfter(i);
          slip -= normal * normal.dot(slip);
          if (slip.norm() > kSlipTolerance) {
            const Vec3 opposed = -slip.normalized();
            if ((opposed - friction[i]).norm() > 1e-9) {
              // half way, so that a direction that swings settles
              friction[i] = (opposed + friction[i]).norm() > 0.1
                                ? Vec3((opposed + friction[i]).normalized())
                                : opposed;
              turned = true;
            }
          }
        }
      }
    }
    if (worst < kSlots) {
      kind[worst] = change;
      continue;
    }
    if (turned) continue;
    bool rejoined = false;
    for (std::size_t i = 0; i < kSlots && pass < kPasses / 2; ++i) {
      const Slot& s = slots_[i];
      if (kind[i] != Kind::kNone || s.mode == Mode::kApart || !s.point.valid) continue;
      if (s.point.normal.dot(velocityAfter(i)) < -1e-12) {
        kind[i] = Kind::kStick;
        rejoined = true;
      }
    }
    if (!rejoined) break;
  }

  Vec3 total = Vec3::Zero(), moment = Vec3::Zero();
  for (std::size_t i = 0; i < kSlots; ++i) {
    if (kind[i] == Kind::kNone) continue;
    total += impulse[i];
    moment += slots_[i].r.cross(impulse[i]);
  }
  applyImpulse(k, total, moment);
  // who leaves is apart at once
  locate(kinematics(state_), slots_);
  for (Slot& s : slots_) {
    if (s.mode != Mode::kApart && s.point.valid && s.gap_rate > 1e-9) s.mode = Mode::kApart;
  }
}

// Closed contacts stay closed: gaps, gap rates and the slip of resting points are put to zero by
// the smallest correction in the metric of the kinetic energy.
void Simulation::project() {
  const Kinematics k = kinematics(state_);
  struct Row {
    const Slot* slot;
    Vec3 direction;
    double velocity;
  };
  std::array<Row, 3 * kSlots> rows;
  int n = 0, normals = 0;
  const auto closed = [](const Slot& s) {
    return (s.mode == Mode::kSlip || s.mode == Mode::kStick) && s.point.valid;
  };
  for (const Slot& s : slots_) {
    if (closed(s)) rows[static_cast<std::size_t>(n++)] = {&s, s.point.normal, s.gap_rate};
  }
  normals = n;
  if (normals == 0) return;
  for (const Slot& s : slots_) {
    if (!closed(s) || s.mode != Mode::kStick) continue;
    const Vec3 one = s.point.normal.unitOrthogonal(), two = s.point.normal.cross(one);
    rows[static_cast<std::size_t>(n++)] = {&s, one, one.dot(s.velocity)};
    rows[static_cast<std::size_t>(n++)] = {&s, two, two.dot(s.velocity)};
  }
  Small<3 * kSlots> A(n, n);
  SmallVector<3 * kSlots> b(n);
  for (int i = 0; i < n; ++i) {
    const Row& ri = rows[static_cast<std::size_t>(i)];
    b(i) = -ri.velocity;
    for (int j = 0; j < n; ++j) {
      const Row& rj = rows[static_cast<std::size_t>(j)];
      A(i, j) =
          ri.direction.dot(influence(scenario_.peg, k.a, ri.slot->r, rj.slot->r) * rj.direction);
    }
  }
  A.diagonal() *= 1.0 + kShift;

  // positions by the normal rows alone
  const Small<3 * kSlots> An = A.topLeftCorner(normals, normals);
  SmallVector<3 * kSlots> gaps(normals);
  for (int i = 0; i < normals; ++i) gaps(i) = -rows[static_cast<std::size_t>(i)].slot->point.gap;
  const SmallVector<3 * kSlots> lift = An.partialPivLu().solve(gaps);
  const SmallVector<3 * kSlots> push = A.partialPivLu().solve(b);

  Vector9 shift = Vector9::Zero();
  Vec3 impulse = Vec3::Zero(), moment = Vec3::Zero();
  for (int i = 0; i < n; ++i) {
    const Row& r = rows[static_cast<std::size_t>(i)];
    impulse += push(i) * r.direction;
    moment += push(i) * r.slot->r.cross(r.direction);
    if (i >= normals) continue;
    shift.head<3>() += lift(i) * r.direction;
    shift.segment<3>(3) += lift(i) * (k.Re.transpose() * r.slot->r.cross(r.direction));
  }
  applyImpulse(k, impulse, moment);
  state_.q += solveMass(scenario_, k, shift);
}

}  // namespace assembly_cell
