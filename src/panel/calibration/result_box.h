// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <QGroupBox>
#include <functional>
#include <string>
#include <vector>

#include "links/cell_link.h"

class QComboBox;
class QLabel;
class QPushButton;

namespace assembly_cell::panel {

/// Result of a calibration, the active calibrations, and the stored ones to activate.
class ResultBox : public QGroupBox {
 public:
  /// refresh: called after each click.
  ResultBox(CellLink& link, const std::function<void()>& refresh);
  void show(const CellView& view);

 private:
  QLabel *result_, *active_;
  QComboBox* stored_;
  QPushButton *list_, *load_;
  std::vector<std::string> shown_;  // ids
};

}  // namespace assembly_cell::panel
