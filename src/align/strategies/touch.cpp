// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include <algorithm>
#include <cmath>

#include "assembly_cell/align/strategies/edge_search.h"
#include "assembly_cell/align/strategies/strategies.h"
#include "assembly_cell/base/text.h"

namespace assembly_cell {
namespace {

using Vec3 = Eigen::Vector3d;

// Touches of the first part of a survey, and at most of the second.
constexpr int kRound = 3;
// The direction to the hole counts as known beyond this distance of its centre, and below this
// standard deviation of it [m]. With half the deviation a cycle takes 0.4 s longer, at level 2
// 1.5 s; with twice of it one of 80 starts takes 32 s. With twice the distance near starts take
// 0.3 s longer; half of it changes nothing.
constexpr double kDirected = 1.4e-3, kDirectedSd = 2.5e-3;
// The face's tilt counts as known below this standard deviation [rad]. Level 3 draws tilts of 0.4
// degrees; touches with a greater deviation contradict one another.
constexpr double kTiltSd = 0.02;
// Attempts after failures from which the peg came free again, the first one included.
constexpr int kAttempts = 4;
// Surveys without a hole: after each the edge touched the face in all places where it may be.
constexpr int kWithoutHole = 3;
// Addition to the peg's tilt while the face's tilt is unknown [rad].
constexpr double kMoreTilt = 0.01;
// Height of the retreat after a failed attempt [m].
constexpr double kRetreat = 8e-3;

bool isPlaneKnown(const SearchState& s) {
  return s.known.rotation_sd * std::min(1.0, s.scale.length) < kTiltSd;
}

// The direction to the hole is enough: the low edge goes into a hole at any distance ahead of it,
// and walls measure the rest. An estimate close below the peg may be far from the hole: touches of
// the face alone lead to it.
bool isDirectionKnown(const Vec3& to, const SearchState& s) {
  return isPlaneKnown(s) && to.norm() > kDirected * s.scale.length &&
         s.known.position_sd < kDirectedSd * s.scale.length;
}

// Touches the face with the low side in three directions, the peg tilted against its start. Then
// tilted against the plane, the low side towards the estimated hole first, until the direction to
// the hole is known.
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
  int without_hole = 0;
  for (int k = 1;; ++k) {
    try {
      if (!edge.known) survey(edge, s);
      edge.enterByWalls();
      return;
    } catch (const AlignError& error) {
      without_hole += error.failure == AlignFailure::kNoHoleUnderEdge ? 1 : 0;
      if (k >= kAttempts || without_hole == kWithoutHole || !traitsOf(error.failure).touch_again) {
        if (error.failure == AlignFailure::kWedged) edge.refuseTooTight();
        throw;
      }
      s.report("recover", error.what());
      search.retreat.backOut(kRetreat * s.scale.travel);
      // the peg may not have been free at the earlier zero
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
