// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "goal_box.h"

#include <QCheckBox>
#include <QComboBox>
#include <QDoubleSpinBox>
#include <QGridLayout>
#include <QHBoxLayout>
#include <QLabel>
#include <QPushButton>
#include <algorithm>

#include "parts/colors.h"
#include "parts/parts.h"

namespace assembly_cell::panel {

namespace {

constexpr char kDefaultStrategy[] = "the supervisor's own";

}  // namespace

GoalBox::GoalBox(CellLink& link, const std::function<void()>& refresh) : QGroupBox("Alignment") {
  strategy_ = named("strategy", new QComboBox);
  strategy_->addItem(kDefaultStrategy);
  for (const char* name : {"auto", "single_contact", "double_contact", "vibratory", "twin_force",
                           "touch", "spiral", "passive"}) {
    strategy_->addItem(name);
  }
  insert_ = named("insert", new QCheckBox("insert to"));
  depth_ = named("depth", new QDoubleSpinBox);
  depth_->setRange(0.1, 1000.0);
  depth_->setDecimals(1);
  depth_->setValue(40.0);
  depth_->setSuffix(" mm");
  floor_ = named("floor", new QCheckBox("the floor"));
  start_ = button(
      "start", "Start", [this, &link] { link.start(request()); }, refresh);
  start_->setStyleSheet("QPushButton:enabled { background-color: " + goodColor().name() +
                        "; color: white; padding: 3px; border-radius: 3px; }");
  cancel_ = button(
      "cancel", "Cancel", [&link] { link.cancel(); }, refresh);
  retreat_ = button(
      "retreat", "Retreat", [&link] { link.retreat(); }, refresh);

  auto* grid = tightGrid(this);
  grid->addWidget(strategy_, 0, 0, 1, 3);
  grid->addLayout(row({insert_, depth_, floor_}), 1, 0, 1, 3);
  auto* buttons = new QHBoxLayout;
  for (QPushButton* each : {start_, cancel_, retreat_}) buttons->addWidget(each, 1);
  grid->addLayout(buttons, 2, 0, 1, 3);
  state_ = wrappedLabel("state");
  step_ = wrappedLabel("step", 2);
  contacts_ = wrappedLabel("contacts");
  reading_ = wrappedLabel("reading");
  outcome_ = wrappedLabel("outcome");
  int line = 3;
  for (QLabel* label : {state_, step_, contacts_, reading_, outcome_}) {
    grid->addWidget(new QLabel(label->objectName()), line, 0, Qt::AlignTop);
    grid->addWidget(label, line++, 1, 1, 2);
  }
  grid->setColumnStretch(1, 1);
  grid->setColumnStretch(2, 1);
}

GoalRequest GoalBox::request() const {
  GoalRequest goal;
  if (strategy_->currentIndex() > 0) goal.strategy = strategy_->currentText().toStdString();
  goal.insert = insert_->isChecked();
  goal.floor = floor_->isChecked();
  goal.depth = 1e-3 * depth_->value();
  return goal;
}

void GoalBox::show(const CellView& view) {
  const GoalView& goal = view.goal;
  const bool runs = !goal.goal.empty();
  start_->setEnabled(goal.there && !runs && !goal.stuck);
  retreat_->setEnabled(goal.there && !runs);
  cancel_->setEnabled(goal.there && (runs || goal.requested));
  depth_->setEnabled(insert_->isChecked() && !floor_->isChecked());
  floor_->setEnabled(insert_->isChecked());

  QString state = "not there";
  if (goal.there) {
    state = runs ? QString::fromStdString(goal.goal) : goal.requested ? "requested" : "idle";
    if (goal.stuck) state += ", stuck: retreat first";
    // while a goal runs, it is what the goal before has left
    if (goal.in_contact && goal.known && !goal.stuck && !runs) state += ", in contact";
    if (goal.in_contact && !goal.reason.empty())
      state += " (" + QString::fromStdString(goal.reason) + ")";
  }
  state_->setText(state);
  step_->setText(goal.step.empty() ? "-" : QString::fromStdString(goal.step + ": " + goal.message));
  QString contacts = QString::asprintf("%u in %.2f s", goal.contacts, goal.time);
  if (goal.inserting) {
    contacts += QString::asprintf("; %.1f mm deep, %.1f N, %d walls", 1e3 * goal.depth, goal.force,
                                  goal.walls);
  }
  contacts_->setText(contacts);
  reading_->setText(view.reading.empty() ? "-" : QString::fromStdString(view.reading));
  showOutcome(goal);
}

void GoalBox::showOutcome(const GoalView& goal) {
  using Outcome = GoalView::Outcome;
  const QString text = QString::fromStdString(goal.outcome_text);
  switch (goal.outcome) {
    case Outcome::kNone:
      setColored(outcome_, "-", QColor());
      break;
    case Outcome::kSuccess:
      setColored(outcome_, "success: " + text, goodColor());
      break;
    case Outcome::kFailure:
      setColored(outcome_, "failed: " + text, faultColor());
      break;
    case Outcome::kCancelled:
      setColored(outcome_, "cancelled: " + text, warningColor());
      break;
  }
}

std::map<std::string, std::string> GoalBox::settings() const {
  const auto flag = [](bool set) { return set ? "true" : "false"; };
  return {{"Strategy", request().strategy},
          {"Insert", flag(insert_->isChecked())},
          {"Floor", flag(floor_->isChecked())},
          {"Depth", QString::number(depth_->value()).toStdString()}};
}

void GoalBox::apply(const std::map<std::string, std::string>& settings) {
  strategy_->setCurrentIndex(std::max(0, strategy_->findText(setting(settings, "Strategy"))));
  insert_->setChecked(setting(settings, "Insert") == "true");
  floor_->setChecked(setting(settings, "Floor") == "true");
  bool is_number = false;
  const double depth = setting(settings, "Depth").toDouble(&is_number);
  if (is_number) depth_->setValue(depth);
}

}  // namespace assembly_cell::panel
