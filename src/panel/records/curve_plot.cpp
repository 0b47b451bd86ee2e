// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "curve_plot.h"

#include <QPainter>
#include <algorithm>

#include "parts/colors.h"

namespace assembly_cell::panel {

namespace {

constexpr int kAxis = 16;                            // height of the texts at both ends [px]
constexpr double kMinDepth = 1e-3, kMinForce = 1.0;  // shown at least [m] [N]

}  // namespace

CurvePlot::CurvePlot(QWidget* parent) : QWidget(parent) {
  setSizePolicy(QSizePolicy::Expanding, QSizePolicy::Fixed);
}

QSize CurvePlot::sizeHint() const { return {340, 220}; }
QSize CurvePlot::minimumSizeHint() const { return {220, 220}; }

void CurvePlot::show(const RecordView& record) {
  record_ = record;
  update();
}

void CurvePlot::paintEvent(QPaintEvent*) {
  double depth = kMinDepth, low = 0.0, high = kMinForce;
  const auto include = [&](double at, double from, double to) {
    depth = std::max(depth, at);
    low = std::min(low, from);
    high = std::max(high, to);
  };
  for (const Pair& point : record_.curve) include(point[0], point[1], point[1]);
  for (const auto& limit : record_.band) include(limit[0], limit[1], limit[2]);
  const QRectF area(0, kAxis, width(), height() - 2 * kAxis);
  const auto at = [&](double x, double y) {
    return QPointF(area.left() + area.width() * std::max(0.0, x) / depth,
                   area.bottom() - area.height() * (y - low) / (high - low));
  };
  QPainter painter(this);
  QPolygonF band;
  for (const auto& limit : record_.band) band << at(limit[0], limit[1]);
  for (auto it = record_.band.rbegin(); it != record_.band.rend(); ++it) {
    band << at((*it)[0], (*it)[2]);
  }
  painter.setPen(Qt::NoPen);
  painter.setBrush(trackColor());
  painter.drawPolygon(band);
  painter.setPen(absentColor());
  painter.drawLine(at(0.0, 0.0), at(depth, 0.0));
  QPolygonF curve;
  for (const Pair& point : record_.curve) curve << at(point[0], point[1]);
  painter.setPen(QPen(colorOf(record_.state), 2));
  painter.drawPolyline(curve);

  QFont small = font();
  small.setPixelSize(11);
  painter.setFont(small);
  painter.setPen(palette().color(QPalette::WindowText));
  painter.drawText(QRectF(0, 0, width(), kAxis), Qt::AlignLeft | Qt::AlignVCenter,
                   QString::asprintf("%.1f to %.1f N along the axis", low, high));
  painter.drawText(QRectF(0, height() - kAxis, width(), kAxis), Qt::AlignRight | Qt::AlignVCenter,
                   QString::asprintf("%.1f mm deep", 1e3 * depth));
}

}  // namespace assembly_cell::panel
