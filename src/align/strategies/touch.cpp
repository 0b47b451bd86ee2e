// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include <cmath>

#include "assembly_cell/align/strategies/edge_search.h"
#include "assembly_cell/align/strategies/strategies.h"

namespace assembly_cell {
namespace {

constexpr int kRound = 3;           // touches of each of the first two rounds
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

// The face all round, first at tilts against the start, then against the plane.
void survey(EdgeSearch& edge, const SearchState& s) {
  for (int i = 0; i < kRound; ++i) {
    const double a = 2 * M_PI * i / kRound;
    edge.touch(tiltedTo(Eigen::Vector3d::UnitZ(), a, s.p.contact_tilt + kMoreTilt));
  }
  edge.resolve();
  for (int i = 0; i < kRound; ++i) {
    const double a = 2 * M_PI * (i + 0.5) / kRound;
    edge.touch(tiltedTo(s.hole.normal, a, s.p.contact_tilt));
  }
  edge.resolve();
  edge.known = true;
}

void find(Search& search) {
  SearchState& s = search.state;
  if (search.begin()) return;
  EdgeSearch edge(search);
  edge.bottom = Eigen::Vector3d(0, 0, -s.frame.length());
  for (int k = 1;; ++k) {
    try {
      if (!edge.known) survey(edge, s);
      edge.enterByWalls();
      return;
    } catch (const AlignError& error) {
      if (k >= kAttempts || !isRecoverable(error.failure)) throw;
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
