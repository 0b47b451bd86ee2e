// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <cstddef>
#include <optional>
#include <string>
#include <vector>

namespace assembly_cell {

/// A file of numbers in rows, as recorders write them: cells between commas, semicolons, tabs or
/// blanks; a header row or none; blank rows and rows that begin with # don't count.
struct Table {
  std::string path;
  bool header = false;
  std::vector<std::string> names;         ///< of the columns, lower case
  std::vector<std::vector<double>> rows;  ///< as many cells each as there are names
  std::vector<std::size_t> line;          ///< of the file, of each row

  /// The one column with one of these names, in any case; empty without one. Throws InputError for
  /// two.
  std::optional<std::size_t> find(const std::vector<std::string>& any) const;
  /// The same; throws InputError naming the first of them where there is none.
  std::size_t need(const std::vector<std::string>& any) const;
  /// need() of each.
  std::vector<std::size_t> needAll(const std::vector<std::vector<std::string>>& columns) const;
  /// "path:line: " of a row, to begin a refusal with.
  std::string place(std::size_t row) const;
  /// Throws InputError unless the column's numbers rise from row to row.
  void checkRising(std::size_t column) const;
};

/// names: of the columns of a file without a header; what further columns it has are "column 8" and
/// so on. blanks: empty cells are NaN, otherwise refused. Throws InputError naming file, line and
/// column: unreadable or empty file, a row of another length, what is no number within ±1e30.
Table readTable(const std::string& path, const std::vector<std::string>& names,
                bool blanks = false);

/// The same of a text; `path` names it in messages.
Table tableFromText(const std::string& text, const std::string& path,
                    const std::vector<std::string>& names, bool blanks = false);

/// A slip of the pen in `meant`, a word of letters: one off, or two of a longer word. What only
/// adds to it, as temperature_2 does, is another word.
bool isMisspelt(const std::string& word, const std::string& meant);

/// Seconds in the unit of times that count in s, ms, µs or ns, by their median spacing: recorders
/// take 14 samples a second to 14 thousand.
double timeUnit(const std::vector<double>& times);

}  // namespace assembly_cell
