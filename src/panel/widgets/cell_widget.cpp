// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "cell_widget.h"

#include <QCheckBox>
#include <QComboBox>
#include <QDoubleSpinBox>
#include <QGridLayout>
#include <QGroupBox>
#include <QHBoxLayout>
#include <QLabel>
#include <QPushButton>
#include <QScrollArea>
#include <QSpinBox>
#include <QTabWidget>
#include <QTimer>
#include <QVBoxLayout>
#include <algorithm>
#include <cmath>
#include <utility>

#include "calibration_page.h"
#include "colors.h"
#include "force_bars.h"
#include "node_lights.h"
#include "parts.h"

namespace assembly_cell::panel {

namespace {

constexpr int kRefresh = 100;             // [ms]
constexpr int kTableFont = 12;            // [px]
constexpr double kDegree = M_PI / 180.0;  // [rad]
constexpr char kOwn[] = "the supervisor's own";

QString pairText(const Pair& values, double unit) {
  return QString::asprintf("%.3f  %.3f", values[0] / unit, values[1] / unit);
}

QString sdText(double sd, double unit) {
  return sd > 0.0 ? QString::asprintf("%.4f", sd / unit) : QString("-");
}

QString errorText(const Pair& a, const Pair& b, double unit) {
  return QString::asprintf("%.3f", std::hypot(a[0] - b[0], a[1] - b[1]) / unit);
}

}  // namespace

CellWidget::CellWidget(CellLink& link, QWidget* parent) : QWidget(parent), link_(link) {
  auto* cell = new QWidget;
  auto* column = new QVBoxLayout(cell);
  column->setContentsMargins(4, 4, 4, 4);
  column->setSpacing(4);
  for (QWidget* box : {goalBox(), estimateBox(), forceBox(), simulationBox(), nodeBox()}) {
    column->addWidget(box);
  }
  column->addStretch();
  page_ = new CalibrationPage(link_, [this] { refresh(); });
  auto* tabs = new QTabWidget;
  tabs->setObjectName("tabs");
  tabs->addTab(scrolled(cell), "Cell");
  tabs->addTab(scrolled(page_), "Calibration");
  answer_ = wrappedLabel("answer", 2);
  auto* all = new QVBoxLayout(this);
  all->setContentsMargins(0, 0, 0, 0);
  all->addWidget(tabs);
  all->addWidget(answer_);

  auto* timer = new QTimer(this);
  connect(timer, &QTimer::timeout, this, [this] { refresh(); });
  timer->start(kRefresh);
  refresh();
}

// what was asked for shows at once
void CellWidget::onClick(QPushButton* button, std::function<void()> ask) {
  connect(button, &QPushButton::clicked, this, [this, ask = std::move(ask)] {
    ask();
    refresh();
  });
}

QWidget* CellWidget::goalBox() {
  strategy_ = new QComboBox;
  strategy_->setObjectName("strategy");
  strategy_->addItem(kOwn);
  for (const char* name : {"auto", "single_contact", "double_contact", "vibratory", "twin_force",
                           "touch", "spiral", "passive"}) {
    strategy_->addItem(name);
  }
  insert_ = new QCheckBox("insert to");
  insert_->setObjectName("insert");
  depth_ = new QDoubleSpinBox;
  depth_->setObjectName("depth");
  depth_->setRange(0.1, 1000.0);
  depth_->setDecimals(1);
  depth_->setValue(40.0);
  depth_->setSuffix(" mm");
  floor_ = new QCheckBox("the floor");
  floor_->setObjectName("floor");
  start_ = button("start", "Start");
  start_->setStyleSheet("QPushButton:enabled { background-color: " + goodColor().name() +
                        "; color: white; padding: 3px; border-radius: 3px; }");
  cancel_ = button("cancel", "Cancel");
  retreat_ = button("retreat", "Retreat");
  onClick(start_, [this] {
    GoalRequest goal;
    if (strategy_->currentIndex() > 0) goal.strategy = strategy_->currentText().toStdString();
    goal.insert = insert_->isChecked();
    goal.floor = floor_->isChecked();
    goal.depth = 1e-3 * depth_->value();
    link_.start(goal);
  });
  onClick(cancel_, [this] { link_.cancel(); });
  onClick(retreat_, [this] { link_.retreat(); });

  auto* box = new QGroupBox("Alignment");
  auto* grid = tightGrid(box);
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
  const std::array<std::pair<const char*, QLabel*>, 5> lines = {{{"state", state_},
                                                                 {"step", step_},
                                                                 {"contacts", contacts_},
                                                                 {"reading", reading_},
                                                                 {"outcome", outcome_}}};
  for (const auto& [name, label] : lines) {
    grid->addWidget(new QLabel(name), line, 0, Qt::AlignTop);
    grid->addWidget(label, line++, 1, 1, 2);
  }
  grid->setColumnStretch(1, 1);
  grid->setColumnStretch(2, 1);
  return box;
}

QWidget* CellWidget::estimateBox() {
  auto* box = new QGroupBox("Peg at the start");
  auto* grid = tightGrid(box);
  int column = 1;
  for (const char* title : {"estimated x, y", "sd", "true x, y", "error"}) {
    grid->addWidget(new QLabel(title), 0, column++);
  }
  grid->addWidget(new QLabel("offset [mm]"), 1, 0);
  grid->addWidget(new QLabel("tilt [deg]"), 2, 0);
  const std::array<const char*, 8> names = {"offset", "offset_sd", "true_offset", "offset_error",
                                            "tilt",   "tilt_sd",   "true_tilt",   "tilt_error"};
  for (std::size_t i = 0; i < names.size(); ++i) {
    estimate_[i] = new QLabel("-");
    estimate_[i]->setObjectName(names[i]);
    grid->addWidget(estimate_[i], i < 4 ? 1 : 2, 1 + static_cast<int>(i % 4));
  }
  // four numbers in a row, whatever the font of the rest
  QFont small = box->font();
  small.setPixelSize(kTableFont);
  for (QLabel* label : box->findChildren<QLabel*>()) label->setFont(small);
  box->setToolTip("As the peg hung before its first move. sd: of both axes together.");
  return box;
}

QWidget* CellWidget::forceBox() {
  auto* box = new QGroupBox("Forces");
  auto* column = new QVBoxLayout(box);
  column->setContentsMargins(4, 4, 4, 4);
  column->setSpacing(3);
  for (std::size_t i = 0; i < 2; ++i) {
    const QString name = kSensorNames[i];
    calibration_[i] = new QLabel;
    calibration_[i]->setObjectName(name + "_calibration");
    zero_[i] = button(name + "_zero", "Zero");
    undo_[i] = button(name + "_undo", "Undo");
    const Sensor sensor = i == 0 ? kSensorA : kSensorB;
    onClick(zero_[i], [this, sensor] { link_.zero(sensor); });
    onClick(undo_[i], [this, sensor] { link_.undoBias(sensor); });
    column->addLayout(row({calibration_[i], zero_[i], undo_[i]}));
    bars_[i] = new ForceBars;
    bars_[i]->setObjectName(name + "_bars");
    column->addWidget(bars_[i]);
  }
  return box;
}

QWidget* CellWidget::simulationBox() {
  auto* box = new QGroupBox("Simulation");
  auto* column = new QVBoxLayout(box);
  column->setContentsMargins(4, 4, 4, 4);
  column->setSpacing(3);
  simulation_ = wrappedLabel("simulation");
  pause_ = button("pause", "Pause");
  run_ = button("run", "Run");
  step_button_ = button("step_blocks", "Step");
  reset_ = button("reset", "Reset");
  blocks_ = new QSpinBox;
  blocks_->setObjectName("blocks");
  blocks_->setRange(1, 1000);
  blocks_->setSuffix(" blocks");
  onClick(pause_, [this] { link_.pause(true); });
  onClick(run_, [this] { link_.pause(false); });
  onClick(step_button_, [this] { link_.step(static_cast<std::uint32_t>(blocks_->value())); });
  onClick(reset_, [this] { link_.reset(); });
  column->addWidget(simulation_);
  column->addLayout(row({pause_, run_, step_button_, blocks_, reset_}));
  return box;
}

QWidget* CellWidget::nodeBox() {
  auto* box = new QGroupBox("Nodes");
  auto* column = new QVBoxLayout(box);
  column->setContentsMargins(4, 4, 4, 4);
  lights_ = new NodeLights;
  lights_->setObjectName("lights");
  column->addWidget(lights_);
  return box;
}

// ---- what is shown ----

void CellWidget::refresh() {
  const CellView view = link_.view();
  showGoal(view);
  showEstimate(view.estimate);
  showSensors(view);
  showSimulator(view);
  lights_->show(view.nodes);
  page_->show(view);
  showAnswer(view.answers);
}

void CellWidget::showGoal(const CellView& view) {
  const GoalView& goal = view.goal;
  const bool runs = !goal.goal.empty();
  start_->setEnabled(goal.there && !runs && !goal.stuck);
  retreat_->setEnabled(goal.there && !runs);
  cancel_->setEnabled(goal.there && (runs || goal.asked));
  depth_->setEnabled(insert_->isChecked() && !floor_->isChecked());
  floor_->setEnabled(insert_->isChecked());

  QString state = "not there";
  if (goal.there) {
    state = runs ? QString::fromStdString(goal.goal) : goal.asked ? "asked" : "idle";
    if (goal.stuck) state += ", stuck: retreat first";
    if (goal.in_contact && !goal.stuck) state += ", in contact";
    if (goal.in_contact && !goal.reason.empty())
      state += " (" + QString::fromStdString(goal.reason) + ")";
  }
  state_->setText(state);
  step_->setText(goal.step.empty() ? "-" : QString::fromStdString(goal.step + ": " + goal.message));
  QString contacts = QString::asprintf("%u read in %.2f s", goal.contacts, goal.time);
  if (goal.inserting) {
    contacts += QString::asprintf("; %.1f mm deep, %.1f N, %d walls", 1e3 * goal.depth, goal.force,
                                  goal.walls);
  }
  contacts_->setText(contacts);
  reading_->setText(view.reading.empty() ? "-" : QString::fromStdString(view.reading));

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

void CellWidget::showEstimate(const EstimateView& e) {
  const auto rows = [this](std::size_t first, const EstimateView& shown, const Pair& estimated,
                           double sd, const Pair& truth, double unit) {
    const bool both = shown.known && shown.truth_known;
    estimate_[first]->setText(shown.known ? pairText(estimated, unit) : "-");
    estimate_[first + 1]->setText(shown.known ? sdText(sd, unit) : "-");
    estimate_[first + 2]->setText(shown.truth_known   ? pairText(truth, unit)
                                  : shown.truth_there ? "-"
                                                      : "not there");
    estimate_[first + 3]->setText(both ? errorText(estimated, truth, unit) : "-");
  };
  rows(0, e, e.offset, e.position_sd, e.true_offset, 1e-3);
  rows(4, e, e.tilt, e.rotation_sd, e.true_tilt, kDegree);
}

void CellWidget::showSensors(const CellView& view) {
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

void CellWidget::showSimulator(const CellView& view) {
  const SimulatorView& simulator = view.simulator;
  QString text = QString::fromStdString(simulator.message);
  if (simulator.there) {
    text += QString::asprintf(", %.2f s", simulator.time);
    if (!simulator.paused) {
      text += QString::asprintf(", %.1f times real time", simulator.real_time_factor);
    }
  }
  simulation_->setText(text);
  const bool there = simulator.there, paused = simulator.paused;
  pause_->setEnabled(there && !paused && !waits(view.answers, "pause"));
  run_->setEnabled(there && paused && !waits(view.answers, "run"));
  step_button_->setEnabled(there && paused && !waits(view.answers, "step"));
  reset_->setEnabled(there && !waits(view.answers, "reset"));
}

// the newest answer in one line
void CellWidget::showAnswer(const std::map<std::string, Answer>& answers) {
  const auto newest = std::max_element(
      answers.begin(), answers.end(),
      [](const auto& a, const auto& b) { return a.second.number < b.second.number; });
  answer_->setVisible(newest != answers.end());
  if (newest == answers.end()) return;
  const Answer& answer = newest->second;
  const QString name = QString::fromStdString(newest->first);
  if (answer.state == Answer::State::kWaiting) {
    const auto seconds =
        std::chrono::duration_cast<std::chrono::seconds>(Clock::now() - answer.since).count();
    setColored(answer_,
               name + QString::asprintf(": no answer yet, %d s", static_cast<int>(seconds)),
               QColor());
    return;
  }
  const bool good = answer.state == Answer::State::kGood;
  setColored(answer_,
             name + (good ? ": done. " : " failed: ") + QString::fromStdString(answer.text),
             good ? QColor() : faultColor());
}

// ---- what is kept ----

std::map<std::string, std::string> CellWidget::settings() const {
  const auto flag = [](bool set) { return set ? "true" : "false"; };
  return {{"Strategy", strategy_->currentIndex() > 0 ? strategy_->currentText().toStdString() : ""},
          {"Insert", flag(insert_->isChecked())},
          {"Floor", flag(floor_->isChecked())},
          {"Depth", QString::number(depth_->value()).toStdString()},
          {"Blocks", std::to_string(blocks_->value())}};
}

void CellWidget::apply(const std::map<std::string, std::string>& settings) {
  const auto find = [&settings](const char* key) {
    const auto found = settings.find(key);
    return found == settings.end() ? QString() : QString::fromStdString(found->second);
  };
  strategy_->setCurrentIndex(std::max(0, strategy_->findText(find("Strategy"))));
  insert_->setChecked(find("Insert") == "true");
  floor_->setChecked(find("Floor") == "true");
  bool number = false;
  const double depth = find("Depth").toDouble(&number);
  if (number) depth_->setValue(depth);
  const int blocks = find("Blocks").toInt(&number);
  if (number) blocks_->setValue(blocks);
}

}  // namespace assembly_cell::panel
