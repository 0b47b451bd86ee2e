// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include <cmath>
#include <random>
#include <tuple>

#include "assembly_cell/mismatch/mismatch.h"
#include "assembly_cell/scene/scenario_numbers.h"
#include "assembly_cell/sensor/bridge.h"
#include "draw_keys.h"

namespace assembly_cell {
namespace {

using Eigen::Vector3d;

// so far from its mean a normal draw may go
constexpr double kNormalReach = 5.0;

// Seed of a key path's stream in a run: FNV-1a of the path, mixed with the seed (splitmix64).
std::uint64_t streamSeed(std::uint64_t seed, const std::string& key) {
  std::uint64_t hash = 14695981039346656037ull;
  for (const char c : key) hash = (hash ^ static_cast<unsigned char>(c)) * 1099511628211ull;
  std::uint64_t z = hash + 0x9e3779b97f4a7c15ull * (seed + 1);
  z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9ull;
  z = (z ^ (z >> 27)) * 0x94d049bb133111ebull;
  return z ^ (z >> 31);
}

// The random numbers of one key path.
class Stream {
 public:
  Stream(std::uint64_t seed, const std::string& key)
      : engine_(streamSeed(seed, key)), normal_(streamSeed(seed, key + "#normal")) {}

  double unit() { return static_cast<double>(engine_() >> 11) * 0x1p-53; }
  double angle() { return 2 * M_PI * unit(); }
  double value(const Draw& draw, double mean) {
    switch (draw.kind) {
      case Draw::Kind::kNormal:
        return mean + draw.first * normal_();
      case Draw::Kind::kUniform:
        return draw.first + (draw.second - draw.first) * unit();
      case Draw::Kind::kLogUniform:
        return draw.first * std::pow(draw.second / draw.first, unit());
      case Draw::Kind::kNumber:
        break;
    }
    return draw.first;
  }
  // a vector of this size in any direction
  Vector3d directed(const Draw& draw) {
    const double size = value(draw, 0.0);
    Vector3d direction;
    do {
      for (double& axis : direction) axis = normal_();
    } while (!(direction.squaredNorm() > 1e-6));
    return size * direction.normalized();
  }

 private:
  std::mt19937_64 engine_;
  NormalSource normal_;
};

std::vector<DrawnChange> drawChanges(const std::vector<ScenarioChange>& changes,
                                     const std::string& section, double mean, std::uint64_t seed) {
  std::vector<DrawnChange> drawn;
  Scenario any;
  for (const ScenarioChange& change : changes) {
    DrawnChange d{change.key, change.path, change.each, {}, 0.0, 0.0};
    std::tie(d.low, d.high) = change.draw.reach(mean);
    const bool matrix = change.path == "coupling.stiffness" || change.path == "coupling.damping";
    std::size_t entries =
        scenarioNumbers(any, matrix ? change.path + ".diagonal" : change.path).size();
    if (change.path == "friction") entries = 2;
    // each entry of a list has its own draw
    d.each = change.each || (section == "add" && entries > 1);
    Stream stream(seed, section + "." + change.key);
    for (std::size_t i = 0; i < (d.each ? entries : 1); ++i) {
      d.values.push_back(stream.value(change.draw, mean));
    }
    drawn.push_back(d);
  }
  return drawn;
}

void drawKey(const DrawKey& key, const Draw& draw, std::uint64_t seed) {
  Stream stream(seed, key.path);
  switch (key.shape) {
    case DrawKey::Shape::kNumber:
      *key.values = stream.value(draw, key.mean);
      if (key.angle != nullptr) *key.angle = stream.angle();
      return;
    case DrawKey::Shape::kAxes:
      for (int i = 0; i < 3; ++i) key.values[i] = stream.value(draw, 0.0);
      return;
    case DrawKey::Shape::kDirection:
      Eigen::Map<Vector3d>(key.values) = stream.directed(draw);
      return;
    case DrawKey::Shape::kTilt: {
      const double size = stream.value(draw, 0.0), azimuth = stream.angle();
      Eigen::Map<Eigen::Vector2d>(key.values) =
          size * Eigen::Vector2d(std::cos(azimuth), std::sin(azimuth));
      return;
    }
    case DrawKey::Shape::kMatrix:
      for (int i = 0; i < 6; ++i) {
        for (int j = 0; j < 6; ++j) Eigen::Map<Matrix6>(key.values)(i, j) = stream.value(draw, 0.0);
      }
  }
}

}  // namespace

std::pair<double, double> Draw::reach(double mean) const {
  if (kind == Kind::kNumber) return {first, first};
  if (kind == Kind::kNormal) return {mean - kNormalReach * first, mean + kNormalReach * first};
  return {first, second};
}

Eigen::Vector2d boreLean(const Eigen::Vector2d& tilt) {
  const double angle = tilt.norm();
  if (angle == 0.0) return Eigen::Vector2d::Zero();
  // an axis that turns about (x, y) leans towards (y, -x)
  return std::tan(angle) / angle * Eigen::Vector2d(tilt.y(), -tilt.x());
}

Truth drawTruth(const Mismatch& mismatch, std::uint64_t seed) {
  Truth truth;
  truth.scale = drawChanges(mismatch.scale, "scale", 1.0, seed);
  truth.add = drawChanges(mismatch.add, "add", 0.0, seed);
  for (const DrawKey& key : drawKeys(truth)) {
    const auto draw = mismatch.draws.find(key.path);
    if (draw == mismatch.draws.end()) continue;
    drawKey(key, draw->second, seed);
    truth.drawn.push_back(key.path);
  }
  const auto noise = [&](const char* key) { return streamSeed(seed, std::string(key) + "#noise"); };
  truth.cell.sensor_a.walk_seed = noise("sensor_a.drift.walk");
  truth.cell.sensor_b.walk_seed = noise("sensor_b.drift.walk");
  truth.cell.carrier.reading_seed = noise("carrier.reading_noise");
  truth.cell.carrier.repeatability_seed = noise("carrier.repeatability");
  truth.cell.carrier.jitter_seed = noise("carrier.jitter");
  truth.imperfections.bore_lean = boreLean(truth.bore_tilt);
  return truth;
}

}  // namespace assembly_cell
