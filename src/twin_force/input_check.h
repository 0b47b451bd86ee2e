// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <cstddef>
#include <optional>
#include <vector>

#include "assembly_cell/twin_force/pose_estimate.h"

namespace assembly_cell {
namespace twin_force {

/// Throws InputError for options, covariances or a number of contacts that make no sense.
void checkInput(const std::vector<TwinContact>& contacts, const TwinForceOptions& options,
                std::size_t capacity);

/// Why a contact can't count, and which.
struct Refusal {
  const char* reason;
  int culprit;
};
std::optional<Refusal> refusalOf(const std::vector<TwinContact>& contacts,
                                 const TwinForceOptions& options);

}  // namespace twin_force
}  // namespace assembly_cell
