// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include <algorithm>
#include <cmath>
#include <filesystem>
#include <set>

#include "assembly_cell/base/csv_text.h"
#include "assembly_cell/base/input_error.h"
#include "assembly_cell/base/text.h"
#include "assembly_cell/base/yaml_section.h"
#include "assembly_cell/base/yaml_text.h"
#include "assembly_cell/study/run.h"
#include "assembly_cell/study/study.h"
#include "study_check.h"

namespace assembly_cell {
namespace {

namespace fs = std::filesystem;
using study_file::checkAlign;
using study_file::checkCount;
using study_file::checkKeys;
using study_file::findDirectKeys;
using study_file::kMaxRuns;
using study_file::loadScenarios;
using study_file::nameOf;
using yaml::Range;
using yaml::Section;
using yaml::shown;

constexpr std::size_t kMaxValues = 100000;  // of one axis

// a node as YAML text on one line
std::string flowText(const YAML::Node& node) {
  if (node.IsScalar()) return node.Scalar();
  std::string text;
  if (node.IsSequence()) {
    for (const auto& entry : node) text += (text.empty() ? "" : ", ") + flowText(entry);
    return "[" + text + "]";
  }
  if (node.IsMap()) {
    for (const auto& entry : node) {
      text += (text.empty() ? "" : ", ") + entry.first.Scalar() + ": " + flowText(entry.second);
    }
    return "{" + text + "}";
  }
  return "null";
}

// Reads a study; what refers to files is looked up beside it.
class Reader {
 public:
  Reader(const YAML::Node& root, const std::string& path)
      : path_(path), folder_(fs::path(path).parent_path()), in_(root, "", path) {}

  Study read() {
    study_.name = nameOf(in_, "give the study a name");
    study_.scenarios.push_back(
        file(in_.text("scenario", "give a scenario file, seen from the study's folder")));
    readJob();
    study_.seed = static_cast<std::uint64_t>(in_.integer("seed", 0, 1L << 53, 1));
    study_.samples = in_.integer("samples", 1, kMaxRuns, 1);
    study_.paired = in_.flag("paired", false);
    if (in_.optional("set")) {
      study_.set = settings(in_.required("set", ""), in_.at("set"));
    }
    if (in_.optional("axes")) readAxes(in_.required("axes", ""));
    readMismatch();
    readSearch();
    readOutcomes();
    readEnough();
    in_.finish();
    checkCount(study_, path_);
    loadScenarios(study_, path_);
    within("set", [&] { checkAlign(study_.job.align); });
    study_.evaluated = study_.job.kind == StudyJob::Kind::kAlign ||
                       std::isfinite(study_.job.assembled_depth) ||
                       std::isfinite(study_.job.assembled_offset);
    checkKeys(study_, path_);
    findDirectKeys(study_);
    return std::move(study_);
  }

 private:
  template <class Do>
  void within(const std::string& where, const Do& what) const {
    study_file::within(path_, where, what);
  }

  std::string file(const std::string& name) const {
    const fs::path path(name);
    return (path.is_absolute() ? path : folder_ / path).lexically_normal().string();
  }

  // a mapping "key.path: value"
  std::vector<StudySetting> settings(const YAML::Node& node, const std::string& where) {
    const Section unique(node, where, in_.source());
    std::vector<StudySetting> list;
    for (const auto& entry : node) {
      addSettings(entry.first.Scalar(), entry.second, where, list);
    }
    std::set<std::string> keys;
    for (const StudySetting& s : list) {
      if (!keys.insert(s.key).second) in_.refuse(where, s.key, "set twice, keep one of them");
    }
    return list;
  }

  // a mapping as value changes the keys it names and leaves the others
  void addSettings(const std::string& key, const YAML::Node& value, const std::string& where,
                   std::vector<StudySetting>& list) {
    if (value.IsNull()) in_.refuse(where, key, "give key.path: value");
    if (!value.IsMap()) {
      list.push_back(setting(key, flowText(value), where));
      return;
    }
    for (const auto& entry : value) {
      if (!entry.first.IsScalar()) in_.refuse(where, shown(entry.first), "give key.path: value");
      addSettings(key + "." + entry.first.Scalar(), entry.second, where, list);
    }
  }

