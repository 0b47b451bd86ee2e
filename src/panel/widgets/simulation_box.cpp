// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "simulation_box.h"

#include <QHBoxLayout>
#include <QLabel>
#include <QPushButton>
#include <QSpinBox>
#include <QVBoxLayout>

#include "parts/parts.h"

namespace assembly_cell::panel {

SimulationBox::SimulationBox(CellLink& link, const std::function<void()>& refresh)
    : QGroupBox("Simulation") {
  state_ = wrappedLabel("simulation");
  blocks_ = named("blocks", new QSpinBox);
  blocks_->setRange(1, 1000);
  blocks_->setSuffix(" blocks");
  pause_ = button(
      "pause", "Pause", [&link] { link.pause(true); }, refresh);
  run_ = button(
      "run", "Run", [&link] { link.pause(false); }, refresh);
  const auto step = [this, &link] { link.step(static_cast<std::uint32_t>(blocks_->value())); };
  step_ = button("step_blocks", "Step", step, refresh);
  reset_ = button(
      "reset", "Reset", [&link] { link.reset(); }, refresh);
  auto* column = tightColumn(this);
  column->addWidget(state_);
  column->addLayout(row({pause_, run_, step_, blocks_, reset_}));
}

void SimulationBox::show(const CellView& view) {
  const SimulatorView& simulator = view.simulator;
  QString text = QString::fromStdString(simulator.message);
  if (simulator.there) {
    text += QString::asprintf(", %.2f s", simulator.time);
    if (!simulator.paused) {
      text += QString::asprintf(", %.1f times real time", simulator.real_time_factor);
    }
  }
  state_->setText(text);
  const bool there = simulator.there, paused = simulator.paused;
  pause_->setEnabled(there && !paused && !waits(view.answers, "pause"));
  run_->setEnabled(there && paused && !waits(view.answers, "run"));
  step_->setEnabled(there && paused && !waits(view.answers, "step"));
  reset_->setEnabled(there && !waits(view.answers, "reset"));
}

std::map<std::string, std::string> SimulationBox::settings() const {
  return {{"Blocks", std::to_string(blocks_->value())}};
}

void SimulationBox::apply(const std::map<std::string, std::string>& settings) {
  bool is_number = false;
  const int blocks = setting(settings, "Blocks").toInt(&is_number);
  if (is_number) blocks_->setValue(blocks);
}

}  // namespace assembly_cell::panel
