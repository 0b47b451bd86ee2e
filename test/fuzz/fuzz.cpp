// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
// A libFuzzer program for the target ASSEMBLY_CELL_FUZZ_TARGET of targets.h.

#include "targets.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  assembly_cell::ASSEMBLY_CELL_FUZZ_TARGET(data, size);
  return 0;
}
