// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "sensor_box.h"

#include <QHBoxLayout>
#include <QLabel>
#include <QPushButton>
#include <QVBoxLayout>

#include "parts/force_bars.h"
#include "parts/parts.h"

namespace assembly_cell::panel {

SensorBox::SensorBox(CellLink& link, const std::function<void()>& refresh) : QGroupBox("Forces") {
  auto* column = tightColumn(this);
  for (const Sensor sensor : {kSensorA, kSensorB}) {
    const QString name = kSensorNames[sensor];
    calibration_[sensor] = named(name + "_calibration", new QLabel);
    zero_[sensor] = button(
        name + "_zero", "Zero", [&link, sensor] { link.zero(sensor); }, refresh);
    undo_[sensor] = button(
        name + "_undo", "Undo", [&link, sensor] { link.undoBias(sensor); }, refresh);
    bars_[sensor] = named(name + "_bars", new ForceBars);
    column->addLayout(row({calibration_[sensor], zero_[sensor], undo_[sensor]}));
    column->addWidget(bars_[sensor]);
  }
}

void SensorBox::show(const CellView& view) {
  for (std::size_t i = 0; i < 2; ++i) {
    const SensorView& sensor = view.sensors[i];
    bars_[i]->show(sensor, view.goal_force_limit);
    const std::string name = kSensorNames[i];
    calibration_[i]->setText(
        QString::fromStdString(name + ": " +
                               (!sensor.there                ? "not there"
                                : sensor.calibration.empty() ? "no calibration"
                                                             : sensor.calibration)));
    zero_[i]->setEnabled(sensor.there && !waits(view.answers, name + " zero"));
    undo_[i]->setEnabled(sensor.there && !waits(view.answers, name + " undo"));
  }
}

}  // namespace assembly_cell::panel
