// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/identification/unknowns.h"

#include <cmath>

namespace assembly_cell {
namespace {

// standard deviation of a uniform draw of ±1
const double kUniform = 1.0 / std::sqrt(3.0);

void setMass(double factor, double& mass, double& inertia) {
  mass *= factor;
  inertia *= factor;
}

// factor or value of every unknown at z
UnknownVector amounts(const std::vector<Unknown>& unknowns, const UnknownVector& z) {
  UnknownVector amount;
  for (int i = 0; i < kUnknowns; ++i) {
    const Unknown& unknown = unknowns[static_cast<std::size_t>(i)];
    const double moved = unknown.mean + unknown.sd * z[i];
    amount[i] = unknown.factor ? std::exp(moved) : moved;
  }
  return amount;
}

double ratio(double value, double nominal) { return nominal != 0.0 ? value / nominal : 1.0; }

// Nominal value of an unknown; 1 for factors without one.
double nominalOf(const Mechanism& m, int i) {
  if (i < kDamping) return m.coupling.stiffness.diagonal[i];
  if (i < kPegMass) return m.coupling.damping.diagonal[i - kDamping];
  if (i >= kCarrierStiffness && i < kFriction) return m.carrier.stiffness[i - kCarrierStiffness];
  switch (i) {
    case kPegMass:
      return m.peg.mass;
    case kCouplingHeight:
      return m.peg.coupling_height;
    case kExciterHeight:
      return m.peg.exciter_height;
    case kCarrierMass:
      return m.carrier.mass;
    case kFriction:
    case kExciterGain:
      return 1.0;
    default:
      return 0.0;
  }
}

}  // namespace

std::vector<Unknown> unknownsAsDrawn(double scale) {
  std::vector<Unknown> unknowns;
  const auto factor = [&](const std::string& name, double sd) {
    unknowns.push_back({name, true, 0.0, scale * sd});
  };
  const auto addend = [&](const std::string& name, double mean, double sd) {
    unknowns.push_back({name, false, mean, scale * sd});
  };
  const auto entry = [](const std::string& name, int i) {
    return name + "[" + std::to_string(i) + "]";
  };
  for (int i = 0; i < 6; ++i) factor(entry("coupling.stiffness.diagonal", i), 0.1 * kUniform);
  for (int i = 0; i < 6; ++i) {
    factor(entry("coupling.damping.diagonal", i), std::log(1.7) * kUniform);
  }
  factor("peg.mass", 0.05 * kUniform);
  addend("peg.coupling_height", 0.0, 5e-4 * kUniform);
  addend("peg.exciter_height", 0.0, 5e-4 * kUniform);
  factor("carrier.mass", 0.05 * kUniform);
  for (int i = 0; i < 3; ++i) factor(entry("carrier.stiffness", i), 0.2 * kUniform);
  factor("friction", 0.5 * kUniform);
  factor("exciter.amplitude", 0.2 * kUniform);
  addend("exciter.delay", 5e-4, 5e-4 * kUniform);
  // a size uniform from 0 to 0.05 in a random direction, twice
  addend("exciter.ellipticity.cos", 0.0, 0.05 * kUniform / std::sqrt(2.0));
  addend("exciter.ellipticity.sin", 0.0, 0.05 * kUniform / std::sqrt(2.0));
  // from none to 1e-5, which is level 3's
  addend("carrier.compliance", 5e-6, 5e-6 * kUniform);
  return unknowns;
}

MechanismModel modelAt(const Mechanism& nominal, const std::vector<Unknown>& unknowns,
                       const UnknownVector& z) {
  const UnknownVector amount = amounts(unknowns, z);
  MechanismModel model{nominal, {}};
  Mechanism& m = model.mechanism;
  scaleRows(m.coupling.stiffness, amount.segment<6>(kStiffness));
  scaleRows(m.coupling.damping, amount.segment<6>(kDamping));
  setMass(amount[kPegMass], m.peg.mass, m.peg.inertia_transverse);
  m.peg.inertia_axial *= amount[kPegMass];
  m.peg.coupling_height += amount[kCouplingHeight];
  m.peg.exciter_height += amount[kExciterHeight];
  setMass(amount[kCarrierMass], m.carrier.mass, m.carrier.inertia);
  for (int i = 0; i < 3; ++i) m.carrier.stiffness[i] *= amount[kCarrierStiffness + i];
  m.friction.static_coefficient *= amount[kFriction];
  m.friction.sliding_coefficient *= amount[kFriction];
  model.drive.gain = amount[kExciterGain];
  model.drive.delay = amount[kExciterDelay];
  model.drive.ellipse = amount.segment<2>(kEllipse);
  model.drive.compliance = amount[kCompliance];
  return model;
}

double valueAt(const Mechanism& nominal, const std::vector<Unknown>& unknowns, int i, double z) {
  const Unknown& unknown = unknowns[static_cast<std::size_t>(i)];
  const double moved = unknown.mean + unknown.sd * z, from = nominalOf(nominal, i);
  return unknown.factor ? from * std::exp(moved) : from + moved;
}

double sdAt(const Mechanism& nominal, const std::vector<Unknown>& unknowns, int i, double z,
            double sd) {
  const Unknown& unknown = unknowns[static_cast<std::size_t>(i)];
  return unknown.sd * sd * (unknown.factor ? std::abs(valueAt(nominal, unknowns, i, z)) : 1.0);
}

UnknownVector unknownsOf(const Mechanism& nominal, const std::vector<Unknown>& unknowns,
                         const MechanismModel& model) {
  const Mechanism& m = model.mechanism;
  UnknownVector amount;
  for (int i = 0; i < kUnknowns; ++i) {
    const double from = nominalOf(nominal, i), to = nominalOf(m, i);
    amount[i] = unknowns[static_cast<std::size_t>(i)].factor ? ratio(to, from) : to - from;
  }
  amount[kFriction] = ratio(m.friction.static_coefficient, nominal.friction.static_coefficient);
  amount[kExciterGain] = model.drive.gain;
  amount[kExciterDelay] = model.drive.delay;
  amount.segment<2>(kEllipse) = model.drive.ellipse;
  amount[kCompliance] = model.drive.compliance;
  UnknownVector z;
  for (int i = 0; i < kUnknowns; ++i) {
    const Unknown& unknown = unknowns[static_cast<std::size_t>(i)];
    z[i] = ((unknown.factor ? std::log(amount[i]) : amount[i]) - unknown.mean) / unknown.sd;
  }
  return z;
}

}  // namespace assembly_cell
