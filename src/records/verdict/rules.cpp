// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
// Files of rules: boxes, a band, or both for one program.
#include <algorithm>
#include <cmath>
#include <filesystem>
#include <map>
#include <utility>

#include "assembly_cell/base/input_error.h"
#include "assembly_cell/base/text.h"
#include "assembly_cell/base/yaml_section.h"
#include "assembly_cell/base/yaml_text.h"
#include "assembly_cell/records/band.h"
#include "assembly_cell/records/verdict.h"
#include "verdict/boxes.h"

namespace assembly_cell {
namespace {

namespace fs = std::filesystem;

constexpr int kFormat = 1;
constexpr std::size_t kLargestFile = std::size_t(1) << 24;
constexpr double kAny = 1e9;

std::string rowText(const char* key, const std::vector<double>& values) {
  return std::string("      ") + key + ": " + yamlList(values) + "\n";
}

std::string placeText(const BandPlace& place) {
  return YamlMapping().number("mean", place.mean).number("sd", place.sd).text();
}

BandPlace readPlace(yaml::Section section) {
  BandPlace place;
  place.mean = section.number("mean", -kAny, kAny);
  place.sd = section.number("sd", 1e-12, kAny);
  section.finish();
  return place;
}

std::vector<double> readSds(yaml::Section& section, const char* key, std::size_t count) {
  std::vector<double> values = section.numbers(key, count);
  for (std::size_t k = 0; k < count; ++k) {
    if (values[k] > 0.0) continue;
    section.refuse(section.at(key) + "[" + std::to_string(k) + "]", values[k],
                   "give a standard deviation above 0");
  }
  return values;
}

Band readBand(yaml::Section section, const std::string& program) {
  Band band;
  band.program = program;
  band.name = section.text("name", "give the band a name");
  band.over_time = section.choice("over", {"depth", "time"}) == "time";
  band.alpha = section.number("alpha", 1e-9, 1.0);
  band.limit = section.number("limit", 1e-9, kAny);
  band.learnt = static_cast<std::size_t>(section.integer("learnt", 2, 1000000000));
  band.calibrated = static_cast<std::size_t>(section.integer("calibrated", 1, 1000000000));
  band.from = section.number("from", -kAny, kAny);
  band.step = section.number("step", 1e-9, kAny);
  const auto cells = static_cast<std::size_t>(section.integer("cells", 1, 1000000));
  if (!band.over_time) {
    band.begin = readPlace(section.section("begin"));
    band.end = readPlace(section.section("end"));
  }
  for (yaml::Section channel : section.sections("quantities")) {
    BandChannel read;
    read.quantity = channel.choice("quantity", curveQuantities());
    read.low = channel.numbers("low", cells);
    read.low_sd = readSds(channel, "low_sd", cells);
    read.high = channel.numbers("high", cells);
    read.high_sd = readSds(channel, "high_sd", cells);
    channel.finish();
    band.channels.push_back(std::move(read));
  }
  if (band.channels.empty()) section.refuse(section.at("quantities"), "[]", "give at least one");
  section.finish();
  return band;
}

std::vector<std::string> filesOf(const std::vector<std::string>& paths) {
  std::vector<std::string> files;
  for (const std::string& path : paths) {
    std::error_code error;
    if (!fs::is_directory(path, error)) {
      files.push_back(path);
      continue;
    }
    std::vector<std::string> in;
    for (fs::directory_iterator it(path, error), end; !error && it != end; it.increment(error)) {
      if (it->path().extension() == ".yaml") in.push_back(it->path().string());
    }
    if (error) throw InputError(path + ": can't be listed (" + error.message() + ")");
    std::sort(in.begin(), in.end());
    files.insert(files.end(), in.begin(), in.end());
  }
  return files;
}

}  // namespace

struct RunRules::Data {
  struct Program {
    std::vector<CurveBox> boxes;
    std::optional<Band> band;
    std::string file;  // of the band
  };
  std::map<std::string, Program> programs;

  void read(const std::string& file) {
    yaml::Section root(yaml::loadYaml(yaml::fileText(file, "file of rules", kLargestFile), file,
                                      yaml::FileKind::kRules),
                       "", file);
    root.integer("rules", kFormat, kFormat);
    const std::string name = root.text("program", "give the program that the rules are for");
    Program& program = programs[name];
    if (root.has("boxes")) {
      for (yaml::Section& section : root.sections("boxes")) {
        CurveBox box = readBox(section);
        for (const CurveBox& other : program.boxes) {
          if (other.name == box.name) {
            section.refuse(section.at("name"), box.name,
                           "another box for program " + name + " has this name");
          }
        }
        program.boxes.push_back(std::move(box));
      }
    }
    if (root.has("band")) {
      Band band = readBand(root.section("band"), name);
      if (program.band) {
        throw InputError(file + ": band: the second one for program " + printable(name) +
                         ", the first is in " + program.file + ": leave out one of both files");
      }
      program.band = std::move(band);
      program.file = file;
    }
    if (!root.has("boxes") && !root.has("band")) {
      root.refuse("boxes", "no boxes and no band", "give one of them or both");
    }
    root.finish();
  }
};

RunRules::RunRules() : data_(std::make_shared<Data>()) {}
RunRules::~RunRules() = default;

RunRules::RunRules(const std::vector<std::string>& paths) {
  auto data = std::make_shared<Data>();
  for (const std::string& file : filesOf(paths)) data->read(file);
  data_ = std::move(data);
}

std::vector<RunVerdict> RunRules::evaluate(const Run& run) const {
  std::vector<RunVerdict> verdicts;
  const auto found = data_->programs.find(run.program);
  if (found == data_->programs.end()) return verdicts;
  for (const CurveBox& box : found->second.boxes) verdicts.push_back(evaluateBox(box, run.curve));
  if (found->second.band) verdicts.push_back(evaluateBand(*found->second.band, run.curve));
  return verdicts;
}

const Band* RunRules::band(const std::string& program) const {
  const auto found = data_->programs.find(program);
  if (found == data_->programs.end() || !found->second.band) return nullptr;
  return &*found->second.band;
}

std::string rulesText(const Band& band) {
  std::string out =
      "# A band learnt from good runs by split conformal prediction, docs/theory/records.md\n"
      "rules: " +
      std::to_string(kFormat) + "\nprogram: " + yamlQuoted(band.program) +
      "\nband:\n  name: " + yamlQuoted(band.name) +
      "\n  over: " + (band.over_time ? "time" : "depth") + "\n";
  const auto line = [&out](const char* key, const std::string& value) {
    out += std::string("  ") + key + ": " + value + "\n";
  };
  line("alpha", yamlNumber(band.alpha));
  line("limit", yamlNumber(band.limit));
  line("learnt", std::to_string(band.learnt));
  line("calibrated", std::to_string(band.calibrated));
  line("from", yamlNumber(band.from));
  line("step", yamlNumber(band.step));
  line("cells", std::to_string(band.cells()));
  if (!band.over_time) {
    line("begin", placeText(band.begin));
    line("end", placeText(band.end));
  }
  out += "  quantities:\n";
  for (const BandChannel& channel : band.channels) {
    out += "    - quantity: " + channel.quantity + "\n";
    out += rowText("low", channel.low) + rowText("low_sd", channel.low_sd) +
           rowText("high", channel.high) + rowText("high_sd", channel.high_sd);
  }
  return out;
}

}  // namespace assembly_cell
