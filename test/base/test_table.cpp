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

std::string utf16(const std::string& text, bool big) {
  std::string out = big ? "\xFE\xFF" : "\xFF\xFE";
  for (const char c : text) out += big ? std::string{'\0', c} : std::string{c, '\0'};
  return out;
}

// Each dialect of the same two rows, with a header or in the order t, a.
TEST(Table, ReadsDialects) {
  const std::string plain = "t,a\n1,2.5\n3,4\n";
  std::string returns = plain;
  for (char& c : returns) c = c == '\n' ? '\r' : c;
  for (const std::string& text :
       {utf16(plain, false), utf16(plain, true), utf16(plain, false).substr(2), returns,
        std::string("t;a\n1;2,5\n3;4\n"), std::string("1;2,5\n3;4\n"),
        std::string("1\t2,5\n3\t4\n"), std::string("1,0 2,5\n3 4\n"),
        std::string("\"t\",\"a\"\n\"1\",\"2,5\"\n3,4\n"), std::string(",t,a\n0,1,2.5\n1,3,4\n"),
        std::string("t,unit,a\n1,N,2.5\n3,N,4\n"), std::string("T [s],a (N)\n1,2.5\n3,4\n"),
        std::string("t,a\ns,N\n1,2.5\n3,4\n"), std::string("Time [s]  a [N]\n1 2.5\n3 4\n"),
        std::string("Run 3 of May\nt,a\n1,2.5\n3,4\n"), std::string("# t a\n1 2.5\n3 4\n"),
        std::string("%time,a\n1,2.5\n3,4\n"), std::string("t,a,\n1,2.5\n3,4\n"),
        std::string("t,a\n1,2.5\n,\n3,4\n")}) {
    const Table table = parse(text);
    ASSERT_EQ(table.rows.size(), 2u) << text;
    EXPECT_EQ(table.rows[0][table.need({"t", "time"})], 1.0) << text;
    EXPECT_EQ(table.rows[0][table.need({"a"})], 2.5) << text;
    EXPECT_EQ(table.rows[1][table.need({"a"})], 4.0) << text;
  }
}

TEST(Table, NamesDialectsThatItCannotRead) {
  EXPECT_EQ(refusal("t;a\n1;2,5\n2;1.234,5\n"),
            "f.csv:3: column a is '1.234,5': give a finite number");
  EXPECT_EQ(
      refusal("t;a\n1;2,5\n2;2.5\n"),
      "f.csv:3: column a is '2.5': numbers before it have another decimal mark; give one, and "
      "no thousands' mark");
  EXPECT_EQ(refusal("t,a\nforce,torque\n1,2\n"),
            "f.csv:2: a second row of names: leave one, with units below it or none");
  EXPECT_EQ(refusal("t,a,b\n1,2\n2,3\n"),
            "f.csv:1: the header has 3 columns, the rows 2: give one name for each column");
  EXPECT_EQ(refusal("#ROSBAG V2.0\n"), "f.csv: this is a bag: let its name end with .bag");
  EXPECT_EQ(refusal("PK\x03\x04 some sheet\n"),
            "f.csv: this is a spreadsheet or an archive: export it as CSV");
  EXPECT_EQ(refusal(std::string("t,a\n1,2\n3,\0\0\0\n", 14)),
            "f.csv:3: a zero byte: give a text such as CSV, in UTF-8 or UTF-16");
  EXPECT_NE(refusal(std::string(70000, '1')).find("a row of more than 65536 bytes"),
            std::string::npos);
  EXPECT_EQ(parse("ok,2.5\nok,3.5\n").rows.size(), 2u);
  EXPECT_EQ(parse("t,1,2\n1,2,3\n").rows.size(), 1u);
  EXPECT_EQ(refusal("header: \n  seq: 0\n"),
            "f.csv: this is output of rostopic echo: write it with rostopic echo -p");
  const std::string commas = ": numbers with decimal commas need another separator, such as ;";
  EXPECT_EQ(refusal("t,a\n1,5,2,5\n"), "f.csv:1: the header has 2 columns, the rows 4" + commas);
  EXPECT_EQ(refusal("1,5,2,5,3,5,4,5,5,5,6,5\n"), "f.csv:1: 12 columns of whole numbers" + commas);
  // without a header an index shifts the columns
  EXPECT_EQ(
      refusal("0,1.5,2\n1,1.6,3\n2,1.7,2\n"),
      "f.csv:1: column t counts the rows: name the columns in a header, or take this one out");
}

TEST(Table, AFaultCountsInAColumnThatIsNeeded) {
  const Table table = parse("t,a,b\n1,2,x\n3,4,5\n");
  EXPECT_EQ(table.need({"a"}), 1u);
  EXPECT_FALSE(table.isText(2));
  EXPECT_THROW(table.need({"b"}), InputError);
  EXPECT_TRUE(parse("t,a,b\n1,2,x\n3,4,y\n").isText(2));
}

