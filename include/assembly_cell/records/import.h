// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
// Curves that other cells have recorded.
#pragma once

#include <string>
#include <vector>

#include "assembly_cell/base/table.h"
#include "assembly_cell/records/run.h"

namespace assembly_cell {

/// Runs from a table (base/table.h): columns depth or t or both; axial (also force, fz); lateral,
/// or fx and fy; moment, or tx and ty; tilt. SI, or the unit that a header names. What the table
/// hasn't is NaN. Without a column run one curve, its serial is the
/// file's name without the ending; with it a curve for each row of equal numbers there, with
/// "-NUMBER" added. Throws InputError naming the file.
std::vector<Run> readCurveFile(const std::string& path, TimeUnit unit = TimeUnit::kFound);

/// The runs of a folder, in the order of their names: NN_R_Torques.dat[.gz] of the snap_fit
/// recordings (t, force, moment of the tool; the time counts from the second row of
/// NN_R_State.dat, the end of the approach, if it is there; the depth from NN_R_CartPos.dat), and
/// every *.csv. Throws InputError naming the file; for a folder with none of both.
std::vector<Run> readCurveFolder(const std::string& folder, TimeUnit unit = TimeUnit::kFound);

/// The bytes of a file, decompressed where it is in gzip format. Throws InputError naming it:
/// unreadable, broken off, more than `largest` bytes.
std::string gzipText(const std::string& path, std::size_t largest = std::size_t(1) << 28);

}  // namespace assembly_cell
