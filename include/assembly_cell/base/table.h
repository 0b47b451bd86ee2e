// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
// The one reader of tables of numbers for all programs. A reader of a format calls readTable(),
// then wrenchColumns(), needAll() and readTimes(), and reads Table::rows by the columns these
// return.
#pragma once

#include <cstddef>
#include <iosfwd>
#include <optional>
#include <string>
#include <utility>
#include <vector>

namespace assembly_cell {

/// What a column holds, for the unit of its header: N, N m, m, rad, V.
enum class Quantity { kForce, kTorque, kLength, kAngle, kVoltage };

/// A file of numbers in rows, as recorders write them. Recognised: UTF-8 or UTF-16, any ends of
/// lines; cells between commas, semicolons, tabs or blanks, in quotes or not; a decimal comma
/// between other separators; a header row or none, one of units below it, a header in a comment
/// (numpy, `rostopic echo -p`); a row index without a name (pandas). Blank rows and rows that begin
/// with # or % don't count. A column that isn't needed may hold anything.
struct Table {
  std::string path;
  bool header = false;
  /// Names of the columns, as columnName() makes them.
  std::vector<std::string> names;
  std::vector<std::string> units;         ///< of the header, as written there; empty: none
  std::vector<std::vector<double>> rows;  ///< as many cells each as there are names
  std::vector<std::size_t> line;          ///< of the file, of each row
  std::vector<std::string> faults;        ///< of each column: its first cell that is no number
  std::vector<std::size_t> numbers;       ///< of each column: number of cells with a number
  std::vector<bool> whole;                ///< of each column: only whole numbers, without a point
  std::vector<std::string> words;         ///< of each column: the text in all its cells, if one
  std::vector<std::string> comments;      ///< rows that begin with #
  std::vector<std::string> notes;         ///< unit conversions, in words

  /// The one column with one of these names, in any case; empty without one. Throws InputError for
  /// two, and for a column with a cell that is no number.
  std::optional<std::size_t> find(const std::vector<std::string>& any) const;
  /// The same; throws InputError naming the first of them where there is none.
  std::size_t need(const std::vector<std::string>& any) const;
  /// need() of each.
  std::vector<std::size_t> needAll(const std::vector<std::vector<std::string>>& columns) const;
  /// needAll(), and converts the columns to the SI unit of the quantity where the header names
  /// another. Throws InputError for a unit that isn't one of the quantity.
  std::vector<std::size_t> needAll(const std::vector<std::vector<std::string>>& columns,
                                   Quantity quantity);
  /// Whether no cell of the column is a number.
  bool isText(std::size_t column) const { return numbers[column] == 0; }
  /// "path:line: " of a row, to begin a refusal with.
  std::string place(std::size_t row) const;
  /// Throws InputError unless the column's numbers rise from row to row.
  void checkRising(std::size_t column) const;
};

/// names: of the columns of a file without a header; what further columns it has are "column 8" and
/// so on. blanks: empty cells are NaN, otherwise a fault. Throws InputError naming file and line:
/// unreadable, binary or empty file, a row of another length, two rows of names, rows without a
/// header whose first column counts them.
Table readTable(const std::string& path, const std::vector<std::string>& names,
                bool blanks = false);

/// The table of a text; `path` names it in messages.
Table tableFromText(const std::string& text, const std::string& path,
                    const std::vector<std::string>& names, bool blanks = false);
Table tableFromStream(std::istream& stream, const std::string& path,
                      const std::vector<std::string>& names, bool blanks = false);

/// The columns fx fy fz [N] and tx ty tz (or mx my mz) [N m], as needAll() finds and converts them;
/// prefix: before each name.
std::vector<std::size_t> wrenchColumns(Table& table, const std::string& prefix = {});

/// A column's name in lower case without its unit in brackets. Of fields of ROS messages and of
/// words the short form: field.wrench.force.x and force_x are fx, pose.orientation.w is qw.
std::string columnName(const std::string& header);

/// A slip of the pen in `meant`, a word of letters: one off, or two of a longer word. What only
/// adds to it, as temperature_2 does, is another word.
bool isMisspelt(const std::string& word, const std::string& meant);

enum class TimeUnit { kFound, kSeconds, kMilliseconds, kMicroseconds, kNanoseconds };

/// The choices of an option or a parameter.
extern const std::vector<std::pair<std::string, TimeUnit>> kTimeUnitChoices;
std::vector<std::string> timeUnitNames();  ///< of the choices

struct TableTimes {
  std::size_t column = 0;
  std::vector<double> t;  ///< rising [s]
  std::string unit;       ///< of the file: s, ms, us or ns
  std::string reason;     ///< why this one, for people
};

/// The column t (time, timestamp, the stamp of a message's header) in seconds. The unit is the
/// given one, that of the header (t_ms, "time [us]"), or found: by magnitude where it counts from
/// 1970; s for numbers with decimals less than 1 apart; ms, us or ns for whole numbers by their
/// spacing. Throws InputError where two units are possible, and for times that don't rise.
TableTimes readTimes(const Table& table, TimeUnit given = TimeUnit::kFound);

}  // namespace assembly_cell
