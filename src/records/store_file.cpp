// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "store_file.h"

#include <sqlite3.h>
#include <sys/stat.h>
#include <sys/statvfs.h>
#include <unistd.h>

#include <cerrno>
#include <chrono>
#include <cstring>
#include <filesystem>
#include <thread>

#include "assembly_cell/base/input_error.h"
#include "assembly_cell/base/text.h"
#include "schema.h"

namespace assembly_cell {
namespace {

namespace fs = std::filesystem;

constexpr int kPatience = 1000;  // with another program's lock [ms]
// A run of 4096 samples takes up to 0.2 MB, in the log and in the file; a log that waits for a
// reader grows by more.
constexpr std::uint64_t kFreeSpace = 4u << 20;  // [bytes]

// SQLite's own wait is longer each time, up to 0.1 s: one that writes without a pause would then
// keep out another for good.
int waitForLock(void* /*unused*/, int waited) {
  std::this_thread::sleep_for(std::chrono::milliseconds(1));
  return waited < kPatience ? 1 : 0;
}

std::string because(int error) {
  return error == 0 ? "" : std::string(": ") + std::strerror(error);
}

// Without the error that is plain from the file system.
void checkFile(const std::string& where, const std::string& path, RunStore::Access access) {
  struct stat file {};
  if (::stat(path.c_str(), &file) != 0) {
    if (errno != ENOENT) throw InputError(where + ": can't be opened" + because(errno));
    if (access == RunStore::Access::kRead) {
      throw InputError(where + ": there is no such file: give one that runs were recorded in");
    }
    std::error_code error;
    const fs::path folder = fs::absolute(path).parent_path();
    fs::create_directories(folder, error);
    if (error) {
      throw InputError(where + ": its folder can't be made (" + error.message() +
                       "): give a writable folder");
    }
    if (::access(folder.c_str(), W_OK) != 0) {
      throw InputError(where + ": can't be made" + because(errno) + ": give a writable folder");
    }
    return;
  }
  if (!S_ISREG(file.st_mode)) throw InputError(where + ": is no file: give a file");
  if (::access(path.c_str(), R_OK) != 0) {
    throw InputError(where + ": can't be read" + because(errno) + ": give permission to read it");
  }
}

}  // namespace

StoreFile::StoreFile(const std::string& path, RunStore::Access access) : path_(path) {
  if (path.empty()) throw InputError("store: value '': give a file");
  checkFile(where(), path_, access);
  guarded([&] { open(access); });
}

void StoreFile::open(RunStore::Access access) {
  const auto connect = [&](const std::string& name, int flags) {
    database_ = std::make_unique<SQLite::Database>(name, flags);
    sqlite3_busy_handler(database_->getHandle(), waitForLock, nullptr);
  };
  const bool reads = access == RunStore::Access::kRead;
  if (!reads) checkSpace();  // SQLite would open a file that can't be written as one to be read
  if (!reads) {
    connect(path_, SQLite::OPEN_READWRITE | SQLite::OPEN_CREATE);
  } else {
    connect(path_, SQLite::OPEN_READONLY);
    try {
      pragma("user_version");
    } catch (const SQLite::Exception&) {
      // where no file can be made beside it, it is read as one that nothing writes
      std::error_code none;
      if (::access(fs::absolute(path_).parent_path().c_str(), W_OK) == 0 ||
          (fs::exists(path_ + "-wal", none) && fs::file_size(path_ + "-wal", none) > 0)) {
        throw;
      }
      std::string name = "file:";
      for (const unsigned char c : fs::absolute(path_).string()) {
        name +=
            std::isalnum(c) || c == '/' ? std::string(1, static_cast<char>(c)) : text("%%%02X", c);
      }
      connect(name + "?immutable=1", SQLite::OPEN_READONLY | SQLite::OPEN_URI);
    }
  }
  checkIdentity();
  const int version = pragma("user_version");
  if (reads && version < static_cast<int>(kMigrations.size())) {
    if (version == 0) throw InputError(where() + ": has no runs yet: record one first");
    connect(path_, SQLite::OPEN_READWRITE);
  }
  if (!reads || version < static_cast<int>(kMigrations.size())) {
    checkSpace();
    useLog();
    migrate();
  }
  struct stat file {};
  if (::stat(path_.c_str(), &file) != 0) throw InputError(where() + ": was removed: try again");
  device_ = file.st_dev;
  node_ = file.st_ino;
}

int StoreFile::pragma(const char* name) {
  return database_->execAndGet(std::string("PRAGMA ") + name).getInt();
}

// A store, or an empty file that becomes one. In one transaction: another program may be making it.
void StoreFile::checkIdentity() {
  const SQLite::Transaction snapshot(*database_);
  const int application = pragma("application_id"), version = pragma("user_version");
  if (application != kApplicationId) {
    const bool empty = application == 0 && version == 0 &&
                       database_->execAndGet("SELECT count(*) FROM sqlite_master").getInt() == 0;
    if (!empty) {
      throw InputError(where() + ": is a database of another program: give another file");
    }
  }
  if (version > static_cast<int>(kMigrations.size())) {
    throw InputError(
        where() +
        text(": has schema %d, this program only knows up to %zu: ", version, kMigrations.size()) +
        "update the program");
  }
}

// A commit is on the disk when it returns; readers never wait for a writer.
void StoreFile::useLog() {
  const auto until = std::chrono::steady_clock::now() + std::chrono::milliseconds(kPatience);
  std::string mode;
  for (;;) {
    try {
      mode = database_->execAndGet("PRAGMA journal_mode = WAL").getString();
      break;
    } catch (const SQLite::Exception& error) {
      // SQLite doesn't wait for the lock of this change
      if ((error.getErrorCode() & 0xff) != SQLITE_BUSY ||
          std::chrono::steady_clock::now() > until) {
        throw;
      }
      std::this_thread::sleep_for(std::chrono::milliseconds(5));
    }
  }
  if (mode != "wal") {
    throw InputError(where() +
                     ": its file system doesn't support a write-ahead log: give a file "
                     "on a local disk");
  }
  database_->exec("PRAGMA synchronous = FULL; PRAGMA foreign_keys = ON");
}

void StoreFile::migrate() {
  if (pragma("user_version") == static_cast<int>(kMigrations.size())) return;
  SQLite::Transaction transaction(*database_, SQLite::TransactionBehavior::IMMEDIATE);
  // another program may have done it meanwhile
  for (auto i = static_cast<std::size_t>(pragma("user_version")); i < kMigrations.size(); ++i) {
    database_->exec(kMigrations[i]);
  }
  database_->exec(text("PRAGMA application_id = %d; PRAGMA user_version = %zu", kApplicationId,
                       kMigrations.size()));
  transaction.commit();
}

SQLite::Statement& StoreFile::statement(const char* sql) {
  auto found = statements_.find(sql);
  if (found == statements_.end()) {
    found = statements_.emplace(sql, SQLite::Statement(*database_, sql)).first;
  }
  found->second.reset();
  found->second.clearBindings();
  return found->second;
}

void StoreFile::checkSame() const {
  struct stat file {};
  if (::stat(path_.c_str(), &file) == 0 && file.st_dev == device_ && file.st_ino == node_) return;
  throw InputError(where() +
                   ": was removed or replaced while it was open: put it back, or start "
                   "this program again");
}

void StoreFile::checkSpace() const {
  const fs::path folder = fs::absolute(path_).parent_path();
  for (const std::string& path : {path_, folder.string()}) {
    if (::access(path.c_str(), W_OK) == 0 || errno == ENOENT) continue;
    throw InputError(where() + ": can't be written" + because(errno) +
                     ": give permission to write it and its folder, or another store");
  }
  struct statvfs system {};
  if (::statvfs(folder.c_str(), &system) != 0) return;
  const std::uint64_t free = static_cast<std::uint64_t>(system.f_bavail) * system.f_frsize;
  if (free >= kFreeSpace) return;
  throw InputError(where() + text(": its disk is full (%.1f MB are free): free %.0f MB",
                                  static_cast<double>(free) * 1e-6,
                                  static_cast<double>(kFreeSpace) * 1e-6));
}

void StoreFile::refuse(const SQLite::Exception& error) const {
  const int system = database_ ? sqlite3_system_errno(database_->getHandle()) : 0;
  switch (error.getErrorCode() & 0xff) {
    case SQLITE_BUSY:
    case SQLITE_LOCKED:
      throw InputError(where() +
                       text(": another program has locked it for %g s: ", 1e-3 * kPatience) +
                       "end that program, or try again");
    case SQLITE_FULL:
      throw InputError(where() + ": its disk is full: free space");
    case SQLITE_READONLY:
      throw InputError(where() + ": is read-only: give permission to write it, or another store");
    case SQLITE_CORRUPT:
      throw InputError(where() + ": is damaged (" + error.what() +
                       "): restore a copy, or save what is left with: sqlite3 FILE .recover");
    case SQLITE_NOTADB:
      throw InputError(where() + ": is no store of runs: give another file");
    case SQLITE_CANTOPEN:
      throw InputError(where() + ": can't be opened" + because(system) +
                       ": give a file in a writable folder");
    case SQLITE_IOERR:
      throw InputError(where() + ": can't be read or written (" + error.what() + because(system) +
                       "): check the disk and its free space");
    default:
      throw InputError(where() + ": " + error.what() + ": run `records check`");
  }
}

}  // namespace assembly_cell
