// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <QWidget>
#include <array>
#include <functional>
#include <string>

#include "links/cell_link.h"
#include "links/cell_view.h"

class QCheckBox;
class QComboBox;
class QDoubleSpinBox;
class QLabel;
class QLineEdit;
class QListWidget;
class QProgressBar;
class QPushButton;

namespace assembly_cell::panel {

/// Leads through a calibration: choose and judge a plan, measure step by step, see what came of it,
/// put a calibration in force.
class CalibrationPage : public QWidget {
 public:
  /// asked: called after each click, for all to be shown anew.
  CalibrationPage(CellLink& link, std::function<void()> asked);
  void show(const CellView& view);

 private:
  void onClick(QPushButton* button, std::function<void()> ask);
  QWidget* planBox();
  QWidget* stepBox();
  QWidget* forceBox();
  void showSteps(const CalibrationView& view);
  void showMeasured(const CalibrationView& view, bool waiting);

  CellLink& link_;
  const std::function<void()> asked_;
  QComboBox *plan_ = nullptr, *stored_ = nullptr;
  QPushButton *ask_ = nullptr, *begin_ = nullptr, *cancel_ = nullptr, *confirm_ = nullptr;
  QPushButton *take_back_ = nullptr, *look_ = nullptr, *load_ = nullptr;
  QLabel *there_ = nullptr, *judgement_ = nullptr, *do_ = nullptr, *state_ = nullptr;
  QLabel *result_ = nullptr, *in_force_ = nullptr;
  QListWidget* steps_ = nullptr;
  QProgressBar* progress_ = nullptr;
  QCheckBox *restart_ = nullptr, *changed_ = nullptr;
  QLineEdit* id_ = nullptr;
  QDoubleSpinBox* mass_ = nullptr;
  std::array<QDoubleSpinBox*, 6> gauges_{};
  QWidget *mass_row_ = nullptr, *gauge_row_ = nullptr;
  std::string shown_plan_, stored_ids_, awaited_;
};

}  // namespace assembly_cell::panel
