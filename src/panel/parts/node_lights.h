// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <QWidget>
#include <vector>

#include "links/cell_view.h"

namespace assembly_cell::panel {

/// A light for each node, its name and the reason: grey not there, green good, amber a warning,
/// red a fault.
class NodeLights : public QWidget {
 public:
  explicit NodeLights(QWidget* parent = nullptr);
  void show(const std::vector<NodeView>& nodes);
  QSize sizeHint() const override;
  QSize minimumSizeHint() const override;
  /// Middle of a node's light; (−1, −1) where it isn't shown.
  QPoint lightOf(const std::string& node) const;

 protected:
  void paintEvent(QPaintEvent* event) override;
  bool event(QEvent* event) override;

 private:
  std::vector<NodeView> nodes_;
};

}  // namespace assembly_cell::panel