  // a value of the job is checked here, a scenario joins the files
  StudySetting setting(const std::string& key, const std::string& value, const std::string& where) {
    StudySetting s{key, value};
    if (key == "scenario") {
      s.value = file(value);
      if (std::find(study_.scenarios.begin(), study_.scenarios.end(), s.value) ==
          study_.scenarios.end()) {
        study_.scenarios.push_back(s.value);
      }
    }
    StudyJob copy = study_.job;
    within(where, [&] { setStudyJob(copy, s); });
    return s;
  }

  void readJob() {
    StudyJob& job = study_.job;
    const std::string kind = in_.optional("job") ? in_.text("job", "") : "simulate";
    if (kind != "simulate" && kind != "align") in_.refuse("job", kind, "give simulate or align");
    job.kind = kind == "align" ? StudyJob::Kind::kAlign : StudyJob::Kind::kSimulate;
    for (const char* section : {"start", "move", "assembled", "stop", "cell", "align"}) {
      if (!in_.optional(section)) continue;
      const YAML::Node node = in_.required(section, "");
      const Section keys(node, section, in_.source());
      for (const auto& entry : node) {
        const std::string key = std::string(section) + "." + entry.first.Scalar();
        within("", [&] { setStudyJob(job, {key, flowText(entry.second)}); });
      }
    }
    if (in_.optional("look")) {
      const YAML::Node node = in_.required("look", "");
      within("", [&] { setStudyJob(job, {"look", flowText(node)}); });
    }
    study_.history = in_.flag("history", false);
    if (study_.history && job.kind == StudyJob::Kind::kAlign) {
      in_.refuse("history", "true", "only runs of job: simulate have one");
    }
    within("", [&] { checkAlign(job.align); });
  }

  void readMismatch() {
    if (!in_.optional("mismatch")) return;
    within("mismatch", [&] {
      const std::string path = file(in_.text("mismatch", "give a mismatch file"));
      study_.mismatch_text = yaml::fileText(path, "mismatch");
      study_.mismatch = parseMismatch(study_.mismatch_text, path);
    });
  }

  void readAxes(const YAML::Node& node) {
    if (!node.IsSequence()) in_.refuse("axes", shown(node), "give a list of axes");
    std::set<std::string> names, keys;
    for (std::size_t i = 0; i < node.size(); ++i) {
      const std::string where = "axes[" + std::to_string(i) + "]";
      study_.axes.push_back(axis(Section(node[i], where, in_.source())));
      const StudyAxis& a = study_.axes.back();
      const auto& outcomes = outcomeNames(study_.job.kind);
      if (a.name == "run" || a.name == "seed" || a.name == "status" || a.name == "reason" ||
          a.name == "mismatch" ||
          std::find(outcomes.begin(), outcomes.end(), a.name) != outcomes.end()) {
        in_.refuse(where + ".name", a.name, "a column of the results, give the axis another name");
      }
      if (!names.insert(a.name).second) {
        in_.refuse(where + ".name", a.name, "two axes of one name, rename one");
      }
      std::set<std::string> mine;
      for (const StudyAxis::Target& target : a.targets) mine.insert(target.key);
      for (const auto& one : a.cases) {
        for (const StudySetting& s : one) mine.insert(s.key);
      }
      for (const std::string& key : mine) {
        if (!keys.insert(key).second) {
          in_.refuse(where, key, "two axes set this key, keep it in one of them");
        }
      }
    }
  }

  StudyAxis axis(Section in) {
    StudyAxis a;
    readTargets(in, a);
    const std::vector<std::string> kinds = {"cases",       "values", "range", "uniform",
                                            "log_uniform", "normal", "search"};
    std::vector<std::string> given;
    for (const std::string& kind : kinds) {
      if (in.has(kind)) given.push_back(kind);
    }
    if (given.size() != 1) {
      in.refuse(in.at(""), given.empty() ? "no values" : given[0] + " and " + given[1],
                "give one of cases, values, range, uniform, log_uniform, normal, search");
    }
    if (given[0] == "cases") {
      readCases(in, a);
    } else if (given[0] == "values") {
      readValues(in, a);
    } else if (given[0] == "range") {
      readRange(in.section("range"), a);
    } else {
      readPair(in, given[0], a);
    }
    if (a.kind != StudyAxis::Kind::kCases && a.targets.empty()) {
      in.refuse(in.at("key"), "missing", "give the key path that the axis changes");
    }
    for (const StudyAxis::Target& target : a.targets) {
      for (const char* text : {"scenario", "align.strategy", "stop.assembled"}) {
        if (target.key == text) in.refuse(in.at("key"), text, "no number, use values or cases");
      }
    }
    in.finish();
    return a;
  }

