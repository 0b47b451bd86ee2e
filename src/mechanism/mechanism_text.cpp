// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/mechanism/mechanism_text.h"

#include <cmath>
#include <sstream>

#include "assembly_cell/base/yaml_text.h"

namespace assembly_cell {
namespace {

template <class Vector>
std::string list(const Vector& values) {
  std::string text = "[";
  for (int i = 0; i < values.size(); ++i) text += (i > 0 ? ", " : "") + yamlNumber(values[i]);
  return text + "]";
}

std::string matrix(const CouplingMatrix& m, const std::string& letter) {
  return "{diagonal: " + list(m.diagonal) + ", " + letter + "26: " + yamlNumber(m.k26) + ", " +
         letter + "35: " + yamlNumber(m.k35) + "}";
}

std::string chamfer(double width, double angle) {
  if (!(width > 0.0)) return "";
  return "  chamfer: {width: " + yamlNumber(width) + ", angle: " + yamlNumber(angle) + "}\n";
}

}  // namespace

std::string mechanismText(const Mechanism& m) {
  std::ostringstream out;
  const auto line = [&out](const char* key, double value) {
    out << "  " << key << ": " << yamlNumber(value) << "\n";
  };
  out << "gravity: " << yamlNumber(m.gravity) << "\npeg:\n";
  line("radius", m.peg.radius);
  line("half_height", m.peg.half_height);
  line("mass", m.peg.mass);
  line("inertia_transverse", m.peg.inertia_transverse);
  line("inertia_axial", m.peg.inertia_axial);
  line("coupling_height", m.peg.coupling_height);
  line("exciter_height", m.peg.exciter_height);
  out << chamfer(m.peg.chamfer_width, m.peg.chamfer_angle) << "hole:\n";
  line("radius", m.hole.radius);
  if (std::isfinite(m.hole.depth)) line("depth", m.hole.depth);
  out << chamfer(m.hole.chamfer_width, m.hole.chamfer_angle) << "carrier:\n";
  line("mass", m.carrier.mass);
  line("inertia", m.carrier.inertia);
  out << "  stiffness: " << list(m.carrier.stiffness) << "\n"
      << "  damping: " << list(m.carrier.damping) << "\n";
  line("max_speed", m.carrier.max_speed);
  line("max_acceleration", m.carrier.max_acceleration);
  out << "coupling:\n"
      << "  stiffness: " << matrix(m.coupling.stiffness, "k") << "\n"
      << "  damping: " << matrix(m.coupling.damping, "c") << "\n"
      << (m.coupling.axes == CouplingAxes::kCarrier ? "  axes: carrier\n" : "")
      << "exciter: {amplitude: " << yamlNumber(m.exciter.amplitude)
      << ", frequency: " << yamlNumber(m.exciter.frequency)
      << ", phase: " << yamlNumber(m.exciter.phase) << ", direction: " << m.exciter.direction
      << "}\n"
      << "friction: {static: " << yamlNumber(m.friction.static_coefficient)
      << ", sliding: " << yamlNumber(m.friction.sliding_coefficient) << "}\n";
  return out.str();
}

}  // namespace assembly_cell
