// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <SQLiteCpp/SQLiteCpp.h>
#include <sys/types.h>

#include <map>
#include <memory>
#include <string>

#include "assembly_cell/records/store.h"

namespace assembly_cell {

/// The open file of a store, at the present schema. What SQLite refuses becomes an InputError that
/// names the file.
class StoreFile {
 public:
  StoreFile(const std::string& path, RunStore::Access access);

  SQLite::Database& database() { return *database_; }
  /// A statement ready to be bound, compiled once. `sql`: a literal.
  SQLite::Statement& statement(const char* sql);
  /// The path still leads to the open file.
  void checkSame() const;
  /// The file can be written as far as the file system reports without a write.
  void checkSpace() const;
  /// What messages begin with.
  std::string where() const { return "store '" + path_ + "'"; }
  /// Calls `work`; exceptions of SQLite are refusals.
  template <class Work>
  auto guarded(const Work& work) -> decltype(work()) {
    try {
      return work();
    } catch (const SQLite::Exception& error) {
      refuse(error);
    }
  }
  [[noreturn]] void refuse(const SQLite::Exception& error) const;

 private:
  void open(RunStore::Access access);
  void checkIdentity();
  void useLog();
  void migrate();
  int pragma(const char* name);

  std::string path_;
  dev_t device_ = 0;
  ino_t node_ = 0;
  std::unique_ptr<SQLite::Database> database_;
  std::map<const char*, SQLite::Statement> statements_;
};

}  // namespace assembly_cell
