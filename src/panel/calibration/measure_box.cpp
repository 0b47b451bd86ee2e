// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "measure_box.h"

#include <QCheckBox>
#include <QDoubleSpinBox>
#include <QGridLayout>
#include <QHBoxLayout>
#include <QLabel>
#include <QLineEdit>
#include <QProgressBar>
#include <QPushButton>
#include <QVBoxLayout>
#include <algorithm>

#include "parts/parts.h"
#include "plan_box.h"

namespace assembly_cell::panel {

namespace {

constexpr char kThenCall[] = "; then call confirm";      // the page has a button for it
constexpr char kWaiting[] = "waiting for confirmation";  // state of the action

}  // namespace

MeasureBox::MeasureBox(CellLink& link, PlanBox& plan, const std::function<void()>& refresh)
    : QGroupBox("2. Measure, step by step") {
  restart_ = named("restart", new QCheckBox("delete earlier observations"));
  id_ = named("id", new QLineEdit);
  id_->setPlaceholderText("name of the result; empty: date and time");
  const auto begin = [this, &link, &plan] {
    link.startCalibration({plan.select(), restart_->isChecked(), id_->text().toStdString()});
    restart_->setChecked(false);
  };
  begin_ = button("begin", "Begin or go on", begin, refresh);
  cancel_ = button(
      "cancel_calibration", "Cancel", [&link] { link.cancelCalibration(); }, refresh);
  progress_ = named("progress", new QProgressBar);
  state_ = wrappedLabel("calibration_state");
  load_ = wrappedLabel("load_to_apply");
  QFont bold = load_->font();
  bold.setBold(true);
  load_->setFont(bold);
  addMeasured();
  confirm_ = button(
      "confirm", "The load is on: read", [this, &link] { link.confirmLoad(measured()); }, refresh);
  remove_ = button(
      "remove_last", "Remove the last", [&link] { link.removeLast(); }, refresh);

  auto* column = tightColumn(this);
  column->addWidget(restart_);
  column->addWidget(id_);
  column->addLayout(row({begin_, cancel_}));
  for (QWidget* part :
       std::initializer_list<QWidget*>{progress_, state_, load_, changed_, mass_row_, gauge_row_}) {
    column->addWidget(part);
  }
  column->addLayout(row({confirm_, remove_}));
}

void MeasureBox::addMeasured() {
  changed_ = named("changed", new QCheckBox("not as planned:"));
  mass_ = named("mass", new QDoubleSpinBox);
  mass_->setDecimals(4);
  mass_->setRange(0.0, 100.0);
  mass_->setSuffix(" kg");
  mass_row_ = new QWidget;
  mass_row_->setLayout(row({new QLabel("mass"), mass_}));
  gauge_row_ = new QWidget;
  auto* gauges = tightGrid(gauge_row_);
  for (int i = 0; i < 6; ++i) {
    auto* gauge = named("gauge_" + QString::number(i + 1), new QDoubleSpinBox);
    gauge->setDecimals(4);
    gauge->setRange(-1000.0, 1000.0);
    gauge->setSuffix(" mm");
    gauges->addWidget(gauge, i / 3, i % 3);
    gauges_[static_cast<std::size_t>(i)] = gauge;
  }
}

Measured MeasureBox::measured() const {
  Measured measured;
  measured.changed = changed_->isChecked() || gauge_row_->isVisibleTo(this);
  measured.mass = mass_->value();
  for (std::size_t i = 0; i < gauges_.size(); ++i) {
    measured.gauges[i] = 1e-3 * gauges_[i]->value();
  }
  return measured;
}

void MeasureBox::show(const CellView& all) {
  const CalibrationView& view = all.calibration;
  const bool waiting = view.running && (view.step_state == kWaiting || view.step_unknown);
  begin_->setEnabled(view.there && !view.running);
  cancel_->setEnabled(view.there && view.running);
  confirm_->setEnabled(view.there && waiting && !waits(all.answers, "confirm"));
  remove_->setEnabled(view.there && !view.running && view.observations > 0 &&
                      !waits(all.answers, "remove last"));
  progress_->setRange(0, std::max(1, static_cast<int>(view.step_count)));
  progress_->setValue(static_cast<int>(view.step));
  progress_->setFormat(QString::asprintf("%u of %u steps", view.step, view.step_count));
  QString state = view.there ? QString::fromStdString(view.state) : "not there";
  if (!view.step_state.empty()) state += ": " + QString::fromStdString(view.step_state);
  state += QString::asprintf("; %u observations on disk", view.observations);
  if (!view.last_id.empty()) state += ", the last one " + QString::fromStdString(view.last_id);
  state_->setText(state);
  load_->setText(view.step_unknown
                     ? "A calibration was running before this panel was opened: cancel it and "
                       "continue, or confirm the load that it waits for."
                     : QString::fromStdString(view.step_message).remove(kThenCall));
  showMeasured(view, waiting);
}

// Deviations from the plan, where a step has any.
void MeasureBox::showMeasured(const CalibrationView& view, bool waiting) {
  const int current = waiting ? currentStep(view) : -1;
  const CalibrationStep step =
      current >= 0 ? view.steps[static_cast<std::size_t>(current)] : CalibrationStep();
  const bool weight = step.kind == "weight";
  changed_->setVisible(weight);
  mass_row_->setVisible(weight);
  mass_->setEnabled(changed_->isChecked());
  gauge_row_->setVisible(step.kind == "displacement");
  if (view.step_message == shown_) return;
  shown_ = view.step_message;
  changed_->setChecked(false);
  mass_->setValue(step.mass);
}

}  // namespace assembly_cell::panel
