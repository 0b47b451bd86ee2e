// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/base/yaml_text.h"

#include <yaml-cpp/yaml.h>

#include <charconv>
#include <cmath>
#include <system_error>

namespace assembly_cell {
namespace {

template <typename Number>
bool parse(const std::string& text, Number& value) {
  const char* first = text.data() + (text.size() > 1 && text[0] == '+' ? 1 : 0);
  const char* last = text.data() + text.size();
  const auto [end, error] = std::from_chars(first, last, value);
  return error == std::errc() && end == last;
}

}  // namespace

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

}  // namespace assembly_cell
