// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <QWidget>
#include <map>
#include <string>

#include "links/cell_link.h"
#include "links/cell_view.h"

class QLabel;

namespace assembly_cell::panel {

class CalibrationPage;
class EstimateBox;
class GoalBox;
class NodeLights;
class RecordPage;
class SensorBox;
class SimulationBox;

/// Content of the panel: shows the link's view ten times a second, and has buttons. Each part has
/// an object name.
class CellWidget : public QWidget {
 public:
  explicit CellWidget(CellLink& link, QWidget* parent = nullptr);

  /// Stored settings: strategy, insert, floor, depth in mm, blocks.
  std::map<std::string, std::string> settings() const;
  void apply(const std::map<std::string, std::string>& settings);

 private:
  void refresh();
  void showAnswer(const std::map<std::string, Answer>& answers);

  CellLink& link_;
  GoalBox* goal_;
  EstimateBox* estimate_;
  SensorBox* sensors_;
  SimulationBox* simulation_;
  NodeLights* lights_;
  CalibrationPage* page_;
  RecordPage* records_;
  QLabel* answer_;
};

}  // namespace assembly_cell::panel
