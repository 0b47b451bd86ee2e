// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <QWidget>
#include <array>
#include <functional>
#include <map>
#include <string>

#include "links/cell_link.h"
#include "links/cell_view.h"

class QCheckBox;
class QComboBox;
class QDoubleSpinBox;
class QLabel;
class QLayout;
class QPushButton;
class QSpinBox;

namespace assembly_cell::panel {

class CalibrationPage;
class ForceBars;
class NodeLights;

/// The panel's content: what the link says, ten times a second, and buttons. Each part has an
/// object name.
class CellWidget : public QWidget {
 public:
  explicit CellWidget(CellLink& link, QWidget* parent = nullptr);

  /// Settings that are kept: strategy, insert, floor, depth in mm, blocks.
  std::map<std::string, std::string> settings() const;
  void apply(const std::map<std::string, std::string>& settings);

 private:
  void onClick(QPushButton* button, std::function<void()> ask);
  QWidget* goalBox();
  QWidget* estimateBox();
  QWidget* forceBox();
  QWidget* simulationBox();
  QWidget* nodeBox();

  void refresh();
  void showGoal(const CellView& view);
  void showEstimate(const EstimateView& estimate);
  void showSensors(const CellView& view);
  void showSimulator(const CellView& view);
  void showAnswer(const std::map<std::string, Answer>& answers);

  CellLink& link_;
  QComboBox* strategy_ = nullptr;
  QCheckBox *insert_ = nullptr, *floor_ = nullptr;
  QDoubleSpinBox* depth_ = nullptr;
  QPushButton *start_ = nullptr, *cancel_ = nullptr, *retreat_ = nullptr;
  QLabel *state_ = nullptr, *step_ = nullptr, *contacts_ = nullptr, *reading_ = nullptr;
  QLabel *outcome_ = nullptr, *answer_ = nullptr;
  std::array<QLabel*, 8> estimate_{};  // offset, tilt: estimated, sd, true, error
  std::array<ForceBars*, 2> bars_{};
  std::array<QLabel*, 2> calibration_{};
  std::array<QPushButton*, 2> zero_{}, undo_{};
  QLabel* simulation_ = nullptr;
  QPushButton *pause_ = nullptr, *run_ = nullptr, *step_button_ = nullptr, *reset_ = nullptr;
  QSpinBox* blocks_ = nullptr;
  NodeLights* lights_ = nullptr;
  CalibrationPage* page_ = nullptr;
};

}  // namespace assembly_cell::panel
