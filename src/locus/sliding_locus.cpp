// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/locus/sliding_locus.h"

#include <Eigen/LU>
#include <cmath>

#include "assembly_cell/base/input_error.h"

namespace assembly_cell {
namespace {

constexpr double kMaxInflation = 1e6;

}  // namespace

template <int kSignals>
SlidingFit<kSignals>::SlidingFit(std::size_t window, bool drift) : drift_(drift) {
  if (window < kMinLocusSamples) {
    throw InputError("window has " + std::to_string(window) + " samples: at least " +
                     std::to_string(kMinLocusSamples) + " are needed");
  }
  ring_.resize(window);
}

template <int kSignals>
void SlidingFit<kSignals>::reset() {
  next_ = count_ = fresh_count_ = 0;
  sums_ = fresh_ = Sums{};
}

// into the window's sums and the fresh ones
template <int kSignals>
void SlidingFit<kSignals>::put(const Sample& o, double d) {
  const double cc = o.c * o.c, cs = o.c * o.s, dd = d * d, dc = d * o.c, ds = d * o.s;
  const Values xc = o.c * o.x, xs = o.s * o.x, xd = d * o.x;
  const Squares xx = o.x * o.x.transpose();
  for (Sums* sums : {&sums_, &fresh_}) {
    sums->c += o.c;
    sums->s += o.s;
    sums->cc += cc;
    sums->cs += cs;
    sums->d += d;
    sums->dd += dd;
    sums->dc += dc;
    sums->ds += ds;
    sums->x += o.x;
    sums->xc += xc;
    sums->xs += xs;
    sums->xd += xd;
    sums->xx += xx;
  }
}

template <int kSignals>
void SlidingFit<kSignals>::take(const Sample& o, double d) {
  sums_.c -= o.c;
  sums_.s -= o.s;
  sums_.cc -= o.c * o.c;
  sums_.cs -= o.c * o.s;
  sums_.d -= d;
  sums_.dd -= d * d;
  sums_.dc -= d * o.c;
  sums_.ds -= d * o.s;
  sums_.x -= o.x;
  sums_.xc -= o.c * o.x;
  sums_.xs -= o.s * o.x;
  sums_.xd -= d * o.x;
  sums_.xx.noalias() -= o.x * o.x.transpose();
}

template <int kSignals>
bool SlidingFit<kSignals>::add(double angle, const Values& signals) {
  if (!std::isfinite(angle) || !signals.allFinite()) {
    reset();
    return false;
  }
  if (count_ == 0) origin_ = signals;
  const Sample sample{std::cos(angle), std::sin(angle), signals - origin_};
  const double n = static_cast<double>(ring_.size());
  const double place = static_cast<double>(fresh_count_) / n;
  if (full()) {
    take(ring_[next_], place - 1.0);
  } else {
    ++count_;
  }
  put(sample, place);
  ring_[next_] = sample;
  next_ = next_ + 1 == ring_.size() ? 0 : next_ + 1;
  // sums of one full window without subtractions; positions count from its end
  if (++fresh_count_ == ring_.size()) {
    sums_ = fresh_;
    sums_.dd += n - 2.0 * sums_.d;
    sums_.d -= n;
    sums_.dc -= sums_.c;
    sums_.ds -= sums_.s;
    sums_.xd -= sums_.x;
    fresh_ = Sums{};
    fresh_count_ = 0;
  }
  return true;
}

template <int kSignals>
HarmonicFit SlidingFit<kSignals>::fit() const {
  if (count_ < kMinLocusSamples) {
    throw InputError("window has " + std::to_string(count_) + " samples so far: at least " +
                     std::to_string(kMinLocusSamples) + " are needed");
  }
  const double n = static_cast<double>(count_);
  // about the means, so that the offset drops out
  const double c = sums_.c / n, s = sums_.s / n, d = sums_.d / n;
  const Values x = sums_.x / n;
  Eigen::Matrix3d normal;
  normal(0, 0) = sums_.cc - n * c * c;
  normal(0, 1) = normal(1, 0) = sums_.cs - n * c * s;
  normal(1, 1) = n - sums_.cc - n * s * s;
  normal(0, 2) = normal(2, 0) = drift_ ? sums_.dc - n * d * c : 0.0;
  normal(1, 2) = normal(2, 1) = drift_ ? sums_.ds - n * d * s : 0.0;
  normal(2, 2) = drift_ ? sums_.dd - n * d * d : 1.0;
  Eigen::Matrix<double, 3, kSignals> moment;
  moment.row(0) = (sums_.xc - n * c * x).transpose();
  moment.row(1) = (sums_.xs - n * s * x).transpose();
  moment.row(2).setZero();
  if (drift_) moment.row(2) = (sums_.xd - n * d * x).transpose();

  const Eigen::Matrix3d inverse = normal.inverse();
  const double inflation = inverse.topLeftCorner<2, 2>().trace() * n / 4.0;
  if (!(normal.determinant() > 0.0 && inflation > 0.0 && inflation < kMaxInflation)) {
    throw InputError(
        "the samples do not resolve the exciter's angle: take at least a period of it, at a "
        "sampling rate that is no multiple or fraction of its frequency");
  }
  const Eigen::Matrix<double, 3, kSignals> fitted = inverse * moment;
  const Squares squares = sums_.xx - n * x * x.transpose() - fitted.transpose() * normal * fitted;

  HarmonicFit result;
  result.samples = count_;
  result.inflation = inflation;
  result.scatter = inverse.topLeftCorner<2, 2>();
  // c cos a + s sin a = Re((c - i s) e^{ia})
  result.phasor.setZero();
  result.phasor.real().template head<kSignals>() = fitted.row(0).transpose();
  result.phasor.imag().template head<kSignals>() = -fitted.row(1).transpose();
  result.offset.template head<kSignals>() =
      origin_ + x - c * fitted.row(0).transpose() - s * fitted.row(1).transpose();
  const double freedom = n - (drift_ ? 4.0 : 3.0);
  result.noise.template topLeftCorner<kSignals, kSignals>() = squares / freedom;
  // rounding may make it negative
  for (int i = 0; i < kSignals; ++i) {
    if (result.noise(i, i) > 0.0) continue;
    result.noise.row(i).setZero();
    result.noise.col(i).setZero();
  }
  return result;
}

template class SlidingFit<2>;
template class SlidingFit<6>;

Locus SlidingLocus::locus() const { return locusFromFit(fit_.fit()); }

}  // namespace assembly_cell
