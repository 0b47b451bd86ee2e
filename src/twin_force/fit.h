// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
// Fits of a subset of the contacts by each method.
#pragma once

#include <cstddef>
#include <vector>

#include "closed_forms.h"

namespace assembly_cell {
namespace twin_force {

/// What the fits of one estimate share. Prior, tare and errors, which include the tare, are of the
/// likelihood: null without, and for the other methods.
struct Problem {
  const std::vector<Term>* terms;
  const TwinForceOptions& options;
  const PosePrior* prior;
  TareState* tare;
  ErrorState* errors;
  Pose start;            ///< the prior's pose; where directions stay that the contacts can't tell
  Vector6 scale;         ///< diagonal of S
  Matrix6 prior_weight;  ///< P₀⁻¹
};
/// tare and errors are memory. `contacts` are those of the terms.
Problem makeProblem(const std::vector<Term>& terms, const std::vector<TwinContact>& contacts,
                    const TwinForceOptions& options, TareState& tare, ErrorState& errors);

/// One fit of a subset of the contacts.
struct Fit {
  Pose pose;
  Eigen::Quaterniond q = Eigen::Quaterniond::Identity();
  Normal normal;
  Vector12 tare_offset = Vector12::Zero();
  Eigen::MatrixXd error_slope, error_rest;  ///< as in TwinForceEstimate
  int iterations = 0;
  bool solved = false;
  Vector6 eigenvalues;
  Matrix6 eigenvectors;
  int null_count = 0, dof = 0;
  double p = 0.0;
};

/// By the options' method from the terms that `used` lists.
Fit fitSubset(const Problem& problem, const std::vector<int>& used);

/// The thesis form from the pair with the smallest covariance, which it gives too. False where all
/// pairs are singular.
bool fitThesis(const Problem& problem, const std::vector<int>& used, Fit& fit, Matrix6& covariance);

/// The removal of one that leaves the best fit; `out` is its position in used, `trial` memory.
Fit bestRemoval(const Problem& problem, const std::vector<int>& used, std::vector<int>& trial,
                std::size_t& out);

}  // namespace twin_force
}  // namespace assembly_cell
