// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <iosfwd>
#include <string>
#include <vector>

namespace assembly_cell {

/// `calibrate payload POSES.csv WRENCHES.csv …`: argv[0] is the word `payload`. YAML on standard
/// output, messages on standard error. Returns 0 ok, 1 refused, 2 bad input.
int payloadCommand(int argc, char** argv);

/// The same on given streams; arguments without the word `payload`.
int payloadCommand(const std::vector<std::string>& arguments, std::ostream& out,
                   std::ostream& messages);

}  // namespace assembly_cell
