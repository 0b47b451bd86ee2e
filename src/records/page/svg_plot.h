// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <cmath>
#include <string>
#include <vector>

namespace assembly_cell {

/// & < > " of a text as HTML entities; control characters as blanks.
std::string escaped(const std::string& text);

struct PlotRange {
  double low = HUGE_VAL, high = -HUGE_VAL;
  void add(double value);  ///< finite ones only
  bool empty() const { return !(low <= high); }
};

/// A diagram as inline SVG; classes of its elements are coloured by the page's style sheet.
class SvgPlot {
 public:
  SvgPlot(const PlotRange& x, const PlotRange& y, const std::string& x_label,
          const std::string& y_label);

  /// Lines through the finite points; points closer than half a pixel to the last one are left out.
  void line(const std::string& style, const std::vector<double>& x, const std::vector<double>& y,
            const std::string& title);
  void dots(const std::string& style, const std::vector<double>& x, const std::vector<double>& y,
            const std::vector<std::string>& titles);
  /// The area between two lines over the same x.
  void area(const std::string& style, const std::vector<double>& x, const std::vector<double>& low,
            const std::vector<double>& high);
  std::string finish() const;

 private:
  double px(double x) const;
  double py(double y) const;
  std::string point(double x, double y) const;
  void axes(const std::string& x_label, const std::string& y_label);

  PlotRange x_, y_;
  std::string out_;
};

}  // namespace assembly_cell
