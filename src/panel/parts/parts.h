// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <QColor>
#include <QString>
#include <functional>
#include <initializer_list>
#include <map>
#include <string>

#include "links/cell_view.h"

class QGridLayout;
class QHBoxLayout;
class QLabel;
class QPushButton;
class QScrollArea;
class QVBoxLayout;
class QWidget;

// Small parts of the panel's pages.
namespace assembly_cell::panel {

/// The widget with an object name.
template <class Widget>
Widget* named(const QString& name, Widget* widget) {
  widget->setObjectName(name);
  return widget;
}

/// A click calls `action`, then `refresh`.
QPushButton* button(const QString& name, const QString& text, const std::function<void()>& action,
                    const std::function<void()>& refresh);
/// Wraps its text, never widens its page; at least `lines` high, so that the layout below doesn't
/// move.
QLabel* wrappedLabel(const QString& name, int lines = 1);
QGridLayout* tightGrid(QWidget* parent);
QVBoxLayout* tightColumn(QWidget* parent);
/// Side by side, the first one as wide as possible.
QHBoxLayout* row(std::initializer_list<QWidget*> widgets);
QScrollArea* scrolled(QWidget* content);
/// An invalid colour: that of the palette.
void setColored(QLabel* label, const QString& text, const QColor& color);

/// Has this request no answer yet?
bool waits(const std::map<std::string, Answer>& answers, const std::string& name);

/// A stored setting; empty: none.
QString setting(const std::map<std::string, std::string>& settings, const char* key);

}  // namespace assembly_cell::panel
