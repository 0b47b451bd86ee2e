// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "calibration_page.h"

#include <QLabel>
#include <QVBoxLayout>

#include "measure_box.h"
#include "parts/colors.h"
#include "parts/parts.h"
#include "plan_box.h"
#include "result_box.h"

namespace assembly_cell::panel {

CalibrationPage::CalibrationPage(CellLink& link, const std::function<void()>& refresh) {
  there_ = wrappedLabel("calibration_there");
  plan_ = new PlanBox(link, refresh);
  measure_ = new MeasureBox(link, *plan_, refresh);
  result_ = new ResultBox(link, refresh);
  auto* column = tightColumn(this);
  for (QWidget* part : std::initializer_list<QWidget*>{there_, plan_, measure_, result_}) {
    column->addWidget(part);
  }
  column->addStretch();
}

void CalibrationPage::show(const CellView& view) {
  const bool there = view.calibration.there;
  setColored(there_, there ? "" : "calibration_server is not there: calibration.launch starts it",
             faultColor());
  there_->setVisible(!there);
  plan_->show(view);
  measure_->show(view);
  result_->show(view);
}

}  // namespace assembly_cell::panel
