// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <QGroupBox>
#include <array>
#include <functional>

#include "links/cell_link.h"

class QLabel;
class QPushButton;

namespace assembly_cell::panel {

class ForceBars;

/// Wrench bars and calibration of both sensors, buttons to zero them and to undo that.
class SensorBox : public QGroupBox {
 public:
  /// refresh: called after each click.
  SensorBox(CellLink& link, const std::function<void()>& refresh);
  void show(const CellView& view);

 private:
  std::array<ForceBars*, 2> bars_{};
  std::array<QLabel*, 2> calibration_{};
  std::array<QPushButton*, 2> zero_{}, undo_{};
};

}  // namespace assembly_cell::panel
