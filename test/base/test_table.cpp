// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/base/table.h"

#include <gtest/gtest.h>

#include <cmath>

#include "assembly_cell/base/input_error.h"

namespace assembly_cell {
namespace {

Table parse(const std::string& text, bool blanks = false) {
  return tableFromText(text, "f.csv", {"t", "a"}, blanks);
}

std::string refusal(const std::string& text) {
  try {
    parse(text).need({"a"});
  } catch (const InputError& error) {
    return error.what();
  }
  return "";
}

TEST(Table, ReadsHeadersSeparatorsAndComments) {
  for (const char* text :
       {"1,2\n3,4\n", "1\t2\n3\t4\n", "1;2;\n3;4;\n", "# note\n 1   2\n\n 3 4 \n",
        "t,A\n1,2\n3,4\n", "\xEF\xBB\xBF  t , \"a\"\r\n1,2\r\n3,4\r\n"}) {
    const Table table = parse(text);
    ASSERT_EQ(table.rows.size(), 2u) << text;
    EXPECT_EQ(table.rows[1][table.need({"a"})], 4.0) << text;
  }
  EXPECT_TRUE(std::isnan(parse("1,\n3,4\n", true).rows[0][1]));
}

TEST(Table, NamesFileLineAndColumn) {
  EXPECT_EQ(refusal("t,b\n1,2\n"), "f.csv:1: column a is missing: add it");
  EXPECT_EQ(refusal("t,a\n1,nan\n"), "f.csv:2: column a is 'nan': give a finite number");
  EXPECT_EQ(
      refusal("t,a\n1,-2e30\n"),
      "f.csv:2: column a is -2e30: nothing measured is beyond 1e30; correct it, or take the row "
      "out");
  EXPECT_EQ(refusal("1,2\n3\n"), "f.csv:2: 1 columns: give 2 as in the first row");
  EXPECT_EQ(refusal("1,\n"), "f.csv:1: column a is '': give a finite number");
  EXPECT_EQ(refusal("a,a\n1,2\n"), "f.csv:1: column a: there are two such");
  EXPECT_EQ(refusal("t,a\n"), "f.csv: no rows of numbers: give a CSV file");
  EXPECT_THROW(parse("1,2\n1,3\n").checkRising(0), InputError);
}

TEST(Table, RefusesAMisspeltColumn) {
  const auto find = [](const std::string& header) {
    return tableFromText(header + "\n1,2\n", "f.csv", {"a"}).find({"temperature"});
  };
  for (const char* slip : {"temprature", "Temperatur", "tempreature"}) {
    EXPECT_THROW(find(std::string("a,") + slip), InputError) << slip;
  }
  for (const char* other : {"temperature_2", "humidity", "tare"}) {
    EXPECT_FALSE(find(std::string("a,") + other)) << other;
  }
  EXPECT_TRUE(find("temprature,temperature"));
}

TEST(Table, FindsTheUnitOfTimesBySpacing) {
  for (const double unit : {1.0, 1e-3, 1e-6, 1e-9}) {
    for (const double spacing : {1e-4, 1e-3, 0.05}) {
      EXPECT_EQ(timeUnit({0.0, spacing / unit, 2 * spacing / unit}), unit)
          << unit << " " << spacing;
    }
  }
}

}  // namespace
}  // namespace assembly_cell
