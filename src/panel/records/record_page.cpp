// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "record_page.h"

#include <QLabel>
#include <QListWidget>
#include <QVBoxLayout>

#include "curve_plot.h"
#include "parts/colors.h"
#include "parts/parts.h"

namespace assembly_cell::panel {

namespace {

QString lineOf(const PartView& part) {
  return QString::number(part.id) + "  " +
         QString::fromStdString(part.serial + "  " + part.verdict);
}

}  // namespace

RecordPage::RecordPage() {
  store_ = wrappedLabel("record_store", 2);
  next_ = wrappedLabel("next_part");
  plot_ = named("curve", new CurvePlot);
  verdict_ = wrappedLabel("verdict", 2);
  parts_ = named("parts", new QListWidget);
  auto* column = tightColumn(this);
  for (QWidget* part : std::initializer_list<QWidget*>{store_, next_, plot_, verdict_, parts_}) {
    column->addWidget(part);
  }
}

void RecordPage::show(const RecordView& record) {
  const bool bad = record.there && !record.writable;
  setColored(store_,
             !record.there ? QString("assembly_recorder is not there")
             : bad         ? "no run can be stored: " + QString::fromStdString(record.reason)
                           : QString("runs are stored"),
             bad ? faultColor() : QColor());
  next_->setText(
      "next part: " +
      QString::fromStdString(record.serial.empty() ? "a running number" : record.serial) +
      ", program " +
      QString::fromStdString(record.program.empty() ? "of the scenario" : record.program));
  plot_->show(record);
  const bool has_verdict = !record.parts.empty() && record.state != RecordState::kGrowing;
  setColored(verdict_, has_verdict ? lineOf(record.parts.front()) : QString("-"),
             has_verdict ? colorOf(record.state) : QColor());
  const QString newest = record.parts.empty() ? QString() : lineOf(record.parts.front());
  if (parts_->count() == static_cast<int>(record.parts.size()) &&
      (parts_->count() == 0 || parts_->item(0)->text() == newest)) {
    return;
  }
  parts_->clear();
  for (const PartView& part : record.parts) {
    parts_->addItem(lineOf(part));
    parts_->item(parts_->count() - 1)->setForeground(colorOf(part.state));
  }
}

}  // namespace assembly_cell::panel
