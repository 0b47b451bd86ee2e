// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/shaker/shaker.h"

#include "audio.h"
#include "unbalance.h"

namespace assembly_cell {

const std::vector<std::string>& shakerTypes() {
  static const std::vector<std::string> types{"audio", "unbalance"};
  return types;
}

std::unique_ptr<Shaker> makeShaker(const std::string& type) {
  if (type == "audio") return std::make_unique<AudioShaker>();
  if (type == "unbalance") return std::make_unique<UnbalanceShaker>();
  return nullptr;
}

}  // namespace assembly_cell
