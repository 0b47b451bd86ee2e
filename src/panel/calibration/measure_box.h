// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <QGroupBox>
#include <array>
#include <functional>
#include <string>

#include "links/cell_link.h"

class QCheckBox;
class QDoubleSpinBox;
class QLabel;
class QLineEdit;
class QProgressBar;
class QPushButton;

namespace assembly_cell::panel {

class PlanBox;

/// Runs the calibration action: the load to apply, its confirmation, deviations from the plan.
class MeasureBox : public QGroupBox {
 public:
  /// refresh: called after each click.
  MeasureBox(CellLink& link, PlanBox& plan, const std::function<void()>& refresh);
  void show(const CellView& view);

 private:
  void addMeasured();
  Measured measured() const;
  void showMeasured(const CalibrationView& view, bool waiting);

  QPushButton *begin_, *cancel_, *confirm_, *remove_;
  QCheckBox *restart_, *changed_;
  QLineEdit* id_;
  QProgressBar* progress_;
  QLabel *state_, *load_;
  QDoubleSpinBox* mass_;
  std::array<QDoubleSpinBox*, 6> gauges_{};
  QWidget *mass_row_, *gauge_row_;
  std::string shown_;  // message of the step whose mass is shown
};

}  // namespace assembly_cell::panel
