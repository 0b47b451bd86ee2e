// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/identification/readings_file.h"

#include <sstream>

#include "assembly_cell/base/files.h"
#include "assembly_cell/base/yaml_text.h"

namespace assembly_cell {

void saveReadings(const IdentificationData& data, const Identification& found,
                  const std::string& path) {
  std::ostringstream out;
  out << "place,frequency,direction,amplitude,held_out";
  for (const char* prefix : {"", "fit_"}) {
    for (const char* axis : {"fx", "fy", "fz", "tx", "ty", "tz"}) {
      out << "," << prefix << axis << "_re," << prefix << axis << "_im";
    }
  }
  out << "\n";
  for (std::size_t k = 0; k < data.vibrations.size(); ++k) {
    const VibrationReading& reading = data.vibrations[k];
    out << reading.place.value_or(-1) << "," << yamlNumber(reading.exciter.frequency) << ","
        << reading.exciter.direction << "," << yamlNumber(reading.exciter.amplitude) << ","
        << (reading.held_out ? 1 : 0);
    for (const WrenchPhasor* phasor : {&reading.phasor, &found.fitted[k]}) {
      for (int axis = 0; axis < 6; ++axis) {
        out << "," << yamlNumber((*phasor)[axis].real()) << ","
            << yamlNumber((*phasor)[axis].imag());
      }
    }
    out << "\n";
  }
  writeFileAtomically(path, out.str(), path);
}

}  // namespace assembly_cell
