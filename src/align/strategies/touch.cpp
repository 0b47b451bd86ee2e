// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include <cmath>

#include "assembly_cell/align/strategies/edge_search.h"

namespace assembly_cell {
namespace {

using Vec2 = Eigen::Vector2d;
using Vec3 = Eigen::Vector3d;
using Mat3 = Eigen::Matrix3d;

constexpr int kRound = 3;           // touches of each of the first two rounds
constexpr int kAttempts = 4;        // from where the peg came free again
constexpr double kMoreTilt = 0.01;  // while the plane is unknown [rad]
constexpr double kRetreat = 8e-3;   // above where an attempt failed [m]

// The strategy `touch`: the peg's tilted edge touches the face all round, which tells plane and,
// where it sinks over the rim, roughly the hole; then the low edge is put into the hole and moved
// against its wall on three sides. Only places and thresholds of force count: neither strain
// matrices nor the mechanism need to be known well.
class TouchSearch : public EdgeSearch {
 public:
  TouchSearch(Plant& plant, const Mechanism& mechanism, const AlignParameters& p,
              const Progress& progress)
      : EdgeSearch(plant, mechanism, p, progress) {}

 private:
  void find() override {
    if (begin()) return;
    bottom_ = Vec3(0, 0, -length_);
    for (int k = 1;; ++k) {
      try {
        attempt();
        return;
      } catch (const AlignError& error) {
        if (k >= kAttempts || !recoverable(error.failure)) throw;
        report("recover", error.what());
        backOut(kRetreat * scale_.room);
        // the zero before may have been of a peg that was not free
        press_.tare(2);
        bottom_ = pegPose(press_.target(), Vector6::Zero()).p;
        if (!known_) {
          readings_.clear();
          bottom_ += wayAside(p_.contact_tilt + kMoreTilt);
          found_ = false;
          hole_ = HoleEstimate();
        }
      }
    }
  }

  static bool recoverable(AlignFailure failure) {
    switch (failure) {
      case AlignFailure::kWedged:
      case AlignFailure::kForceLimit:
      case AlignFailure::kSensorSaturated:
      case AlignFailure::kNotStill:
      case AlignFailure::kNotFree:
      case AlignFailure::kNotInserted:
      case AlignFailure::kNoPlaneReading:
      case AlignFailure::kNoHoleUnderEdge:
        return true;
      default:
        return false;
    }
  }

  void attempt() {
    if (!known_) survey();
    feelIn();
  }

  // the face all round, first at tilts against the start, then against the plane
  void survey() {
    for (int i = 0; i < kRound; ++i) {
      const double a = 2 * M_PI * i / kRound;
      touch(tilted(Vec3::UnitZ(), a, p_.contact_tilt + kMoreTilt));
    }
    resolve();
    for (int i = 0; i < kRound; ++i) {
      const double a = 2 * M_PI * (i + 0.5) / kRound;
      touch(tilted(hole_.normal, a, p_.contact_tilt));
    }
    resolve();
    known_ = true;
  }

  void summarise(AlignResult& result) const override {
    result.known = true;
    result.offset = offset();
    result.offset_covariance = hole_.center_covariance;
    result.tilt = -axisTilt(hole_.normal);
    result.tilt_sd = hole_.normal_sd;
  }
};

}  // namespace

AlignResult touchSearch(Plant& plant, const Mechanism& mechanism, const AlignParameters& parameters,
                        const std::function<void(const AlignProgress&)>& progress) {
  return TouchSearch(plant, mechanism, parameters, progress).run();
}

}  // namespace assembly_cell
