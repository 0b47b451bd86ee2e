// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <string>

namespace assembly_cell {

/// Temporary file, fsync, rename, fsync of the folder: a reader sees the old content or the new
/// one. Throws InputError beginning with `where`.
void writeFileAtomically(const std::string& path, const std::string& content,
                         const std::string& where);

/// All bytes into an open file, whatever signals come; false (errno says why) when they can't be
/// written.
bool writeAll(int file, const std::string& bytes);

}  // namespace assembly_cell
