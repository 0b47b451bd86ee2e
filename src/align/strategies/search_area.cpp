// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/align/strategies/search_area.h"

#include <algorithm>
#include <cmath>

namespace assembly_cell {
namespace {

using Vec2 = Eigen::Vector2d;

// Spacing of the grid over the reach of a touch. Half of it needs as many touches.
constexpr double kSpacing = 1.0 / 3.0;

}  // namespace

std::optional<Vec2> nextPlace(const Vec2& start, double region, double reach,
                              const std::vector<Vec2>& touched, const Vec2& from) {
  const double spacing = kSpacing * reach;
  const int n = static_cast<int>(std::ceil(region / spacing));
  const auto is_reached = [&](const Vec2& a, const Vec2& b) { return (a - b).norm() < reach; };
  std::vector<Vec2> left;
  for (int i = -n; i <= n; ++i) {
    for (int k = -n; k <= n; ++k) {
      const Vec2 centre = start + spacing * Vec2(i, k);
      const auto rules_out = [&](const Vec2& touch) { return is_reached(touch, centre); };
      if ((centre - start).norm() > region) continue;
      if (std::none_of(touched.begin(), touched.end(), rules_out)) left.push_back(centre);
    }
  }
  std::optional<Vec2> best;
  std::ptrdiff_t most = 0;
  for (const Vec2& place : left) {
    const auto count = std::count_if(left.begin(), left.end(),
                                     [&](const Vec2& centre) { return is_reached(place, centre); });
    const bool nearer = best && (place - from).norm() < (*best - from).norm();
    if (count > most || (count == most && nearer)) {
      best = place;
      most = count;
    }
  }
  return best;
}

}  // namespace assembly_cell
