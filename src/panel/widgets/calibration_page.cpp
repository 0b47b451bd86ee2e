// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "calibration_page.h"

#include <QCheckBox>
#include <QComboBox>
#include <QDoubleSpinBox>
#include <QGroupBox>
#include <QHBoxLayout>
#include <QLabel>
#include <QLineEdit>
#include <QListWidget>
#include <QProgressBar>
#include <QPushButton>
#include <QVBoxLayout>
#include <algorithm>
#include <utility>

#include "colors.h"
#include "parts.h"

namespace assembly_cell::panel {

namespace {

constexpr char kThenCall[] = "; then call confirm";      // the page has a button for it
constexpr char kWaiting[] = "waiting for confirmation";  // state of the action

QVBoxLayout* tightColumn(QWidget* parent) {
  auto* column = new QVBoxLayout(parent);
  column->setContentsMargins(4, 4, 4, 4);
  column->setSpacing(3);
  return column;
}

// the step whose load the action is about; −1: none
int currentStep(const CalibrationView& view) {
  for (std::size_t i = 0; i < view.steps.size(); ++i) {
    const std::string& text = view.steps[i].text;
    // equal texts are equal loads: of these the next one
    const bool said = view.step_message.compare(0, text.size(), text) == 0;
    if (said && i >= view.step) return static_cast<int>(i);
  }
  return -1;
}

}  // namespace

CalibrationPage::CalibrationPage(CellLink& link, std::function<void()> asked)
    : link_(link), asked_(std::move(asked)) {
  auto* column = tightColumn(this);
  there_ = wrappedLabel("calibration_there");
  column->addWidget(there_);
  for (QWidget* box : {planBox(), stepBox(), forceBox()}) column->addWidget(box);
  column->addStretch();
}

void CalibrationPage::onClick(QPushButton* button, std::function<void()> ask) {
  connect(button, &QPushButton::clicked, this, [this, ask = std::move(ask)] {
    ask();
    asked_();
  });
}

QWidget* CalibrationPage::planBox() {
  auto* box = new QGroupBox("1. Plan");
  auto* column = tightColumn(box);
  plan_ = new QComboBox;
  plan_->setObjectName("plan");
  plan_->addItems({"recommended", "quadratic", "displacement"});
  ask_ = button("ask_plan", "Show and judge");
  onClick(ask_, [this] { link_.askPlan(plan_->currentText().toStdString()); });
  judgement_ = wrappedLabel("judgement");
  steps_ = new QListWidget;
  steps_->setObjectName("steps");
  steps_->setMinimumHeight(110);
  steps_->setWordWrap(true);
  column->addLayout(row({plan_, ask_}));
  column->addWidget(judgement_);
  column->addWidget(steps_);
  return box;
}

QWidget* CalibrationPage::stepBox() {
  auto* box = new QGroupBox("2. Measure, step by step");
  auto* column = tightColumn(box);
  begin_ = button("begin", "Begin or go on");
  cancel_ = button("cancel_calibration", "Cancel");
  restart_ = new QCheckBox("throw away what was measured");
  restart_->setObjectName("restart");
  id_ = new QLineEdit;
  id_->setObjectName("id");
  id_->setPlaceholderText("name of the result; empty: date and time");
  onClick(begin_, [this] {
    const std::string plan = plan_->currentText().toStdString();
    // the page shows what it leads through
    if (shown_plan_ != plan) link_.askPlan(plan);
    link_.beginCalibration({plan, restart_->isChecked(), id_->text().toStdString()});
    restart_->setChecked(false);
  });
  onClick(cancel_, [this] { link_.cancelCalibration(); });
  progress_ = new QProgressBar;
  progress_->setObjectName("progress");
  state_ = wrappedLabel("calibration_state");
  do_ = wrappedLabel("what_to_do");
  QFont bold = do_->font();
  bold.setBold(true);
  do_->setFont(bold);

  changed_ = new QCheckBox("not as planned:");
  changed_->setObjectName("changed");
  mass_ = new QDoubleSpinBox;
  mass_->setObjectName("mass");
  mass_->setDecimals(4);
  mass_->setRange(0.0, 100.0);
  mass_->setSuffix(" kg");
  mass_row_ = new QWidget;
  mass_row_->setLayout(row({new QLabel("mass"), mass_}));
  gauge_row_ = new QWidget;
  auto* gauges = tightGrid(gauge_row_);
  for (std::size_t i = 0; i < gauges_.size(); ++i) {
    gauges_[i] = new QDoubleSpinBox;
    gauges_[i]->setObjectName("gauge_" + QString::number(i + 1));
    gauges_[i]->setDecimals(4);
    gauges_[i]->setRange(-1000.0, 1000.0);
    gauges_[i]->setSuffix(" mm");
    gauges->addWidget(gauges_[i], static_cast<int>(i) / 3, static_cast<int>(i) % 3);
  }
  confirm_ = button("confirm", "The load is on: read");
  take_back_ = button("take_back", "Take back the last");
  onClick(confirm_, [this] {
    Measured measured;
    measured.changed = changed_->isChecked() || gauge_row_->isVisibleTo(this);
    measured.mass = mass_->value();
    for (std::size_t i = 0; i < gauges_.size(); ++i)
      measured.gauges[i] = 1e-3 * gauges_[i]->value();
    link_.confirmLoad(measured);
  });
  onClick(take_back_, [this] { link_.removeLast(); });

  column->addWidget(restart_);
  column->addWidget(id_);
  column->addLayout(row({begin_, cancel_}));
  column->addWidget(progress_);
  column->addWidget(state_);
  column->addWidget(do_);
  column->addWidget(changed_);
  column->addWidget(mass_row_);
  column->addWidget(gauge_row_);
  column->addLayout(row({confirm_, take_back_}));
  return box;
}

QWidget* CalibrationPage::forceBox() {
  auto* box = new QGroupBox("3. Result, and what is in force");
  auto* column = tightColumn(box);
  result_ = wrappedLabel("calibration_result");
  in_force_ = wrappedLabel("in_force");
  stored_ = new QComboBox;
  stored_->setObjectName("stored");
  look_ = button("look", "Look");
  load_ = button("load", "Put in force");
  onClick(look_, [this] { link_.askStored(); });
  onClick(load_, [this] { link_.loadCalibration(stored_->currentText().toStdString()); });
  column->addWidget(result_);
  column->addWidget(in_force_);
  column->addLayout(row({stored_, look_, load_}));
  return box;
}

void CalibrationPage::show(const CellView& all) {
  const CalibrationView& view = all.calibration;
  const bool waiting = view.running && (view.step_state == kWaiting || view.step_unknown);
  setColored(there_,
             view.there ? "" : "calibration_server is not there: calibration.launch starts it",
             faultColor());
  there_->setVisible(!view.there);
  ask_->setEnabled(view.there && !waits(all.answers, "plan"));
  begin_->setEnabled(view.there && !view.running);
  cancel_->setEnabled(view.there && view.running);
  confirm_->setEnabled(view.there && waiting && !waits(all.answers, "confirm"));
  take_back_->setEnabled(view.there && !view.running && view.observations > 0 &&
                         !waits(all.answers, "take back"));
  look_->setEnabled(view.there && !waits(all.answers, "stored"));
  load_->setEnabled(view.there && stored_->count() > 0 && !waits(all.answers, "load"));

  showSteps(view);
  showMeasured(view, waiting);
  setColored(judgement_, QString::fromStdString(view.judgement),
             view.plan_good ? QColor() : faultColor());
  progress_->setRange(0, std::max(1, static_cast<int>(view.step_count)));
  progress_->setValue(static_cast<int>(view.step));
  progress_->setFormat(QString::asprintf("%u of %u steps", view.step, view.step_count));
  QString state = view.there ? QString::fromStdString(view.state) : "not there";
  if (!view.step_state.empty()) state += ": " + QString::fromStdString(view.step_state);
  state += QString::asprintf("; %u observations on disk", view.observations);
  if (!view.last_id.empty()) state += ", the last one " + QString::fromStdString(view.last_id);
  state_->setText(state);
  do_->setText(view.step_unknown ? "A calibration was under way before this panel: cancel it and "
                                   "go on, or confirm the load that it waits for."
                                 : QString::fromStdString(view.step_message).remove(kThenCall));
  setColored(result_, view.result_known ? QString::fromStdString(view.result) : "no result yet",
             !view.result_known ? QColor()
             : view.success     ? goodColor()
                                : faultColor());
  const auto id = [](const std::string& in_force) {
    return in_force.empty() ? QString("none") : QString::fromStdString(in_force);
  };
  in_force_->setText("in force: sensor_a " + id(view.in_force[0]) + ", sensor_b " +
                     id(view.in_force[1]));
  std::string ids;
  for (const std::string& stored : view.stored) ids += stored + "\n";
  if (ids != stored_ids_) {
    stored_ids_ = ids;
    stored_->clear();
    for (const std::string& stored : view.stored) stored_->addItem(QString::fromStdString(stored));
  }
}

void CalibrationPage::showSteps(const CalibrationView& view) {
  if (view.plan != shown_plan_ || steps_->count() != static_cast<int>(view.steps.size())) {
    shown_plan_ = view.plan;
    steps_->clear();
    int number = 0;
    for (const CalibrationStep& step : view.steps) {
      steps_->addItem(QString::number(++number) + ". " + QString::fromStdString(step.text));
    }
  }
  const int current = view.running ? currentStep(view) : -1;
  if (current >= 0 && current != steps_->currentRow()) steps_->setCurrentRow(current);
}

// what a person may have done otherwise, where there is something to say
void CalibrationPage::showMeasured(const CalibrationView& view, bool waiting) {
  const int current = waiting ? currentStep(view) : -1;
  const CalibrationStep step =
      current >= 0 ? view.steps[static_cast<std::size_t>(current)] : CalibrationStep();
  const bool weight = step.kind == "weight";
  changed_->setVisible(weight);
  mass_row_->setVisible(weight);
  mass_->setEnabled(changed_->isChecked());
  gauge_row_->setVisible(step.kind == "displacement");
  if (view.step_message == awaited_) return;
  // another step: as planned until somebody says otherwise
  awaited_ = view.step_message;
  changed_->setChecked(false);
  mass_->setValue(step.mass);
}

}  // namespace assembly_cell::panel
