// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <string>

#include "assembly_cell/base/input_error.h"

namespace assembly_cell {

/// Message of the InputError that a call throws.
template <typename Call>
std::string refusalOf(const Call& call) {
  try {
    call();
  } catch (const InputError& error) {
    return error.what();
  }
  return "nothing thrown";
}

}  // namespace assembly_cell
