// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/sensor/devices/netft_configuration.h"

#include <algorithm>
#include <array>
#include <cctype>

#include "assembly_cell/base/csv_text.h"
#include "assembly_cell/base/text.h"
#include "assembly_cell/base/yaml_text.h"
#include "assembly_cell/sensor/source_parameters.h"
#include "assembly_cell/sensor/strain_source.h"

namespace assembly_cell {

namespace {

constexpr double kPound = 4.4482216152605;  // [N], exact
constexpr double kGravity = 9.80665;        // [m/s²], standard
constexpr double kInch = 0.0254;            // [m]
constexpr std::size_t kLongestEntry = 64;
constexpr double kLargestCounts = 1e12;

struct Unit {
  std::string_view name;
  double value;
};

constexpr std::array<Unit, 8> kForces = {{{"n", 1.0},
                                          {"kn", 1e3},
                                          {"lbf", kPound},
                                          {"klbf", 1e3 * kPound},
                                          {"kgf", kGravity},
                                          {"kg", kGravity},
                                          {"gf", 1e-3 * kGravity},
                                          {"g", 1e-3 * kGravity}}};
constexpr std::array<Unit, 7> kTorques = {{{"nm", 1.0},
                                           {"nmm", 1e-3},
                                           {"knm", 1e3},
                                           {"lbfin", kPound* kInch},
                                           {"lbfft", kPound * 12.0 * kInch},
                                           {"kgfcm", 0.01 * kGravity},
                                           {"kgcm", 0.01 * kGravity}}};
constexpr std::array<Unit, 2> kVolts = {{{"v", 1.0}, {"mv", 1e-3}}};

template <std::size_t N>
std::optional<double> find(const std::array<Unit, N>& units, std::string_view label) {
  std::string name;
  for (const char c : label.substr(0, kLongestEntry)) {
    if (c == ' ' || c == '-') continue;
    name += static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  }
  for (const Unit& unit : units) {
    if (unit.name == name) return unit.value;
  }
  return std::nullopt;
}

[[noreturn]] void refuse(const std::string& what, std::string_view value,
                         const std::string& remedy) {
  throw SourceError("source netft: the box's configuration: " + what + " is '" +
                    printable(std::string(value)) + "': " + remedy);
}

std::optional<std::string_view> entry(std::string_view xml, const std::string& tag) {
  const std::string opening = "<" + tag + ">", closing = "</" + tag + ">";
  const std::size_t start = xml.find(opening);
  if (start == std::string_view::npos) return std::nullopt;
  const std::string_view rest = xml.substr(start + opening.size());
  const std::size_t end = rest.find(closing);
  if (end == std::string_view::npos) return std::nullopt;
  return trimmed(rest.substr(0, end), " \t\r\n");
}

std::string_view required(std::string_view xml, const std::string& tag) {
  const auto text = entry(xml, tag);
  if (!text || text->empty() || text->size() > kLongestEntry) {
    refuse(tag, text.value_or("missing"),
           "is this a Net F/T box? else set configuration: parameters");
  }
  return *text;
}

std::string optionalText(std::string_view xml, const std::string& tag) {
  return printable(std::string(entry(xml, tag).value_or("").substr(0, kLongestEntry)));
}

double positive(std::string_view text, const std::string& tag) {
  double value = 0.0;
  if (!parseNumber(std::string(text), value) || !(value > 0.0) || value > kLargestCounts) {
    refuse(tag, text, "it must be a number above 0");
  }
  return value;
}

char lower(char c) { return static_cast<char>(std::tolower(static_cast<unsigned char>(c))); }

// value of a header field, by its name in small letters
std::optional<std::string_view> field(std::string_view header, std::string_view name) {
  while (!header.empty()) {
    const std::size_t end = std::min(header.find('\n'), header.size());
    const std::string_view line = header.substr(0, end);
    header.remove_prefix(std::min(end + 1, header.size()));
    if (line.size() <= name.size() || line[name.size()] != ':') continue;
    if (std::equal(name.begin(), name.end(), line.begin(),
                   [](char a, char b) { return a == lower(b); })) {
      return trimmed(line.substr(name.size() + 1));
    }
  }
  return std::nullopt;
}

// length of the body by the header, if given [bytes]
std::optional<std::size_t> contentLength(std::string_view header) {
  const auto text = field(header, "content-length");
  long length = 0;
  if (!text || text->size() > 9 || !parseInteger(std::string(*text), length) || length < 0) {
    return std::nullopt;
  }
  return static_cast<std::size_t>(length);
}

constexpr std::string_view kHeaderEnd = "\r\n\r\n";

}  // namespace

std::optional<double> forceUnit(std::string_view label) { return find(kForces, label); }
std::optional<double> torqueUnit(std::string_view label) { return find(kTorques, label); }
std::optional<double> voltUnit(std::string_view label) { return find(kVolts, label); }

NetftScale netftScale(const NetftConfiguration& configuration) {
  const auto volts_a = voltUnit(configuration.force_unit);
  const auto volts_b = voltUnit(configuration.torque_unit);
  const bool volts = volts_a && volts_b;
  const auto force = volts ? volts_a : forceUnit(configuration.force_unit);
  const auto torque = volts ? volts_b : torqueUnit(configuration.torque_unit);
  if (!force) refuse("unit of force", configuration.force_unit, "set the box to N");
  if (!torque) refuse("unit of torque", configuration.torque_unit, "set the box to N-m");
  for (const double counts : {configuration.counts_per_force, configuration.counts_per_torque}) {
    if (!(counts > 0.0) || counts > kLargestCounts) {
      refuse("counts per unit", yamlNumber(counts), "it must be a number above 0");
    }
  }
  return {*force / configuration.counts_per_force, *torque / configuration.counts_per_torque,
          volts};
}

bool httpComplete(std::string_view response) {
  const std::size_t end = response.find(kHeaderEnd);
  if (end == std::string_view::npos) return false;
  const auto length = contentLength(response.substr(0, end + 2));
  if (!length) return response.find("</netft>", end) != std::string_view::npos;
  return response.size() - end - kHeaderEnd.size() >= *length;
}

std::string_view httpBody(std::string_view response) {
  const std::string_view line = response.substr(0, response.find('\r'));
  // HTTP/1.x 200 …
  const bool ok = line.size() >= 12 && line.substr(0, 7) == "HTTP/1." &&
                  line.substr(8, 4) == " 200" && (line.size() == 12 || line[12] == ' ');
  if (!ok) {
    throw SourceError("source netft: the box answered '" + printable(std::string(line)) +
                      "' instead of HTTP/1.1 200: is http_port right?");
  }
  const std::size_t end = response.find(kHeaderEnd);
  if (end == std::string_view::npos) {
    throw SourceError("source netft: the box's answer breaks off: try again");
  }
  std::string_view body = response.substr(end + kHeaderEnd.size());
  const auto length = contentLength(response.substr(0, end + 2));
  if (length && body.size() < *length) {
    throw SourceError("source netft: the box's answer breaks off after " +
                      std::to_string(body.size()) + " of " + std::to_string(*length) +
                      " bytes: try again");
  }
  return length ? body.substr(0, *length) : body;
}

std::string describeChange(const NetftConfiguration& from, const NetftConfiguration& to) {
  std::string changes;
  const auto number = [](double value) { return text("%.10g", value); };
  const auto compare = [&](const char* what, const std::string& before, const std::string& after) {
    if (before == after) return;
    changes += (changes.empty() ? "" : ", ") + std::string(what) + " from " + printable(before) +
               " to " + printable(after);
  };
  compare("counts per force (cfgcpf)", number(from.counts_per_force), number(to.counts_per_force));
  compare("counts per torque (cfgcpt)", number(from.counts_per_torque),
          number(to.counts_per_torque));
  compare("unit of force (scfgfu)", from.force_unit, to.force_unit);
  compare("unit of torque (scfgtu)", from.torque_unit, to.torque_unit);
  compare("rate (comrdtrate) [Hz]", number(from.rate), number(to.rate));
  compare("calibration (calsn)", from.serial_number, to.serial_number);
  return changes;
}

NetftConfiguration parseNetftConfiguration(std::string_view xml) {
  NetftConfiguration configuration;
  configuration.counts_per_force = positive(required(xml, "cfgcpf"), "cfgcpf");
  configuration.counts_per_torque = positive(required(xml, "cfgcpt"), "cfgcpt");
  configuration.force_unit = std::string(required(xml, "scfgfu"));
  configuration.torque_unit = std::string(required(xml, "scfgtu"));
  const auto enabled = entry(xml, "comrdte");
  configuration.rdt_enabled = !enabled || !(*enabled == "0" || *enabled == "Disabled");
  if (const auto rate = entry(xml, "comrdtrate")) {
    configuration.rate = positive(rate->substr(0, kLongestEntry), "comrdtrate");
    if (configuration.rate > 1e5) refuse("comrdtrate", *rate, "it must be at most 1e5 Hz");
  }
  configuration.serial_number = optionalText(xml, "calsn");
  configuration.firmware = optionalText(xml, "mfgdigver");
  return configuration;
}

}  // namespace assembly_cell