  // key: path | key: [paths] | scale: {path: power}
  void readTargets(Section& in, StudyAxis& a) {
    if (in.has("key") && in.has("scale")) {
      in.refuse(in.at("scale"), "given with key", "keep one of them");
    }
    if (in.optional("key")) {
      const YAML::Node node = in.required("key", "");
      const std::size_t count = node.IsSequence() ? node.size() : 1;
      for (std::size_t i = 0; i < count; ++i) {
        const YAML::Node entry = node.IsSequence() ? node[i] : node;
        if (!entry.IsScalar() || entry.Scalar().empty()) {
          in.refuse(in.at("key"), shown(entry), "give a key path or a list of them");
        }
        a.targets.push_back({entry.Scalar(), 0.0});
      }
    }
    if (in.optional("scale")) {
      const YAML::Node node = in.required("scale", "");
      if (!node.IsMap()) in.refuse(in.at("scale"), shown(node), "give key.path: power");
      for (const auto& entry : node) {
        const std::string key = entry.first.IsScalar() ? entry.first.Scalar() : "";
        double power = 0.0;
        Scenario any;
        if (scenarioNumber(any, key) == nullptr) {
          in.refuse(in.at("scale"), key, "no number of a scenario that can be scaled");
        }
        if (!yaml::readNumber(entry.second, power) || power == 0.0) {
          in.refuse(in.at("scale") + "." + key, shown(entry.second),
                    "give the power of the factor, not 0");
        }
        a.targets.push_back({key, power});
      }
    }
    std::set<std::string> keys;
    for (const StudyAxis::Target& target : a.targets) {
      if (keys.insert(target.key).second) continue;
      in.refuse(in.at("key"), target.key, "named twice, keep one of them");
    }
    if (in.optional("name")) {
      a.name = csvCell(nameOf(in, "give a name"));
    } else if (!a.targets.empty()) {
      a.name = csvCell(a.targets.front().key);
    } else {
      in.refuse(in.at("name"), "missing", "give the axis a name");
    }
    a.stream = 0;
    for (const char c : a.name) {
      a.stream = a.stream * 1099511628211ull + static_cast<unsigned char>(c);
    }
    a.stream += static_cast<std::uint64_t>(in.integer("seed", 0, 1L << 53, 0)) * 0x9e3779b97f4aull;
  }

  // cases: {label: {key.path: value, ...}, ...}
  void readCases(Section& in, StudyAxis& a) {
    const YAML::Node node = in.required("cases", "");
    const Section unique(node, in.at("cases"), in.source());
    if (!a.targets.empty()) in.refuse(in.at("key"), "given with cases", "cases name their keys");
    for (const auto& entry : node) {
      const std::string& label = entry.first.Scalar();
      a.labels.push_back(csvCell(label));
      a.cases.push_back(settings(entry.second, in.at("cases." + label)));
    }
    if (a.cases.empty()) in.refuse(in.at("cases"), "empty", "give at least one case");
  }

