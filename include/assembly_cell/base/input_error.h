// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <stdexcept>
#include <string>

namespace assembly_cell {

/// Bad input from a person: a file, key, parameter or option. what() is one line that names the
/// item, its value and what to do. Tools exit with 2, nodes with 1, services answer success: false.
struct InputError : std::runtime_error {
  using std::runtime_error::runtime_error;
};

/// A key that doesn't exist, or is of no use where it stands: wrong whatever its value.
struct KeyError : InputError {
  using InputError::InputError;
};

}  // namespace assembly_cell
