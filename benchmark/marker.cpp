// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
// How fast this machine is, by the frozen loop that the benchmarks print beside their times.
#include "marker.h"

#include <cstdio>

int main() { std::printf("marker: %.1f ns\n", assembly_cell::markerTime()); }