  void readValues(Section& in, StudyAxis& a) {
    const YAML::Node node = in.required("values", "");
    if (!node.IsSequence() || node.size() == 0 || node.size() > kMaxValues) {
      in.refuse(in.at("values"), shown(node),
                "give a list of 1 to " + std::to_string(kMaxValues) + " values");
    }
    const bool scaled = std::any_of(a.targets.begin(), a.targets.end(),
                                    [](const auto& target) { return target.power != 0.0; });
    for (std::size_t i = 0; i < node.size(); ++i) {
      const std::string where = in.at("values") + "[" + std::to_string(i) + "]";
      if (scaled) {
        double value = 0.0;
        if (!yaml::readNumber(node[i], value) || value <= 0.0) {
          in.refuse(where, shown(node[i]), "give a factor > 0");
        }
        a.kind = StudyAxis::Kind::kValues;
        a.values.push_back(value);
        continue;
      }
      if (node[i].IsNull()) in.refuse(where, shown(node[i]), "give a value");
      const std::string text = flowText(node[i]);
      std::vector<StudySetting> list;
      for (const StudyAxis::Target& target : a.targets) {
        addSettings(target.key, node[i], where, list);
      }
      // a file is shown by its name, not by where it is
      const bool is_file = !list.empty() && list.front().key == "scenario";
      a.labels.push_back(csvCell(is_file ? fs::path(text).stem().string() : text));
      a.cases.push_back(list);
    }
    if (!scaled && a.targets.empty()) {
      in.refuse(in.at("key"), "missing", "give the key path that the axis changes");
    }
    if (!scaled) a.targets.clear();
  }

  void readRange(Section in, StudyAxis& a) {
    a.kind = StudyAxis::Kind::kValues;
    const double from = in.number("from", Range::kAny), to = in.number("to", Range::kAny);
    const std::int64_t count = in.integer("count", 2, static_cast<std::int64_t>(kMaxValues));
    const bool logarithmic = in.choice("spacing", {"linear", "log"}, "linear") == "log";
    in.finish();
    if (logarithmic && !(from > 0.0 && to > 0.0)) {
      in.refuse(in.at("from"), std::min(from, to), "logarithmic spacing needs bounds > 0");
    }
    checkScaled(in, a, std::min(from, to));
    for (std::int64_t i = 0; i < count; ++i) {
      const double u = static_cast<double>(i) / static_cast<double>(count - 1);
      double value = logarithmic ? from * std::pow(to / from, u) : from + (to - from) * u;
      if (i == count - 1) value = to;
      // a grid shows round numbers: 0.3, not 0.30000000000000004
      a.values.push_back(std::stod(text("%.14g", value)));
    }
  }

  // uniform: [low, high], log_uniform: [low, high], normal: [mean, sd], search: [low, high]
  void readPair(Section& in, const std::string& kind, StudyAxis& a) {
    const Eigen::Vector2d pair = in.numbers<2>(kind, Range::kAny);
    a.low = pair[0];
    a.high = pair[1];
    if (kind == "uniform") a.kind = StudyAxis::Kind::kUniform;
    if (kind == "log_uniform") a.kind = StudyAxis::Kind::kLogUniform;
    if (kind == "normal") a.kind = StudyAxis::Kind::kNormal;
    if (kind == "search") {
      a.kind = StudyAxis::Kind::kSearch;
      a.logarithmic = in.choice("spacing", {"linear", "log"}, "linear") == "log";
    }
    const bool bounds = kind != "normal";
    if (bounds && !(a.low < a.high)) {
      in.refuse(in.at(kind), flowText(in.required(kind, "")), "give [low, high] with low < high");
    }
    if (!bounds && a.high < 0.0) {
      in.refuse(in.at(kind) + "[1]", a.high, "give a standard deviation >= 0");
    }
    if ((kind == "log_uniform" || a.logarithmic) && a.low <= 0.0) {
      in.refuse(in.at(kind) + "[0]", a.low, "logarithmic spacing needs bounds > 0");
    }
    if (bounds) checkScaled(in, a, a.low);
  }

  void checkScaled(const Section& in, const StudyAxis& a, double min) const {
    for (const StudyAxis::Target& target : a.targets) {
      if (target.power != 0.0 && min <= 0.0) in.refuse(in.at(""), min, "factors must be > 0");
    }
  }

