// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/math/distributions.h"

#include <boost/math/distributions/fisher_f.hpp>
#include <boost/math/distributions/non_central_f.hpp>
#include <boost/math/special_functions/gamma.hpp>
#include <cmath>

namespace assembly_cell {

double normalTail(double z) { return 0.5 * std::erfc(z / std::sqrt(2.0)); }

double chiSquareTail(double chi2, int dof) {
  if (dof <= 0 || chi2 <= 0.0) return 1.0;
  if (!std::isfinite(chi2)) return 0.0;
  return boost::math::gamma_q(0.5 * dof, 0.5 * chi2);
}

double chiSquareLimit(double p, int dof) {
  return dof <= 0 ? 0.0 : 2.0 * boost::math::gamma_q_inv(0.5 * dof, p);
}

double fTail(double f, double d1, double d2, double non_centrality) {
  if (!(d1 > 0.0 && d2 > 0.0 && f > 0.0)) return 1.0;
  // far out the root of a non-central chi-square is normal, and so is its ratio to sigma
  constexpr double kLarge = 1e4;
  if (non_centrality > kLarge || d1 * f > 1e8) {
    return normalTail((std::sqrt(d1 * f) - std::sqrt(non_centrality)) /
                      std::sqrt(1.0 + non_centrality / (2.0 * d2)));
  }
  using boost::math::cdf;
  using boost::math::complement;
  if (non_centrality <= 0.0) return cdf(complement(boost::math::fisher_f(d1, d2), f));
  return cdf(complement(boost::math::non_central_f(d1, d2, non_centrality), f));
}

}  // namespace assembly_cell
