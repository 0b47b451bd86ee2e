// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "parts.h"

#include <QGridLayout>
#include <QHBoxLayout>
#include <QLabel>
#include <QPushButton>
#include <QScrollArea>
#include <QVBoxLayout>

namespace assembly_cell::panel {

QPushButton* button(const QString& name, const QString& text, const std::function<void()>& action,
                    const std::function<void()>& refresh) {
  auto* out = named(name, new QPushButton(text));
  // no wider than its text
  out->setMinimumWidth(out->fontMetrics().horizontalAdvance(text) + 14);
  QObject::connect(out, &QPushButton::clicked, out, [action, refresh] {
    action();
    refresh();
  });
  return out;
}

QLabel* wrappedLabel(const QString& name, int lines) {
  auto* label = named(name, new QLabel);
  label->setWordWrap(true);
  label->setTextFormat(Qt::PlainText);
  label->setTextInteractionFlags(Qt::TextSelectableByMouse);
  QSizePolicy policy(QSizePolicy::Ignored, QSizePolicy::Preferred);
  policy.setHeightForWidth(true);
  label->setSizePolicy(policy);
  label->setMinimumHeight(lines * label->fontMetrics().lineSpacing());
  label->setAlignment(Qt::AlignTop);
  return label;
}

QGridLayout* tightGrid(QWidget* parent) {
  auto* grid = new QGridLayout(parent);
  grid->setContentsMargins(4, 4, 4, 4);
  grid->setHorizontalSpacing(6);
  grid->setVerticalSpacing(2);
  return grid;
}

QVBoxLayout* tightColumn(QWidget* parent) {
  auto* column = new QVBoxLayout(parent);
  column->setContentsMargins(4, 4, 4, 4);
  column->setSpacing(3);
  return column;
}

QHBoxLayout* row(std::initializer_list<QWidget*> widgets) {
  auto* layout = new QHBoxLayout;
  layout->setContentsMargins(0, 0, 0, 0);
  layout->setSpacing(4);
  for (QWidget* widget : widgets) layout->addWidget(widget, widget == *widgets.begin() ? 1 : 0);
  return layout;
}

QScrollArea* scrolled(QWidget* content) {
  auto* area = new QScrollArea;
  area->setWidget(content);
  area->setWidgetResizable(true);
  area->setFrameShape(QFrame::NoFrame);
  return area;
}

void setColored(QLabel* label, const QString& text, const QColor& color) {
  label->setText(text);
  QPalette palette;
  if (color.isValid()) palette.setColor(QPalette::WindowText, color);
  label->setPalette(palette);
}

bool waits(const std::map<std::string, Answer>& answers, const std::string& name) {
  const auto found = answers.find(name);
  return found != answers.end() && found->second.state == Answer::State::kWaiting;
}

QString setting(const std::map<std::string, std::string>& settings, const char* key) {
  const auto found = settings.find(key);
  return found == settings.end() ? QString() : QString::fromStdString(found->second);
}

}  // namespace assembly_cell::panel
