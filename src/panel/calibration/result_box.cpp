// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "result_box.h"

#include <QComboBox>
#include <QHBoxLayout>
#include <QLabel>
#include <QPushButton>
#include <QVBoxLayout>

#include "parts/colors.h"
#include "parts/parts.h"

namespace assembly_cell::panel {

ResultBox::ResultBox(CellLink& link, const std::function<void()>& refresh)
    : QGroupBox("3. Result and active calibration") {
  result_ = wrappedLabel("calibration_result");
  active_ = wrappedLabel("active_calibration");
  stored_ = named("stored", new QComboBox);
  list_ = button(
      "list", "List", [&link] { link.requestStored(); }, refresh);
  const auto load = [this, &link] { link.loadCalibration(stored_->currentText().toStdString()); };
  load_ = button("load", "Activate", load, refresh);
  auto* column = tightColumn(this);
  column->addWidget(result_);
  column->addWidget(active_);
  column->addLayout(row({stored_, list_, load_}));
}

void ResultBox::show(const CellView& all) {
  const CalibrationView& view = all.calibration;
  list_->setEnabled(view.there && !waits(all.answers, "stored"));
  load_->setEnabled(view.there && stored_->count() > 0 && !waits(all.answers, "load"));
  setColored(result_, view.result_known ? QString::fromStdString(view.result) : "no result yet",
             !view.result_known ? QColor()
             : view.success     ? goodColor()
                                : faultColor());
  const auto id = [](const std::string& active) {
    return active.empty() ? QString("none") : QString::fromStdString(active);
  };
  active_->setText("active: sensor_a " + id(view.active[0]) + ", sensor_b " + id(view.active[1]));
  if (view.stored == shown_) return;
  shown_ = view.stored;
  stored_->clear();
  for (const std::string& stored : shown_) stored_->addItem(QString::fromStdString(stored));
}

}  // namespace assembly_cell::panel
