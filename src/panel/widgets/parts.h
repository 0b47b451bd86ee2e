// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <QColor>
#include <QString>
#include <initializer_list>
#include <map>
#include <string>

#include "links/cell_view.h"

class QGridLayout;
class QHBoxLayout;
class QLabel;
class QPushButton;
class QScrollArea;
class QWidget;

// Small parts of the panel's pages.
namespace assembly_cell::panel {

QPushButton* button(const QString& name, const QString& text);
/// Breaks lines, never makes its page wider; has room for so many lines, so that what is below
/// stays where it is.
QLabel* wrappedLabel(const QString& name, int lines = 1);
QGridLayout* tightGrid(QWidget* parent);
/// Side by side, the first one as wide as may be.
QHBoxLayout* row(std::initializer_list<QWidget*> widgets);
QScrollArea* scrolled(QWidget* content);
/// An invalid colour: that of the palette.
void setColored(QLabel* label, const QString& text, const QColor& color);

/// Has this been asked and not been answered yet?
bool waits(const std::map<std::string, Answer>& answers, const std::string& name);

}  // namespace assembly_cell::panel
