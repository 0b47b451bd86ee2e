// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/identification/mechanism_record.h"

#include <Eigen/Cholesky>
#include <cmath>
#include <sstream>

#include "assembly_cell/base/files.h"
#include "assembly_cell/base/yaml_section.h"
#include "assembly_cell/base/yaml_text.h"
#include "assembly_cell/mechanism/mechanism.h"

namespace assembly_cell {
namespace {

using yaml::Range;
using yaml::Section;

constexpr const char* kFormat = "assembly_cell mechanism 1";
constexpr double kAgree = 1e-9;     // of a value with the mechanism's own key, relative
constexpr double kRounding = 1e-9;  // of a correlation matrix

bool hasNoNominal(int i) { return i == kFriction || i >= kExciterGain; }

// Unknowns centred at a model; sd: of a factor's logarithm, else in its unit.
std::vector<Unknown> about(const MechanismModel& model, const UnknownVector& sd) {
  std::vector<Unknown> unknowns = unknownsAsDrawn();
  for (Unknown& unknown : unknowns) {
    unknown.mean = 0.0;
    unknown.sd = 1.0;
  }
  const UnknownVector moved = unknownsOf(model.mechanism, unknowns, model);
  for (int i = 0; i < kUnknowns; ++i) {
    Unknown& unknown = unknowns[static_cast<std::size_t>(i)];
    // exciter and compliance of the carrier are not part of Mechanism: their means have the values
    if (i >= kExciterGain) unknown.mean = moved[i];
    unknown.sd = sd[i];
  }
  return unknowns;
}

std::string shownList(const std::vector<std::string>& texts) {
  std::string list;
  for (const std::string& text : texts) list += (list.empty() ? "" : ", ") + yamlQuoted(text);
  return "[" + list + "]";
}

std::vector<std::string> namesOf(const std::vector<int>& places,
                                 const std::vector<Unknown>& unknowns) {
  std::vector<std::string> names;
  for (const int i : places) names.push_back(unknowns[static_cast<std::size_t>(i)].name);
  return names;
}

std::string recordText(const Mechanism& nominal, const Identification& found) {
  std::ostringstream out;
  out << "  parameters:      # factors for friction and exciter.amplitude, else SI\n";
  for (int i = 0; i < kUnknowns; ++i) {
    YamlMapping row;
    row.quoted("name", found.unknowns[static_cast<std::size_t>(i)].name)
        .number("drawn", valueAt(nominal, found.unknowns, i, 0.0))
        .number("drawn_sd", sdAt(nominal, found.unknowns, i, 0.0, 1.0))
        .number("value", valueAt(nominal, found.unknowns, i, found.z[i]))
        .number("sd", sdAt(nominal, found.unknowns, i, found.z[i], found.sd(i)));
    out << "    - " << row.text() << "\n";
  }
  out << "  correlation:     # of the parameters, in their order\n";
  for (int i = 0; i < kUnknowns; ++i) {
    UnknownVector row;
    for (int k = 0; k < kUnknowns; ++k) {
      const double size = found.sd(i) * found.sd(k);
      row[k] = i == k ? 1.0 : found.covariance(i, k) / size;
    }
    out << "    - " << yamlList(row) << "\n";
  }
  out << "  unseen: " << shownList(namesOf(found.unseen, found.unknowns)) << "\n"
      << "  correlated:      # pairs that the data don't separate\n";
  for (const CorrelatedPair& pair : found.correlated) {
    const std::vector<std::string> names = namesOf({pair.first, pair.second}, found.unknowns);
    YamlMapping row;
    row.quoted("first", names[0]).quoted("second", names[1]);
    out << "    - " << row.number("correlation", pair.correlation).text() << "\n";
  }
  if (found.correlated.empty()) out << "    []\n";
  return out.str();
}

void readCorrelation(Section& in, KnownMechanism& known) {
  const YAML::Node rows = in.required("correlation", "give a row for each parameter");
  const auto refuse = [&](const std::string& why) {
    in.refuse(in.at("correlation"), yaml::shown(rows), why + "; identify the mechanism again");
  };
  if (!rows.IsSequence() || rows.size() != kUnknowns) refuse("has not a row for each parameter");
  for (int i = 0; i < kUnknowns; ++i) {
    const YAML::Node row = rows[static_cast<std::size_t>(i)];
    if (!row.IsSequence() || row.size() != kUnknowns) refuse("is not square");
    for (int k = 0; k < kUnknowns; ++k) {
      double& entry = known.covariance(i, k);
      if (!yaml::readNumber(row[static_cast<std::size_t>(k)], entry)) {
        refuse("has an entry that is no number");
      }
    }
  }
  const UnknownMatrix& c = known.covariance;
  if ((c.diagonal().array() - 1.0).abs().maxCoeff() > kRounding) refuse("has not ones only");
  if ((c - c.transpose()).cwiseAbs().maxCoeff() > kRounding) refuse("is not symmetric");
  const Eigen::MatrixXd raised = c + kRounding * UnknownMatrix::Identity();
  if (raised.llt().info() != Eigen::Success) refuse("is not positive definite");
}

// Deviations as about() takes them; the values are checked against the mechanism.
UnknownVector readParameters(Section& in, KnownMechanism& known) {
  const std::vector<Unknown> names = unknownsAsDrawn();
  std::vector<Section> entries = in.sections("parameters");
  if (entries.size() != kUnknowns) {
    in.refuse(in.at("parameters"), static_cast<double>(entries.size()),
              "give all " + std::to_string(kUnknowns) + " parameters; identify again");
  }
  UnknownVector value, sd;
  for (int i = 0; i < kUnknowns; ++i) {
    Section& entry = entries[static_cast<std::size_t>(i)];
    const std::string& name = names[static_cast<std::size_t>(i)].name;
    const std::string found = entry.text("name", "give " + name);
    if (found != name) entry.refuse(entry.at("name"), found, "give " + name + " at this place");
    entry.number("drawn", Range::kAny);
    entry.number("drawn_sd", Range::kPositive);
    value[i] = entry.number("value", Range::kAny);
    sd[i] = entry.number("sd", Range::kPositive);
    if (names[static_cast<std::size_t>(i)].factor) {
      if (!(value[i] > 0.0)) entry.refuse(entry.at("value"), value[i], "give a positive number");
      sd[i] /= value[i];
    }
    entry.finish();
  }
  known.drive.gain = value[kExciterGain];
  known.drive.delay = value[kExciterDelay];
  known.drive.ellipse = value.segment<2>(kEllipse);
  known.drive.compliance = value[kCompliance];
  std::vector<Unknown> plain = names;
  for (Unknown& unknown : plain) unknown.mean = 0.0;
  for (int i = 0; i < kUnknowns; ++i) {
    if (hasNoNominal(i)) continue;
    const double own = valueAt(known.mechanism, plain, i, 0.0);
    if (std::abs(own - value[i]) > kAgree * std::abs(own)) {
      Section& entry = entries[static_cast<std::size_t>(i)];
      entry.refuse(entry.at("value"), value[i],
                   "the mechanism's own key is " + yaml::shown(own) +
                       "; don't change an identified file by hand, identify again");
    }
  }
  return sd;
}

}  // namespace

KnownMechanism knownAsDrawn(const Mechanism& nominal) {
  KnownMechanism known;
  known.mechanism = nominal;
  known.verdict = "as drawn";
  known.unknowns = unknownsAsDrawn();
  return known;
}

KnownMechanism knownFrom(const Identification& found) {
  KnownMechanism known;
  known.mechanism = found.model.mechanism;
  known.drive = found.model.drive;
  known.identified = true;
  known.accepted = found.accepted;
  known.verdict = found.verdict;
  known.unseen = namesOf(found.unseen, found.unknowns);
  UnknownVector sd;
  for (int i = 0; i < kUnknowns; ++i) {
    sd[i] = found.unknowns[static_cast<std::size_t>(i)].sd * found.sd(i);
    for (int k = 0; k < kUnknowns; ++k) {
      known.covariance(i, k) = found.covariance(i, k) / (found.sd(i) * found.sd(k));
    }
  }
  known.unknowns = about({known.mechanism, known.drive}, sd);
  return known;
}

std::string mechanismRecord(const Mechanism& nominal, const Identification& found,
                            const std::string& origin, const std::string& date) {
  YamlMapping left_out, fit;
  left_out.number("chi2", found.chi2).integer("dof", found.dof).number("p", found.p);
  fit.number("chi2", found.fit_chi2).integer("dof", found.fit_dof);
  fit.number("condition", found.condition);
  std::ostringstream out;
  out << "# Identified mechanism: docs/theory/identification.md\n"
      << mechanismText(found.model.mechanism) << "identification:\n"
      << "  format: " << yamlQuoted(kFormat) << "\n"
      << "  origin: " << yamlQuoted(origin) << "\n"
      << "  date: " << yamlQuoted(date) << "\n"
      << "  accepted: " << (found.accepted ? "true" : "false") << "\n"
      << "  verdict: " << yamlQuoted(found.verdict) << "\n"
      << "  left_out: " << left_out.text() << "\n"
      << "  fit: " << fit.text() << "\n"
      << "  notes: " << shownList(found.notes) << "\n"
      << recordText(nominal, found);
  return out.str();
}

void saveMechanism(const Mechanism& nominal, const Identification& found, const std::string& origin,
                   const std::string& date, const std::string& path) {
  writeFileAtomically(path, mechanismRecord(nominal, found, origin, date), path);
}

KnownMechanism loadKnownMechanism(const std::string& path,
                                  const std::vector<std::string>& overrides) {
  return parseKnownMechanism(yaml::fileText(path, "mechanism"), path, overrides);
}

KnownMechanism parseKnownMechanism(const std::string& text, const std::string& source,
                                   const std::vector<std::string>& overrides) {
  const Mechanism mechanism = parseMechanism(text, source, overrides);
  Section root(yaml::loadMapping(text, source, overrides, yaml::FileKind::kMechanism), "", source);
  if (!root.has("identification")) return knownAsDrawn(mechanism);
  Section in = root.section("identification");
  in.choice("format", {kFormat});
  KnownMechanism known;
  known.mechanism = mechanism;
  known.identified = true;
  in.text("origin", "give the source of the readings");
  in.text("date", "give the date");
  in.required("accepted", "give true or false");
  known.accepted = in.flag("accepted", false);
  known.verdict = in.text("verdict", "give accepted or the reason");
  Section left_out = in.section("left_out");
  left_out.number("chi2", Range::kNotNegative);
  left_out.integer("dof", 0, 1000000);
  left_out.number("p", 0.0, 1.0);
  left_out.finish();
  Section fit = in.section("fit");
  fit.number("chi2", Range::kNotNegative);
  fit.integer("dof", 0, 1000000);
  fit.number("condition", Range::kPositive);
  fit.finish();
  in.texts("notes");
  const UnknownVector sd = readParameters(in, known);
  readCorrelation(in, known);
  known.unseen = in.texts("unseen");
  for (Section& pair : in.sections("correlated")) {
    pair.text("first", "give a parameter's name");
    pair.text("second", "give a parameter's name");
    pair.number("correlation", -1.0, 1.0);
    pair.finish();
  }
  in.finish();
  known.unknowns = about({known.mechanism, known.drive}, sd);
  return known;
}

ExciterParameters compensated(const ExciterParameters& wanted, const DriveErrors& drive) {
  ExciterParameters command = wanted;
  command.amplitude /= drive.gain;
  command.phase += wanted.frequency * drive.delay;
  return command;
}

}  // namespace assembly_cell
