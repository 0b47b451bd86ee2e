// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
// Contacts in a recording of wrench and pose: where the line of action passes, one point or
// several.

#include "assembly_cell/recording/contacts.h"

#include <cmath>
#include <iostream>

#include "assembly_cell/base/files.h"
#include "assembly_cell/base/input_error.h"
#include "assembly_cell/base/options.h"
#include "assembly_cell/base/text.h"
#include "assembly_cell/base/yaml_text.h"

namespace {

using namespace assembly_cell;

constexpr const char* kHelp =
    R"(Usage: contacts RECORDING.csv [options]
       contacts RECORDING.bag [options]

Contacts in a recording of a wrench and the tool's pose, without a model of the part, as YAML. RECORDING.csv: columns t
(s, ms, us or ns), fx fy fz tx ty tz [N, N m] of the sensor, x y z [m] and qx qy qz qw (or r11 ... r33, or rotation vectors
rx ry rz [rad]) of the tool in the base, by a header or in this order. The tool's axes are taken for the sensor's. RECORDING.bag: a geometry_msgs/WrenchStamped
or WrenchSamples and a geometry_msgs/PoseStamped.
Payload and bias come from the parts in which the tool moves and touches nothing; where along z the contacts lie (the
lever) and how far from z they may be (the footprint) from those in which the wrench is that of one point.

  --topic TOPIC         of a bag's wrenches, where it has several
  --pose-topic TOPIC    of its poses
  --time-unit U         of t in a table: s, ms, us or ns (default auto: by the header, by magnitude since 1970, or by spacing)
  --lever L             z of the tip's plane in the sensor's frame [m] (default: found)
  --footprint R         radius of the tip [m] (default: found)
  --force F             smallest force that is evaluated [N] (default 1)
  --output FILE         every sample as CSV: kind, force, couple over force and its sd, where the line of action cuts the
                        tip's plane with covariance, its direction, and that point in the base (scripts/plot contacts)
  --help                print this

Exit code: 0 ok, 2 bad input.

Example: contacts 001.csv --output contacts.csv && scripts/plot contacts contacts.csv contacts.png
)";

template <typename Values>
std::string list(const Values& values) {
  std::string out;
  for (Eigen::Index i = 0; i < values.size(); ++i) {
    out += (i == 0 ? "" : ", ") + yamlNumber(values[i]);
  }
  return "[" + out + "]";
}

void line(const char* key, const std::string& value) { std::cout << key << ": " << value << "\n"; }

void print(const WrenchRecording& r, const ContactAnalysis& a) {
  line("samples", std::to_string(r.t.size()));
  line("time_unit", yamlQuoted(r.time_unit));
  std::string notes;
  for (const std::string& note : r.notes) notes += (notes.empty() ? "" : ", ") + yamlQuoted(note);
  line("notes", "[" + notes + "]");
  line("free_windows", std::to_string(a.free_windows));
  if (a.payload.refusal) {
    line("payload", "null  # " + a.payload.refusal.text);
  } else {
    line("weight", yamlNumber(a.payload.weight));
    line("weight_sd", yamlNumber(a.payload.weight_sd));
    line("gravity_direction", list(Eigen::Vector3d(a.payload.gravity / a.payload.weight)));
    line("center_of_mass", list(a.payload.center_of_mass));
    line("center_of_mass_sd",
         list(Eigen::Vector3d(a.payload.center_covariance.diagonal().cwiseSqrt())));
  }
  line("bias", list(a.bias));
  line("bias_sd", list(a.bias_sd));
  line("noise_sd", list(Vector6(a.noise.diagonal().cwiseSqrt())));
  line("lever", yamlNumber(a.lever));
  line("lever_sd", yamlNumber(a.lever_sd));
  line("lever_windows", std::to_string(a.lever_windows));
  line("footprint", yamlNumber(a.footprint));
  std::size_t counts[4] = {};
  for (const ContactSample& s : a.samples) ++counts[static_cast<std::size_t>(s.kind)];
  std::string text;
  for (std::size_t k = 0; k < 4; ++k) {
    text += (k == 0 ? "" : ", ") + std::string(toString(static_cast<ContactKind>(k))) + ": " +
            std::to_string(counts[k]);
  }
  line("counts", "{" + text + "}");
  std::cout << "segments:" << (a.segments.empty() ? " []" : "") << "\n";
  for (const ContactSegment& s : a.segments) {
    std::cout << "  - {start: " << yamlNumber(r.t[s.first])
              << ", end: " << yamlNumber(r.t[s.end - 1]) << ", kind: " << toString(s.kind)
              << ", force: " << yamlNumber(s.force) << ", pitch: " << yamlNumber(s.pitch);
    if (s.kind == ContactKind::kOne) {
      std::cout << ", point: " << list(s.cut) << ", scatter: [" << yamlNumber(s.scatter(0, 0))
                << ", " << yamlNumber(s.scatter(0, 1)) << ", " << yamlNumber(s.scatter(1, 1))
                << "]";
    }
    std::cout << "}\n";
  }
}

