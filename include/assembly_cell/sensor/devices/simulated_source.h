// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <cstdint>

#include "assembly_cell/sensor/bridge.h"
#include "assembly_cell/sensor/strain_source.h"

namespace assembly_cell {

/// A strain bridge without a device: volts of a cell's bridge under load + amplitude·sin(2π f t).
/// The same seed gives the same bits. Keys: bridge [a, b, nominal], bits, noise [V], seed, rate
/// [Hz], block_size, load and amplitude [N, N·m], frequency [Hz], samples (0: endless), pace
/// [original, fast].
class SimulatedSource : public StrainSource {
 public:
  SimulatedSource();
  ~SimulatedSource() override { close(); }

 protected:
  void doConfigure(const YAML::Node& parameters) override;
  void doOpen() override;
  ReadResult doRead(SourceBlock& block, Clock::time_point deadline) override;

 private:
  Bridge bridge_;
  Matrix6 strain_matrix_ = Matrix6::Zero();
  Vector6 load_ = Vector6::Zero();
  Vector6 amplitude_ = Vector6::Zero();
  double frequency_ = 0.0;  // [Hz]
  double rate_ = 0.0;       // [Hz]
  std::size_t block_size_ = 1;
  std::uint64_t samples_ = 0;
  std::uint64_t seed_ = 1;
  bool paced_ = true;

  NormalSource normal_{1};
  std::uint64_t position_ = 0;  // samples delivered since open
  std::uint64_t first_ = 0;     // sequence of the first one since open
  std::uint32_t stream_ = 0;
  Clock::time_point start_;
};

}  // namespace assembly_cell