TEST(Table, NamesOfMessagesAndUnitsOfHeaders) {
  for (const auto& [header, name] :
       std::vector<std::pair<std::string, std::string>>{{"field.wrench.force.x", "fx"},
                                                        {"/ft/wrench/torque/z", "tz"},
                                                        {"field.pose.orientation.w", "qw"},
                                                        {"pose.position.y", "y"},
                                                        {"Force_X [N]", "fx"},
                                                        {"field.header.stamp", "stamp"},
                                                        {"fx_kN", "fx"},
                                                        {"T (ms)", "t"},
                                                        {"drive_V", "drive_v"},
                                                        {"known_Fx", "known_fx"},
                                                        {"desired.force.x", "desired.force.x"},
                                                        {"force(1)", "force(1)"}}) {
    EXPECT_EQ(columnName(header), name) << header;
  }
  Table table = tableFromText("fx [kN],fy,fz,mx [Nmm],my,mz\n1,2,3,4,5,6\n", "f.csv", {});
  const auto column = wrenchColumns(table);
  EXPECT_EQ(table.rows[0][column[0]], 1000.0);
  EXPECT_EQ(table.rows[0][column[1]], 2.0);
  EXPECT_EQ(table.rows[0][column[3]], 0.004);
  EXPECT_EQ(table.notes[0], "converted to N: fx from kN");
  Table ati =
      tableFromText("fx,fy,fz,tx,ty,tz,force_unit,torque_unit\n1,2,3,4,5,6,lbf,N-m\n", "f.csv", {});
  EXPECT_NEAR(ati.rows[0][wrenchColumns(ati)[0]], 4.4482216152605, 1e-15);
  Table wrong = tableFromText("fx [V],fy,fz,tx,ty,tz\n1,2,3,4,5,6\n", "f.csv", {});
  EXPECT_THROW(wrenchColumns(wrong), InputError);
}

struct Times {
  const char* text;
  const char* unit;  // ? where two are possible
};

TEST(Table, UnitsOfTimesByHeaderMagnitudeAndKind) {
  for (const auto& [text, unit] :
       std::vector<Times>{{"t\n0.0\n0.1\n0.2\n", "s"},               // 10 Hz
                          {"t\n0.00\n0.05\n0.10\n", "s"},            // 20 Hz
                          {"t\n0.0\n0.5\n1.0\n", "s"},               // 2 Hz
                          {"t\n1700000000.1\n1700000000.2\n", "s"},  // since 1970
                          {"t\n1700000000.0\n1700000002.0\n", "s"},  // at 0.5 Hz
                          {"t\n0\n10\n20\n", "ms"},                  // whole
                          {"t\n0\n10204\n20408\n", "us"},
                          {"t\n0\n370000\n740000\n", "ns"},
                          {"t\n1700000000000\n1700000000100\n", "ms"},  // since 1970, at 10 Hz
                          {"t\n1700000000000000\n1700000000100000\n", "us"},
                          {"t\n1700000000000000000\n1700000000100000000\n", "ns"},
                          {"t\n1500000000\n1500010204\n", "us"},            // 25 minutes
                          {"t\n900000000000000\n900000010000000\n", "ns"},  // 10 days
                          {"t_ms\n0.0\n5.0\n", "ms"},
                          {"time [us]\n0\n100\n", "us"},
                          {"t\ns\n0\n1\n", "s"},
                          {"t\n0.000\n5.000\n10.000\n", "?"},  // 0.2 Hz or 200 Hz
                          {"t\n0\n100\n200\n", "?"},           // 10 Hz or 10 kHz
                          {"t\n1700000000\n1700000001\n", "?"}}) {
    const Table table = tableFromText(text, "f.csv", {"t"});
    std::string found = "?";
    try {
      const TableTimes times = readTimes(table);
      found = times.unit;
      EXPECT_GT(times.t[1], times.t[0]);
    } catch (const InputError& error) {
      EXPECT_NE(std::string(error.what()).find("Hz in"), std::string::npos) << error.what();
    }
    EXPECT_EQ(found, unit) << text;
  }
  const Table table = tableFromText("t\n0\n100\n", "f.csv", {"t"});
  EXPECT_EQ(readTimes(table, TimeUnit::kMilliseconds).t[1], 0.1);
  EXPECT_THROW(readTimes(tableFromText("t [m]\n0\n1\n", "f.csv", {"t"})), InputError);
}

// The time of recording stands in for stamps that are all zero.
TEST(Table, TimesOfEchoedTopics) {
  const std::string header = "%time,field.header.stamp\n";
  const Table stamped = tableFromText(header +
                                          "1700000000100000000,1700000000000000000\n"
                                          "1700000000300000000,1700000000100000000\n",
                                      "f.csv", {"t"});
  EXPECT_NEAR(readTimes(stamped).t[1] - readTimes(stamped).t[0], 0.1, 1e-6);
  const Table zero =
      tableFromText(header + "1700000000100000000,0\n1700000000300000000,0\n", "f.csv", {"t"});
  EXPECT_NEAR(readTimes(zero).t[1] - readTimes(zero).t[0], 0.2, 1e-6);
}

}  // namespace
}  // namespace assembly_cell
