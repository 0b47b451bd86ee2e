// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <ros/node_handle.h>

#include <memory>
#include <string>

#include "assembly_cell/sensor/strain_source.h"

namespace assembly_cell::ros_bridge {

/// A configured source of the parameter `~source`: a map with `type` (a built-in one, bag, or the
/// name of a plug-in) and the source's own keys; or the text replay with `~replay/…`.
struct SourceChoice {
  std::string type;              ///< simulated: blocks come on a topic, there is no source
  std::shared_ptr<void> loader;  ///< keeps the plug-in's library; destroyed after the source
  std::shared_ptr<StrainSource> source;
};

/// Throws InputError: an unknown type (with the known ones), or a refusal of its keys.
SourceChoice chooseSource(const ros::NodeHandle& pnh);

}  // namespace assembly_cell::ros_bridge