void writeSamples(const std::string& path, const WrenchRecording& r, const ContactAnalysis& a) {
  NewFile file(path, path, "give a place that can");
  file.write("t,kind,force,pitch,pitch_sd,x,y,xx,xy,yy,ux,uy,uz,base_x,base_y,base_z\n");
  // the recorded position is the tip's, the lever below the sensor's origin
  for (std::size_t i = 0; i < r.t.size(); ++i) {
    const ContactSample& s = a.samples[i];
    std::string row = text("%.6f,%s,%.6g", r.t[i], toString(s.kind), s.wrench.head<3>().norm());
    if (s.kind == ContactKind::kOne || s.kind == ContactKind::kSeveral) {
      const Eigen::Matrix2d& c = s.line.cut_covariance;
      const Eigen::Vector3d& u = s.line.line.direction;
      const Eigen::Vector3d base =
          r.pose[i].p + r.pose[i].R * Eigen::Vector3d(s.line.cut.x(), s.line.cut.y(), 0.0);
      row +=
          text(",%.6g,%.6g,%.6g,%.6g,%.6g,%.6g,%.6g", s.line.pitch, s.line.pitch_sd, s.line.cut.x(),
               s.line.cut.y(), c(0, 0), c(0, 1), c(1, 1)) +
          text(",%.6g,%.6g,%.6g,%.6g,%.6g,%.6g", u.x(), u.y(), u.z(), base.x(), base.y(), base.z());
    } else {
      row += ",,,,,,,,,,,,,";
    }
    file.write(row + "\n");
  }
  file.finish();
}

int run(const std::vector<std::string>& arguments) {
  std::string path, output;
  ContactSettings settings;
  RecordingOptions options;
  OptionParser parser(kHelp);
  parser.file("recording", path);
  parser.text("--topic", options.topic);
  parser.text("--pose-topic", options.pose_topic);
  parser.choice("--time-unit", options.time_unit, kTimeUnitChoices);
  parser.number("--lever", settings.lever, -2.0, 2.0);
  parser.number("--footprint", settings.footprint, 1e-4, 1.0);
  parser.number("--force", settings.force, 1e-3, 1e5);
  parser.text("--output", output);
  if (!parser.parse(arguments)) return 0;
  const WrenchRecording recording = readWrenchRecording(path, options);
  ContactAnalysis analysis;
  try {
    analysis = findContacts(recording, settings);
  } catch (const InputError& error) {
    throw InputError(path + ": " + error.what());
  }
  print(recording, analysis);
  if (!output.empty()) writeSamples(output, recording, analysis);
  return 0;
}

}  // namespace

int main(int argc, char** argv) { return assembly_cell::runTool("contacts", argc, argv, run); }
