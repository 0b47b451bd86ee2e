// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <QWidget>

#include "links/cell_view.h"

namespace assembly_cell::panel {

/// Six bars from the middle: force and torque of a sensor. A bar's end is the limit of the sensor
/// along that axis; green, from half of the limit on amber, from nine tenths on red. A thin line in
/// the bars of the force is the limit beyond which a goal ends.
class ForceBars : public QWidget {
 public:
  explicit ForceBars(QWidget* parent = nullptr);
  /// goal_limit: 0 where it isn't known [N].
  void show(const SensorView& sensor, double goal_limit);
  QSize sizeHint() const override;
  QSize minimumSizeHint() const override;

 protected:
  void paintEvent(QPaintEvent* event) override;

 private:
  SensorView sensor_;
  double goal_limit_ = 0.0;
};

}  // namespace assembly_cell::panel
