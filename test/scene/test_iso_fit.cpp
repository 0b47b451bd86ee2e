// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
// Tolerance zones against values printed in ISO 286-2.
#include <gtest/gtest.h>

#include <string>

#include "assembly_cell/base/input_error.h"
#include "assembly_cell/mechanism/iso_fit.h"

namespace assembly_cell {
namespace {

std::string refusalOf(const std::string& name, double diameter) {
  try {
    isoFit(name, diameter);
  } catch (const InputError& error) {
    return error.what();
  }
  return "";
}

void expectZone(const ToleranceZone& zone, double low, double high) {
  EXPECT_NEAR(1e6 * zone.low, low, 1e-9);
  EXPECT_NEAR(1e6 * zone.high, high, 1e-9);
}

TEST(IsoFit, ZonesAreThoseOfTheStandard) {
  struct {
    const char* name;
    double diameter, hole[2], shaft[2];  // [mm], [µm]
  } const kRows[] = {
      {"H7/g6", 50.0, {0, 25}, {-25, -9}},   {"H7/g6", 20.0, {0, 21}, {-20, -7}},
      {"H7/h6", 20.0, {0, 21}, {-13, 0}},    {"H8/f7", 50.0, {0, 39}, {-50, -25}},
      {"H7/g6", 10.0, {0, 15}, {-14, -5}},   {"H7/k6", 25.0, {0, 21}, {2, 15}},
      {"H7/p6", 40.0, {0, 25}, {26, 42}},    {"G7/h6", 16.0, {6, 24}, {-11, 0}},
      {"JS7/h6", 8.0, {-7.5, 7.5}, {-9, 0}}, {"H11/d9", 100.0, {0, 220}, {-207, -120}},
      {"H7/g6", 3.0, {0, 10}, {-8, -2}},     {"H7/g6", 3.001, {0, 12}, {-12, -4}},
      {"H8/k8", 20.0, {0, 33}, {0, 33}},
  };
  for (const auto& row : kRows) {
    SCOPED_TRACE(testing::Message() << row.name << " of " << row.diameter);
    const Fit fit = isoFit(row.name, 1e-3 * row.diameter);
    expectZone(fit.hole, row.hole[0], row.hole[1]);
    expectZone(fit.shaft, row.shaft[0], row.shaft[1]);
  }
}

TEST(IsoFit, OthersAreRefusedByName) {
  for (const char* name : {"", "H7", "h6/H7", "H7/q6", "H7/g6 ", "H4/g6", "H12/g6", "A7/g6"}) {
    const std::string refusal = refusalOf(name, 0.02);
    EXPECT_EQ(refusal.rfind("fit '" + std::string(name) + "': give", 0), 0U) << refusal;
  }
  for (const double diameter : {0.0, -0.01, 0.181}) {
    const std::string refusal = refusalOf("H7/g6", diameter);
    EXPECT_NE(refusal.find("at most 180 mm"), std::string::npos) << refusal;
  }
}

}  // namespace
}  // namespace assembly_cell
