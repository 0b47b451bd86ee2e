// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "cell_widget.h"

#include <QGroupBox>
#include <QLabel>
#include <QScrollArea>
#include <QTabWidget>
#include <QTimer>
#include <QVBoxLayout>
#include <algorithm>

#include "calibration/calibration_page.h"
#include "estimate_box.h"
#include "goal_box.h"
#include "parts/colors.h"
#include "parts/node_lights.h"
#include "parts/parts.h"
#include "records/record_page.h"
#include "sensor_box.h"
#include "simulation_box.h"

namespace assembly_cell::panel {

namespace {

constexpr int kRefresh = 100;  // [ms]

}  // namespace

CellWidget::CellWidget(CellLink& link, QWidget* parent) : QWidget(parent), link_(link) {
  const auto refresh_now = [this] { refresh(); };
  goal_ = new GoalBox(link_, refresh_now);
  estimate_ = new EstimateBox;
  sensors_ = new SensorBox(link_, refresh_now);
  simulation_ = new SimulationBox(link_, refresh_now);
  auto* nodes = new QGroupBox("Nodes");
  lights_ = named("lights", new NodeLights);
  tightColumn(nodes)->addWidget(lights_);
  auto* cell = new QWidget;
  auto* column = tightColumn(cell);
  column->setSpacing(4);
  for (QWidget* box :
       std::initializer_list<QWidget*>{goal_, estimate_, sensors_, simulation_, nodes}) {
    column->addWidget(box);
  }
  column->addStretch();
  page_ = new CalibrationPage(link_, refresh_now);
  records_ = new RecordPage;
  auto* tabs = named("tabs", new QTabWidget);
  tabs->addTab(scrolled(cell), "Cell");
  tabs->addTab(scrolled(page_), "Calibration");
  tabs->addTab(scrolled(records_), "Records");
  answer_ = wrappedLabel("answer", 2);
  auto* all = new QVBoxLayout(this);
  all->setContentsMargins(0, 0, 0, 0);
  all->addWidget(tabs);
  all->addWidget(answer_);

  auto* timer = new QTimer(this);
  connect(timer, &QTimer::timeout, this, refresh_now);
  timer->start(kRefresh);
  refresh();
}

void CellWidget::refresh() {
  const CellView view = link_.view();
  goal_->show(view);
  estimate_->show(view.estimate);
  sensors_->show(view);
  simulation_->show(view);
  lights_->show(view.nodes);
  records_->show(view.record);
  page_->show(view);
  showAnswer(view.answers);
}

// The newest answer in one line.
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

std::map<std::string, std::string> CellWidget::settings() const {
  auto settings = goal_->settings();
  settings.merge(simulation_->settings());
  return settings;
}

void CellWidget::apply(const std::map<std::string, std::string>& settings) {
  goal_->apply(settings);
  simulation_->apply(settings);
}

}  // namespace assembly_cell::panel
