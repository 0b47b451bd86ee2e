// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "plan_box.h"

#include <QComboBox>
#include <QHBoxLayout>
#include <QLabel>
#include <QListWidget>
#include <QPushButton>
#include <QVBoxLayout>

#include "parts/colors.h"
#include "parts/parts.h"

namespace assembly_cell::panel {

int currentStep(const CalibrationView& view) {
  for (std::size_t i = view.step; i < view.steps.size(); ++i) {
    // steps with equal texts have equal loads: the next of them
    const std::string& text = view.steps[i].text;
    if (view.step_message.compare(0, text.size(), text) == 0) return static_cast<int>(i);
  }
  return -1;
}

PlanBox::PlanBox(CellLink& link, const std::function<void()>& refresh)
    : QGroupBox("1. Plan"), link_(link) {
  plan_ = named("plan", new QComboBox);
  plan_->addItems({"recommended", "quadratic", "displacement"});
  const auto request = [this] { link_.requestPlan(plan_->currentText().toStdString()); };
  check_ = button("check_plan", "Show and evaluate", request, refresh);
  report_ = wrappedLabel("plan_report");
  steps_ = named("steps", new QListWidget);
  steps_->setMinimumHeight(110);
  steps_->setWordWrap(true);
  auto* column = tightColumn(this);
  column->addLayout(row({plan_, check_}));
  column->addWidget(report_);
  column->addWidget(steps_);
}

std::string PlanBox::select() {
  const std::string plan = plan_->currentText().toStdString();
  if (shown_ != plan) link_.requestPlan(plan);
  return plan;
}

void PlanBox::show(const CellView& all) {
  const CalibrationView& view = all.calibration;
  check_->setEnabled(view.there && !waits(all.answers, "plan"));
  setColored(report_, QString::fromStdString(view.plan_report),
             view.plan_good ? QColor() : faultColor());
  if (view.plan != shown_ || steps_->count() != static_cast<int>(view.steps.size())) {
    shown_ = view.plan;
    steps_->clear();
    int number = 0;
    for (const CalibrationStep& step : view.steps) {
      steps_->addItem(QString::number(++number) + ". " + QString::fromStdString(step.text));
    }
  }
  const int current = view.running ? currentStep(view) : -1;
  if (current >= 0 && current != steps_->currentRow()) steps_->setCurrentRow(current);
}

}  // namespace assembly_cell::panel
