// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
// A setting is declared once: from the list come readers, writer, checks and descriptions.
#include "assembly_cell/base/fields.h"

#include <gtest/gtest.h>

#include <array>
#include <limits>

#include "assembly_cell/base/input_error.h"
#include "assembly_cell/base/yaml_section.h"

namespace assembly_cell {
namespace {

struct Inner {
  double force = 12.0;
  std::array<double, 2> row{1.0, 2.0};
};
struct Outer {
  enum class Mode { kOff, kOn };
  double time = 0.1;
  int count = 3;
  bool flag = false;
  std::string name = "peg";
  Mode mode = Mode::kOff;
  Inner inner;
};

}  // namespace

static void fields(FieldList& f, Inner& p) {
  f.number("force", p.force, {2, 1000, "N"}, "Force of a contact.").required().live();
  f.numbers("row", p.row.data(), 2, Range::kNotNegative, "Two numbers.");
}

static void fields(FieldList& f, Outer& p) {
  f.number("time", p.time, positive("s", 60), "Time at rest.");
  f.integer("count", p.count, 1, 10, "Number of contacts.");
  f.flag("flag", p.flag, "A switch.");
  f.text("name", p.name, "A name.");
  f.choice("mode", p.mode, {"off", "on"}, "A mode.");
  f.section("inner", p.inner);
}

namespace {

// the outcome of what is done with a list: "" or the refusal
template <class Do>
std::string refusedBy(const Do& what) {
  try {
    what();
  } catch (const InputError& error) {
    return error.what();
  }
  return "";
}

std::string refusedFile(const std::string& text, Outer& outer) {
  return refusedBy([&] {
    yaml::Section in(yaml::loadYaml(text, "f.yaml"), "", "f.yaml");
    in.read(fieldsOf(outer));
    in.finish();
  });
}

TEST(Fields, AWrittenStructReadsBackTheSame) {
  Outer written{0.3, 7, true, "a: b", Outer::Mode::kOn, {1.0 / 3.0 + 2.0, {1e-17, 5e300}}};
  Outer read;
  EXPECT_EQ(refusedFile(yamlText(fieldsOf(written)), read), "");
  EXPECT_EQ(read.time, written.time);
  EXPECT_EQ(read.count, 7);
  EXPECT_TRUE(read.flag);
  EXPECT_EQ(read.name, "a: b");
  EXPECT_EQ(read.mode, Outer::Mode::kOn);
  EXPECT_EQ(read.inner.force, written.inner.force);
  EXPECT_EQ(read.inner.row, written.inner.row);
}

TEST(Fields, WhatIsMissingKeepsItsValueUnlessItIsRequired) {
  Outer outer;
  EXPECT_EQ(refusedFile("count: 4\n", outer), "");
  EXPECT_EQ(outer.count, 4);
  EXPECT_EQ(outer.time, 0.1);
  EXPECT_EQ(refusedFile("inner: {row: [3, 4]}\n", outer),
            "f.yaml: inner.force: value missing: give a number from 2 to 1000 [N]");
}

TEST(Fields, ReadersNamePathValueAndRemedy) {
  Outer outer;
  EXPECT_EQ(refusedFile("time: 0\n", outer),
            "f.yaml: time: value 0: give a number > 0 and at most 60 [s]");
  EXPECT_EQ(refusedFile("inner: {force: 3, row: [3, -4]}\n", outer),
            "f.yaml: inner.row[1]: value -4: give a finite number >= 0");
  EXPECT_EQ(refusedFile("inner: {force: 3, w: 1}\n", outer),
            "f.yaml: inner.w: value 1: unknown key, known here: force, row");
  const auto set = [&](const char* text) {
    return refusedBy([&] { setField(fieldsOf(outer), text); });
  };
  EXPECT_EQ(set("inner.force=1"), "inner.force: value 1: give a number from 2 to 1000 [N]");
  EXPECT_EQ(set("count=2.5"), "count: value 2.5: give a whole number from 1 to 10");
  EXPECT_EQ(set("mode=half"), "mode: value half: give off or on");
  EXPECT_EQ(set("flag=yes"), "flag: value yes: give true or false");
  EXPECT_EQ(set("inner.row=[1]"), "inner.row: value [1]: give a list of 2 numbers");
  EXPECT_EQ(set("speed=1"),
            "speed: value 1: unknown key, known here: time, count, flag, name, mode, inner.force, "
            "inner.row");
  EXPECT_EQ(set("inner.row=[5, 6]"), "");
  EXPECT_EQ(set("mode=on"), "");
  EXPECT_EQ(outer.inner.row[1], 6.0);
  EXPECT_EQ(outer.mode, Outer::Mode::kOn);
}

TEST(Fields, ValuesOutOfRangeAreFound) {
  Outer outer;
  outer.inner.force = std::numeric_limits<double>::quiet_NaN();
  EXPECT_EQ(refusedBy([&] { checkFields(fieldsOf(outer)); }),
            "inner.force: value nan: give a number from 2 to 1000 [N]");
  outer.inner.force = 3.0;
  EXPECT_EQ(refusedBy([&] { checkFields(fieldsOf(outer)); }), "");
}

TEST(Fields, TablesHaveDefaultRangeAndDescription) {
  Outer outer;
  const std::string table = fieldTable(fieldsOf(outer), true);
  EXPECT_NE(table.find("| `~time` | 0.1 | number > 0 and at most 60 [s] | Time at rest. |"),
            std::string::npos)
      << table;
  EXPECT_NE(table.find("| `~inner_force` | required | number from 2 to 1000 [N] | Force of a "
                       "contact. Live. |"),
            std::string::npos)
      << table;
  EXPECT_NE(commentedParameters(fieldsOf(outer)).find("count: 3                  # Number of "),
            std::string::npos);
}

TEST(Fields, DefaultsThatDependOnOthersAreDescribedInWords) {
  double width = 0.0;
  std::string name, file;
  FieldList list;
  list.number("width", width, positive("m"), "Width.").derived("twice height");
  list.text("file", file, "Input.").required();
  list.text("name", name, "Name.");
  const std::string table = fieldTable(list, true);
  EXPECT_NE(table.find("| `~width` | twice height |"), std::string::npos) << table;
  // a parameter file must not replace them by the struct's values
  const std::string comments = commentedParameters(list);
  EXPECT_EQ(comments.find("# width: twice height "), 0U) << comments;
  EXPECT_NE(comments.find("\n# file: required "), std::string::npos) << comments;
  EXPECT_NE(comments.find("\nname: "), std::string::npos) << comments;
}

}  // namespace
}  // namespace assembly_cell
