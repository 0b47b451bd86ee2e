// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <cstdint>

// Macros of the address sanitizer: GCC and clang have different ones.
#if defined(__has_feature)
#if __has_feature(address_sanitizer)
#define ASSEMBLY_CELL_SANITIZED
#endif
#endif
#if defined(__SANITIZE_ADDRESS__)
#define ASSEMBLY_CELL_SANITIZED
#endif

// Linked into each test of the core: counts allocations.
namespace assembly_cell::test {

std::uint64_t allocationsOfAll();         ///< of all threads, since the start
std::uint64_t allocationsOfThisThread();  ///< of the calling thread

}  // namespace assembly_cell::test
