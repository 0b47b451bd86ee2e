// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <functional>
#include <utility>

#include "assembly_cell/align/plant.h"

namespace assembly_cell::ros_bridge {

/// A plant that shows each block to `watch` before the strategy gets it.
class WatchedPlant : public Plant {
 public:
  WatchedPlant(Plant& plant, std::function<void(const PlantBlock&)> watch)
      : plant_(plant), watch_(std::move(watch)) {}

  PlantBlock next(const PlantCommand& command) override {
    const PlantBlock block = plant_.next(command);
    watch_(block);
    return block;
  }

 private:
  Plant& plant_;
  std::function<void(const PlantBlock&)> watch_;
};

}  // namespace assembly_cell::ros_bridge
