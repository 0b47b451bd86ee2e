// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/vibration/inertia.h"

#include "assembly_cell/math/validity.h"

namespace assembly_cell {
namespace {

void requireCylinder(double m, double r, double h) {
  requirePositive({{"m", m}, {"r", r}, {"h", h}});
}

}  // namespace

ContactInertia contactInertia(double m, double r, double h) {
  requireCylinder(m, r, h);
  ContactInertia i;
  i.Ix = m * (16 * h * h + 15 * r * r) / 12;
  i.Iy_local = m * (16 * h * h + 3 * r * r) / 12;
  i.Iz_local = 1.5 * m * r * r;
  i.Iyz_local = m * r * h;
  i.beta = 0.5 * std::atan2(24 * r * h, 16 * h * h - 15 * r * r);
  // the smaller principal value from the determinant, without cancellation
  const double larger =
      (i.Iy_local + i.Iz_local) / 2 + std::hypot((i.Iy_local - i.Iz_local) / 2, i.Iyz_local);
  i.Iy = larger;
  i.Iz = (m * r) * (m * r) * (h * h + 3 * r * r / 8) / larger;
  finiteResult("Ix", i.Ix);
  finiteResult("Iy", i.Iy);
  finiteResult("Iz", i.Iz);
  return i;
}

double centroidInertia(double m, double r, double h) {
  requireCylinder(m, r, h);
  return finiteResult("I", m * (3 * r * r + 4 * h * h) / 12);
}

double chordInertia(double m, double r, double h, double d) {
  requireCylinder(m, r, h);
  if (!(d >= 0.0 && d <= r)) refuse("d", d, "give the chord's distance, from 0 to r");
  return finiteResult("I", m * ((16 * h * h + 3 * r * r) / 12 + d * d));
}

double chordStiffness(double kx, double kz, double KY, double h, double l, double d) {
  requireNotNegative({{"kx", kx}, {"kz", kz}, {"KY", KY}, {"l", l}, {"d", d}});
  requirePositive("h", h);
  const double arm = 2 * h + l;
  return finiteResult("K", kx * arm * arm + KY + kz * d * d);
}

}  // namespace assembly_cell
