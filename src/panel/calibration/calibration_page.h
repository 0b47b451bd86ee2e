// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <QWidget>
#include <functional>

#include "links/cell_link.h"

class QLabel;

namespace assembly_cell::panel {

class MeasureBox;
class PlanBox;
class ResultBox;

/// Guides through a calibration: choose and check a plan, measure step by step, see the result,
/// activate a calibration.
class CalibrationPage : public QWidget {
 public:
  /// refresh: called after each click.
  CalibrationPage(CellLink& link, const std::function<void()>& refresh);
  void show(const CellView& view);

 private:
  QLabel* there_;
  PlanBox* plan_;
  MeasureBox* measure_;
  ResultBox* result_;
};

}  // namespace assembly_cell::panel
