// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "lines.h"

#include <array>
#include <utility>

#include "assembly_cell/base/input_error.h"

namespace assembly_cell::table {

namespace {

constexpr std::size_t kLongestLine = 64 * 1024;  // [bytes]
constexpr std::size_t kStart = 12;               // bytes by which the format is recognised
constexpr int kByteOrderMark = 0xFEFF;

struct Binary {
  std::string start;
  const char* name;
};

const std::array<Binary, 8> kBinaries = {
    {{"#ROSBAG", "a bag: let its name end with .bag"},
     {"header:", "output of rostopic echo: write it with rostopic echo -p"},
     {"PK\x03\x04", "a spreadsheet or an archive: export it as CSV"},
     {"\xD0\xCF\x11\xE0", "a spreadsheet: export it as CSV"},
     {"MATLAB 5.0", "a MATLAB file: write it as CSV, as writematrix does"},
     {"\x89HDF", "an HDF5 file: write it as CSV"},
     {"\x93NUMPY", "an array of numpy: write it as CSV, as numpy.savetxt does"},
     {"\x1F\x8B", "compressed: unpack it"}}};

}  // namespace

Lines::Lines(std::istream& stream, std::string path) : stream_(stream), path_(std::move(path)) {
  recognise();
}

void Lines::recognise() {
  for (int c = 0; start_.size() < kStart && (c = rest()) >= 0;) start_ += static_cast<char>(c);
  refuseBinary();
  const auto begins = [&](const std::string& bytes) { return start_.rfind(bytes, 0) == 0; };
  const auto zero = [&](std::size_t i) { return start_.size() > i && start_[i] == '\0'; };
  if (begins("\xEF\xBB\xBF")) {
    at_ = 3;
  } else if (begins("\xFF\xFE") || (!zero(0) && zero(1) && !zero(2) && zero(3))) {
    encoding_ = Encoding::kLittle;
  } else if (begins("\xFE\xFF") || (zero(0) && !zero(1) && zero(2) && !zero(3))) {
    encoding_ = Encoding::kBig;
  }
}

void Lines::refuseBinary() const {
  for (const Binary& binary : kBinaries) {
    if (start_.rfind(binary.start, 0) == 0) throw InputError(path_ + ": this is " + binary.name);
  }
}

int Lines::rest() {
  std::streambuf* buffer = stream_.rdbuf();
  const int c = buffer == nullptr ? std::char_traits<char>::eof() : buffer->sbumpc();
  return c == std::char_traits<char>::eof() ? -1 : static_cast<unsigned char>(c);
}

int Lines::unit() {
  const int first = byte();
  if (encoding_ == Encoding::kUtf8 || first < 0) return first;
  const int second = byte();
  if (second < 0) return -1;
  return encoding_ == Encoding::kLittle ? first + 256 * second : 256 * first + second;
}

void Lines::append(std::string& line, int unit) const {
  if (encoding_ == Encoding::kUtf8 || unit < 0x80) {
    line += static_cast<char>(unit);
  } else if (unit < 0x800) {
    line += static_cast<char>(0xC0 | unit >> 6);
    line += static_cast<char>(0x80 | (unit & 0x3F));
  } else {
    line += static_cast<char>(0xE0 | unit >> 12);
    line += static_cast<char>(0x80 | (unit >> 6 & 0x3F));
    line += static_cast<char>(0x80 | (unit & 0x3F));
  }
}

bool Lines::next(std::string& line) {
  line.clear();
  int c = unit();
  if (after_return_ && c == '\n') c = unit();
  after_return_ = false;
  if (c < 0) return false;
  ++number_;
  for (; c >= 0 && c != '\n' && c != '\r'; c = unit()) {
    if (c == 0) {
      throw InputError(path_ + ":" + std::to_string(number_) +
                       ": a zero byte: give a text such as CSV, in UTF-8 or UTF-16");
    }
    if (c != kByteOrderMark) append(line, c);
    if (line.size() > kLongestLine) {
      throw InputError(path_ + ":" + std::to_string(number_) + ": a row of more than " +
                       std::to_string(kLongestLine) + " bytes: give a text such as CSV");
    }
  }
  after_return_ = c == '\r';
  return true;
}

}  // namespace assembly_cell::table
