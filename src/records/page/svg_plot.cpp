// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "page/svg_plot.h"

#include <algorithm>

#include "assembly_cell/base/text.h"

namespace assembly_cell {
namespace {

constexpr double kWidth = 900.0, kHeight = 320.0;  // [px]
constexpr double kLeft = 70.0, kRight = 15.0, kTop = 12.0, kBottom = 46.0;
constexpr double kTicks = 6.0;

// A step of 1, 2 or 5 times a power of ten.
double tickStep(double span) {
  const double power = std::pow(10.0, std::floor(std::log10(span / kTicks)));
  for (const double factor : {1.0, 2.0, 5.0}) {
    if (span <= kTicks * factor * power) return factor * power;
  }
  return 10.0 * power;
}

PlotRange widened(PlotRange range) {
  if (range.empty()) return {0.0, 1.0};
  double margin = 0.04 * (range.high - range.low);
  if (!(margin > 1e-9 * std::max(std::abs(range.low), std::abs(range.high)))) {
    margin = std::max(1e-12, 0.05 * std::abs(range.high));
  }
  return {range.low - margin, range.high + margin};
}

}  // namespace

std::string escaped(const std::string& text) {
  std::string out;
  for (const char c : text) {
    switch (c) {
      case '&':
        out += "&amp;";
        break;
      case '<':
        out += "&lt;";
        break;
      case '>':
        out += "&gt;";
        break;
      case '"':
        out += "&quot;";
        break;
      default:
        out += static_cast<unsigned char>(c) < 0x20 || c == 0x7f ? ' ' : c;
    }
  }
  return out;
}

void PlotRange::add(double value) {
  if (!std::isfinite(value)) return;
  low = std::min(low, value);
  high = std::max(high, value);
}

SvgPlot::SvgPlot(const PlotRange& x, const PlotRange& y, const std::string& x_label,
                 const std::string& y_label)
    : x_(widened(x)), y_(widened(y)) {
  out_ = text("<svg viewBox=\"0 0 %.0f %.0f\" role=\"img\">\n", kWidth, kHeight);
  axes(x_label, y_label);
}

double SvgPlot::px(double x) const {
  return kLeft + (kWidth - kLeft - kRight) * (x - x_.low) / (x_.high - x_.low);
}

double SvgPlot::py(double y) const {
  return kHeight - kBottom - (kHeight - kTop - kBottom) * (y - y_.low) / (y_.high - y_.low);
}

std::string SvgPlot::point(double x, double y) const { return text("%.1f,%.1f ", px(x), py(y)); }

void SvgPlot::axes(const std::string& x_label, const std::string& y_label) {
  const double x_step = tickStep(x_.high - x_.low), y_step = tickStep(y_.high - y_.low);
  for (double n = std::ceil(x_.low / x_step); n * x_step <= x_.high; ++n) {
    const double x = n == 0.0 ? 0.0 : n * x_step;
    out_ += text("<line class=\"grid\" x1=\"%.1f\" x2=\"%.1f\" y1=\"%.1f\" y2=\"%.1f\"/>", px(x),
                 px(x), kTop, kHeight - kBottom) +
            text("<text x=\"%.1f\" y=\"%.1f\" text-anchor=\"middle\">%.6g</text>\n", px(x),
                 kHeight - kBottom + 16.0, x);
  }
  for (double n = std::ceil(y_.low / y_step); n * y_step <= y_.high; ++n) {
    const double y = n == 0.0 ? 0.0 : n * y_step;
    out_ += text("<line class=\"grid\" x1=\"%.1f\" x2=\"%.1f\" y1=\"%.1f\" y2=\"%.1f\"/>", kLeft,
                 kWidth - kRight, py(y), py(y)) +
            text("<text x=\"%.1f\" y=\"%.1f\" text-anchor=\"end\">%.6g</text>\n", kLeft - 6.0,
                 py(y) + 4.0, y);
  }
  out_ += text("<text x=\"%.1f\" y=\"%.1f\" text-anchor=\"middle\">", 0.5 * (kWidth + kLeft),
               kHeight - 8.0) +
          escaped(x_label) + "</text>" +
          text("<text transform=\"translate(14,%.1f) rotate(-90)\" text-anchor=\"middle\">",
               0.5 * (kHeight - kBottom)) +
          escaped(y_label) + "</text>\n";
}

void SvgPlot::line(const std::string& style, const std::vector<double>& x,
                   const std::vector<double>& y, const std::string& title) {
  out_ += "<polyline class=\"" + style + "\" points=\"";
  double last_x = HUGE_VAL, last_y = HUGE_VAL;
  for (std::size_t i = 0; i < x.size(); ++i) {
    if (!std::isfinite(x[i]) || !std::isfinite(y[i])) continue;
    const bool end = i + 1 == x.size();
    if (!end && std::hypot(px(x[i]) - last_x, py(y[i]) - last_y) < 0.5) continue;
    last_x = px(x[i]);
    last_y = py(y[i]);
    out_ += point(x[i], y[i]);
  }
  out_ += "\"><title>" + escaped(title) + "</title></polyline>\n";
}

void SvgPlot::dots(const std::string& style, const std::vector<double>& x,
                   const std::vector<double>& y, const std::vector<std::string>& titles) {
  for (std::size_t i = 0; i < x.size(); ++i) {
    if (!std::isfinite(x[i]) || !std::isfinite(y[i])) continue;
    out_ += text("<circle class=\"%s\" cx=\"%.1f\" cy=\"%.1f\" r=\"3\"><title>", style.c_str(),
                 px(x[i]), py(y[i])) +
            escaped(titles[i]) + "</title></circle>\n";
  }
}

void SvgPlot::area(const std::string& style, const std::vector<double>& x,
                   const std::vector<double>& low, const std::vector<double>& high) {
  out_ += "<polygon class=\"" + style + "\" points=\"";
  for (std::size_t i = 0; i < x.size(); ++i) out_ += point(x[i], high[i]);
  for (std::size_t i = x.size(); i-- > 0;) out_ += point(x[i], low[i]);
  out_ += "\"/>\n";
}

std::string SvgPlot::finish() const { return out_ + "</svg>\n"; }

}  // namespace assembly_cell
