// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <Eigen/Core>
#include <complex>

namespace assembly_cell {

// Forward models of chapter 9: the planar motion of the centre of mass, Z = P e^{iwt} + N e^{-iwt},
// under a force F e^{iwt} at the peg's top. Any coherent units.

struct PlanarLocus {
  std::complex<double> P, N;
  double a = 0.0, b = 0.0;     ///< semi-axes |P| ± |N|; b < 0: against the exciter
  double psi = 0.0;            ///< direction of the major axis in [0, pi)
  bool has_direction = false;  ///< false for a circle or no motion: psi is undefined then
};

PlanarLocus planarLocus(std::complex<double> P, std::complex<double> N);

/// From the radial response A_r and the tangential A_t: P = (A_r + A_t)/2,
/// N = conj(A_r − A_t)/2 e^{2 i alpha}.
PlanarLocus planarLocus(std::complex<double> A_r, std::complex<double> A_t, double alpha);

/// Peg, force and contact direction; gravity enters the general model alone.
struct LocusCase {
  double m = 0.0, r = 0.0, h = 0.0, F = 0.0, w = 0.0, alpha = 0.0;
};

/// 9.2.1: K and damping c about all three axes through the contact.
PlanarLocus isotropicLocus(const LocusCase& s, double K, double c = 0.0);
/// 9.2.2: no yaw. Corrected: I_y' about the radial axis, not the principal I_y.
PlanarLocus transverseLocus(const LocusCase& s, double Kx, double Ky, double cx = 0.0,
                            double cy = 0.0);
/// 9.2.3: yaw alone. Corrected 9.10: sin(wt − alpha).
PlanarLocus verticalLocus(const LocusCase& s, double K, double c = 0.0);
/// 9.4: double contact, alpha toward the hole, chord at distance d. Corrected 9.13, 9.14.
PlanarLocus doubleContactLocus(const LocusCase& s, double d, double K, double c = 0.0);
/// 9.3: sliding under friction mu_N, transverse stiffness k; needs F > mu_N.
PlanarLocus slidingLocus(double m, double k, double F, double mu_N, double w);

using SupportMatrix = Eigen::Matrix<double, 6, 6>;
/// Any support at height 2h + l over the contact plane (rows x y z, then rotation about x y z in
/// fixed axes), force at height hF, weight with g.
PlanarLocus generalLocus(const LocusCase& s, double l, double hF, double g, const SupportMatrix& K6,
                         const SupportMatrix& C6);

}  // namespace assembly_cell
