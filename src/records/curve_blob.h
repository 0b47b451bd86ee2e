// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <optional>
#include <string>

#include "assembly_cell/math/curve.h"

namespace assembly_cell {

/// A curve as bytes, exact: its channels one after another as little-endian doubles, the first
/// bytes of all numbers, then the second ones and so on, compressed by zlib.
std::string packCurve(const Curve& curve);
/// Nothing where the bytes aren't a curve of so many samples.
std::optional<Curve> unpackCurve(const std::string& bytes, std::size_t samples);

}  // namespace assembly_cell
