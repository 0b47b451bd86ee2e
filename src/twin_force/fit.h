// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
// Fits of a subset of the contacts by each method.
#pragma once

#include <cstddef>
#include <vector>

#include "closed_forms.h"

namespace assembly_cell {
namespace twin_force {

/// Input shared by the fits of one estimate. Prior, tare and errors (which include the tare) are
/// used by the likelihood: null if not given, and for the other methods.
struct Problem {
  const std::vector<Term>* terms;
  const TwinForceOptions& options;
  const PosePrior* prior;
  TareState* tare;
  ErrorState* errors;
  Pose start;            ///< the prior's pose; initial value of unobservable directions
  Vector6 scale;         ///< diagonal of S
  Matrix6 prior_weight;  ///< P₀⁻¹
};
/// tare and errors: memory. contacts: those of the terms.
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

/// Fit by the options' method. used: indices of the terms.
Fit fitSubset(const Problem& problem, const std::vector<int>& used);

/// Thesis form from the pair with the smallest covariance, which is returned too. False if all
/// pairs are singular.
bool fitThesis(const Problem& problem, const std::vector<int>& used, Fit& fit, Matrix6& covariance);

/// Fit after the removal of the contact that leaves the best fit; out: its position in used; trial:
/// memory.
Fit bestRemoval(const Problem& problem, const std::vector<int>& used, std::vector<int>& trial,
                std::size_t& out);

}  // namespace twin_force
}  // namespace assembly_cell
