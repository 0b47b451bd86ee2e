// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <QGroupBox>
#include <functional>
#include <map>
#include <string>

#include "links/cell_link.h"

class QLabel;
class QPushButton;
class QSpinBox;

namespace assembly_cell::panel {

/// State of the simulator, buttons to pause, run, step and reset it.
class SimulationBox : public QGroupBox {
 public:
  /// refresh: called after each click.
  SimulationBox(CellLink& link, const std::function<void()>& refresh);
  void show(const CellView& view);
  /// Blocks of a step.
  std::map<std::string, std::string> settings() const;
  void apply(const std::map<std::string, std::string>& settings);

 private:
  QLabel* state_;
  QPushButton *pause_, *run_, *step_, *reset_;
  QSpinBox* blocks_;
};

}  // namespace assembly_cell::panel
