// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <QGroupBox>
#include <functional>
#include <map>
#include <string>

#include "links/cell_link.h"

class QCheckBox;
class QComboBox;
class QDoubleSpinBox;
class QLabel;
class QPushButton;

namespace assembly_cell::panel {

/// Starts and cancels goals, and shows their progress.
class GoalBox : public QGroupBox {
 public:
  /// refresh: called after each click.
  GoalBox(CellLink& link, const std::function<void()>& refresh);
  void show(const CellView& view);
  /// Strategy, insert, floor, depth in mm.
  std::map<std::string, std::string> settings() const;
  void apply(const std::map<std::string, std::string>& settings);

 private:
  void showOutcome(const GoalView& goal);
  GoalRequest request() const;

  QComboBox* strategy_;
  QCheckBox *insert_, *floor_;
  QDoubleSpinBox* depth_;
  QPushButton *start_, *cancel_, *retreat_;
  QLabel *state_, *step_, *contacts_, *reading_, *outcome_;
};

}  // namespace assembly_cell::panel
