// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <QGroupBox>
#include <array>

#include "links/cell_view.h"

class QLabel;

namespace assembly_cell::panel {

/// Offset and tilt of the peg at the start: estimate, sd, ground truth, error.
class EstimateBox : public QGroupBox {
 public:
  EstimateBox();
  void show(const EstimateView& estimate);

 private:
  std::array<QLabel*, 8> labels_{};  // offset, tilt
};

}  // namespace assembly_cell::panel
