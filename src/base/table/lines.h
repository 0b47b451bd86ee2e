// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <cstddef>
#include <istream>
#include <string>

namespace assembly_cell::table {

/// Lines of a text in UTF-8 or UTF-16 (with a byte order mark, or recognised by its zero bytes)
/// that end with LF, CR LF or CR, as UTF-8 without the mark.
class Lines {
 public:
  /// `path` begins refusals.
  Lines(std::istream& stream, std::string path);

  /// The next line without its end, or false at the end of the text. Throws InputError for a line
  /// of more than 64 KiB, for zero bytes and for known binary formats.
  bool next(std::string& line);
  std::size_t number() const { return number_; }  ///< of the last line, from 1 on

 private:
  enum class Encoding { kUtf8, kLittle, kBig };

  int byte() { return at_ < start_.size() ? static_cast<unsigned char>(start_[at_++]) : rest(); }
  int rest();
  int unit();  // of two bytes, or a byte; below 0: the end
  void append(std::string& line, int unit) const;
  void recognise();
  void refuseBinary() const;

  std::istream& stream_;
  std::string path_;
  std::string start_;  // bytes read to recognise the format
  std::size_t at_ = 0;
  Encoding encoding_ = Encoding::kUtf8;
  std::size_t number_ = 0;
  bool after_return_ = false;  // the last line ended with CR
};

}  // namespace assembly_cell::table
