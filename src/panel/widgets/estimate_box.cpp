// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "estimate_box.h"

#include <QGridLayout>
#include <QLabel>
#include <cmath>

#include "parts/parts.h"

namespace assembly_cell::panel {

namespace {

constexpr int kTableFont = 12;            // [px]
constexpr double kDegree = M_PI / 180.0;  // [rad]

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

EstimateBox::EstimateBox() : QGroupBox("Peg at the start") {
  auto* grid = tightGrid(this);
  int column = 1;
  for (const char* title : {"estimated x, y", "sd", "true x, y", "error"}) {
    grid->addWidget(new QLabel(title), 0, column++);
  }
  grid->addWidget(new QLabel("offset [mm]"), 1, 0);
  grid->addWidget(new QLabel("tilt [deg]"), 2, 0);
  const std::array<const char*, 8> names = {"offset", "offset_sd", "true_offset", "offset_error",
                                            "tilt",   "tilt_sd",   "true_tilt",   "tilt_error"};
  for (std::size_t i = 0; i < names.size(); ++i) {
    labels_[i] = named(names[i], new QLabel("-"));
    grid->addWidget(labels_[i], i < 4 ? 1 : 2, 1 + static_cast<int>(i % 4));
  }
  // four numbers fit in a row with any font of the other boxes
  QFont small = font();
  small.setPixelSize(kTableFont);
  for (QLabel* label : findChildren<QLabel*>()) label->setFont(small);
  setToolTip("Pose of the peg before its first move. sd: of both axes together.");
}

void EstimateBox::show(const EstimateView& e) {
  const auto showRow = [this, &e](std::size_t first, const Pair& estimated, double sd,
                                  const Pair& truth, double unit) {
    const bool both = e.known && e.truth_known;
    labels_[first]->setText(e.known ? pairText(estimated, unit) : "-");
    labels_[first + 1]->setText(e.known ? sdText(sd, unit) : "-");
    labels_[first + 2]->setText(e.truth_known   ? pairText(truth, unit)
                                : e.truth_there ? "-"
                                                : "not there");
    labels_[first + 3]->setText(both ? errorText(estimated, truth, unit) : "-");
  };
  showRow(0, e.offset, e.position_sd, e.true_offset, 1e-3);
  showRow(4, e.tilt, e.rotation_sd, e.true_tilt, kDegree);
}

}  // namespace assembly_cell::panel
