// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/calibration/observation_log.h"

#include <fcntl.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstdio>
#include <cstring>

#include "assembly_cell/base/input_error.h"
#include "assembly_cell/sensor/calibration.h"

namespace assembly_cell {

namespace {

[[noreturn]] void fail(const std::string& path, const std::string& what) {
  const std::string reason = std::strerror(errno);
  throw InputError("journal '" + path + "' can't be written (" + what + ": " + reason +
                   "): give a writable folder with room");
}

std::string seal(std::size_t number, const std::string& text) {
  const std::string label = std::to_string(number);
  return "  # " + label + " " + crcText(label + text);
}

// where the seal of a line begins, or npos
std::size_t sealOf(const std::string& line) {
  const std::size_t place = line.rfind("  # ");
  return place != std::string::npos && line.find(" crc32:", place) != std::string::npos
             ? place
             : std::string::npos;
}

// the header with its seal on the last line
std::string sealed(const std::string& header) {
  const std::string text = header.substr(0, header.size() - 1);
  return text + seal(0, text) + "\n";
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

std::string contentOf(int file, const std::string& path) {
  std::string content;
  char buffer[65536];
  for (;;) {
    const ssize_t n = ::read(file, buffer, sizeof(buffer));
    if (n < 0 && errno == EINTR) continue;
    if (n < 0) {
      throw InputError("journal '" + path + "' can't be read (" + std::strerror(errno) +
                       "): give a file that can be read and written");
    }
    if (n == 0) return content;
    content.append(buffer, static_cast<std::size_t>(n));
  }
}

}  // namespace

ObservationLog::ObservationLog(const std::string& path, const std::string& header) : path_(path) {
  if (header.empty() || header.back() != '\n') {
    throw InputError("journal '" + path + "': header has no end of line: give whole lines");
  }
  const std::string lock = path + ".lock";
  lock_ = ::open(lock.c_str(), O_RDWR | O_CREAT | O_CLOEXEC, 0644);
  try {
    if (lock_ < 0) fail(path, "open");
    if (::flock(lock_, LOCK_EX | LOCK_NB) != 0) {
      throw InputError("journal '" + path +
                       "' is in use by another process: end it, or give another folder");
    }
    struct stat there;
    if (::stat(path.c_str(), &there) != 0) {
      create(header);
    } else if (!read(header)) {
      create(header);
      records_.clear();
      starts_.clear();
    }
    if (file_ < 0) open();
  } catch (...) {
    if (file_ >= 0) ::close(file_);
    if (lock_ >= 0) ::close(lock_);
    throw;
  }
}

ObservationLog::~ObservationLog() {
  ::close(file_);
  ::close(lock_);
}

// the whole header at once: a reader sees no file, the old one, or one with its header
void ObservationLog::create(const std::string& header) {
  const std::string text = sealed(header);
  writeFileAtomically(path_, text, "journal '" + path_ + "'");
  size_ = static_cast<std::int64_t>(text.size());
}

void ObservationLog::open() {
  file_ = ::open(path_.c_str(), O_RDWR | O_APPEND | O_CLOEXEC);
  if (file_ < 0) fail(path_, "open");
}

// false: the file holds no record, and another header
bool ObservationLog::read(const std::string& header) {
  open();
  const std::string content = contentOf(file_, path_);
  const std::string where = "journal '" + path_ + "'";
  bool in_header = true;
  std::string found;
  std::size_t begin = 0;
  int line_number = 0;
  while (begin < content.size()) {
    ++line_number;
    const std::size_t end = content.find('\n', begin);
    const std::string line = content.substr(begin, end == std::string::npos ? end : end - begin);
    const std::size_t mark = sealOf(line);
    const bool has_seal = mark != std::string::npos;
    const std::string text = has_seal ? line.substr(0, mark) : line;

    if (in_header) {
      found += text;
      if (has_seal && line.substr(mark) == seal(0, found) && end != std::string::npos) {
        in_header = false;
      } else if (has_seal || end == std::string::npos) {
        break;
      } else {
        found += '\n';
      }
    } else if (end == std::string::npos || line.find('\0') != std::string::npos) {
      // a line without end, or room that was never filled, and nothing after it
      const bool nothing_follows =
          end == std::string::npos || content.find_first_not_of('\0', begin) == std::string::npos;
      if (!nothing_follows) {
        throw InputError(where + ", line " + std::to_string(line_number) +
                         ": damaged (holds zero bytes): restore the file, or move it away");
      }
      torn_ = true;
      break;
    } else if (!has_seal || line.substr(mark) != seal(records_.size() + 1, text)) {
      throw InputError(where + ", line " + std::to_string(line_number) +
                       ": damaged or edited (its seal is not that of record " +
                       std::to_string(records_.size() + 1) +
                       "): restore the file, or move it away");
    } else {
      starts_.push_back(static_cast<std::int64_t>(begin));
      records_.push_back(text);
    }
    begin = end + 1;
  }
  if (in_header) {
    throw InputError(where + ", line " + std::to_string(line_number) +
                     ": no journal, or its header is damaged: move the file away");
  }
  if (found + '\n' != header) {
    if (!records_.empty()) {
      throw InputError(where + " was begun with another header (" +
                       std::to_string(records_.size()) +
                       " records): use the same sensors and accuracies, or move the file away");
    }
    ::close(file_);
    file_ = -1;
    return false;
  }
  size_ = static_cast<std::int64_t>(begin);
  if (torn_ && (::ftruncate(file_, size_) != 0 || ::fsync(file_) != 0)) fail(path_, "truncate");
  return true;
}

void ObservationLog::append(const std::string& record) {
  if (record.empty() || record.find_first_of(std::string("\n\0", 2)) != std::string::npos) {
    throw InputError("journal '" + path_ + "': a record must be one line that isn't empty");
  }
  const std::string line = record + seal(records_.size() + 1, record) + "\n";
  try {
    writeAll(file_, line, path_);
    if (::fsync(file_) != 0) fail(path_, "fsync");
  } catch (...) {
    // half a line must not stay in front of the next
    if (::ftruncate(file_, size_) == 0) ::fsync(file_);
    throw;
  }
  starts_.push_back(size_);
  records_.push_back(record);
  size_ += static_cast<std::int64_t>(line.size());
}

void ObservationLog::removeLast() {
  if (records_.empty()) throw InputError("journal '" + path_ + "' is empty: nothing to remove");
  if (::ftruncate(file_, starts_.back()) != 0 || ::fsync(file_) != 0) fail(path_, "truncate");
  size_ = starts_.back();
  starts_.pop_back();
  records_.pop_back();
}

void ObservationLog::clear(const std::string& header) {
  if (header.empty() || header.back() != '\n') {
    throw InputError("journal '" + path_ + "': header has no end of line: give whole lines");
  }
  // the old file under both names, then the new one in its place: at no moment there is none
  const std::string previous = path_ + ".previous", link = path_ + ".old";
  ::unlink(link.c_str());
  if (::link(path_.c_str(), link.c_str()) != 0) fail(path_, "link");
  if (std::rename(link.c_str(), previous.c_str()) != 0) fail(path_, "rename");
  create(header);
  ::close(file_);
  open();
  records_.clear();
  starts_.clear();
  torn_ = false;
}

}  // namespace assembly_cell
