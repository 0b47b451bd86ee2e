// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include <algorithm>
#include <cmath>

#include "assembly_cell/align/strategies/edge_search.h"
#include "assembly_cell/align/strategies/strategies.h"
#include "assembly_cell/base/text.h"

namespace assembly_cell {
namespace {

using Vec3 = Eigen::Vector3d;

constexpr int kRound = 3;  // touches of a round
// Distance of the hole's centre from which its direction is certain, and the centre's sd then. Half
// the sd: 0.4 s longer, at level 2 1.5 s; twice: one of 80 starts takes 32 s. Twice the distance:
// 0.3 s longer for near starts; half: the same. [m]
constexpr double kDirected = 1.4e-3, kDirectedSd = 2.5e-3;
// Of the face's tilt, whose touches contradict one another beyond: level 3 has 0.4 degrees. [rad]
constexpr double kTiltSd = 0.02;
constexpr int kAttempts = 4;        // from where the peg came free again
constexpr double kMoreTilt = 0.01;  // while the plane is unknown [rad]
constexpr double kRetreat = 8e-3;   // above where an attempt failed [m]

bool isRecoverable(AlignFailure failure) {
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

bool isPlaneKnown(const SearchState& s) {
  return s.known.rotation_sd * std::min(1.0, s.scale.length) < kTiltSd;
}

// The low edge goes into a hole that is in about its direction, however far; walls measure the
// rest. A hole that seems to be below the peg may be far off, where the plane explains the touches.
bool isDirectionKnown(const Vec3& to, const SearchState& s) {
  return isPlaneKnown(s) && to.norm() > kDirected * s.scale.length &&
         s.known.position_sd < kDirectedSd * s.scale.length;
}

// The face all round at tilts against the start; then against the plane, the low side towards the
// hole first, until the direction to the hole is known.
void survey(EdgeSearch& edge, const SearchState& s) {
  for (int i = 0; i < kRound; ++i) {
    const double a = 2 * M_PI * i / kRound;
    edge.touch(tiltedTo(Vec3::UnitZ(), a, s.p.contact_tilt + kMoreTilt));
  }
  edge.resolve();
  for (int i = 0; i < kRound && !isDirectionKnown(toHole(s, edge.bottom), s); ++i) {
    const Vec3 to = toHole(s, edge.bottom);
    const double a = std::atan2(to.y(), to.x()) + 2 * M_PI * i / kRound;
    edge.touch(tiltedTo(s.hole.normal, a, s.p.contact_tilt));
    edge.resolve();
  }
  if (!isPlaneKnown(s)) {
    throw AlignError(AlignFailure::kNoPlaneReading,
                     text("touches know the face's tilt to %.2g rad only", s.known.rotation_sd));
  }
  edge.known = true;
}

void find(Search& search) {
  SearchState& s = search.state;
  if (search.begin()) return;
  EdgeSearch edge(search);
  edge.bottom = Vec3(0, 0, -s.frame.length());
  for (int k = 1;; ++k) {
    try {
      if (!edge.known) survey(edge, s);
      edge.enterByWalls();
      return;
    } catch (const AlignError& error) {
      if (k >= kAttempts || !isRecoverable(error.failure)) {
        if (error.failure == AlignFailure::kWedged) edge.refuseTooTight();
        throw;
      }
      s.report("recover", error.what());
      search.retreat.backOut(kRetreat * s.scale.travel);
      // the earlier zero may have been of a peg that was not free
      s.carrier.tare(2);
      edge.bottom = s.target().p;
      if (!edge.known) {
        edge.readings.clear();
        edge.bottom += search.retreat.nextOffset(s.p.contact_tilt + kMoreTilt);
        s.found = false;
        s.hole = HoleEstimate();
      }
    }
  }
}

}  // namespace

AlignResult touchSearch(Plant& plant, const Mechanism& mechanism, const AlignParameters& parameters,
                        const ProgressCallback& progress) {
  Search search(plant, mechanism, parameters, progress);
  return search.run([&] { find(search); },
                    [&](AlignResult& result) { summariseHole(search.state, result); });
}

}  // namespace assembly_cell
