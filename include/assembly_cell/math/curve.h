// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <array>
#include <cstddef>
#include <vector>

namespace assembly_cell {

/// Contact wrench over the path into the hole. All vectors are of the same length, in the order of
/// time; the depth may go back where the peg was pulled up. NaN: not measured (of a curve of
/// others).
struct Curve {
  std::vector<double> time;     ///< since the run's start [s]
  std::vector<double> depth;    ///< of the centre of the peg's edge below the hole's plane [m]
  std::vector<double> axial;    ///< force up the peg's axis [N]
  std::vector<double> lateral;  ///< force across it [N]
  std::vector<double> moment;   ///< about the edge's centre, across the axis [N·m]
  std::vector<double> tilt;     ///< of the peg's axis against the hole's estimated one [rad]

  std::size_t size() const { return time.size(); }
  void reserve(std::size_t samples);
  void add(const std::array<double, 6>& sample);  ///< in the order of the members
  void thin();                                    ///< keeps every second sample
};

/// A vector of the curve by its name.
struct CurveChannel {
  const char* name;
  std::vector<double> Curve::*values;
};
inline constexpr std::array<CurveChannel, 6> kCurveChannels{{{"time", &Curve::time},
                                                             {"depth", &Curve::depth},
                                                             {"axial", &Curve::axial},
                                                             {"lateral", &Curve::lateral},
                                                             {"moment", &Curve::moment},
                                                             {"tilt", &Curve::tilt}}};

}  // namespace assembly_cell
