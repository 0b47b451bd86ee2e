// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/base/yaml_text.h"

#include <yaml-cpp/yaml.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <cstring>
#include <system_error>
#include <vector>

namespace assembly_cell {
namespace {

template <typename Number>
bool parse(const std::string& text, Number& value) {
  const char* first = text.data() + (text.size() > 1 && text[0] == '+' ? 1 : 0);
  const char* last = text.data() + text.size();
  const auto [end, error] = std::from_chars(first, last, value);
  return error == std::errc() && end == last;
}

// The columns at which blocks of the present line's ancestors begin.
class Blocks {
 public:
  /// A line from its first character on; its depth.
  std::size_t begin(const std::string& text, std::size_t at) {
    std::size_t column = skipBlanks(text, at) - at;
    while (!columns_.empty() && columns_.back() > column) columns_.pop_back();
    push(column);
    // entries and keys that begin in the same line
    while (at + column + 1 < text.size() && isMark(text[at + column]) &&
           isBlank(text[at + column + 1])) {
      column = skipBlanks(text, at + column + 1) - at;
      push(column);
    }
    return columns_.size();
  }

 private:
  static bool isMark(char c) { return c == '-' || c == '?' || c == ':'; }
  static bool isBlank(char c) { return c == ' ' || c == '\t'; }
  static std::size_t skipBlanks(const std::string& text, std::size_t at) {
    while (at < text.size() && isBlank(text[at])) ++at;
    return at;
  }
  // a list may stand at the column of its key: an entry more
  void push(std::size_t column) {
    columns_.push_back(column);
    const std::size_t n = columns_.size();
    if (n > 2 && columns_[n - 3] == column) columns_.pop_back();
  }

  std::vector<std::size_t> columns_;
};

}  // namespace

std::size_t yamlDepth(const std::string& text) {
  Blocks blocks;
  std::size_t deepest = 0, block = 0, flow = 0;
  char quote = 0;
  for (std::size_t k = 0; k < text.size(); ++k) {
    const char c = text[k];
    const char before = k == 0 ? '\n' : text[k - 1];
    if (quote != 0) {
      const bool twice = quote == '\'' && c == quote && k + 1 < text.size() && text[k + 1] == c;
      if (twice || (quote == '"' && c == '\\')) {
        ++k;
      } else if (c == quote) {
        quote = 0;
      }
      continue;
    }
    if (before == '\n' && flow == 0) block = blocks.begin(text, k);
    // a quote or comment only where a word could begin; elsewhere it's part of one
    const bool start = std::strchr(" \t\n,[{:", before) != nullptr;
    if (start && (c == '"' || c == '\'')) quote = c;
    if (start && c == '#') {
      k = std::min(text.find('\n', k), text.size()) - 1;
      continue;
    }
    if (c == '[' || c == '{') ++flow;
    if ((c == ']' || c == '}') && flow > 0) --flow;
    deepest = std::max(deepest, block + flow);
  }
  return deepest;
}

std::string tooDeep(const std::string& text) {
  const std::size_t depth = yamlDepth(text);
  if (depth <= kDeepestYaml) return {};
  return std::to_string(depth) + " lists and mappings stand in each other: give at most " +
         std::to_string(kDeepestYaml);
}

std::string yamlNumber(double value) {
  if (!std::isfinite(value)) return "null";
  char text[32];
  const auto [end, error] = std::to_chars(text, text + sizeof text, value);
  std::string number(text, error == std::errc() ? end : text);
  if (number.find('.') == std::string::npos) {
    const std::size_t exponent = number.find('e');
    number.insert(exponent == std::string::npos ? number.size() : exponent, ".0");
  }
  return number;
}

std::string yamlQuoted(const std::string& text) {
  YAML::Emitter out;
  out << YAML::DoubleQuoted << text;
  return out.c_str();
}

bool parseNumber(const std::string& text, double& value) {
  double read = 0.0;
  if (!parse(text, read) || !std::isfinite(read)) return false;
  value = read;
  return true;
}

bool parseInteger(const std::string& text, long& value) { return parse(text, value); }

std::string yamlList(const double* values, std::size_t count) {
  std::string text = "[";
  for (std::size_t i = 0; i < count; ++i) text += (i > 0 ? ", " : "") + yamlNumber(values[i]);
  return text + "]";
}

YamlMapping& YamlMapping::add(const std::string& key, const std::string& yaml) {
  entries_ += (entries_.empty() ? "" : ", ") + key + ": " + yaml;
  return *this;
}

}  // namespace assembly_cell
