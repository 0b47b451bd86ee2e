// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "fit.h"

#include <algorithm>
#include <cctype>

#include "assembly_cell/base/text.h"

namespace assembly_cell {
namespace {

// Tolerance zone about nominal diameters above those of the zone before, up to `largest`.
struct Zone {
  const char* name;  // "H7"
  double largest;    // nominal diameter [m]
  double low, high;  // of the diameter [m]
};
// written by zones.py from the table of scripts/make_peg
constexpr Zone kZones[] = {
#include "zones.inc"
};

constexpr double kRounding = 2e-9;  // of a diameter in a file [m]

// Nominal diameters whose zones contain both radii. [m]
struct Nominal {
  double low, high;
};

Nominal nominalOf(const Zone& hole, double hole_radius, const Zone& shaft, double peg_radius) {
  return {2.0 * std::max(hole_radius - 0.5 * hole.high, peg_radius - 0.5 * shaft.high),
          2.0 * std::min(hole_radius - 0.5 * hole.low, peg_radius - 0.5 * shaft.low)};
}

double middle(const Zone& zone) { return 0.5 * (zone.low + zone.high); }

RadiusTolerance toleranceOf(const Zone& zone, double nominal, double radius) {
  return {std::min(radius, 0.5 * (nominal + zone.low)),
          std::max(radius, 0.5 * (nominal + zone.high))};
}

}  // namespace

void readFit(yaml::Section& in, HoleParameters& hole, PegParameters& peg) {
  const std::string remedy =
      "give hole and shaft by ISO 286, such as H7/g6: D to H or JS, d to h, js, k, m, n or p, each "
      "with a grade from 5 to 11";
  const std::string path = in.at("fit"), name = in.text("fit", remedy);
  if (hole.radius_tolerance != kNoTolerance || peg.radius_tolerance != kNoTolerance) {
    in.refuse(path, name, "it determines radius_tolerance of hole and peg, leave one of them out");
  }
  const bool nominal = hole.radius == peg.radius;
  bool exists = false;
  double smallest = 0.0, largest = 0.0;  // diameters of a row
  for (const Zone& of_hole : kZones) {
    if (std::isupper(of_hole.name[0]) == 0 || name.rfind(std::string(of_hole.name) + "/", 0) != 0)
      continue;
    for (const Zone& of_shaft : kZones) {
      if (of_shaft.largest != of_hole.largest || std::islower(of_shaft.name[0]) == 0) continue;
      if (name != std::string(of_hole.name) + "/" + of_shaft.name) continue;
      exists = true;
      smallest = largest;
      largest = of_hole.largest;
      Nominal d = nominalOf(of_hole, hole.radius, of_shaft, peg.radius);
      if (nominal) d = {2.0 * hole.radius, 2.0 * hole.radius};
      d.low = std::max(d.low, smallest + (smallest > 0.0 ? kRounding : 0.0));
      d.high = std::min(d.high, largest);
      if (d.low > d.high + kRounding) continue;
      const double diameter = 0.5 * (d.low + d.high);
      if (nominal) {
        hole.radius = 0.5 * (diameter + middle(of_hole));
        peg.radius = 0.5 * (diameter + middle(of_shaft));
      }
      hole.radius_tolerance = toleranceOf(of_hole, diameter, hole.radius);
      peg.radius_tolerance = toleranceOf(of_shaft, diameter, peg.radius);
      return;
    }
  }
  if (!exists) in.refuse(path, name, remedy);
  if (2.0 * hole.radius > largest) {
    in.refuse(path, name,
              text("hole.radius is %g m, and fits are tabulated up to a diameter of %g mm",
                   hole.radius, 1e3 * largest) +
                  "; give radius_tolerance of hole and peg in its place");
  }
  in.refuse(path, name,
            text("hole.radius %.9g and peg.radius %.9g m are in no zones of this fit", hole.radius,
                 peg.radius) +
                "; correct them, or give both the nominal radius");
}

}  // namespace assembly_cell
