// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/sensor/bridge.h"

#include <algorithm>
#include <boost/random/chi_squared_distribution.hpp>
#include <cmath>
#include <string>

#include "assembly_cell/base/input_error.h"

namespace assembly_cell {

namespace {

// half bridge of gauge factor 2.10 at 2.5 V, amplified 1000 times [V] per unit strain
constexpr double kGain = 1000.0 * 2.5 * 2.10 / 2.0;
// notch in Al 7075: 1/(E b t²/6) with E 71.7 GPa, b 40 mm, t 2 mm [1/(N m)]
constexpr double kStrainPerMoment = 6.0 / (71.7e9 * 0.040 * 0.002 * 0.002);

// the same notch, l 6 mm: E b t³/12/l [N m/rad]
constexpr double kStiffness = 71.7e9 * 0.040 * 0.002 * 0.002 * 0.002 / 12.0 / 0.006;
constexpr double kGainDrift = 2e-4;             // [1/K]
constexpr double kReferenceTemperature = 20.0;  // [°C]
constexpr double kNoFraction = 0x1.8p52;        // neighbours of it are 1 apart
// in series from the datum: channels 1 3 5 2 4 6
constexpr std::array<std::size_t, 6> kOrder = {0, 2, 4, 1, 3, 5};

// a hinge as it was made
struct MadeHinge {
  Eigen::Vector3d position;   // [mm]
  Eigen::Vector3d direction;  // not normalised
  double stiffness, strain;   // relative to nominal
  double curvature;
  double gain;    // relative to nominal
  double offset;  // [V]
  double drift;   // of the zero [V/K]
};

Hinge hinge(const MadeHinge& made) {
  return {1e-3 * made.position,
          made.direction.normalized(),
          made.strain * kStrainPerMoment,
          made.gain * kGain,
          made.offset,
          made.stiffness * kStiffness,
          made.curvature,
          made.drift};
}

Bridge bridge(const std::array<MadeHinge, 6>& hinges, int bits, double noise) {
  checkBits(bits, "bridge: bits is ");
  if (!(noise >= 0.0) || !std::isfinite(noise)) {
    throw InputError("bridge: noise is " + std::to_string(noise) + ": give volts rms, not below 0");
  }
  Bridge b;
  std::transform(hinges.begin(), hinges.end(), b.hinges.begin(), hinge);
  b.bits = bits;
  b.noise = noise;
  return b;
}

}  // namespace

void checkBits(int bits, const std::string& what) {
  if (bits == 10 || bits == 16 || bits == 24) return;
  throw InputError(what + std::to_string(bits) + ": give 10, 16 or 24");
}

Bridge bridgeA(int bits, double noise) {
  return bridge(
      {MadeHinge{{30, 30.6, 10.4}, {1, .010, -.008}, 1.00, 1.00, .004, 1.000, .012, .0025},
       MadeHinge{{30, 29.5, 49.7}, {1, -.012, .006}, 1.03, .98, -.003, 1.004, -.020, -.0040},
       MadeHinge{{9.6, 30, 30.7}, {.007, 1, .011}, .97, 1.02, .002, .997, .015, .0030},
       MadeHinge{{50.3, 30, 29.4}, {-.009, 1, -.010}, 1.02, 1.01, .005, 1.002, .008, -.0020},
       MadeHinge{{30.5, 9.8, 30}, {.012, -.006, 1}, .98, .99, -.004, .999, -.011, .0035},
       MadeHinge{{29.3, 50.4, 30}, {-.008, .009, 1}, 1.01, 1.03, .003, .995, .018, .0015}},
      bits, noise);
}

Bridge bridgeB(int bits, double noise) {
  return bridge(
      {MadeHinge{{30, 29.6, 10.5}, {1, -.007, .012}, .99, 1.01, -.003, 1.001, -.016, -.0030},
       MadeHinge{{30, 30.7, 49.8}, {1, .009, -.011}, 1.01, 1.00, .004, .996, .010, .0020},
       MadeHinge{{10.6, 30, 29.7}, {-.010, 1, .006}, 1.02, .97, .003, 1.003, -.009, -.0015},
       MadeHinge{{49.5, 30, 30.4}, {.008, 1, .013}, .98, 1.02, -.002, .998, .014, .0040},
       MadeHinge{{29.7, 10.6, 30}, {-.006, .012, 1}, 1.03, 1.00, .005, 1.005, .006, -.0025},
       MadeHinge{{30.4, 49.4, 30}, {.011, -.007, 1}, 1.00, .98, -.004, 1.000, -.013, .0030}},
      bits, noise);
}

Bridge nominalBridge() {
  const auto as_drawn = [](const Eigen::Vector3d& position, const Eigen::Vector3d& direction) {
    return MadeHinge{position, direction, 1, 1, 0, 1, 0, 0};
  };
  return bridge({as_drawn({30, 30, 10}, {1, 0, 0}), as_drawn({30, 30, 50}, {1, 0, 0}),
                 as_drawn({10, 30, 30}, {0, 1, 0}), as_drawn({50, 30, 30}, {0, 1, 0}),
                 as_drawn({30, 10, 30}, {0, 0, 1}), as_drawn({30, 50, 30}, {0, 0, 1})},
                16, 0.5e-3);
}

Matrix6 strainMatrix(const Bridge& bridge) {
  Matrix6 C;
  for (int k = 0; k < 6; ++k) {
    // moment about the hinge: m = u·(M − r × F) = −(u × r)·F + u·M, r from the reference point
    const Hinge& h = bridge.hinges[static_cast<std::size_t>(k)];
    const Eigen::Vector3d r = h.position - bridge.reference_point;
    C.row(k) << -h.direction.cross(r).transpose(), h.direction.transpose();
    C.row(k) *= h.gain * h.strain_per_moment;
  }
  return C;
}

BridgeState deflect(const Bridge& bridge, const Vector6& w) {
  const Eigen::Vector3d F = w.head<3>();
  const Eigen::Vector3d M = w.tail<3>() + bridge.reference_point.cross(F);  // about O_D
  BridgeState state{Vector6::Zero(), {}};
  Pose carried;  // what the hinges before do to the lines of those behind
  for (const std::size_t k : kOrder) {
    const Hinge& h = bridge.hinges[k];
    const Eigen::Vector3d r = carried.R * h.position + carried.p;
    const Eigen::Vector3d u = carried.R * h.direction;
    const double m = u.dot(M - r.cross(F));
    const double strain = h.strain_per_moment * m;
    state.volts[static_cast<int>(k)] =
        h.gain * strain * (1.0 + bridge.nonlinearity * h.curvature * strain / 1e-3);
    // exp of the hinge's twist: a turn about its line
    const auto turn = [&](double angle) {
      const Eigen::Matrix3d R = rotationFromVector({angle * h.direction});
      return Pose{R, h.position - R * h.position};
    };
    const double angle = m / h.stiffness;
    carried = carried * turn(bridge.nonlinearity * angle);
    state.X_DC = state.X_DC * turn(angle);
  }
  state.X_DC = state.X_DC * Pose{Eigen::Matrix3d::Identity(), kCarrierAtRest};
  return state;
}

double NormalSource::operator()() {
  // Marsaglia's polar method on our own uniforms: std::normal_distribution differs between
  // libraries
  if (has_spare_) {
    has_spare_ = false;
    return spare_;
  }
  const auto uniform = [this] {
    return static_cast<double>(static_cast<std::int64_t>(engine_() >> 11)) * 0x1.0p-52 - 1.0;
  };
  double u = 0.0, v = 0.0, s = 0.0;
  do {
    u = uniform();
    v = uniform();
    s = u * u + v * v;
  } while (s >= 1.0 || s == 0.0);
  const double scale = std::sqrt(-2.0 * std::log(s) / s);
  spare_ = v * scale;
  has_spare_ = true;
  return u * scale;
}

StrainSample convert(const Bridge& bridge, const Matrix6& strain_matrix, const Vector6& w,
                     NormalSource& normal) {
  return convertVolts(bridge, strain_matrix * w, normal);
}

double NormalSource::sumOfSquares(int count) {
  return boost::random::chi_squared_distribution<double>(count)(engine_);
}

double resolution(const Bridge& bridge) {
  return bridge.full_scale / std::ldexp(1.0, bridge.bits - 1);
}

double sampleVariance(const Bridge& bridge) {
  const double code = resolution(bridge);
  return bridge.noise * bridge.noise + code * code / 12.0;
}

Vector6 converterInput(const Bridge& bridge, const Vector6& volts) {
  const double warmth = bridge.temperature - kReferenceTemperature;
  Vector6 input;
  for (int k = 0; k < 6; ++k) {
    const Hinge& h = bridge.hinges[static_cast<std::size_t>(k)];
    input[k] = volts[k] * (1.0 + kGainDrift * warmth) + h.offset + h.zero_drift * warmth;
  }
  return input;
}

StrainSample convertVolts(const Bridge& bridge, const Vector6& volts, NormalSource& normal) {
  const double codes = std::ldexp(1.0, bridge.bits - 1);
  const double lsb = resolution(bridge);
  Vector6 input = converterInput(bridge, volts);
  for (double& channel : input) channel += bridge.noise * normal();
  StrainSample sample;
  for (int k = 0; k < 6; ++k) {
    // the end codes stand for everything beyond (and for what is no number)
    double code = input[k] / lsb;
    code = code < codes - 1.0 ? code : codes - 1.0;
    code = code > -codes ? code : -codes;
    // to the next integer, half to even, as nearbyint(): so large a number has no digits behind it
    code = code + kNoFraction - kNoFraction;
    const bool at_end = code == codes - 1.0 || code == -codes;
    sample.saturated = static_cast<std::uint8_t>(sample.saturated | (at_end ? 1u << k : 0u));
    sample.volts[k] = code * lsb;
  }
  return sample;
}

}  // namespace assembly_cell
