// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/locus/sliding_locus.h"

#include <algorithm>
#include <cmath>

#include "assembly_cell/scene/input_error.h"

namespace assembly_cell {
namespace {

constexpr std::size_t kMinSamples = 8;
constexpr double kWorstInflation = 1e6;

}  // namespace

void SlidingLocus::Sums::add(const Sums& o, double sign) {
  c += sign * o.c;
  s += sign * o.s;
  cc += sign * o.cc;
  cs += sign * o.cs;
  x += sign * o.x;
  xc += sign * o.xc;
  xs += sign * o.xs;
  y += sign * o.y;
  yc += sign * o.yc;
  ys += sign * o.ys;
  zz += sign * o.zz;
}

SlidingLocus::SlidingLocus(std::size_t window) {
  if (window < kMinSamples) {
    throw InputError("window has " + std::to_string(window) + " samples: at least " +
                     std::to_string(kMinSamples) + " are needed");
  }
  ring_.resize(window);
}

void SlidingLocus::reset() {
  next_ = count_ = fresh_count_ = 0;
  sums_ = fresh_ = Sums{};
}

bool SlidingLocus::add(double angle, double x, double y) {
  if (!std::isfinite(angle) || !std::isfinite(x) || !std::isfinite(y)) {
    reset();
    return false;
  }
  if (count_ == 0) {
    origin_x_ = x;
    origin_y_ = y;
  }
  const Sample sample{std::cos(angle), std::sin(angle), x - origin_x_, y - origin_y_};
  if (full()) {
    sums_.add(ring_[next_].terms(), -1.0);
  } else {
    ++count_;
  }
  const Sums terms = sample.terms();
  sums_.add(terms, 1.0);
  fresh_.add(terms, 1.0);
  ring_[next_] = sample;
  next_ = next_ + 1 == ring_.size() ? 0 : next_ + 1;
  // a window's worth of sums that nothing was ever taken from
  if (++fresh_count_ == ring_.size()) {
    sums_ = fresh_;
    fresh_ = Sums{};
    fresh_count_ = 0;
  }
  return true;
}

Locus SlidingLocus::locus() const {
  if (count_ < kMinSamples) {
    throw InputError("window has " + std::to_string(count_) + " samples so far: at least " +
                     std::to_string(kMinSamples) + " are needed");
  }
  const double n = static_cast<double>(count_);
  // about the means, so that the offset drops out
  const double c = sums_.c / n, s = sums_.s / n;
  const double cc = sums_.cc - n * c * c, cs = sums_.cs - n * c * s, ss = n - sums_.cc - n * s * s;
  const double determinant = cc * ss - cs * cs;
  const double inflation = (cc + ss) / determinant * n / 4.0;
  if (!(determinant > 0.0 && inflation < kWorstInflation)) {
    throw InputError(
        "the samples do not resolve the exciter's angle: take at least a period of it, at a "
        "sampling rate that is no multiple or fraction of its frequency");
  }
  const double xc = sums_.xc - c * sums_.x, xs = sums_.xs - s * sums_.x;
  const double yc = sums_.yc - c * sums_.y, ys = sums_.ys - s * sums_.y;
  const double x_cos = (ss * xc - cs * xs) / determinant, x_sin = (cc * xs - cs * xc) / determinant;
  const double y_cos = (ss * yc - cs * ys) / determinant, y_sin = (cc * ys - cs * yc) / determinant;
  const double squares = sums_.zz - (sums_.x * sums_.x + sums_.y * sums_.y) / n -
                         (x_cos * xc + x_sin * xs + y_cos * yc + y_sin * ys);
  const double variance = std::max(0.0, squares) / (2.0 * (n - 3.0));
  // c cos a + s sin a = Re((c - i s) e^{ia})
  return locusFromPhasors({x_cos, -x_sin}, {y_cos, -y_sin}, std::sqrt(variance), count_, inflation);
}

}  // namespace assembly_cell
