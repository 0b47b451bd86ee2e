// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/base/journal.h"

#include <fcntl.h>
#include <sys/file.h>
#include <unistd.h>

#include <cerrno>
#include <chrono>
#include <cstring>
#include <thread>
#include <utility>

#include "assembly_cell/base/files.h"
#include "assembly_cell/base/input_error.h"

namespace assembly_cell {

Journal::Journal(std::string path, std::string remedy)
    : path_(std::move(path)), remedy_(std::move(remedy)) {}

Journal::~Journal() {
  if (file_ >= 0) ::close(file_);
  if (lock_ >= 0) ::close(lock_);
}

void Journal::fail(const std::string& what) const {
  throw InputError(where() + " can't be written (" + what + ": " + std::strerror(errno) +
                   "): " + remedy_);
}

void Journal::lockOut(const std::string& lock, double patience) {
  constexpr std::chrono::milliseconds kPause(100);
  lock_ = ::open(lock.c_str(), O_RDWR | O_CREAT | O_CLOEXEC, 0644);
  if (lock_ < 0) fail("open");
  const auto end = std::chrono::steady_clock::now() + std::chrono::duration<double>(patience);
  while (::flock(lock_, LOCK_EX | LOCK_NB) != 0) {
    if (std::chrono::steady_clock::now() >= end) {
      throw InputError(where() + " is in use by another process: end it, or give another folder");
    }
    std::this_thread::sleep_for(kPause);
  }
}

void Journal::open() {
  if (file_ >= 0) ::close(file_);
  file_ = ::open(path_.c_str(), O_RDWR | O_CREAT | O_APPEND | O_CLOEXEC, 0644);
  if (file_ < 0) fail("open");
  size_ = ::lseek(file_, 0, SEEK_END);
}

std::string Journal::read(std::int64_t place, std::size_t size) const {
  std::string bytes(size, '\0');
  std::size_t done = 0;
  while (done < size) {
    const ssize_t n =
        ::pread(file_, &bytes[done], size - done, place + static_cast<std::int64_t>(done));
    if (n < 0 && errno == EINTR) continue;
    if (n < 0) {
      throw InputError(where() + " can't be read (" + std::strerror(errno) +
                       "): give a file that can be read and written");
    }
    if (n == 0) break;
    done += static_cast<std::size_t>(n);
  }
  bytes.resize(done);
  return bytes;
}

void Journal::append(const std::string& record, bool sync) {
  if (!writeAll(file_, record) || (sync && ::fsync(file_) != 0)) {
    const int error = errno;
    // half a record must not stay in front of the next
    if (::ftruncate(file_, size_) == 0) ::fsync(file_);
    errno = error;
    fail("write");
  }
  size_ += static_cast<std::int64_t>(record.size());
}

void Journal::cut(std::int64_t size) {
  if (::ftruncate(file_, size) != 0 || ::fsync(file_) != 0) fail("truncate");
  size_ = size;
}

void Journal::sync() const { ::fdatasync(file_); }

}  // namespace assembly_cell