  void readSearch() {
    const bool searched = std::any_of(study_.axes.begin(), study_.axes.end(), [](const auto& a) {
      return a.kind == StudyAxis::Kind::kSearch;
    });
    if (!in_.optional("search")) {
      if (searched) in_.refuse("search", "missing", "an axis is searched: give the outcome");
      return;
    }
    if (!searched) in_.refuse("search", "given", "needs an axis with search: [low, high]");
    StudySearch& search = study_.search;
    Section in = in_.section("search");
    search.maximise = in.has("maximise");
    if (search.maximise == in.has("minimise")) {
      in.refuse(in.at("minimise"), search.maximise ? "given with maximise" : "missing",
                "give minimise or maximise with the name of an outcome");
    }
    const std::string key = search.maximise ? "maximise" : "minimise";
    search.outcome = in.text(key, "give the name of an outcome");
    const auto& names = outcomeNames(study_.job.kind);
    if (search.outcome == "modes" ||
        std::find(names.begin(), names.end(), search.outcome) == names.end()) {
      in.refuse(in.at(key), search.outcome, "no number of this job's, see docs/how_to/studies.md");
    }
    search.otherwise = in.number("otherwise", Range::kAny);
    search.tolerance = in.number("tolerance", Range::kPositive, search.tolerance);
    if (search.tolerance >= 1.0) {
      in.refuse(in.at("tolerance"), search.tolerance, "give a part of the ranges, below 1");
    }
    std::vector<Section> steps = in.sections("steps");
    if (steps.empty()) {
      in.refuse(in.at("steps"), "empty", "give a list of {algorithm, evaluations}");
    }
    const std::vector<std::string> known = {"direct", "crs2",   "isres",  "esch",
                                            "sbplx",  "cobyla", "bobyqa", "nelder_mead"};
    for (Section& step : steps) {
      StudySearch::Step s;
      s.algorithm = step.choice("algorithm", known);
      s.evaluations = static_cast<int>(step.integer("evaluations", 1, 1000000));
      step.finish();
      search.steps.push_back(s);
    }
    in.finish();
    // points are compared with one another: by the same draws
    study_.paired = true;
  }

  void readOutcomes() {
    const auto& names = outcomeNames(study_.job.kind);
    if (!in_.optional("outcomes")) {
      study_.outcomes = names;
      return;
    }
    const YAML::Node node = in_.required("outcomes", "");
    if (!node.IsSequence()) in_.refuse("outcomes", shown(node), "give a list of names");
    for (std::size_t i = 0; i < node.size(); ++i) {
      const std::string where = "outcomes[" + std::to_string(i) + "]";
      const std::string name = node[i].IsScalar() ? node[i].Scalar() : "";
      if (std::find(names.begin(), names.end(), name) == names.end()) {
        std::string known;
        for (const std::string& n : names) known += (known.empty() ? "" : ", ") + n;
        in_.refuse(where, shown(node[i]), "unknown outcome, known for this job: " + known);
      }
      if (std::count(study_.outcomes.begin(), study_.outcomes.end(), name) != 0) {
        in_.refuse(where, name, "named twice, keep one of them");
      }
      study_.outcomes.push_back(name);
    }
  }

  void readEnough() {
    if (!in_.optional("enough")) return;
    if (!study_.search.outcome.empty()) {
      in_.refuse("enough", "given with search", "a search ends by its steps, drop it");
    }
    Section in = in_.section("enough");
    StudyEnough& enough = study_.enough;
    enough.min_runs = in.integer("least", 1, kMaxRuns, enough.min_runs);
    enough.half_width = in.number("half_width", Range::kPositive, enough.half_width);
    if (enough.half_width >= 0.5) {
      in.refuse(in.at("half_width"), enough.half_width, "give a share below 0.5");
    }
    enough.failed = in.number("failed", Range::kPositive, enough.failed);
    in.finish();
  }

  std::string path_;
  fs::path folder_;
  Section in_;
  Study study_;
};

}  // namespace

Study loadStudy(const std::string& path, const std::vector<std::string>& overrides) {
  YAML::Node root = yaml::loadYaml(yaml::fileText(path, "study"), path, yaml::FileKind::kStudy);
  if (!root.IsMap()) {
    yaml::refuse(path, "file", shown(root), "give a mapping of keys, see docs/how_to/studies.md");
  }
  for (const std::string& text : overrides) root.reset(yaml::withOverride(root, text));
  Study study = Reader(root, path).read();
  // comments and layout decide nothing
  std::string all = YAML::Dump(root);
  for (std::size_t i = 0; i < study.texts.size(); ++i) {
    all += "\n" + YAML::Dump(yaml::loadYaml(study.texts[i], study.scenarios[i]));
  }
  if (study.mismatch) all += "\n" + YAML::Dump(YAML::Load(study.mismatch_text));
  study.digest = crcText(all);
  return study;
}

}  // namespace assembly_cell
