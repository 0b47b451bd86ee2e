// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <memory>
#include <string>

#include "assembly_cell/sensor/devices/replay.h"
#include "assembly_cell/sensor/strain_source.h"

namespace assembly_cell {

/// Plays a CSV recording; sequences count its rows, device_time is its time, loops appended. Keys:
/// file, quantity [counts, volts, wrench], columns, time_unit [auto, s, ms, us, ns], bits,
/// full_scale [V], rate [original, fast], loop, block_size.
class ReplaySource : public StrainSource {
 public:
  ReplaySource();
  ~ReplaySource() override { close(); }

 protected:
  void doConfigure(const YAML::Node& parameters) override;
  void doOpen() override;
  ReadResult doRead(SourceBlock& block, Clock::time_point deadline) override;

 private:
  std::string file_;
  ReplayFormat format_;
  bool paced_ = true;
  bool loop_ = false;
  std::size_t block_size_ = 1;

  std::unique_ptr<Replay> replay_;
  ReplayBlock due_;
  bool has_due_ = false;
  std::uint64_t sequence_ = 0;  // of the next sample
  std::uint32_t stream_ = 0;
  double origin_ = 0.0;  // time of the first sample [s]
  Clock::time_point start_;
};

}  // namespace assembly_cell
