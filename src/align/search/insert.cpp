// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include <algorithm>
#include <cmath>

#include "assembly_cell/align/search/search.h"

namespace assembly_cell {
namespace {

using Vec3 = Eigen::Vector3d;

constexpr double kFollow = 0.3;     // of the coupling's strain that the carrier takes out a block
constexpr double kStuckTime = 0.4;  // without a step down [s]
constexpr double kProgress = 5e-5;  // that is a step down [m]
constexpr double kBackOut = 1e-3;   // the first time, then twice as far each time [m]
constexpr double kPull = 0.6;       // of the force limit, on the way up
constexpr double kPullStep = 0.25;  // of that pull, in one block
constexpr double kRelaxTime = 0.2;  // between a way up and the next one down [s]
constexpr double kFarIn = 2.0;      // times as deep as an entry is what doesn't stand on the face
constexpr double kOver = 6e-3;      // more, before the way aside [m]
constexpr double kOut = 2e-3;       // above the face is out of the hole [m]
constexpr int kBackOuts = 6;        // before it is said to jam
constexpr std::size_t kTold = 5;    // steps of the profile between two words of progress
constexpr double kProfileStep = 1e-3;  // [m]

constexpr double kWallFelt = 0.3;    // of a wall that pushes; lengths and forces as Scale's [N]
constexpr double kLeverArm = 5e-3;   // of the mouth that tells two points from one [m]
constexpr double kFloorForce = 5.0;  // along the axis: perhaps the floor [N]
constexpr double kFloorStep = 2.0;   // force of a block's step near the drawn floor [N]
constexpr double kNear = 2e-3;       // over the drawn floor [m]
constexpr double kDrawn = 1e-3;      // the felt floor may lie above the drawn one [m]
constexpr double kLift = 2e-4;       // off the floor and down again [m]
constexpr double kSlack = 2.0;       // or of the coupling's strain, where that is more
constexpr double kLetsGo = 0.3;      // of the force, after the lift: less
constexpr double kPressStep = 0.5;   // force of a block's step on the way back [N]
constexpr double kSame = 5e-5;       // the floor twice [m]
constexpr double kFloorShare = 0.5;  // of the stiffness of a press on the peg's edge, at least
constexpr double kMachine = 1e-5;    // that a carrier of mismatch level 3 gives way by [m/N]
constexpr double kRestForce = 1.0;   // on the floor at the end [N]
constexpr int kMeanBlocks = 5;
constexpr int kEaseBlocks = 50;

double highestFloor(const Mechanism& mechanism, const Scale& scale) {
  return mechanism.hole.depth - kDrawn * scale.room;
}

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
  felt.walls = wallsFelt(wrench, felt.depth);
  inserted_.force = std::max(inserted_.force, felt.force());
  inserted_.end = felt;
  return felt;
}

// The bore pushes the peg at its end, at the mouth or at both: at the mouth by the moment about the
// end over the depth, at the end by the rest.
int Search::wallsFelt(const Vector6& wrench, double depth) const {
  const double least = kWallFelt * scale_.force;
  if (depth < kLeverArm * scale_.length) return wrench.head<2>().norm() > least ? 1 : 0;
  const Eigen::Vector2d mouth = Eigen::Vector2d(wrench(4), -wrench(3)) / depth;
  const Eigen::Vector2d end = wrench.head<2>() - mouth;
  return (mouth.norm() > least ? 1 : 0) + (end.norm() > least ? 1 : 0);
}

// What was felt last against a way down (1) or up (-1): a strain along it helps. [N]
double Search::against(double way) const {
  return std::hypot(std::max(0.0, way * inserted_.end.along), inserted_.end.sideways);
}

// Up by so much, or as far as a bounded pull takes the peg, then until the walls let go.
void Search::backOutOfBore(double travel) {
  const double pull = kPull * p_.force_limit;
  // what is felt is a block and a half late
  const double step = std::min(p_.insert.speed * block_,
                               kPullStep * pull / mechanism_.coupling.stiffness.diagonal(0));
  const double from = inserted_.end.depth;
  double least = from;
  for (int waited = 0; from - inserted_.end.depth < travel && waited < blocks(kStuckTime);
       ++waited) {
    moveInBore(-step * std::clamp(1.0 - against(-1.0) / pull, -0.5, 1.0));
    if (inserted_.end.depth > least - kProgress) continue;
    least = inserted_.end.depth;
    waited = 0;
  }
  for (int i = 0; i < blocks(kRelaxTime); ++i) moveInBore(0.0);
}

// Down until the depth is reached, the peg is stuck or something resists where the floor may be.
Search::BoreEnd Search::lowerInBore() {
  const InsertParameters& p = p_.insert;
  const double stiffness = mechanism_.coupling.stiffness.diagonal(0);
  // against a floor no more in one block than the force that stops the peg
  const double step = std::min(p.speed * block_, p.force / stiffness);
  const double careful = std::min(step, kFloorStep * scale_.force * pressCompliance(mechanism_));
  const double near = mechanism_.hole.depth - kNear * scale_.room;
  const int patience = blocks(kStuckTime);
  if (!p.floor && inserted_.end.depth >= p.depth) return BoreEnd::kDeep;  // from the start
  double deepest = -1e9;
  for (int waited = 0; waited < patience; ++waited) {
    const double share = std::clamp(1.0 - against(1.0) / p.force, -0.5, 1.0);
    const BoreReading felt =
        moveInBore((p.floor && inserted_.end.depth > near ? careful : step) * share);
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
    // farther up it's the swing of a heavy peg, or walls
    if (p.floor && felt.depth > highestFloor(mechanism_, scale_) &&
        felt.along > std::min(kFloorForce * scale_.force, 0.5 * p.force)) {
      return BoreEnd::kResisted;
    }
    if (!p.floor && felt.depth >= p.depth) return BoreEnd::kDeep;
    if (p.floor && felt.depth > mechanism_.hole.depth + kDrawn * scale_.room) {
      throw AlignError(AlignFailure::kNotSeated,
                       text("no floor felt down to %.2f mm, the drawing has it at %.2f mm",
                            felt.depth * 1e3, mechanism_.hole.depth * 1e3));
    }
  }
  return BoreEnd::kStuck;
}

// Mean over some blocks, at rest.
BoreReading Search::feelInBore() {
  for (int i = 0; i < blocks(kRelaxTime); ++i) moveInBore(0.0);
  BoreReading mean;
  for (int i = 0; i < kMeanBlocks; ++i) {
    const BoreReading felt = moveInBore(0.0);
    mean.depth += felt.depth / kMeanBlocks;
    mean.along += felt.along / kMeanBlocks;
    mean.sideways += felt.sideways / kMeanBlocks;
    mean.moment += felt.moment / kMeanBlocks;
  }
  return mean;
}

// Off what resists and on it again: as high as before, and as stiff as a press on the peg's edge.
// Friction of walls holds a peg on the way up, too, and gives way on the way down.
bool Search::pressAgain(const BoreReading& pressed) {
  const double compliance = pressCompliance(mechanism_);
  const double lift = std::max(kLift * scale_.room, kSlack * pressed.along * compliance);
  const double step = kPressStep * scale_.force * compliance;
  for (double up = 0.0; up < lift; up += step) moveInBore(-step);
  const BoreReading free = feelInBore();
  if (std::abs(free.along) > kLetsGo * pressed.along) return false;
  const double touches = free.along + kLetsGo * (pressed.along - free.along);
  double down = 0.0, before = 0.0, rise = 0.0, way = 0.0;
  for (const double most = 2.0 * lift + pressed.along * compliance;
       inserted_.end.along < pressed.along;) {
    if (down > most) return false;
    before = inserted_.end.along;
    moveInBore(step);
    down += step;
    if (before < touches) continue;
    rise += inserted_.end.along - before;
    way += step;
  }
  report("floor",
         text("again at %.3f mm after %.3f mm", inserted_.end.depth * 1e3, pressed.depth * 1e3) +
             text(", %.0f N/mm of %.0f", way > 0.0 ? 1e-3 * rise / way : 0.0, 1e-3 / compliance));
  if (!(way > 0.0 && rise * (compliance + kMachine) > kFloorShare * way)) return false;
  const auto same = [&](const BoreReading& felt) {
    return std::abs(felt.depth - pressed.depth) < kSame * scale_.room;
  };
  // a soft coupling's step is more than that, and what is felt is a block and a half late
  return same(inserted_.end) || same(feelInBore());
}

// Whether what resists along the axis is the floor: where the drawing has one, more than the
// friction of all walls that are felt, and there again after a lift.
bool Search::onFloor() {
  const BoreReading pressed = feelInBore();
  report("floor", text("%.2f mm deep, %.1f N along", pressed.depth * 1e3, pressed.along) +
                      text(", %.1f N sideways, %.3f N m", pressed.sideways, pressed.moment));
  if (pressed.depth < highestFloor(mechanism_, scale_)) return false;
  // the floor's own moment is that of a force on the peg's edge at most
  const double arm = std::max(0.0, pressed.moment - mechanism_.peg.radius * pressed.along);
  const double walls = pressed.sideways + 2.0 * arm / pressed.depth;
  if (pressed.along < 2.0 * mechanism_.friction.static_coefficient * walls) return false;
  if (!pressAgain(pressed)) return false;
  const double step = kPressStep * scale_.force * pressCompliance(mechanism_);
  for (int i = 0; i < kEaseBlocks && inserted_.end.along > kRestForce * scale_.force; ++i) {
    moveInBore(-step);
  }
  return true;
}

// Shaken at the peg's own swing sideways in its coupling, where a newton moves it most; friction
// then points along the shaking rather than against the way down.
void Search::shakeInBore(double amplitude) {
  const double stiffness = std::min(mechanism_.coupling.stiffness.diagonal(1),
                                    mechanism_.coupling.stiffness.diagonal(2));
  const double frequency = p_.exciter_frequency > 0.0 ? p_.exciter_frequency
                                                      : std::sqrt(stiffness / mechanism_.peg.mass);
  press_.exciterNext({amplitude, frequency, 0.0, p_.exciter_direction});
}

// From the edge in the hole to the depth or the floor; the force stays bounded, the walls lead.
void Search::insert() {
  const double start = press_.last().time;
  in_bore_ = pegPose(press_.target(), Vector6::Zero());
  if (p_.insert.exciter > 0.0) shakeInBore(p_.insert.exciter);
  moveInBore(0.0);
  double travel = kBackOut;
  for (;;) {
    const BoreEnd end = lowerInBore();
    if (end == BoreEnd::kDeep || (end == BoreEnd::kResisted && onFloor())) break;
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
  if (p_.insert.exciter > 0.0) shakeInBore(0.0);
  for (int i = 0; i < blocks(kRelaxTime); ++i) moveInBore(0.0);
  inserted_.seated = true;
  inserted_.time = press_.last().time - start;
  report("seated",
         text("%.2f mm deep, greatest force %.1f N", inserted_.end.depth * 1e3, inserted_.force));
}

bool Search::isFarIn() const { return p_.inserted > kFarIn * entryDepth(); }

void Search::knowBore() {
  in_bore_ = pegPose(press_.target(), Vector6::Zero());
  hole_.height = in_bore_.p.z() + p_.inserted;
  rememberSag(in_bore_.p);
  inserted_.end.depth = p_.inserted;
}

void Search::leaveBore() {
  press_.tare();
  startHere();
  knowBore();
  moveInBore(0.0);
  const double above = kOut * scale_.room;
  backOutOfBore(p_.inserted + above);
  report("retreat", text("%.2f mm above the face", -1e3 * inserted_.end.depth));
  if (inserted_.end.depth > 0.0) {
    throw AlignError(AlignFailure::kStuck, text("%.2f mm deep still, pulled with %.1f N",
                                                1e3 * inserted_.end.depth, against(-1.0)));
  }
  // beside the hole the next goal finds a face to feel: a tilted edge over the hole wedges in it
  Vec3 beside = in_bore_.p + kOver * scale_.room * Vec3::UnitZ();
  press_.moveTo(restFor(beside, in_bore_.R));
  beside += wayAside(p_.contact_tilt);
  press_.moveTo(restFor(beside, in_bore_.R));
}

namespace {

class Withdrawal : public Search {
 public:
  Withdrawal(Plant& plant, const Mechanism& mechanism, const AlignParameters& p,
             const Progress& progress)
      : Search(plant, mechanism, p, progress) {}

  void find() override { leaveBore(); }

 private:
  void summarise(AlignResult&) const override {}
};

}  // namespace

void withdraw(Plant& plant, const Mechanism& mechanism, const AlignParameters& parameters,
              const std::function<void(const AlignProgress&)>& progress) {
  checkParameters(parameters);
  Withdrawal(plant, mechanism, parameters, progress).find();
}

}  // namespace assembly_cell
