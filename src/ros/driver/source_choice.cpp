// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/ros/driver/source_choice.h"

#include <yaml-cpp/yaml.h>

#include <algorithm>
#include <utility>
#include <vector>

#include "assembly_cell/base/input_error.h"
#include "assembly_cell/base/table.h"
#include "assembly_cell/ros/bridge/parameters.h"
#include "assembly_cell/ros/bridge/plug_in.h"
#include "assembly_cell/ros/driver/bag_source.h"

namespace assembly_cell::ros_bridge {

namespace {

// The parameters ~replay/… of a text `source`, as a source's map.
YAML::Node replayMap(const ros::NodeHandle& pnh) {
  Parameters parameters(ros::NodeHandle(pnh, "replay"));
  YAML::Node map;
  map["file"] = parameters.text("file");
  map["quantity"] = parameters.choice("quantity", {"wrench", "volts", "counts"}, "wrench");
  map["columns"] = parameters.texts("columns", std::vector<std::string>{});
  map["time_unit"] = parameters.choice("time_unit", timeUnitNames(), "auto");
  map["bits"] = parameters.integer("bits", 2, 32, 16);
  map["full_scale"] = parameters.number("full_scale", {1e-9, 1e9}, 5.0);
  map["rate"] = parameters.choice("rate", {"original", "fast"}, "original");
  map["loop"] = parameters.flag("loop", false);
  if (map["rate"].as<std::string>() == "fast" && map["loop"].as<bool>()) {
    throw InputError("parameter " + pnh.resolveName("replay/loop") +
                     " is true with replay/rate fast: it would flood for ever; loop at original");
  }
  map["block_size"] = parameters.integer("block_size", 1, static_cast<int>(kBlockCapacity), 1);
  parameters.refuseUnknown();
  return map;
}

}  // namespace

SourceChoice chooseSource(const ros::NodeHandle& pnh) {
  Parameters parameters(pnh);
  SourceChoice choice;
  YAML::Node map;
  std::string name = pnh.resolveName("source");
  if (parameters.isTree("source")) {
    map = parameters.tree("source");
    Parameters of_source(ros::NodeHandle(pnh, "source"));
    choice.type = of_source.text("type");
    name += "/type";
  } else {
    choice.type = parameters.text("source", "simulated");
    if (choice.type == "simulated") return choice;
    if (choice.type == "replay") map = replayMap(pnh);
  }

  const auto& built_in = sourceTypes();
  if (choice.type == "bag") {
    choice.source = std::make_shared<BagSource>();
  } else if (std::find(built_in.begin(), built_in.end(), choice.type) != built_in.end()) {
    choice.source = makeSource(choice.type);
  } else {
    std::vector<std::string> known = {"bag"};
    known.insert(known.end(), built_in.begin(), built_in.end());
    // maps of these types in config
    if (!map.IsDefined() || !map.IsMap())
      known.push_back("sensor.launch's bota, robotiq, generated");
    auto plug_in =
        loadPlugIn<StrainSource>("StrainSource", choice.type, "parameter " + name, known);
    choice.loader = std::move(plug_in.loader);
    choice.source = std::move(plug_in.object);
  }
  try {
    choice.source->configure(map);
  } catch (const std::exception& error) {
    throw InputError("parameter " + pnh.resolveName("source") + ": " + error.what());
  }
  return choice;
}

}  // namespace assembly_cell::ros_bridge
