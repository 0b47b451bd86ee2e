// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <QWidget>

#include "links/cell_view.h"

namespace assembly_cell::panel {

/// Force up the peg's axis over depth, within its band. The curve has the verdict's colour.
class CurvePlot : public QWidget {
 public:
  explicit CurvePlot(QWidget* parent = nullptr);
  void show(const RecordView& record);
  QSize sizeHint() const override;
  QSize minimumSizeHint() const override;

 protected:
  void paintEvent(QPaintEvent* event) override;

 private:
  RecordView record_;
};

}  // namespace assembly_cell::panel
