// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <cstddef>
#include <optional>
#include <vector>

#include "assembly_cell/twin_force/pose_estimate.h"

namespace assembly_cell {
namespace twin_force {

/// Throws InputError for invalid options and covariances, and for more contacts than `capacity`.
void checkInput(const std::vector<TwinContact>& contacts, const TwinForceOptions& options,
                std::size_t capacity);

/// Reason for a refusal and the index of the contact.
struct Refusal {
  const char* reason;
  int culprit;
};
std::optional<Refusal> refusalOf(const std::vector<TwinContact>& contacts,
                                 const TwinForceOptions& options);

}  // namespace twin_force
}  // namespace assembly_cell
