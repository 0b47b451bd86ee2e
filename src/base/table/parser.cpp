// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "parser.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <string_view>

#include "assembly_cell/base/csv_text.h"
#include "assembly_cell/base/input_error.h"
#include "assembly_cell/base/text.h"

namespace assembly_cell::table {

namespace {

// Counts of nanoseconds are 2e18; squares of squares of this are still finite.
constexpr double kLargest = 1e30;
constexpr std::size_t kMaxComments = 100;
constexpr std::size_t kMaxTextRows = 50;
constexpr std::size_t kMaxRows = 50000000;  // 3 GB in memory

bool isEmpty(const std::string& cell) { return cell.empty(); }

// a unit in brackets belongs to the name before it where blanks separate cells
std::vector<std::string> withUnits(const std::vector<std::string>& cells) {
  std::vector<std::string> out;
  for (const std::string& cell : cells) {
    if (!out.empty() && !cell.empty() && (cell[0] == '[' || cell[0] == '(')) {
      out.back() += " " + cell;
    } else {
      out.push_back(cell);
    }
  }
  return out;
}

}  // namespace

Parser::Parser(const std::string& path, const std::vector<std::string>& names, bool blanks)
    : names_(names), blanks_(blanks) {
  table_.path = path;
}

std::vector<std::string> Parser::cells(const std::string& row) const {
  return cellsOf(row, separator_);
}

bool Parser::isTextRow(const std::string& row) const {
  const std::vector<std::string> cells = cellsOf(row, separatorOf(row));
  if (!isHeader(cells) && !std::all_of(cells.begin(), cells.end(), isUnit)) return false;
  if (text_rows_.empty()) return isHeader(cells);
  // below the first one a row with a number is one of numbers
  return std::none_of(cells.begin(), cells.end(), [](const std::string& cell) {
    double value = 0.0;
    Decimal decimal = Decimal::kUnknown;
    return parseCell(cell, decimal, value);
  });
}

void Parser::add(const std::string& line, std::size_t number) {
  const std::string_view content = trimmed(line, " \t\r");
  if (content.empty()) return;
  if (content.front() == '#' || content.front() == '%') {
    if (table_.comments.size() < kMaxComments) table_.comments.emplace_back(content);
    if (!begun_) last_comment_ = content;
    return;
  }
  const std::string row(trimmed(line, separatorOf(line) == '\t' ? " \r" : " \t\r"));
  if (!begun_ && text_rows_.size() < kMaxTextRows && isTextRow(row)) {
    text_rows_.push_back({row, number});
    return;
  }
  if (!begun_) begin(row);
  addNumbers(cells(row), number);
}

void Parser::begin(const std::string& row) {
  begun_ = true;
  separator_ = separatorOf(row);
  std::vector<std::string> first = cells(row);
  // a separator at the end of a row makes no cell beyond the columns
  const std::size_t named =
      text_rows_.empty() ? names_.size() : cells(text_rows_.back().text).size();
  if (first.back().empty() && first.size() > named && named > 0) first.pop_back();
  if (!text_rows_.empty()) {
    takeHeader(first.size());
  } else if (!takeCommentHeader(first.size())) {
    for (std::size_t c = 0; c < first.size(); ++c) {
      table_.names.push_back(c < names_.size() ? columnName(names_[c])
                                               : "column " + std::to_string(c + 1));
    }
    table_.units.resize(first.size());
  }
  const std::size_t n = table_.names.size();
  table_.faults.resize(n);
  table_.numbers.resize(n);
  table_.whole.assign(n, true);
  table_.words.resize(n);
}

void Parser::setNames(const std::vector<std::string>& header) {
  table_.header = true;
  for (std::size_t c = 0; c < header.size(); ++c) {
    const HeaderCell cell = headerCell(header[c]);
    table_.names.push_back(cell.name.empty() ? "column " + std::to_string(c + 1) : cell.name);
    table_.units.push_back(cell.unit);
  }
}

void Parser::takeHeader(std::size_t columns) {
  std::vector<std::vector<std::string>> rows;
  std::vector<std::size_t> lines;
  std::size_t widest = 0;
  for (const TextRow& row : text_rows_) {
    std::vector<std::string> header = cells(row.text);
    if (separator_ == ' ') header = withUnits(header);
    if (header.size() == columns + 1 && header.back().empty()) header.pop_back();
    if (header.size() != columns) {
      const auto other = cellsOf(row.text, separatorOf(row.text));
      if (other.size() == columns) header = other;
    }
    widest = std::max(widest, header.size());
    if (header.size() != columns) continue;
    rows.push_back(header);
    lines.push_back(row.line);
  }
  const auto are_units = [](const std::vector<std::string>& row) {
    return std::all_of(row.begin(), row.end(), isUnit);
  };
  if (rows.empty()) {
    throw InputError(table_.path + ":" + std::to_string(text_rows_.front().line) +
                     ": the header has " + std::to_string(widest) + " columns, the rows " +
                     std::to_string(columns) +
                     (separator_ == ',' && columns >= 2 * widest - 1
                          ? ": numbers with decimal commas need another separator, such as ;"
                          : ": give one name for each column"));
  }
  setNames(rows[0]);
  for (std::size_t i = 1; i < rows.size(); ++i) {
    if (!are_units(rows[i])) {
      throw InputError(table_.path + ":" + std::to_string(lines[i]) +
                       ": a second row of names: leave one, with units below it or none");
    }
    for (std::size_t c = 0; c < columns; ++c) {
      if (table_.units[c].empty()) table_.units[c] = trimmed(rows[i][c], " \t[](){}");
    }
  }
}

bool Parser::takeCommentHeader(std::size_t columns) {
  if (last_comment_.empty()) return false;
  const std::string content(trimmed(last_comment_, " \t\r#%"));
  std::vector<std::string> header = cellsOf(content, separator_);
  if (header.size() != columns) header = cellsOf(content, separatorOf(content));
  if (header.size() != columns) return false;
  std::size_t known = 0;
  for (const std::string& cell : header) {
    const std::string name = columnName(cell);
    known += name == "time" || std::count(names_.begin(), names_.end(), name) > 0;
  }
  if (known < std::min<std::size_t>(2, names_.size())) return false;
  setNames(header);
  return true;
}

void Parser::addNumbers(std::vector<std::string> cells, std::size_t line) {
  const std::string place = table_.path + ":" + std::to_string(line) + ": ";
  const std::size_t n = table_.names.size();
  if (separator_ != ' ' && std::all_of(cells.begin(), cells.end(), isEmpty)) return;
  if (cells.size() == n + 1 && cells.back().empty()) cells.pop_back();
  if (cells.size() != n) {
    throw InputError(place + std::to_string(cells.size()) + " columns: give " + std::to_string(n) +
                     " as in the first row");
  }
  if (table_.rows.size() == kMaxRows) {
    throw InputError(table_.path + ": more than " + std::to_string(kMaxRows) + " rows: cut it");
  }
  std::vector<double> row(n, std::numeric_limits<double>::quiet_NaN());
  for (std::size_t c = 0; c < n; ++c) {
    const std::string& cell = cells[c];
    if (table_.rows.empty()) table_.words[c] = cell;
    if (table_.words[c] != cell) table_.words[c].clear();
    if (blanks_ && cell.empty()) continue;
    std::string& fault = table_.faults[c];
    const Decimal before = decimal_;
    if (!parseCell(cell, decimal_, row[c])) {
      if (!fault.empty()) continue;
      Decimal any = Decimal::kUnknown;
      double value = 0.0;
      fault = place + "column " + table_.names[c] + " is '" + printable(cell) + "': ";
      fault += parseCell(cell, any, value) && any != before
                   ? "numbers before it have another decimal mark; give one, and no thousands' mark"
                   : "give a finite number";
      continue;
    }
    ++table_.numbers[c];
    table_.whole[c] = table_.whole[c] && isWhole(cell);
    if (std::abs(row[c]) <= kLargest || !fault.empty()) continue;
    fault = place + "column " + table_.names[c] + " is " + printable(cell) +
            ": nothing measured is beyond 1e30; correct it, or take the row out";
  }
  table_.rows.push_back(std::move(row));
  table_.line.push_back(line);
}

// Without a header an index of rows would shift all columns, and decimal commas double them.
void Parser::checkIndex() const {
  constexpr std::size_t kDoubled = 12;  // columns of a wrench with decimal commas
  const std::size_t n = table_.names.size();
  if (!table_.header && separator_ == ',' && n > names_.size() && n >= kDoubled && n % 2 == 0 &&
      std::all_of(table_.whole.begin(), table_.whole.end(), [](bool whole) { return whole; })) {
    throw InputError(table_.path + ":" + std::to_string(table_.line[0]) + ": " + std::to_string(n) +
                     " columns of whole numbers: numbers with decimal commas need another "
                     "separator, such as ;");
  }
  if (table_.header || table_.rows.size() < 3 || n < 2 || !table_.whole[0]) return;
  const bool time = !names_.empty() && names_[0] == "t";
  const bool order = !names_.empty() && names_.back() == "order";
  if (time ? n < 3 : n < names_.size() + (order ? 0 : 1)) return;
  const double first = table_.rows[0][0];
  if (first != 0.0 && first != 1.0) return;
  bool rises = true;
  for (std::size_t i = 0; i < table_.rows.size(); ++i) {
    if (table_.rows[i][0] != first + static_cast<double>(i)) return;
    rises = rises && (i == 0 || table_.rows[i][1] > table_.rows[i - 1][1]);
  }
  if (time && !rises) return;
  throw InputError(table_.path + ":" + std::to_string(table_.line[0]) + ": column " +
                   table_.names[0] +
                   " counts the rows: name the columns in a header, or take this one out");
}

Table Parser::finish() {
  if (table_.rows.empty()) {
    throw InputError(table_.path + ": no rows of numbers: give a CSV file");
  }
  checkIndex();
  return std::move(table_);
}

}  // namespace assembly_cell::table
