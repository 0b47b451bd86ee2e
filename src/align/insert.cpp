// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include <algorithm>
#include <cmath>

#include "assembly_cell/align/search.h"

namespace assembly_cell {
namespace {

using Vec3 = Eigen::Vector3d;

constexpr double kFollow = 0.3;     // of the coupling's strain that the carrier takes out a block
constexpr double kStepForce = 0.8;  // of the force that stops the peg, in one block against a floor
constexpr double kStuckTime = 0.4;  // without a step down [s]
constexpr double kProgress = 5e-5;  // that is a step down [m]
constexpr double kBackOut = 1e-3;   // the first time, then twice as far each time [m]
constexpr double kRelaxTime = 0.2;  // between a way up and the next one down [s]
constexpr int kBackOuts = 6;        // before it is said to jam
constexpr std::size_t kTold = 5;    // steps of the profile between two words of progress
constexpr double kProfileStep = 1e-3;  // [m]

}  // namespace

// One block in the bore: down (or up) by so much along the peg's axis, the carrier following the
// coupling's strain sideways and in tilt about the peg's end, so that the walls lead the peg and
// not the estimate of their place. What is felt at the block's end.
BoreReading Search::moveInBore(double down) {
  const RestPose& carrier = press_.last().carrier;
  const Vector6 strained = deflection();
  const Vec3 axis = in_bore_.R.col(2);
  Vec3 aside = pegPose(carrier, strained).p - pegPose(carrier, hanging_).p;
  aside -= axis * axis.dot(aside);
  Vec3 turn = carrierPose().R * (strained - hanging_).tail<3>();
  turn -= axis * axis.dot(turn);
  in_bore_.p += kFollow * aside - down * axis;
  in_bore_.R = rotationFromVector({Vec3(kFollow * turn)}) * in_bore_.R;
  PlantCommand command;
  command.rest = restFor(in_bore_.p, in_bore_.R);
  press_.step(command);

  const Vector6 d = deflection();
  const Vector6 wrench = tipWrench(press_.wrench(), d);
  BoreReading felt;
  felt.depth = hole_.height - hole_.normal.dot(pegPose(press_.last().carrier, d).p);
  felt.along = wrench(2);
  felt.sideways = wrench.head<2>().norm();
  felt.moment = wrench.segment<2>(3).norm();
  inserted_.force = std::max(inserted_.force, felt.force());
  inserted_.end = felt;
  return felt;
}

// Up by so much, then until the walls let go.
void Search::backOutOfBore(double travel) {
  const double step = p_.insert.speed * block_;
  for (double up = 0.0; up < travel; up += step) moveInBore(-std::min(step, travel - up));
  for (int i = 0; i < blocks(kRelaxTime); ++i) moveInBore(0.0);
}

// Down until the depth is reached (true) or the peg is stuck.
bool Search::lowerInBore() {
  const InsertParameters& p = p_.insert;
  const double stiffness = mechanism_.coupling.stiffness.diagonal(0);
  const double step = std::min(p.speed * block_, kStepForce * p.force / stiffness);
  const int patience = blocks(kStuckTime);
  double deepest = -1e9;
  for (int waited = 0; waited < patience; ++waited) {
    const double share = std::clamp(1.0 - inserted_.end.force() / p.force, -0.5, 1.0);
    const BoreReading felt = moveInBore(step * share);
    if (felt.depth > deepest + kProgress) {
      deepest = felt.depth;
      waited = 0;
    }
    const double mark = kProfileStep * static_cast<double>(inserted_.profile.size());
    if (felt.depth >= mark) {
      inserted_.profile.push_back(felt);
      if (inserted_.profile.size() % kTold == 1) {
        report("insert", text("%.1f mm deep, %.1f N", felt.depth * 1e3, felt.force()));
      }
    }
    if (felt.depth >= p.depth) return true;
  }
  return false;
}

// From the edge in the hole to the depth; the force stays bounded, the walls lead.
void Search::insert() {
  const double start = press_.last().time;
  in_bore_ = pegPose(press_.target(), Vector6::Zero());
  moveInBore(0.0);
  double travel = kBackOut;
  while (!lowerInBore()) {
    const BoreReading stuck = inserted_.end;
    report("jam", text("stuck %.2f mm deep", stuck.depth * 1e3) +
                      text(", %.1f N along, %.1f N sideways", stuck.along, stuck.sideways));
    if (inserted_.backed_out == kBackOuts) {
      inserted_.time = press_.last().time - start;
      throw AlignError(AlignFailure::kJammed,
                       text("stuck %.2f mm deep after %.0f ways up", stuck.depth * 1e3, kBackOuts));
    }
    ++inserted_.backed_out;
    backOutOfBore(std::min(travel, stuck.depth));
    travel *= 2.0;
  }
  for (int i = 0; i < blocks(kRelaxTime); ++i) moveInBore(0.0);
  inserted_.seated = true;
  inserted_.time = press_.last().time - start;
  report("seated",
         text("%.2f mm deep, greatest force %.1f N", inserted_.end.depth * 1e3, inserted_.force));
}

}  // namespace assembly_cell
