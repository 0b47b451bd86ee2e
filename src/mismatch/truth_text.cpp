// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include <map>

#include "assembly_cell/base/yaml_text.h"
#include "draw_keys.h"

namespace assembly_cell {
namespace {

// every `step`th of n numbers
std::string list(const double* numbers, std::size_t n, std::size_t step = 1) {
  std::string text;
  for (std::size_t i = 0; i < n; ++i) {
    text += (text.empty() ? "" : ", ") + yamlNumber(numbers[i * step]);
  }
  return "[" + text + "]";
}

std::string textOf(const DrawKey& key) {
  switch (key.shape) {
    case DrawKey::Shape::kAxes:
    case DrawKey::Shape::kDirection:
      return list(key.values, 3);
    case DrawKey::Shape::kTilt:
      return list(key.values, 2);
    case DrawKey::Shape::kMatrix: {
      std::string rows;
      for (int i = 0; i < 6; ++i) rows += (i > 0 ? ", " : "") + list(key.values + i, 6, 6);
      return "[" + rows + "]";
    }
    case DrawKey::Shape::kNumber:
      break;
  }
  const std::string number = yamlNumber(*key.values);
  if (key.angle == nullptr) return number;
  return number + ", " + key.angle_name + ": " + yamlNumber(*key.angle);
}

std::string changes(const std::vector<DrawnChange>& drawn) {
  std::string text;
  for (const DrawnChange& change : drawn) {
    const std::string key =
        change.key.find('[') == std::string::npos ? change.key : yamlQuoted(change.key);
    text += (text.empty() ? "" : ", ") + key + ": " +
            (change.each ? list(change.values.data(), change.values.size())
                         : yamlNumber(change.values.front()));
  }
  return "{" + text + "}";
}

using Texts = std::map<std::string, std::string>;

// keys [first, last) of one mapping, whose path ends before `depth`
std::string mapping(const std::vector<std::string>& keys, std::size_t first, std::size_t last,
                    std::size_t depth, const Texts& texts) {
  std::string text;
  while (first < last) {
    const std::size_t dot = keys[first].find('.', depth);
    const std::string name = keys[first].substr(depth, dot - depth);
    text += (text.empty() ? "" : ", ") + name + ": ";
    if (dot == std::string::npos) {
      text += texts.at(keys[first++]);
      continue;
    }
    std::size_t end = first;
    while (end < last && keys[end].compare(0, dot + 1, keys[first], 0, dot + 1) == 0) ++end;
    text += "{" + mapping(keys, first, end, dot + 1, texts) + "}";
    first = end;
  }
  return text;
}

}  // namespace

std::string truthText(const Truth& truth) {
  std::string text;
  const auto join = [&text](const std::string& part) {
    if (!part.empty()) text += (text.empty() ? "" : ", ") + part;
  };
  if (!truth.scale.empty()) join("scale: " + changes(truth.scale));
  if (!truth.add.empty()) join("add: " + changes(truth.add));
  Truth copy = truth;
  Texts texts;
  for (const DrawKey& key : drawKeys(copy)) texts[key.path] = textOf(key);
  join(mapping(truth.drawn, 0, truth.drawn.size(), 0, texts));
  return "{" + text + "}";
}

}  // namespace assembly_cell
