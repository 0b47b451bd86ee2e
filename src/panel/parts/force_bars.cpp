// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "force_bars.h"

#include <QPainter>
#include <algorithm>
#include <cmath>

#include "colors.h"

namespace assembly_cell::panel {

namespace {

constexpr int kBarRow = 13;                              // height [px]
constexpr int kBarName = 20, kValue = 122;               // widths of the texts [px]
constexpr double kWarnFrom = 0.5, kFaultFrom = 0.9;      // of the limit
constexpr std::array<double, 2> kScale = {100.0, 10.0};  // where no limit is known [N] [N m]
constexpr std::array<const char*, 6> kNames = {"fx", "fy", "fz", "tx", "ty", "tz"};

QColor barColor(double share) {
  return share < kWarnFrom ? goodColor() : share < kFaultFrom ? warningColor() : faultColor();
}

}  // namespace

ForceBars::ForceBars(QWidget* parent) : QWidget(parent) {
  setSizePolicy(QSizePolicy::Expanding, QSizePolicy::Fixed);
}

QSize ForceBars::sizeHint() const { return {340, 6 * kBarRow}; }
QSize ForceBars::minimumSizeHint() const { return {220, 6 * kBarRow}; }

void ForceBars::show(const SensorView& sensor, double goal_limit) {
  sensor_ = sensor;
  goal_limit_ = goal_limit;
  update();
}

void ForceBars::paintEvent(QPaintEvent*) {
  QPainter painter(this);
  QFont small = font();
  small.setPixelSize(11);
  painter.setFont(small);
  const int left = kBarName, right = width() - kValue;
  const double middle = 0.5 * (left + right), half = 0.5 * (right - left) - 1.0;
  for (std::size_t i = 0; i < 6; ++i) {
    const bool force = i < 3;
    const int top = static_cast<int>(i) * kBarRow;
    const double scale = sensor_.limit_known ? sensor_.limit[i] : kScale[force ? 0 : 1];
    const QRectF track(left, top + 2, right - left, kBarRow - 4);
    painter.setPen(palette().color(QPalette::WindowText));
    painter.drawText(QRectF(0, top, kBarName, kBarRow), Qt::AlignVCenter, kNames[i]);
    painter.fillRect(track, trackColor());
    QString value = "-";
    if (sensor_.there) {
      const double share = std::clamp(sensor_.wrench[i] / scale, -1.0, 1.0);
      const double reach = share * half;
      painter.fillRect(
          QRectF(std::min(middle, middle + reach), top + 3, std::abs(reach), kBarRow - 6),
          barColor(std::abs(share)));
      const QString limit = sensor_.limit_known
                                ? QString::asprintf(" of %.*f", force ? 0 : 1, sensor_.limit[i])
                                : QString(", no limit");
      value = QString::asprintf("%.*f%s %s", force ? 1 : 2, sensor_.wrench[i],
                                limit.toUtf8().constData(), force ? "N" : "N m");
    }
    if (force && goal_limit_ > 0.0 && goal_limit_ < scale) {
      for (const double side : {-1.0, 1.0}) {
        painter.fillRect(
            QRectF(middle + side * half * goal_limit_ / scale, top + 2, 1, kBarRow - 4),
            limitColor());
      }
    }
    painter.fillRect(QRectF(middle, top + 2, 1, kBarRow - 4), absentColor());
    painter.setPen(palette().color(QPalette::WindowText));
    painter.drawText(QRectF(right + 6, top, kValue - 6, kBarRow), Qt::AlignVCenter, value);
  }
}

}  // namespace assembly_cell::panel
