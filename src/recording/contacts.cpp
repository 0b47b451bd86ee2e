// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/recording/contacts.h"

#include <Eigen/Cholesky>
#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>

#include "assembly_cell/base/input_error.h"
#include "assembly_cell/base/text.h"
#include "lever.h"

namespace assembly_cell {

namespace {

using Eigen::Matrix3d;
using Eigen::Vector2d;
using Eigen::Vector3d;

constexpr double kFreeWindow = 0.25;  // [s]
// minimum motion of a window without contact [m], [rad]: a hand or robot moves ten times that
constexpr double kMoves = 0.5e-3, kTurns = 0.005;
// maximum difference of forces without contact, by weight and noise: fraction of the largest force,
// then, with the model, sd. Half and twice leave bias and lever of 11 recordings within their sd
constexpr double kEqualForce = 0.02;
constexpr double kFreeSd = 5.0;
constexpr double kUnsureLever = 4e-3;  // sd beyond which a lever is refused [m]
constexpr double kLeverWindow = 0.2;   // [s]
constexpr double kLeverSd = 0.02;      // maximum sd of a window [m]
constexpr std::size_t kMinWindows = 6;
// maximum couple over force of a sample with one contact, as a face or a chipped edge is not a
// point. 3 mm misses 3 % of the single contacts, 12 mm 2 % of the several
constexpr double kOnePitch = 6e-3;
constexpr double kFootprint = 1.5,
                 kFootprintQuantile = 0.6;  // over the quantile of the single contacts
constexpr double kMajority = 0.2;           // [s] on both sides
constexpr double kShortest = 0.05;          // segment [s]
constexpr double kDetected = 8.0;           // minimum force of a detected contact, in its sd

struct Window {
  std::size_t first, end;
  Vector6 mean;
  Pose pose;
  bool moves;
};

double largestTurn(const Matrix3d& a, const Matrix3d& b) {
  return Eigen::AngleAxisd(Matrix3d(a.transpose() * b)).angle();
}

std::vector<Window> windowsOf(const WrenchRecording& r, double length) {
  std::vector<Window> out;
  for (std::size_t first = 0, i = 1; i <= r.t.size(); ++i) {
    if (i < r.t.size() && r.t[i] - r.t[first] < length) continue;
    if (i - first >= 4) {
      Window w{first, i, Vector6::Zero(), r.pose[(first + i) / 2], false};
      for (std::size_t k = first; k < i; ++k)
        w.mean += r.wrench[k] / static_cast<double>(i - first);
      const Pose &a = r.pose[first], &b = r.pose[i - 1];
      w.moves = (b.p - a.p).norm() > kMoves || largestTurn(a.R, b.R) > kTurns;
      out.push_back(w);
    }
    first = i;
  }
  return out;
}

double quantile(std::vector<double> values, double share) {
  const auto at =
      values.begin() + static_cast<std::ptrdiff_t>(share * static_cast<double>(values.size() - 1));
  std::nth_element(values.begin(), at, values.end());
  return *at;
}

// Largest set of moving windows with forces equal within the tolerance.
std::vector<Window> equalWindows(const std::vector<Window>& all, double tolerance) {
  std::vector<Window> moving, best;
  for (const Window& w : all) {
    if (w.moves) moving.push_back(w);
  }
  for (const Window& centre : moving) {
    std::vector<Window> alike;
    for (const Window& w : moving) {
      if ((w.mean - centre.mean).head<3>().norm() < tolerance) alike.push_back(w);
    }
    if (alike.size() > best.size()) best = std::move(alike);
  }
  return best;
}

PayloadModel payloadOf(const WrenchRecording& r, const std::vector<Window>& windows) {
  std::vector<StaticPose> poses;
  std::vector<Vector6> wrenches;
  for (const Window& w : windows) {
    StaticPose pose;
    pose.R = w.pose.R;
    pose.order = r.t[w.first];
    poses.push_back(pose);
    wrenches.push_back(w.mean);
  }
  PayloadOptions options;
  options.axes = WrenchAxes::kSensor;
  options.drift = options.breaks = false;  // a few seconds
  return identifyPayload(poses, wrenches, options);
}

// Wrench of bias and payload.
Vector6 emptyWrench(const ContactAnalysis& a, const WrenchRecording& r, std::size_t i) {
  if (a.payload.refusal) return a.bias;
  StaticPose pose;
  pose.R = r.pose[i].R;
  const Vector3d load = pose.R.transpose() * a.payload.gravity;
  Vector6 out = a.bias;
  out.head<3>() += load;
  out.tail<3>() += a.payload.center_of_mass.cross(load);
  return out;
}

void identify(const WrenchRecording& r, const std::vector<Window>& windows, ContactAnalysis& a) {
  a.payload = payloadOf(r, windows);
  Vector6 mean = Vector6::Zero(), squares = Vector6::Zero();
  const auto n = static_cast<double>(windows.size());
  for (const Window& w : windows) mean += w.mean / n;
  for (const Window& w : windows) squares += (w.mean - mean).cwiseAbs2() / n;
  a.bias = a.payload.refusal ? mean : a.payload.bias;
  a.bias_sd = a.payload.refusal ? Vector6((squares / n).cwiseSqrt()) : a.payload.bias_sd;
  a.free_windows = windows.size();
}

// Robust sd (median) of the windows' means about the wrench of the empty tool.
Vector6 robustSd(const ContactAnalysis& a, const WrenchRecording& r,
                 const std::vector<Window>& windows) {
  Vector6 out;
  for (Eigen::Index axis = 0; axis < 6; ++axis) {
    std::vector<double> sizes;
    for (const Window& w : windows) {
      sizes.push_back(std::abs((w.mean - emptyWrench(a, r, (w.first + w.end) / 2))[axis]));
    }
    out[axis] = std::max(1.4826 * quantile(sizes, 0.5), 1e-9);
  }
  return out;
}

void findFree(const WrenchRecording& r, ContactAnalysis& a) {
  const std::vector<Window> all = windowsOf(r, kFreeWindow);
  double largest = 0.0;
  for (const Window& w : all) {
    largest = std::max(largest, (w.mean - all.front().mean).head<3>().norm());
  }
  const double tolerance = std::max(kEqualForce * largest, 1e-3);
  std::vector<Window> free = equalWindows(all, tolerance);
  for (int pass = 0; pass < 3; ++pass) {
    if (free.size() < kMinWindows) {
      throw InputError(
          text("%zu of %zu quarters of a second are free of contact: record at least "
               "%zu in which the tool moves and touches nothing",
               free.size(), all.size(), kMinWindows));
    }
    identify(r, free, a);
    a.noise.setZero();
    double count = 0.0;
    for (const Window& w : free) {
      for (std::size_t i = w.first; i < w.end; ++i) {
        const Vector6 e = r.wrench[i] - emptyWrench(a, r, i);
        a.noise += e * e.transpose();
        ++count;
      }
    }
    a.noise /= count;
    const Vector6 sd = robustSd(a, r, free);
    std::vector<Window> fits;
    for (const Window& w : all) {
      const Vector6 e = w.mean - emptyWrench(a, r, (w.first + w.end) / 2);
      if (w.moves && e.cwiseQuotient(sd).cwiseAbs().maxCoeff() < kFreeSd &&
          e.head<3>().norm() < tolerance) {
        fits.push_back(w);
      }
    }
    if (pass < 2) free = std::move(fits);
  }
}

// ---- lever: height of the tip along z

void findLever(const WrenchRecording& r, const ContactSettings& settings, ContactAnalysis& a) {
  const std::vector<double> depth = depths(r);
  std::vector<LeverWindow> found;
  for (const Window& w : windowsOf(r, kLeverWindow)) {
    auto one = leverWindow(a, w.first, w.end);
    if (!one || !(one->sd < kLeverSd)) continue;
    one->depth = depth[(w.first + w.end) / 2];
    found.push_back(*one);
  }
  if (found.size() < 3 && !(settings.lever && settings.footprint)) {
    throw InputError(
        text("%zu fifths of a second show one contact of %.0f N under changing forces: "
             "give --lever and --footprint",
             found.size(), kLeverForce));
  }
  const auto radii = [&] {
    std::vector<double> out;
    for (const LeverWindow& w : found) out.push_back(w.point.head<2>().norm());
    return out;
  };
  a.footprint =
      settings.footprint ? *settings.footprint : kFootprint * quantile(radii(), kFootprintQuantile);
  std::vector<LeverWindow> inside;
  for (const LeverWindow& w : found) {
    if (w.point.head<2>().norm() < a.footprint) inside.push_back(w);
  }
  a.lever_windows = inside.size();
  if (settings.lever) {
    a.lever = *settings.lever;
    a.lever_sd = 0.0;
    return;
  }
  if (inside.empty()) {
    throw InputError(
        text("none of %zu fifths of a second of one contact lies within the footprint "
             "of %.3g m: give --lever",
             found.size(), a.footprint));
  }
  const Lever lever = leverOf(inside, firstSurface(a, depth));
  if (lever.sd > kUnsureLever) {
    throw InputError(
        text("the contacts fit a tip %.3g mm below the sensor, +- %.2g mm: against an "
             "edge they slide along the tool; give --lever, or touch a face with the "
             "tip",
             1e3 * lever.value, 1e3 * lever.sd));
  }
  a.lever = lever.value;
  a.lever_sd = lever.sd;
}

// ---- classification

void classify(const WrenchRecording& r, const ContactSettings& settings, ContactAnalysis& a) {
  const double force_sd = std::sqrt(a.noise.diagonal().head<3>().maxCoeff());
  const std::size_t n = r.t.size();
  std::vector<int> one(n + 1, 0), classified(n + 1, 0);  // cumulative sums before each sample
  for (std::size_t i = 0; i < n; ++i) {
    ContactSample& s = a.samples[i];
    const double force = s.wrench.head<3>().norm();
    s.kind = force < kDetected * force_sd ? ContactKind::kFree
             : force < settings.force     ? ContactKind::kLight
                                          : ContactKind::kSeveral;
    bool single = false;
    if (s.kind == ContactKind::kSeveral) {
      if (const auto line = contactLine(s.wrench, a.noise, a.lever)) s.line = *line;
      const double spread = std::sqrt(std::max(0.0, s.line.cut_covariance.trace()));
      single = std::abs(s.line.pitch) < std::hypot(kOnePitch, 2.0 * s.line.pitch_sd) &&
               s.line.cut.norm() < std::hypot(a.footprint, std::min(spread, a.footprint));
    }
    classified[i + 1] = classified[i] + (s.kind == ContactKind::kSeveral);
    one[i + 1] = one[i] + single;
  }
  std::size_t low = 0, high = 0;
  for (std::size_t i = 0; i < n; ++i) {
    while (r.t[i] - r.t[low] > kMajority) ++low;
    while (high < n && r.t[high] - r.t[i] <= kMajority) ++high;
    if (a.samples[i].kind != ContactKind::kSeveral) continue;
    if (2 * (one[high] - one[low]) > classified[high] - classified[low]) {
      a.samples[i].kind = ContactKind::kOne;
    }
  }
}

ContactSegment segmentOf(const ContactAnalysis& a, std::size_t first, std::size_t end) {
  ContactSegment out;
  out.first = first;
  out.end = end;
  out.kind = a.samples[first].kind;
  std::vector<double> pitches;
  double weights = 0.0;
  for (std::size_t i = first; i < end; ++i) {
    const ContactSample& s = a.samples[i];
    out.force += s.wrench.head<3>().norm() / static_cast<double>(end - first);
    pitches.push_back(std::abs(s.line.pitch));
    const double w = 1.0 / std::max(s.line.cut_covariance.trace(), 1e-12);
    if (out.kind != ContactKind::kOne || !std::isfinite(w)) continue;
    out.cut += w * s.line.cut;
    out.scatter += w * s.line.cut * s.line.cut.transpose();
    weights += w;
  }
  out.pitch = quantile(pitches, 0.5);
  if (!(weights > 0.0)) return out;
  out.cut /= weights;
  out.scatter = out.scatter / weights - out.cut * out.cut.transpose();
  return out;
}

}  // namespace

const char* toString(ContactKind kind) {
  return std::array{"free", "light", "one", "several"}[static_cast<std::size_t>(kind)];
}

ContactAnalysis findContacts(const WrenchRecording& r, const ContactSettings& settings) {
  if (r.t.size() < 50 || r.t.back() - r.t.front() < kMinWindows * kFreeWindow) {
    throw InputError(text("%zu samples over %.2g s: record for some seconds", r.t.size(),
                          r.t.empty() ? 0.0 : r.t.back() - r.t.front()));
  }
  const double spacing = (r.t.back() - r.t.front()) / static_cast<double>(r.t.size() - 1);
  if (spacing > kLeverWindow / 8.0) {
    throw InputError(text("a sample every %.3g s: record 40 a second at least", spacing));
  }
  ContactAnalysis out;
  findFree(r, out);
  out.samples.resize(r.t.size());
  for (std::size_t i = 0; i < r.t.size(); ++i) {
    out.samples[i].wrench = r.wrench[i] - emptyWrench(out, r, i);
  }
  findLever(r, settings, out);
  classify(r, settings, out);
  for (std::size_t first = 0, i = 1; i <= r.t.size(); ++i) {
    if (i < r.t.size() && out.samples[i].kind == out.samples[first].kind) continue;
    const bool contact = out.samples[first].kind == ContactKind::kOne ||
                         out.samples[first].kind == ContactKind::kSeveral;
    if (contact && r.t[i - 1] - r.t[first] >= kShortest) {
      out.segments.push_back(segmentOf(out, first, i));
    }
    first = i;
  }
  return out;
}

}  // namespace assembly_cell
