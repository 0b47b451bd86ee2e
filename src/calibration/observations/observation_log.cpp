// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/calibration/observations/observation_log.h"

#include <unistd.h>

#include <cstdio>
#include <filesystem>
#include <fstream>

#include "assembly_cell/base/files.h"
#include "assembly_cell/base/input_error.h"
#include "assembly_cell/base/text.h"

namespace assembly_cell {

namespace {

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

void checkHeader(const Journal& journal, const std::string& header) {
  if (!header.empty() && header.back() == '\n') return;
  throw InputError(journal.where() + ": header has no end of line: give whole lines");
}

}  // namespace

ObservationLog::ObservationLog(const std::string& path, const std::string& header)
    : journal_(path, "give a writable folder with free space") {
  checkHeader(journal_, header);
  journal_.lockOut(path + ".lock", 0.0);
  if (!std::filesystem::exists(path)) {
    // a file that was moved away on purpose has lost nothing
    create(header);
    writeCount(0);
    return;
  }
  if (!read(header)) create(header);
  readCount();
}

// after the record: a crash between the two leaves a count that is too small, never a false alarm
void ObservationLog::writeCount(std::size_t count) const {
  writeFileAtomically(path() + ".count", std::to_string(count) + "\n", journal_.where());
}

void ObservationLog::readCount() {
  std::ifstream in(path() + ".count");
  std::size_t count = 0;
  if (in >> count && count > records_.size()) lost_ = count - records_.size();
}

// the whole header at once: a reader sees no file, the old one, or one with its header
void ObservationLog::create(const std::string& header) {
  writeFileAtomically(path(), sealed(header), journal_.where());
  journal_.open();
  records_.clear();
  starts_.clear();
  torn_ = false;
}

// false: the file holds no record, and another header
bool ObservationLog::read(const std::string& header) {
  journal_.open();
  const std::string content = journal_.read(0, static_cast<std::size_t>(journal_.size()));
  const std::string where = journal_.where();
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
      // a last line without end, or preallocated zero bytes up to the end
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
    return false;
  }
  if (torn_) journal_.cut(static_cast<std::int64_t>(begin));
  return true;
}

void ObservationLog::append(const std::string& record) {
  if (record.empty() || record.find_first_of(std::string("\n\0", 2)) != std::string::npos) {
    throw InputError(journal_.where() + ": a record must be one line that isn't empty");
  }
  const std::int64_t start = journal_.size();
  journal_.append(record + seal(records_.size() + 1, record) + "\n", true);
  starts_.push_back(start);
  records_.push_back(record);
  writeCount(records_.size());
}

void ObservationLog::removeLast() {
  if (records_.empty()) throw InputError(journal_.where() + " is empty: nothing to remove");
  writeCount(records_.size() - 1);
  journal_.cut(starts_.back());
  starts_.pop_back();
  records_.pop_back();
}

void ObservationLog::clear(const std::string& header) {
  checkHeader(journal_, header);
  writeCount(0);
  // the old file gets a second name before the new one replaces it: the path always exists
  const std::string previous = path() + ".previous", link = path() + ".old";
  ::unlink(link.c_str());
  if (::link(path().c_str(), link.c_str()) != 0) journal_.fail("link");
  if (std::rename(link.c_str(), previous.c_str()) != 0) journal_.fail("rename");
  create(header);
}

}  // namespace assembly_cell
