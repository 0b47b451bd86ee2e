// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <QColor>

#include "links/cell_view.h"

// Colours with a meaning; the tests look for them in the pixels.
namespace assembly_cell::panel {

inline QColor goodColor() { return {46, 160, 67}; }
inline QColor warningColor() { return {219, 140, 0}; }
inline QColor faultColor() { return {207, 34, 46}; }
inline QColor absentColor() { return {175, 180, 187}; }
inline QColor trackColor() { return {211, 215, 221}; }
inline QColor limitColor() { return {30, 30, 30}; }

inline QColor colorOf(Light light) {
  switch (light) {
    case Light::kGood:
      return goodColor();
    case Light::kWarning:
      return warningColor();
    case Light::kFault:
      return faultColor();
    case Light::kNotThere:
      break;
  }
  return absentColor();
}

inline QColor colorOf(RecordState state) {
  switch (state) {
    case RecordState::kGood:
      return goodColor();
    case RecordState::kBad:
      return faultColor();
    case RecordState::kNotStored:
      return warningColor();
    case RecordState::kGrowing:
    case RecordState::kNoRules:
      break;
  }
  return limitColor();
}

}  // namespace assembly_cell::panel
