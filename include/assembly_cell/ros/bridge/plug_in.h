// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <memory>
#include <pluginlib/class_loader.hpp>
#include <string>
#include <utility>
#include <vector>

#include "assembly_cell/base/input_error.h"
#include "assembly_cell/base/text.h"

namespace assembly_cell::ros_bridge {

/// An object whose class may be in another package.
template <class Base>
struct PlugIn {
  std::shared_ptr<void> loader;  ///< keeps its library; destroyed after the object
  std::shared_ptr<Base> object;
};

/// The class `type` that a package exports through pluginlib for the base class assembly_cell::NAME
/// (`base`). Throws InputError if no package exports it (the text lists `known` and exported ones)
/// or it can't be loaded; `name`: the parameter that selects it.
template <class Base>
PlugIn<Base> loadPlugIn(const std::string& base, const std::string& type, const std::string& name,
                        const std::vector<std::string>& known) {
  const std::string is = name + " is '" + printable(type) + "'";
  try {
    auto loader =
        std::make_shared<pluginlib::ClassLoader<Base>>("assembly_cell", "assembly_cell::" + base);
    if (!loader->isClassAvailable(type)) {
      std::vector<std::string> all = known;
      for (const std::string& other : loader->getDeclaredClasses()) all.push_back(other);
      std::string list;
      for (const std::string& one : all) list += (list.empty() ? "" : ", ") + one;
      throw InputError(is + ": give one of " + list + ", or a class that a package exports for " +
                       "assembly_cell::" + base);
    }
    auto object = loader->createSharedInstance(type);
    return {std::move(loader), std::move(object)};
  } catch (const pluginlib::PluginlibException& error) {
    throw InputError(is + ", a plug-in that can't be loaded: " + printable(error.what(), 1000));
  }
}

}  // namespace assembly_cell::ros_bridge
