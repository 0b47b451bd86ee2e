// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <cstdint>

// Linked into each test of the core: counts what is allocated.
namespace assembly_cell::test {

std::uint64_t allocationsOfAll();         ///< of all threads, since the start
std::uint64_t allocationsOfThisThread();  ///< of the caller

}  // namespace assembly_cell::test
