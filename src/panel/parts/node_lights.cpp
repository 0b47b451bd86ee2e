// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "node_lights.h"

#include <QHelpEvent>
#include <QPainter>
#include <QToolTip>
#include <cstddef>

#include "colors.h"

namespace assembly_cell::panel {

namespace {

constexpr int kRow = 16, kLight = 10, kName = 150;  // [px]

QPoint middleOf(std::size_t row) { return {kRow / 2, static_cast<int>(row) * kRow + kRow / 2}; }

}  // namespace

NodeLights::NodeLights(QWidget* parent) : QWidget(parent) {
  setSizePolicy(QSizePolicy::Expanding, QSizePolicy::Fixed);
}

QSize NodeLights::sizeHint() const { return {340, static_cast<int>(nodes_.size()) * kRow}; }
QSize NodeLights::minimumSizeHint() const { return {220, sizeHint().height()}; }

void NodeLights::show(const std::vector<NodeView>& nodes) {
  const bool other = nodes.size() != nodes_.size();
  nodes_ = nodes;
  if (other) updateGeometry();
  update();
}

QPoint NodeLights::lightOf(const std::string& node) const {
  for (std::size_t i = 0; i < nodes_.size(); ++i) {
    if (nodes_[i].node == node) return middleOf(i);
  }
  return {-1, -1};
}

void NodeLights::paintEvent(QPaintEvent*) {
  QPainter painter(this);
  painter.setRenderHint(QPainter::Antialiasing);
  QFont small = font();
  small.setPixelSize(11);
  painter.setFont(small);
  for (std::size_t i = 0; i < nodes_.size(); ++i) {
    const NodeView& node = nodes_[i];
    const QPoint middle = middleOf(i);
    painter.setPen(Qt::NoPen);
    painter.setBrush(colorOf(node.light));
    painter.drawEllipse(middle, kLight / 2, kLight / 2);
    painter.setPen(palette().color(QPalette::WindowText));
    const int top = middle.y() - kRow / 2, reason = kRow + kName;
    painter.drawText(QRect(kRow + 2, top, kName, kRow), Qt::AlignVCenter,
                     QString::fromStdString(node.node));
    const QString text = painter.fontMetrics().elidedText(QString::fromStdString(node.reason),
                                                          Qt::ElideRight, width() - reason);
    painter.drawText(QRect(reason, top, width() - reason, kRow), Qt::AlignVCenter, text);
  }
}

// the whole reason where the pointer rests
bool NodeLights::event(QEvent* event) {
  if (event->type() != QEvent::ToolTip) return QWidget::event(event);
  const auto* help = static_cast<QHelpEvent*>(event);
  const auto row = static_cast<std::size_t>(help->y() / kRow);
  if (row < nodes_.size()) {
    QToolTip::showText(help->globalPos(), QString::fromStdString(nodes_[row].reason), this);
  }
  return true;
}

}  // namespace assembly_cell::panel
