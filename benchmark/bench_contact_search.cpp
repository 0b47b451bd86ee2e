// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
// What the contact search costs by feature, cold, warm and skipped, each time with its error. See
// benchmark/README.md.
#include <Eigen/Core>
#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <vector>

#include "assembly_cell/geometry/contact_geometry.h"

namespace assembly_cell {
namespace {

using Eigen::Vector3d;

constexpr int kRepeats = 15;
constexpr int kPoses = 512;

// a peg near a touching pose; thesis axes
struct Scene {
  const char* name;
  EdgeCircle start;
  ContactShapes shapes;
  ContactSlotMask admitted = kAllContactSlots;
};

// axis tilted so that the lowest edge point lies in the direction of `lean`, angle from axis 2
EdgeCircle edgeAt(const Vector3d& center, double tilt, double lean) {
  const Vector3d sideways(0.0, -std::sin(lean), std::cos(lean));
  const Eigen::Matrix3d R = Eigen::AngleAxisd(tilt, sideways).toRotationMatrix();
  return {center, R.col(1), R.col(2), 0.025};
}

ContactShapes shapes(double clearance) {
  ContactShapes s;
  s.hole_radius = 0.025 + clearance;
  s.hole_depth = 0.04;
  s.peg_length = 0.06;
  return s;
}

double smallestGap(const Scene& scene, const EdgeCircle& edge) {
  ContactSet set;
  const ContactSlotMask valid = findContacts(edge, scene.shapes, scene.admitted, set);
  double gap = 1.0;
  for (int i = 0; i < kContactSlots; ++i) {
    if (valid >> i & 1u) gap = std::min(gap, set.slots[static_cast<std::size_t>(i)].gap);
  }
  return gap;
}

// moves the peg along `way` until the first contact closes
Scene touching(Scene scene, const Vector3d& way) {
  const Vector3d from = scene.start.center;
  double high = 0.0;
  const auto gap = [&](double q) {
    scene.start.center = from + q * way;
    return smallestGap(scene, scene.start);
  };
  while (gap(high) > 0.0 && high < 1.0) high += 1e-3;
  double low = high - 1e-3;
  for (int i = 0; i < 60; ++i) {
    const double middle = 0.5 * (low + high);
    (gap(middle) > 0.0 ? low : high) = middle;
  }
  scene.start.center = from + high * way;
  return scene;
}

// small motions about the start, as the stages of an integrator's step of 0.1 ms make them
std::vector<EdgeCircle> poses(const EdgeCircle& start) {
  std::vector<EdgeCircle> list;
  for (int k = 0; k < kPoses; ++k) {
    const double x = 2 * 3.14159265358979 * k / kPoses;
    const Vector3d axis = Vector3d(std::sin(x), std::cos(2 * x), std::sin(3 * x)).normalized();
    const Eigen::Matrix3d R = Eigen::AngleAxisd(1e-5 * std::sin(x), axis).toRotationMatrix();
    EdgeCircle e = start;
    e.axis0 = R * e.axis0;
    e.axis1 = R * e.axis1;
    e.center += 2e-7 * Vector3d(std::cos(x), std::sin(2 * x), std::cos(3 * x));
    list.push_back(e);
  }
  return list;
}

volatile double sink = 0.0;

// fastest of the repeats [ns per call]
template <typename F>
double nanoseconds(const F& f) {
  double best = 1e300;
  for (int i = 0; i < kRepeats; ++i) {
    const auto begin = std::chrono::steady_clock::now();
    for (int k = 0; k < kPoses; ++k) f(k);
    const std::chrono::duration<double> elapsed = std::chrono::steady_clock::now() - begin;
    best = std::min(best, 1e9 * elapsed.count() / kPoses);
  }
  return best;
}

// gap of a slot's contact from samples of its circle in extended precision, refined by halving the
// step around the best one: a distance of the two bodies' surfaces that knows of no Newton step
long double referenceGap(const EdgeCircle& e, const ContactShapes& s, const ContactPoint& c) {
  using Real = long double;
  using Vec = Eigen::Matrix<Real, 3, 1>;
  const Vec center = e.center.cast<Real>(), a0 = e.axis0.cast<Real>(), a1 = e.axis1.cast<Real>();
  const Vec axis = a0.cross(a1);
  const Real r_p = e.radius, r_h = s.hole_radius;
  const bool rim = c.feature == ContactFeature::kRimSide || c.feature == ContactFeature::kRimFace;
  const auto value = [&](Real t) -> Real {
    const Vec p = rim ? Vec(0, r_h * std::cos(t), r_h * std::sin(t))
                      : Vec(center + r_p * (std::cos(t) * a0 + std::sin(t) * a1));
    const Real rho = std::hypot(p(1), p(2));
    switch (c.feature) {
      case ContactFeature::kEdgeEdge:
        return std::hypot(p(0), rho - r_h);
      case ContactFeature::kEdgePlane:
        return p(0) - static_cast<Real>(c.rim(0));
      case ContactFeature::kEdgeWall:
        return r_h - rho;
      case ContactFeature::kRimSide:
        return axis.cross(p - center).norm() - r_p;
      case ContactFeature::kEdgeCone:
      case ContactFeature::kRimCone:
        return NAN;  // the scenes' edges are sharp
      case ContactFeature::kRimFace:
        break;
    }
    return -axis.dot(p - center);
  };
  Real t = c.t, best = value(t);
  for (Real step = 1e-3L; step > 1e-13L; step /= 2) {
    for (const Real side : {-step, step}) {
      for (Real moved = value(t + side); moved < best; moved = value(t + side)) {
        best = moved;
        t += side;
      }
    }
  }
  const bool inside = c.feature == ContactFeature::kEdgeEdge && c.gap < 0.0;
  return inside ? -best : best;
}

void row(const Scene& scene) {
  const std::vector<EdgeCircle> list = poses(scene.start);
  const auto at = [&](int k) -> const EdgeCircle& { return list[static_cast<std::size_t>(k)]; };
  ContactSet set;
  double error = 0.0;
  int contacts = 0;
  for (int k = 0; k < kPoses; k += 16) {
    const ContactSlotMask valid = findContacts(at(k), scene.shapes, scene.admitted, set);
    for (std::size_t i = 0; i < set.slots.size(); ++i) {
      if (!(valid >> i & 1u)) continue;
      ++contacts;
      const ContactPoint& c = set.slots[i];
      const double off = static_cast<double>(referenceGap(at(k), scene.shapes, c) - c.gap);
      error = std::max(error, std::abs(off));
    }
  }
  const double warm = nanoseconds([&](int k) {
    findContacts(at(k), scene.shapes, scene.admitted, set);
    sink = set.slots[0].gap;
  });
  const double cold = nanoseconds([&](int k) {
    set.valid = 0;
    findContacts(at(k), scene.shapes, scene.admitted, set);
    sink = set.slots[0].gap;
  });
  const Vector3d v(0.01, 0.02, -0.03), omega(0.3, -0.2, 0.1);
  double rates = 0.0;
  findContacts(scene.start, scene.shapes, scene.admitted, set);
  int valid = 0;
  for (const ContactPoint& c : set.slots) {
    if (!c.valid) continue;
    ++valid;
    rates += nanoseconds([&](int k) { sink = contactRates(at(k), c, v, omega).gap_bias; });
  }
  std::printf("%-44s %8.1f %8.1f %8.1f %9.2f   %.1e\n", scene.name, warm, cold,
              valid > 0 ? rates / valid : 0.0, contacts / (kPoses / 16.0), error);
}

int run() {
  const ContactShapes wide = shapes(1e-4), close = shapes(2e-5);
  const Vector3d down(-1, 0, 0);
  Scene far{"no contact: 1 mm above the plane", edgeAt({0.00225, 0.004, 0}, 0.05, 3.14159), wide};
  Scene inside{"no contact: inside the hole, 0.1 mm clear", edgeAt({-0.01, 0, 0}, 1e-4, 1), wide};
  std::vector<Scene> scenes = {far, inside};
  const auto add = [&](const char* name, const EdgeCircle& e, const ContactShapes& s,
                       const Vector3d& way) {
    scenes.push_back(touching({name, e, s}, way));
  };
  add("edge_plane", edgeAt({0.01, 0.05, 0.02}, 0.05, 0.0), wide, down);
  add("edge_plane, 2 mm from the rim", edgeAt({0.01, 0.004, 0.0}, 0.05, 0.5), wide, down);
  add("edge_edge, one", edgeAt({0.01, 0.0032, 0.0050}, 0.05, 3.34), wide, down);
  add("edge_edge, one, 0.5 mm off the axis", edgeAt({0.01, 0.0005, 0.0}, 0.02, 2.2), wide, down);
  add("edge_edge, two", edgeAt({0.01, 0.004, 0.0}, 0.05, 3.14159265358979), wide, down);
  add("rim_side, lean inwards", edgeAt({-0.01, 0, 0}, 0.004, 0.3), wide, {0, 1, 0});
  add("edge_wall, lean outwards", edgeAt({-0.01, 0, 0}, 0.001, 0.3), close, {0, 1, 0});
  add("rim_side, deep", edgeAt({-0.02, 0, 0}, 5e-4, 0.3), wide, {0, -1, 0});
  Scene line{"line contact: edge_wall and rim_side", edgeAt({-0.01, 1e-4, 0}, 0, 0), wide};
  scenes.push_back(line);
  std::printf(
      "contact search, all features admitted; times in ns per call, fastest of %d runs over %d "
      "poses\nerror: largest difference of a gap from dense minimisation in extended precision "
      "[m]\n"
      "%-44s %8s %8s %8s %9s   %s\n",
      kRepeats, kPoses, "", "warm", "cold", "rates", "contacts", "error");
  for (const Scene& scene : scenes) row(scene);
  return 0;
}

}  // namespace
}  // namespace assembly_cell

int main() { return assembly_cell::run(); }
