// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <string>

namespace assembly_cell {

/// What a diameter may be more than the nominal one [m].
struct ToleranceZone {
  double low = 0.0;
  double high = 0.0;
};

/// Tolerance zones of a hole and of the shaft in it.
struct Fit {
  ToleranceZone hole;
  ToleranceZone shaft;
};

/// A fit by ISO 286, such as "H7/g6", of a nominal diameter [m]: holes D to H and JS, shafts d to
/// h, js and k to p, tolerance grades 5 to 11, diameters to 180 mm. Throws InputError for others.
Fit isoFit(const std::string& name, double nominal_diameter);

}  // namespace assembly_cell
