// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/arm/block_barrier.h"

#include <utility>

namespace assembly_cell {

bool BlockBarrier::add(std::size_t sensor, std::uint32_t sequence) {
  if (sequence_[sensor] == sequence) return false;
  sequence_[sensor] = sequence;
  return true;
}

std::optional<std::uint32_t> BlockBarrier::complete() const {
  const bool has_all = sensors_ == Sensors::kB || sequence_[0] == sequence_[1];
  if (!sequence_[1] || !has_all || sequence_[1] == finished_) return {};
  return sequence_[1];
}

std::vector<BlockBarrier::Task> BlockBarrier::finish() {
  finished_ = sequence_[1];
  progress_ = true;
  return std::exchange(tasks_, {});
}

bool BlockBarrier::isStuck() {
  return !std::exchange(progress_, false) && sequence_[1] != finished_;
}

void BlockBarrier::restart() {
  tasks_.clear();
  finished_.reset();
  sequence_[1].reset();
}

}  // namespace assembly_cell
