// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include <algorithm>

#include "assembly_cell/align/search/search.h"

namespace assembly_cell {
namespace {

using Vec3 = Eigen::Vector3d;

// Of the default cell, carried over by Scale.
constexpr double kShake = 5.0;        // exciter, unless one is asked for [N]
constexpr double kFrequency = 800.0;  // [rad/s]; both as the studies of success have them
constexpr double kLower = 6e-3;  // starts hang 3 mm over the face, tilted by up to 2 degrees [m]

// The strategy `passive` (thesis Part 1): shake and lower, and let the compliance of coupling and
// carrier do the rest. Nothing is felt on the way but the force limit; only where it ends is the
// evidence taken that every strategy needs.
class Passive : public Search {
 public:
  Passive(Plant& plant, const Mechanism& mechanism, const AlignParameters& parameters,
          const Progress& progress)
      : Search(plant, mechanism, parameters, progress) {}

 private:
  bool feelsWalls() const override { return true; }

  void find() override {
    if (begin()) return;
    shake(true);
    const RestPose start = press_.target();
    RestPose lower = start;
    const double step = p_.approach_step * scale_.step;
    const double travel = kLower * scale_.room;
    report("lower", text("by %.1f mm, shaken", travel * 1e3));
    while (start.z - lower.z < travel) {
      lower.z = std::max(start.z - travel, lower.z - step);
      press_.nudge(lower);
    }
    press_.wait(blocks(p_.settle));
    shake(false);
    press_.wait(blocks(p_.settle));
    ++contacts_;
    if (!alreadyIn()) {
      throw AlignError(AlignFailure::kNotInserted,
                       text("lowered by %.1f mm, and no hole round the peg", travel * 1e3));
    }
  }

  void shake(bool on) {
    PlantCommand command;
    const double amplitude =
        p_.exciter_amplitude > 0.0 ? p_.exciter_amplitude : kShake * std::max(1.0, scale_.force);
    const double frequency = p_.exciter_frequency > 0.0 ? p_.exciter_frequency : kFrequency;
    command.exciter = ExciterParameters{on ? amplitude : 0.0, frequency, 0.0, p_.exciter_direction};
    press_.step(command);
  }

  void summarise(AlignResult& result) const override {
    result.known = true;
    result.offset = (hole_.center - Vec3(0, 0, -length_)).head<2>();
    result.offset_covariance = hole_.center_covariance;
    result.tilt_sd = hole_.normal_sd;
  }
};

}  // namespace

AlignResult passiveAssembly(Plant& plant, const Mechanism& mechanism,
                            const AlignParameters& parameters,
                            const std::function<void(const AlignProgress&)>& progress) {
  return Passive(plant, mechanism, parameters, progress).run();
}

}  // namespace assembly_cell
