// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <gtest/gtest.h>
#include <stdlib.h>

#include <QApplication>
#include <QCheckBox>
#include <QComboBox>
#include <QDoubleSpinBox>
#include <QImage>
#include <QLabel>
#include <QLineEdit>
#include <QListWidget>
#include <QProgressBar>
#include <QPushButton>
#include <QSpinBox>
#include <QTabWidget>
#include <QTest>
#include <string>

#include "cell_fixture.h"
#include "links/cell_link.h"
#include "widgets/cell_widget.h"

// What the tests of the panel share: the widget on a virtual screen, with clicks and pictures.
namespace assembly_cell::panel {

/// Processes events until the condition holds; false after the timeout.
template <class Condition>
bool seen(const Condition& condition, double patience = test::kPatience) {
  return test::waitFor(
      [&condition] {
        QCoreApplication::processEvents();
        return condition();
      },
      patience);
}

/// The panel's widget and its link, shown.
struct Screen {
  CellLink link;
  CellWidget widget{link};

  Screen() {
    widget.resize(460, 1020);
    widget.show();
  }

  template <class Part>
  Part* find(const char* name) {
    auto* part = dynamic_cast<Part*>(widget.findChild<QObject*>(name));
    EXPECT_NE(part, nullptr) << name;
    return part;
  }
  std::string text(const char* label) { return find<QLabel>(label)->text().toStdString(); }
  bool shows(const char* label, const std::string& part) {
    return text(label).find(part) != std::string::npos;
  }
  bool enabled(const char* name) { return find<QPushButton>(name)->isEnabled(); }
  /// Clicks a button as soon as it is enabled.
  void click(const char* name) {
    ASSERT_TRUE(seen([&] { return enabled(name); })) << name << ": " << text("answer");
    QTest::mouseClick(find<QPushButton>(name), Qt::LeftButton);
  }
};

inline int pixelsOf(const QImage& image, const QColor& color, int top, int bottom) {
  int count = 0;
  for (int y = top; y < bottom; ++y) {
    for (int x = 0; x < image.width(); ++x) count += image.pixelColor(x, y) == color ? 1 : 0;
  }
  return count;
}

/// For the documentation, with ASSEMBLY_CELL_PICTURE.
inline void keepPicture(QWidget& widget) {
  const char* file = getenv("ASSEMBLY_CELL_PICTURE");
  if (file == nullptr) return;
  EXPECT_TRUE(widget.grab().save(file)) << file;
}

}  // namespace assembly_cell::panel
