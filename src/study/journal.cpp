// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.

#include <algorithm>
#include <cstring>

#include "assembly_cell/base/input_error.h"
#include "assembly_cell/base/text.h"
#include "assembly_cell/study/ledger.h"

namespace assembly_cell {
namespace {

// ranks whose launcher was killed take a moment to end [s]
constexpr double kLockPatience = 3.0;

}  // namespace

StudyJournal::StudyJournal(const std::string& path, const std::string& header, bool fresh)
    : journal_(path, "give --output a folder that can be written, with free space") {
  journal_.lockOut(path, kLockPatience);
  journal_.open();
  const std::string first = header + "\n";
  const std::string found = journal_.read(0, 4096);
  const std::string line = found.substr(0, found.find('\n'));
  // nothing, or a first line that was cut off: begin
  const bool begun = found.find('\n') != std::string::npos;
  if (begun && line != header && !fresh) {
    throw InputError(journal_.where() + ": begun by \"" + line + "\", this is \"" + header +
                     "\": give another --output, or --fresh to drop its runs");
  }
  if (!begun && first.compare(0, found.size(), found) != 0 && !fresh) {
    throw InputError(journal_.where() +
                     ": no journal of a study: give another --output, or --fresh");
  }
  if (!begun || fresh) {
    journal_.cut(0);
    journal_.append(first, false);
  }
  begin_ = static_cast<std::int64_t>(first.size());
}

StudyJournal::~StudyJournal() { journal_.sync(); }

void StudyJournal::read(const std::function<void(const StudyRecord&, std::int64_t)>& visit) {
  constexpr std::size_t kChunk = 1 << 20;
  std::string text;
  std::int64_t place = begin_;  // offset of the text's first byte
  StudyRecord record;
  bool more = true;
  while (more) {
    const std::string chunk = journal_.read(place + static_cast<std::int64_t>(text.size()), kChunk);
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
  // the rest was cut off
  if (place < journal_.size()) journal_.cut(place);
}

std::int64_t StudyJournal::append(const StudyRecord& record) {
  const std::int64_t place = journal_.size();
  journal_.append(encodeRecord(record), false);
  return place;
}

StudyRecord StudyJournal::at(std::int64_t place) const {
  StudyRecord record;
  for (std::size_t size = 4096; size < (std::size_t{1} << 32); size *= 16) {
    const std::string text = journal_.read(place, size);
    if (decodeRecord(text.data(), text.size(), record) != 0) return record;
    if (text.size() < size) break;
  }
  throw InputError(journal_.where() + ": damaged while it was in use: give another --output");
}

void StudyJournal::sync() const { journal_.sync(); }

}  // namespace assembly_cell
