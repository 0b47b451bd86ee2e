// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/cell/first_goal.h"

#include <random>

#include "assembly_cell/align/search/free_peg.h"
#include "assembly_cell/align/search/press_controller.h"

namespace assembly_cell {
namespace {

constexpr double kMostForce = 40.0;  // of a press [N]
constexpr double kLongest = 30.0;    // of an alignment [s]
constexpr double kPressed = 0.4;     // share of the first goals that only press

// Ends with PlantError at a given time.
class CutPlant : public Plant {
 public:
  CutPlant(Plant& plant, double after) : plant_(plant), after_(after) {}
  PlantBlock next(const PlantCommand& command) override {
    const PlantBlock block = plant_.next(command);
    if (block.time > after_) throw PlantError(AlignFailure::kCancelled, "cut off");
    return block;
  }
  TwinForceSensing* twinForce() override { return plant_.twinForce(); }

 private:
  Plant& plant_;
  double after_;  // on the plant's clock [s]
};

void press(Plant& plant, double force) {
  PressLimits limits;
  limits.force = 1.5 * kMostForce;
  GuardedCarrier carrier(plant, limits);
  carrier.tare();
  PressController hand(carrier);
  hand.approach(carrier.target().z - limits.descent);
  hand.hold(force, 0.05);
}

}  // namespace

void leaveFirstGoal(Plant& plant, const Mechanism& mechanism, const AlignParameters& parameters,
                    std::uint64_t seed) {
  std::mt19937_64 engine(seed ^ 0x5eed);
  const auto uniform = [&engine] { return static_cast<double>(engine() >> 11) * 0x1p-53; };
  const bool only_press = uniform() < kPressed;
  const double force = kMostForce * uniform(), after = kLongest * uniform();
  const bool freed = uniform() < 0.5;
  try {
    if (only_press) {
      press(plant, force);
      return;
    }
    CutPlant cut(plant, after);
    align(cut, mechanism, parameters);
  } catch (const AlignError&) {
    // wherever that has left it
  } catch (const PlantError& error) {
    if (error.failure != AlignFailure::kCancelled) throw;
  }
  PlantCommand off;
  off.exciter = ExciterParameters{};
  plant.next(off);
  if (!freed) return;
  try {
    GuardedCarrier carrier(plant, PressLimits{});
    releasePeg(carrier, mechanism);
  } catch (const AlignError&) {
    // stuck: the next goal has to say so
  }
}

}  // namespace assembly_cell
