// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "verdict/boxes.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>
#include <vector>

#include "assembly_cell/base/text.h"
#include "verdict/cells.h"

namespace assembly_cell {
namespace {

constexpr double kUnbounded = std::numeric_limits<double>::infinity();
const std::vector<std::string> kSides = {"left", "right", "top", "bottom", "inside", "any"};
const std::vector<std::string> kKinds = {"pass", "range", "maximum", "end"};

template <class Enum>
Enum readChoice(yaml::Section& section, const char* key, const std::vector<std::string>& names,
                const std::optional<std::string>& otherwise) {
  const std::string name = section.choice(key, names, otherwise);
  return static_cast<Enum>(std::find(names.begin(), names.end(), name) - names.begin());
}

// [LOW, HIGH], one of which may be null where `open`: no bound.
void readBounds(yaml::Section& section, const char* key, bool open, double& low, double& high) {
  const std::string remedy = open ? "give [LOW, HIGH]; null for one of them: no bound"
                                  : "give [LOW, HIGH], LOW below HIGH";
  const YAML::Node node = section.required(key, remedy);
  const auto read = [&](std::size_t i, double& bound) {
    return (open && node[i].IsNull()) || yaml::readNumber(node[i], bound);
  };
  const bool good = node.IsSequence() && node.size() == 2 && read(0, low) && read(1, high) &&
                    low < high && (std::isfinite(low) || std::isfinite(high));
  if (!good) section.refuse(section.at(key), yaml::shown(node), remedy);
}

std::string rangeText(const CurveBox& box) {
  if (std::isinf(box.low)) return "at most " + shownValue(box.quantity, box.high);
  if (std::isinf(box.high)) return "at least " + shownValue(box.quantity, box.low);
  return text("%.4g to ", box.low) + shownValue(box.quantity, box.high);
}

// Distance from the nearer bound over half the width; of one bound over its magnitude.
double marginOf(const CurveBox& box, double value) {
  double scale = 0.5 * (box.high - box.low);
  if (std::isinf(scale)) scale = std::abs(std::isinf(box.low) ? box.high : box.low);
  if (scale == 0.0) scale = 1.0;
  return std::min(value - box.low, box.high - value) / scale;
}

struct Found {
  double margin = kUnbounded, place = std::nan(""), value = std::nan("");
};

void keepWorst(const CurveBox& box, double place, double value, Found& found) {
  const double margin = marginOf(box, value);
  if (margin < found.margin) found = {margin, place, value};
}

// All values over from … to, those at the bounds interpolated.
Found worstInRange(const CurveBox& box, const std::vector<double>& path,
                   const std::vector<double>& values) {
  Found found;
  for (std::size_t i = 0; i < path.size(); ++i) {
    if (path[i] >= box.from && path[i] <= box.to) keepWorst(box, path[i], values[i], found);
    if (i == 0 || path[i] == path[i - 1]) continue;
    for (const double bound : {box.from, box.to}) {
      const double part = (bound - path[i - 1]) / (path[i] - path[i - 1]);
      if (!(part > 0.0 && part < 1.0)) continue;
      keepWorst(box, bound, values[i - 1] + part * (values[i] - values[i - 1]), found);
    }
  }
  return found;
}

Found largestInRange(const CurveBox& box, const std::vector<double>& path,
                     const std::vector<double>& values) {
  Found found;
  for (std::size_t i = 0; i < path.size(); ++i) {
    if (path[i] < box.from || path[i] > box.to || values[i] <= found.value) continue;
    found.place = path[i];
    found.value = values[i];
  }
  if (!std::isnan(found.value)) found.margin = marginOf(box, found.value);
  return found;
}

// Part [first, last] of a segment that is in the box, and the sides at which that begins and ends;
// first > last: none of it.
struct Clip {
  double first = 0.0, last = 1.0;
  CurveBox::Side entry = CurveBox::Side::kInside, exit = CurveBox::Side::kInside;
};
Clip clip(const CurveBox& box, double x0, double y0, double x1, double y1) {
  using Side = CurveBox::Side;
  struct Edge {
    double speed, distance;  // across the side outward; from the start to it, inward positive
    Side side;
  };
  const std::array<Edge, 4> edges = {{{x0 - x1, x0 - box.from, Side::kLeft},
                                      {x1 - x0, box.to - x0, Side::kRight},
                                      {y0 - y1, y0 - box.low, Side::kBottom},
                                      {y1 - y0, box.high - y0, Side::kTop}}};
  Clip c;
  for (const Edge& edge : edges) {
    if (std::isinf(edge.distance)) continue;
    if (edge.speed == 0.0) {
      if (edge.distance < 0.0) c.last = -1.0;
      continue;
    }
    const double at = edge.distance / edge.speed;
    if (edge.speed > 0.0 && at < c.last) {
      c.last = at;
      c.exit = edge.side;
    } else if (edge.speed < 0.0 && at > c.first) {
      c.first = at;
      c.entry = edge.side;
    }
  }
  return c;
}

bool fits(CurveBox::Side wanted, CurveBox::Side is) {
  return wanted == CurveBox::Side::kAny || wanted == is;
}

std::string sideName(CurveBox::Side side) { return kSides[static_cast<std::size_t>(side)]; }

// Enters by one side only and leaves by one side only.
RunVerdict evaluatePass(const CurveBox& box, const std::vector<double>& path,
                        const std::vector<double>& values, RunVerdict verdict) {
  using Side = CurveBox::Side;
  bool inside = false, was_inside = false;
  const auto fail = [&](std::size_t i, const std::string& what) {
    verdict.passed = false;
    verdict.depth = path[i];
    verdict.margin = -1.0;
    verdict.text = what + " at " + shownPlace(box.over_time, path[i]);
    return verdict;
  };
  const auto holds = [&](std::size_t i) {
    return path[i] >= box.from && path[i] <= box.to && values[i] >= box.low &&
           values[i] <= box.high;
  };
  if (holds(0)) {
    inside = was_inside = true;
    if (!fits(box.entry, Side::kInside)) return fail(0, "begins inside of the box");
  }
  for (std::size_t i = 1; i < path.size(); ++i) {
    const Clip c = clip(box, path[i - 1], values[i - 1], path[i], values[i]);
    if (c.first > c.last) continue;
    if (!inside) {
      if (c.entry == Side::kInside) continue;  // touches a corner
      was_inside = true;
      if (!fits(box.entry, c.entry)) return fail(i, "enters at the " + sideName(c.entry));
    }
    inside = holds(i);
    if (!inside && !fits(box.exit, c.exit)) return fail(i, "leaves at the " + sideName(c.exit));
  }
  if (!was_inside) {
    verdict.passed = false;
    verdict.margin = -1.0;
    verdict.depth = std::nan("");
    verdict.text = "never enters the box";
    return verdict;
  }
  if (inside && !fits(box.exit, Side::kInside)) return fail(path.size() - 1, "ends inside");
  verdict.margin = 1.0;
  verdict.depth = std::nan("");
  verdict.text = "enters and leaves as it should";
  return verdict;
}

RunVerdict notEvaluated(RunVerdict verdict, double place, const std::string& why) {
  verdict.passed = false;
  verdict.margin = std::nan("");
  verdict.depth = place;
  verdict.text = "not evaluated, counts as outside: " + why;
  return verdict;
}

}  // namespace

CurveBox readBox(yaml::Section section) {
  CurveBox box;
  box.name = section.text("name", "give the rule a name");
  box.kind = readChoice<CurveBox::Kind>(section, "type", kKinds, std::nullopt);
  box.quantity = section.choice("quantity", curveQuantities());
  if (section.has("time") && section.has("depth")) {
    section.refuse(section.at("time"), "given beside depth", "give one of both");
  }
  box.over_time = section.has("time");
  const char* const path = box.over_time ? "time" : "depth";
  if (box.kind != CurveBox::Kind::kMaximum || section.has(path)) {
    readBounds(section, path, box.kind == CurveBox::Kind::kMaximum, box.from, box.to);
  }
  readBounds(section, "value", true, box.low, box.high);
  if (box.kind == CurveBox::Kind::kPass) {
    box.entry = readChoice<CurveBox::Side>(section, "entry", kSides, "any");
    box.exit = readChoice<CurveBox::Side>(section, "exit", kSides, "any");
  }
  section.finish();
  return box;
}

RunVerdict evaluateBox(const CurveBox& box, const Curve& curve) {
  RunVerdict verdict;
  verdict.rule = box.name;
  verdict.kind = "box";
  verdict.quantity = box.quantity;
  const std::vector<double>& path = pathOf(curve, box.over_time);
  const std::vector<double>& values = curveValues(curve, box.quantity);
  if (path.empty()) return notEvaluated(verdict, std::nan(""), "the curve has no samples");
  for (std::size_t i = 0; i < path.size(); ++i) {
    if (!std::isfinite(path[i])) {
      return notEvaluated(
          verdict, std::nan(""),
          text("%s of sample %zu isn't a number", box.over_time ? "time" : "depth", i));
    }
    if (i < values.size() && std::isfinite(values[i])) continue;
    return notEvaluated(verdict, path[i],
                        box.quantity + " isn't a number at " + shownPlace(box.over_time, path[i]));
  }
  if (box.kind == CurveBox::Kind::kPass) return evaluatePass(box, path, values, verdict);
  Found found;
  if (box.kind == CurveBox::Kind::kEnd) {
    found = {marginOf(box, values.back()), path.back(), values.back()};
    if (path.back() < box.from || path.back() > box.to) {
      const double middle = 0.5 * (box.from + box.to), half = 0.5 * (box.to - box.from);
      verdict.passed = false;
      verdict.margin = 1.0 - std::abs(path.back() - middle) / half;
      verdict.depth = path.back();
      verdict.text = "ends at " + shownPlace(box.over_time, path.back()) + ", wanted " +
                     shownPlace(box.over_time, box.from) + " to " +
                     shownPlace(box.over_time, box.to);
      return verdict;
    }
  } else {
    const PathEnds ends = pathEnds(path);
    if (box.kind == CurveBox::Kind::kRange && ends.end < box.to) {
      return notEvaluated(verdict, ends.end,
                          "the curve ends before " + shownPlace(box.over_time, box.to));
    }
    if (box.kind == CurveBox::Kind::kRange && ends.begin > box.from) {
      return notEvaluated(verdict, ends.begin,
                          "the curve begins after " + shownPlace(box.over_time, box.from));
    }
    found = box.kind == CurveBox::Kind::kRange ? worstInRange(box, path, values)
                                               : largestInRange(box, path, values);
  }
  if (std::isnan(found.value)) {
    return notEvaluated(verdict, std::nan(""), "the curve has no samples in the box's range");
  }
  verdict.margin = found.margin;
  verdict.passed = found.margin >= 0.0;
  verdict.depth = found.place;
  verdict.text = box.quantity + " " + shownValue(box.quantity, found.value) + " at " +
                 shownPlace(box.over_time, found.place) + (verdict.passed ? ", " : ", wanted ") +
                 rangeText(box);
  return verdict;
}

}  // namespace assembly_cell
