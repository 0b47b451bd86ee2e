// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <cstddef>
#include <optional>
#include <string>
#include <string_view>

namespace assembly_cell {

constexpr std::size_t kLargestHttpResponse = 64 * 1024;

/// Configuration of a Net F/T box, as in its /netftapi2.xml.
struct NetftConfiguration {
  double counts_per_force = 0.0;   ///< cfgcpf, counts per force_unit
  double counts_per_torque = 0.0;  ///< cfgcpt, counts per torque_unit
  std::string force_unit;          ///< scfgfu
  std::string torque_unit;         ///< scfgtu
  bool rdt_enabled = true;         ///< comrdte
  double rate = 0.0;               ///< comrdtrate [Hz], 0 if it doesn't tell
  std::string serial_number;       ///< of the calibration, calsn; may be empty
  std::string firmware;            ///< mfgdigver; may be empty
};

/// Newtons in a unit of force: N, kN, lbf, klbf, kgf (kg), gf (g); newton metres in one of torque:
/// N-m, N-mm, kN-m, lbf-in, lbf-ft, kgf-cm (kg-cm). Capitals, blanks and hyphens don't matter.
/// Volts in V and mV, for a strain bridge with this protocol. None for any other.
std::optional<double> forceUnit(std::string_view label);
std::optional<double> torqueUnit(std::string_view label);
std::optional<double> voltUnit(std::string_view label);

/// Scale of the counts in SI. volts: the six channels are volts, not a wrench.
struct NetftScale {
  double force = 0.0;   ///< [N] or [V] per count
  double torque = 0.0;  ///< [N·m] or [V] per count
  bool volts = false;
};

/// Throws SourceError for an unknown unit or a count that isn't above 0.
NetftScale netftScale(const NetftConfiguration& configuration);

/// Body of an HTTP response. Throws SourceError for anything but a complete 200.
std::string_view httpBody(std::string_view response);

/// True once the response holds as many bytes as its header declares; without a declaration, once
/// it has the end tag of netft.
bool httpComplete(std::string_view response);

/// What differs in counts, units, rate and calibration: "counts per force (cfgcpf) from 1000000 to
/// 1000"; empty: nothing.
std::string describeChange(const NetftConfiguration& from, const NetftConfiguration& to);

/// Reads the document. Throws SourceError for a missing or bad entry.
NetftConfiguration parseNetftConfiguration(std::string_view xml);

}  // namespace assembly_cell
