// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <vector>

namespace assembly_cell {

/// Displacement of a vibration from its acceleration, sampled at `rate` [Hz]: double integration in
/// the frequency domain, as an instrument's integrator does, each line of the spectrum over −ω².
/// What is slower than `lowest` [rad/s], the offset with it, is left out. The window counts
/// as a period: exact for vibrations of whole periods, its ends are off by the leakage of others.
/// Throws InputError for fewer than 8 samples, values that are not finite, and `lowest` that is not
/// between 0 and half the sampling rate.
std::vector<double> integrateTwice(const std::vector<double>& acceleration, double rate,
                                   double lowest);

}  // namespace assembly_cell
