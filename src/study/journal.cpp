// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include <fcntl.h>
#include <sys/file.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <thread>

#include "assembly_cell/base/input_error.h"
#include "assembly_cell/study/ledger.h"

namespace assembly_cell {
namespace {

constexpr int kLockTries = 30;
constexpr std::chrono::milliseconds kLockPause(100);

[[noreturn]] void fail(const std::string& path, const std::string& what) {
  throw InputError("journal " + path + ": " + what + ": " + std::strerror(errno) +
                   ", give --output a folder that can be written, with room");
}

void writeAll(int file, const std::string& text, const std::string& path) {
  std::size_t done = 0;
  while (done < text.size()) {
    const ssize_t n = ::write(file, text.data() + done, text.size() - done);
    if (n < 0 && errno == EINTR) continue;
    if (n < 0) fail(path, "write");
    done += static_cast<std::size_t>(n);
  }
}

// Bytes from a place on, as many as there are.
std::string readAt(int file, std::int64_t place, std::size_t size, const std::string& path) {
  std::string text(size, '\0');
  std::size_t done = 0;
  while (done < size) {
    const ssize_t n =
        ::pread(file, &text[done], size - done, place + static_cast<std::int64_t>(done));
    if (n < 0 && errno == EINTR) continue;
    if (n < 0) fail(path, "read");
    if (n == 0) break;
    done += static_cast<std::size_t>(n);
  }
  text.resize(done);
  return text;
}

}  // namespace

StudyJournal::StudyJournal(const std::string& path, const std::string& header, bool fresh)
    : path_(path) {
  file_ = ::open(path.c_str(), O_RDWR | O_CREAT | O_APPEND | O_CLOEXEC, 0644);
  if (file_ < 0) fail(path, "open");
  try {
    // ranks whose launcher was killed take a moment to end
    int locked = ::flock(file_, LOCK_EX | LOCK_NB);
    for (int i = 0; i < kLockTries && locked != 0; ++i) {
      std::this_thread::sleep_for(kLockPause);
      locked = ::flock(file_, LOCK_EX | LOCK_NB);
    }
    if (locked != 0) {
      throw InputError("journal " + path +
                       ": in use by another process: end that, or give another --output");
    }
    const std::string first = header + "\n";
    const std::string found = readAt(file_, 0, 4096, path);
    const std::string line = found.substr(0, found.find('\n'));
    // nothing, or a first line that was cut off: begin
    const bool begun = found.find('\n') != std::string::npos;
    if (begun && line != header && !fresh) {
      throw InputError("journal " + path + ": begun by \"" + line + "\", this is \"" + header +
                       "\": give another --output, or --fresh to drop its runs");
    }
    if (!begun && first.compare(0, found.size(), found) != 0 && !fresh) {
      throw InputError("journal " + path +
                       ": no journal of a study: give another --output, or --fresh");
    }
    if (!begun || fresh) {
      if (::ftruncate(file_, 0) != 0) fail(path, "truncate");
      writeAll(file_, first, path);
    }
    begin_ = size_ = static_cast<std::int64_t>(first.size());
  } catch (...) {
    ::close(file_);
    throw;
  }
}

StudyJournal::~StudyJournal() {
  ::fdatasync(file_);
  ::close(file_);
}

void StudyJournal::read(const std::function<void(const StudyRecord&, std::int64_t)>& visit) {
  constexpr std::size_t kChunk = 1 << 20;
  std::string text;
  std::int64_t place = begin_;  // of the text's first byte
  StudyRecord record;
  bool more = true;
  while (more) {
    const std::string chunk =
        readAt(file_, place + static_cast<std::int64_t>(text.size()), kChunk, path_);
    more = !chunk.empty();
    text += chunk;
    std::size_t at = 0;
    while (const std::size_t taken = decodeRecord(text.data() + at, text.size() - at, record)) {
      visit(record, place + static_cast<std::int64_t>(at));
      at += taken;
    }
    place += static_cast<std::int64_t>(at);
    text.erase(0, at);
  }
  // what is left was cut off
  size_ = place;
  if (::ftruncate(file_, size_) != 0) fail(path_, "truncate");
}

std::int64_t StudyJournal::append(const StudyRecord& record) {
  const std::string text = encodeRecord(record);
  try {
    writeAll(file_, text, path_);
  } catch (...) {
    // half a record must not stay in front of the next
    if (::ftruncate(file_, size_) != 0) fail(path_, "truncate");
    throw;
  }
  const std::int64_t place = size_;
  size_ += static_cast<std::int64_t>(text.size());
  return place;
}

StudyRecord StudyJournal::at(std::int64_t place) const {
  StudyRecord record;
  for (std::size_t size = 4096; size < (std::size_t{1} << 32); size *= 16) {
    const std::string text = readAt(file_, place, size, path_);
    if (decodeRecord(text.data(), text.size(), record) != 0) return record;
    if (text.size() < size) break;
  }
  throw InputError("journal " + path_ + ": damaged while it was in use: give another --output");
}

void StudyJournal::sync() const { ::fdatasync(file_); }

}  // namespace assembly_cell
