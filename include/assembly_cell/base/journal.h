// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <cstdint>
#include <string>

namespace assembly_cell {

/// A file that grows record by record and survives the end of the process at any moment: a record
/// is there whole or, after a crash, as a rest at the end, which the owner of the format cuts off.
/// Throws InputError, one line that names the file and ends with the remedy.
class Journal {
 public:
  /// `remedy`: what to do where the file can't be written.
  Journal(std::string path, std::string remedy);
  ~Journal();
  Journal(const Journal&) = delete;
  Journal& operator=(const Journal&) = delete;

  /// No other process may have it, until the end of this object: a lock on the file `lock`, tried
  /// for `patience` [s].
  void lockOut(const std::string& lock, double patience);
  /// Opens the file, or makes it; again where it's open: after a rename.
  void open();

  /// The bytes from a place on, as many as there are.
  std::string read(std::int64_t place, std::size_t size) const;
  /// Whole or not at all, also where the disk is full; with `sync` it's on disk after the return.
  void append(const std::string& record, bool sync);
  /// Keeps the first bytes only, on disk after the return.
  void cut(std::int64_t size);
  void sync() const;

  std::int64_t size() const { return size_; }
  const std::string& path() const { return path_; }
  /// What messages begin with.
  std::string where() const { return "journal '" + path_ + "'"; }
  /// Throws for the system call that failed.
  [[noreturn]] void fail(const std::string& what) const;

 private:
  std::string path_, remedy_;
  std::int64_t size_ = 0;
  int file_ = -1, lock_ = -1;
};

}  // namespace assembly_cell
