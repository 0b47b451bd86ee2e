// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/sensor/ati_calibration.h"

#include <tinyxml2.h>

#include <array>
#include <optional>
#include <sstream>

#include "assembly_cell/base/input_error.h"
#include "assembly_cell/base/text.h"
#include "assembly_cell/base/yaml_text.h"
#include "assembly_cell/sensor/devices/netft_configuration.h"

namespace assembly_cell {

namespace {

using tinyxml2::XMLElement;

constexpr std::array<const char*, 6> kAxes = {"Fx", "Fy", "Fz", "Tx", "Ty", "Tz"};

std::string attribute(const XMLElement& element, const char* name) {
  const char* value = element.Attribute(name);
  return value == nullptr ? "" : value;
}

// SI value of the unit in an attribute
double unit(const XMLElement& calibration, const char* name,
            std::optional<double> (*find)(std::string_view), const char* known,
            const std::string& source) {
  const std::string label = attribute(calibration, name);
  const auto value = find(label);
  if (!value) {
    throw InputError(source + ": " + name + " is '" + printable(label) + "': it must be " + known);
  }
  return *value;
}

const XMLElement& row(const XMLElement& calibration, const char* axis, const std::string& source) {
  const XMLElement* found = nullptr;
  for (const XMLElement* e = calibration.FirstChildElement("UserAxis"); e != nullptr;
       e = e->NextSiblingElement("UserAxis")) {
    if (attribute(*e, "Name") != axis) continue;
    if (found != nullptr) {
      throw InputError(source + ": UserAxis " + axis + " is there twice: give the original file");
    }
    found = e;
  }
  if (found == nullptr) {
    throw InputError(source + " has no UserAxis " + axis +
                     ": request a calibration file of version 1.1 from ATI (rows of Axis are "
                     "scaled and can't serve)");
  }
  return *found;
}

void readRow(const XMLElement& element, const char* axis, const std::string& source,
             Eigen::Ref<Eigen::Matrix<double, 1, 6>> out) {
  const std::string where = source + ": UserAxis " + axis;
  std::istringstream words(attribute(element, "values"));
  Eigen::Index count = 0;
  for (std::string word; words >> word; ++count) {
    double value = 0.0;
    if (!parseNumber(word, value)) {
      throw InputError(where + ": value " + std::to_string(count + 1) + " is '" + printable(word) +
                       "': it must be a finite number");
    }
    if (count < 6) out[count] = value;
  }
  if (count != 6) {
    throw InputError(where + " has " + std::to_string(count) +
                     " values: it must have 6, one for each gauge");
  }
}

}  // namespace

bool isXml(const std::string& text) {
  const std::size_t mark = text.compare(0, 3, "\xef\xbb\xbf") == 0 ? 3 : 0;
  const std::size_t first = text.find_first_not_of(" \t\r\n", mark);
  return first != std::string::npos && text[first] == '<';
}

Calibration parseAtiCalibration(const std::string& xml, const std::string& source) {
  tinyxml2::XMLDocument document;
  if (document.Parse(xml.data(), xml.size()) != tinyxml2::XML_SUCCESS) {
    throw InputError(source + ": line " + std::to_string(document.ErrorLineNum()) +
                     ": malformed XML: give the original file");
  }
  const XMLElement* sensor = document.RootElement();
  if (sensor == nullptr || std::string(sensor->Name()) != "FTSensor") {
    throw InputError(
        source + ": this looks like XML: give a calibration here, or one of ATI: its root is '" +
        (sensor == nullptr ? "" : printable(sensor->Name())) + "' instead of FTSensor");
  }
  const XMLElement* calibration = sensor->FirstChildElement("Calibration");
  if (calibration == nullptr || calibration->NextSiblingElement("Calibration") != nullptr) {
    throw InputError(source + " has " + (calibration == nullptr ? "no" : "more than one") +
                     " Calibration: give a file with one");
  }
  const std::string gain = attribute(*calibration, "GainMultiplier");
  double factor = 1.0;
  if (!gain.empty() && (!parseNumber(gain, factor) || factor != 1.0)) {
    throw InputError(source + ": GainMultiplier is '" + printable(gain) +
                     "': only 1 is supported: request a file without one from ATI");
  }
  const double force =
      unit(*calibration, "ForceUnits", forceUnit, "N, kN, lbf, klbf, kgf or gf", source);
  const double torque = unit(*calibration, "TorqueUnits", torqueUnit,
                             "N-m, N-mm, kN-m, lbf-in, lbf-ft or kgf-cm", source);
  Calibration c;
  for (std::size_t i = 0; i < kAxes.size(); ++i) {
    Eigen::Matrix<double, 1, 6> values;
    readRow(row(*calibration, kAxes[i], source), kAxes[i], source, values);
    c.volts_to_wrench.row(static_cast<Eigen::Index>(i)) = (i < 3 ? force : torque) * values;
  }
  c.serial_number = printable(attribute(*sensor, "Serial"));
  c.date = printable(attribute(*calibration, "CalDate"));
  c.id = printable("ATI " + attribute(*calibration, "PartNumber") + " " + c.serial_number);
  if (c.serial_number.empty()) {
    throw InputError(source + ": FTSensor has no Serial: give the original file");
  }
  checkCalibration(c, source);
  return c;
}

}  // namespace assembly_cell
