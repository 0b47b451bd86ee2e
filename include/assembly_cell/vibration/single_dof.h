// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

namespace assembly_cell {

/// I th'' + c th' + K th = A cos wt + B sin wt + C with th(t1) = th1, th'(t1) = thd1.
struct SingleDof {
  double I = 0.0, K = 0.0, c = 0.0;
  double A = 0.0, B = 0.0, C = 0.0, w = 0.0;
  double t1 = 0.0, th1 = 0.0, thd1 = 0.0;
};

struct SingleDofState {
  double theta = 0.0, theta_dot = 0.0;
};

/// Replaces 4.29, 4.30, 4.32–4.37 and 4.44: one form that holds at resonance, where the printed
/// brackets are 0/0, and with any damping. Corrected on the way: denominator I Ω and gravity
/// −m g d in 4.29; signs of the last two terms of 4.36; limits t1..t2 in 4.37; cos(w − Ω)t in 4.44.
/// t at least t1. Throws InputError for I, K not positive, c negative, anything not finite.
SingleDofState singleDof(const SingleDof& s, double t);

}  // namespace assembly_cell
