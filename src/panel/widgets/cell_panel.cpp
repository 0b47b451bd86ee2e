// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include <rviz/panel.h>

#include <QVBoxLayout>
#include <map>
#include <pluginlib/class_list_macros.hpp>
#include <string>

#include "cell_widget.h"
#include "links/cell_link.h"

namespace assembly_cell::panel {

/// The panel as rviz has it: the widget, and its settings in rviz's file.
class CellPanel : public rviz::Panel {
 public:
  explicit CellPanel(QWidget* parent = nullptr) : rviz::Panel(parent) {
    auto* column = new QVBoxLayout(this);
    column->setContentsMargins(0, 0, 0, 0);
    widget_ = new CellWidget(link_);
    column->addWidget(widget_);
  }

  ~CellPanel() override {
    // before the link that it uses
    delete widget_;
  }

  void load(const rviz::Config& config) override {
    rviz::Panel::load(config);
    auto settings = widget_->settings();
    for (auto& [key, value] : settings) {
      QString text;
      if (config.mapGetString(QString::fromStdString(key), &text)) value = text.toStdString();
    }
    widget_->apply(settings);
  }

  void save(rviz::Config config) const override {
    rviz::Panel::save(config);
    for (const auto& [key, value] : widget_->settings()) {
      config.mapSetValue(QString::fromStdString(key), QString::fromStdString(value));
    }
  }

 private:
  CellLink link_;
  CellWidget* widget_ = nullptr;
};

}  // namespace assembly_cell::panel

PLUGINLIB_EXPORT_CLASS(assembly_cell::panel::CellPanel, rviz::Panel)
