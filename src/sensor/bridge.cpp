// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/sensor/bridge.h"

#include <cmath>
#include <string>

#include "assembly_cell/scene/input_error.h"

namespace assembly_cell {

namespace {

// half bridge of gauge factor 2.10 at 2.5 V, amplified 1000 times [V] per unit strain
constexpr double kGain = 1000.0 * 2.5 * 2.10 / 2.0;
// notch in Al 7075: 1/(E b t²/6) with E 71.7 GPa, b 40 mm, t 2 mm [1/(N m)]
constexpr double kStrainPerMoment = 6.0 / (71.7e9 * 0.040 * 0.002 * 0.002);

// a hinge as it was made: position [mm], direction (not normalised), strain and gain relative to
// nominal, offset [V]
Hinge hinge(const Eigen::Vector3d& position, const Eigen::Vector3d& direction, double strain,
            double gain, double offset) {
  return {1e-3 * position, direction.normalized(), strain * kStrainPerMoment, gain * kGain, offset};
}

Bridge bridge(const std::array<Hinge, 6>& hinges, int bits, double noise) {
  if (bits != 10 && bits != 16 && bits != 24) {
    throw InputError("bridge: bits is " + std::to_string(bits) + ": give 10, 16 or 24");
  }
  if (!(noise >= 0.0) || !std::isfinite(noise)) {
    throw InputError("bridge: noise is " + std::to_string(noise) + ": give volts rms, not below 0");
  }
  Bridge b;
  b.hinges = hinges;
  b.bits = bits;
  b.noise = noise;
  return b;
}

}  // namespace

Bridge bridgeA(int bits, double noise) {
  return bridge({hinge({30, 30.6, 10.4}, {1, .010, -.008}, 1.00, 1.000, .012),
                 hinge({30, 29.5, 49.7}, {1, -.012, .006}, .98, 1.004, -.020),
                 hinge({9.6, 30, 30.7}, {.007, 1, .011}, 1.02, .997, .015),
                 hinge({50.3, 30, 29.4}, {-.009, 1, -.010}, 1.01, 1.002, .008),
                 hinge({30.5, 9.8, 30}, {.012, -.006, 1}, .99, .999, -.011),
                 hinge({29.3, 50.4, 30}, {-.008, .009, 1}, 1.03, .995, .018)},
                bits, noise);
}

Bridge bridgeB(int bits, double noise) {
  return bridge({hinge({30, 29.6, 10.5}, {1, -.007, .012}, 1.01, 1.001, -.016),
                 hinge({30, 30.7, 49.8}, {1, .009, -.011}, 1.00, .996, .010),
                 hinge({10.6, 30, 29.7}, {-.010, 1, .006}, .97, 1.003, -.009),
                 hinge({49.5, 30, 30.4}, {.008, 1, .013}, 1.02, .998, .014),
                 hinge({29.7, 10.6, 30}, {-.006, .012, 1}, 1.00, 1.005, .006),
                 hinge({30.4, 49.4, 30}, {.011, -.007, 1}, .98, 1.000, -.013)},
                bits, noise);
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
  const double codes = std::ldexp(1.0, bridge.bits - 1);
  const double lsb = bridge.full_scale / codes;
  const Vector6 ideal = strain_matrix * w;
  StrainSample sample;
  for (int k = 0; k < 6; ++k) {
    const double volts =
        ideal[k] + bridge.hinges[static_cast<std::size_t>(k)].offset + bridge.noise * normal();
    // round to a code; the end codes stand for everything beyond (and for what is no number)
    double code = std::nearbyint(volts / lsb);
    if (!(code < codes - 1.0)) code = codes - 1.0;
    if (code < -codes) code = -codes;
    if (code == codes - 1.0 || code == -codes) {
      sample.saturated = static_cast<std::uint8_t>(sample.saturated | (1u << k));
    }
    sample.volts[k] = code * lsb;
  }
  return sample;
}

}  // namespace assembly_cell
