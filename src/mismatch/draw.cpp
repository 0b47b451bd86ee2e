// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include <cmath>
#include <random>
#include <tuple>

#include "assembly_cell/mismatch/mismatch.h"
#include "assembly_cell/scene/scenario_numbers.h"
#include "assembly_cell/sensor/bridge.h"

namespace assembly_cell {
namespace {

using Eigen::Vector3d;

// so far from its mean a normal draw may go
constexpr double kNormalReach = 5.0;

// of a key path and a run: FNV-1a of the path, mixed with the seed (splitmix64)
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
  Vector3d axes(const Draw& draw) {
    Vector3d drawn;
    for (double& axis : drawn) axis = value(draw, 0.0);
    return drawn;
  }

 private:
  std::mt19937_64 engine_;
  NormalSource normal_;
};

// Draws key after key and notes which were there.
class Drawer {
 public:
  Drawer(std::uint64_t seed, Truth& truth) : seed_(seed), truth_(truth) {}

  template <class Take>
  void draw(const std::string& key, const std::optional<Draw>& asked, const Take& take) {
    if (!asked) return;
    Stream stream(seed_, key);
    take(stream, *asked);
    truth_.drawn.push_back(key);
  }
  void one(const std::string& key, const std::optional<Draw>& asked, double& to,
           double mean = 0.0) {
    draw(key, asked, [&](Stream& s, const Draw& d) { to = s.value(d, mean); });
  }
  void axes(const std::string& key, const std::optional<Draw>& asked, Vector3d& to) {
    draw(key, asked, [&](Stream& s, const Draw& d) { to = s.axes(d); });
  }
  void directed(const std::string& key, const std::optional<Draw>& asked, Vector3d& to) {
    draw(key, asked, [&](Stream& s, const Draw& d) { to = s.directed(d); });
  }
  void tilt(const std::string& key, const std::optional<Draw>& asked, Eigen::Vector2d& to) {
    draw(key, asked, [&](Stream& s, const Draw& d) {
      const double size = s.value(d, 0.0), azimuth = s.angle();
      to = size * Eigen::Vector2d(std::cos(azimuth), std::sin(azimuth));
    });
  }
  std::uint64_t noise(const std::string& key) const { return streamSeed(seed_, key + "#noise"); }

 private:
  std::uint64_t seed_;
  Truth& truth_;
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
    // what is added to a list goes to each entry on its own
    d.each = change.each || (section == "add" && entries > 1);
    Stream stream(seed, section + "." + change.key);
    for (std::size_t i = 0; i < (d.each ? entries : 1); ++i) {
      d.values.push_back(stream.value(change.draw, mean));
    }
    drawn.push_back(d);
  }
  return drawn;
}

void drawSensor(const std::string& name, const Mismatch::Sensor& asked, Drawer& drawer,
                SensorTruth& sensor) {
  drawer.draw(name + ".matrix", asked.matrix, [&](Stream& s, const Draw& d) {
    for (int i = 0; i < 6; ++i) {
      for (int j = 0; j < 6; ++j) sensor.matrix(i, j) = s.value(d, 0.0);
    }
  });
  drawer.directed(name + ".frame.rotation", asked.rotation, sensor.rotation);
  drawer.directed(name + ".frame.offset", asked.offset, sensor.offset);
  Vector3d drift = Vector3d::Zero();
  drawer.axes(name + ".drift.force", asked.drift_force, drift);
  sensor.drift.head<3>() = drift;
  drift.setZero();
  drawer.axes(name + ".drift.torque", asked.drift_torque, drift);
  sensor.drift.tail<3>() = drift;
  drawer.one(name + ".drift.walk", asked.walk, sensor.walk);
  sensor.walk_seed = drawer.noise(name + ".drift.walk");
  drawer.directed(name + ".hum.force", asked.hum_force, sensor.hum);
  drawer.draw(name + ".hum.frequency", asked.hum_frequency, [&](Stream& s, const Draw& d) {
    sensor.hum_frequency = s.value(d, 0.0);
    sensor.hum_phase = s.angle();
  });
  drawer.one(name + ".latency", asked.latency, sensor.latency);
}

void drawExciter(const Mismatch::Exciter& asked, Drawer& drawer, ExciterErrors& exciter) {
  drawer.one("exciter.amplitude", asked.amplitude, exciter.gain, 1.0);
  drawer.one("exciter.delay", asked.delay, exciter.delay);
  drawer.draw("exciter.ellipticity", asked.ellipticity, [&](Stream& s, const Draw& d) {
    exciter.ellipticity = s.value(d, 0.0);
    exciter.azimuth = s.angle();
  });
  drawer.one("exciter.harmonic", asked.harmonic, exciter.harmonic);
}

void drawCarrier(const Mismatch::Carrier& asked, Drawer& drawer, Truth& truth) {
  CarrierTruth& carrier = truth.cell.carrier;
  drawer.axes("carrier.reading_noise", asked.reading_noise, carrier.reading_noise);
  carrier.reading_seed = drawer.noise("carrier.reading_noise");
  drawer.axes("carrier.repeatability", asked.repeatability, carrier.repeatability);
  carrier.repeatability_seed = drawer.noise("carrier.repeatability");
  drawer.axes("carrier.compliance", asked.compliance, truth.imperfections.compliance);
  drawer.directed("carrier.frame.rotation", asked.rotation, carrier.rotation);
  drawer.axes("carrier.frame.scale", asked.scale, carrier.scale);
  drawer.directed("carrier.frame.offset", asked.offset, carrier.offset);
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
  Drawer drawer(seed, truth);
  drawExciter(mismatch.exciter, drawer, truth.imperfections.exciter);
  drawSensor("sensor_a", mismatch.sensor_a, drawer, truth.cell.sensor_a);
  drawSensor("sensor_b", mismatch.sensor_b, drawer, truth.cell.sensor_b);
  drawCarrier(mismatch.carrier, drawer, truth);
  drawer.tilt("hole.bore_tilt", mismatch.bore_tilt, truth.bore_tilt);
  drawer.tilt("hole.face_tilt", mismatch.face_tilt, truth.face_tilt);
  truth.imperfections.bore_lean = boreLean(truth.bore_tilt);
  return truth;
}

}  // namespace assembly_cell
