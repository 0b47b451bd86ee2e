// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/math/curve.h"

namespace assembly_cell {

void Curve::reserve(std::size_t samples) {
  for (const CurveChannel& channel : kCurveChannels) (this->*channel.values).reserve(samples);
}

void Curve::add(const std::array<double, 6>& sample) {
  for (std::size_t i = 0; i < sample.size(); ++i) {
    (this->*kCurveChannels[i].values).push_back(sample[i]);
  }
}

void Curve::thin() {
  for (const CurveChannel& channel : kCurveChannels) {
    std::vector<double>& values = this->*channel.values;
    for (std::size_t i = 0; 2 * i < values.size(); ++i) values[i] = values[2 * i];
    values.resize((values.size() + 1) / 2);
  }
}

}  // namespace assembly_cell
