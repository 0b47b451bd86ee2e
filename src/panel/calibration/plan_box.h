// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <QGroupBox>
#include <functional>
#include <string>

#include "links/cell_link.h"

class QComboBox;
class QLabel;
class QListWidget;
class QPushButton;

namespace assembly_cell::panel {

/// Plan of a calibration: its steps and the expected accuracy.
class PlanBox : public QGroupBox {
 public:
  /// refresh: called after each click.
  PlanBox(CellLink& link, const std::function<void()>& refresh);
  void show(const CellView& view);
  /// Name of the selected plan; its steps are requested unless they are shown.
  std::string select();

 private:
  CellLink& link_;
  QComboBox* plan_;
  QPushButton* check_;
  QLabel* report_;
  QListWidget* steps_;
  std::string shown_;  // plan of the steps
};

/// Index of the step that the action waits for; −1: none.
int currentStep(const CalibrationView& view);

}  // namespace assembly_cell::panel
