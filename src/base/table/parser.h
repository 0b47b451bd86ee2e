// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "assembly_cell/base/table.h"
#include "cells.h"

namespace assembly_cell::table {

/// Makes a table of lines.
class Parser {
 public:
  /// names: of the columns of a file without a header. blanks: empty cells are no faults.
  Parser(const std::string& path, const std::vector<std::string>& names, bool blanks);

  void add(const std::string& line, std::size_t number);
  /// The table when all lines are added. Throws InputError as readTable() does.
  Table finish();

 private:
  struct TextRow {
    std::string text;
    std::size_t line = 0;
  };

  bool isTextRow(const std::string& row) const;
  std::vector<std::string> cells(const std::string& row) const;
  void begin(const std::string& row);  // with the first row of numbers
  void takeHeader(std::size_t columns);
  bool takeCommentHeader(std::size_t columns);
  void setNames(const std::vector<std::string>& header);
  void addNumbers(std::vector<std::string> cells, std::size_t line);
  void checkIndex() const;

  const std::vector<std::string>& names_;
  const bool blanks_;
  Table table_;
  std::vector<TextRow> text_rows_;  // before the first row of numbers
  std::string last_comment_;        // before it
  bool begun_ = false;
  char separator_ = ',';
  Decimal decimal_ = Decimal::kUnknown;
};

}  // namespace assembly_cell::table
