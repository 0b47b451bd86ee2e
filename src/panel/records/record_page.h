// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <QWidget>

#include "links/cell_view.h"

class QLabel;
class QListWidget;

namespace assembly_cell::panel {

class CurvePlot;

/// The record of the part under way and the verdicts on the last ones.
class RecordPage : public QWidget {
 public:
  RecordPage();
  void show(const RecordView& record);

 private:
  QLabel *store_, *next_, *verdict_;
  CurvePlot* plot_;
  QListWidget* parts_;
};

}  // namespace assembly_cell::panel
