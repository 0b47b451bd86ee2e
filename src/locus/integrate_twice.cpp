// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/locus/integrate_twice.h"

#include <algorithm>
#include <cmath>
#include <complex>
#include <string>
#include <unsupported/Eigen/FFT>

#include "assembly_cell/base/input_error.h"

namespace assembly_cell {

std::vector<double> integrateTwice(const std::vector<double>& acceleration, double rate,
                                   double lowest) {
  const std::size_t n = acceleration.size();
  if (n < 8) {
    throw InputError("acceleration has " + std::to_string(n) +
                     " samples: at least 8 are needed to integrate it");
  }
  const auto finite = [](double v) { return std::isfinite(v); };
  if (!std::all_of(acceleration.begin(), acceleration.end(), finite)) {
    throw InputError("acceleration is not finite everywhere: leave such samples out");
  }
  if (!(rate > 0.0 && lowest > 0.0 && lowest < M_PI * rate)) {
    throw InputError("lowest frequency is " + std::to_string(lowest) +
                     ": give one between 0 and half the sampling rate, in rad/s");
  }
  Eigen::FFT<double> fft;
  std::vector<std::complex<double>> spectrum;
  fft.fwd(spectrum, acceleration);
  for (std::size_t k = 0; k < spectrum.size(); ++k) {
    const std::size_t line = std::min(k, spectrum.size() - k);
    const double w = 2.0 * M_PI * rate * static_cast<double>(line) / static_cast<double>(n);
    spectrum[k] = w < lowest ? 0.0 : spectrum[k] / (-w * w);
  }
  std::vector<double> displacement;
  fft.inv(displacement, spectrum);
  return displacement;
}

}  // namespace assembly_cell
