// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include <algorithm>
#include <cmath>

#include "assembly_cell/base/yaml_text.h"
#include "assembly_cell/study/ledger.h"
#include "assembly_cell/study/study.h"

namespace assembly_cell {
namespace {

// one step of the SplitMix64 generator: any two inputs give unrelated outputs
std::uint64_t mix(std::uint64_t x) {
  x += 0x9e3779b97f4a7c15ull;
  x = (x ^ (x >> 30)) * 0xbf58476d1ce4e5b9ull;
  x = (x ^ (x >> 27)) * 0x94d049bb133111ebull;
  return x ^ (x >> 31);
}

// number `index` of a stream, uniform in (0, 1)
double uniform(std::uint64_t stream, std::uint64_t index) {
  return (static_cast<double>(mix(stream + mix(index)) >> 12) + 0.5) * 0x1p-52;
}

double draw(const StudyAxis& a, std::uint64_t seed, std::uint64_t index) {
  const std::uint64_t stream = mix(mix(seed) ^ a.stream);
  const double u = uniform(stream, 2 * index);
  switch (a.kind) {
    case StudyAxis::Kind::kUniform:
      return a.low + (a.high - a.low) * u;
    case StudyAxis::Kind::kLogUniform:
      return std::min(a.high, std::max(a.low, a.low * std::pow(a.high / a.low, u)));
    default:  // normal, by Box and Muller
      return a.low + a.high * std::sqrt(-2.0 * std::log(u)) *
                         std::cos(2.0 * M_PI * uniform(stream, 2 * index + 1));
  }
}

}  // namespace

double searchValue(const StudyAxis& a, double unit) {
  if (!a.logarithmic) return a.low + (a.high - a.low) * unit;
  return std::min(a.high, std::max(a.low, a.low * std::pow(a.high / a.low, unit)));
}

std::int64_t runsPerPoint(const Study& study) {
  std::int64_t count = study.samples;
  for (const StudyAxis& a : study.axes) {
    if (a.grid()) count *= static_cast<std::int64_t>(a.size());
  }
  return count;
}

std::int64_t runCount(const Study& study) {
  std::int64_t points = study.search.outcome.empty() ? 1 : 0;
  for (const StudySearch::Step& step : study.search.steps) points += step.evaluations;
  return points * runsPerPoint(study);
}

StudyRun studyRun(const Study& study, const StudyTask& task) {
  // place in the grid: samples vary fastest, the first axis slowest
  std::int64_t rest = task.run % runsPerPoint(study);
  const std::int64_t sample = rest % study.samples;
  rest /= study.samples;
  std::vector<std::size_t> place(study.axes.size(), 0);
  for (std::size_t i = study.axes.size(); i-- > 0;) {
    if (!study.axes[i].grid()) continue;
    const auto size = static_cast<std::int64_t>(study.axes[i].size());
    place[i] = static_cast<std::size_t>(rest % size);
    rest /= size;
  }

  StudyRun run;
  const auto index = static_cast<std::uint64_t>(study.paired ? sample : task.run);
  // as many bits as every spreadsheet has
  run.seed = mix(mix(study.seed) + mix(index)) >> 11;

  std::size_t file = 0;
  std::vector<std::pair<StudyAxis::Target, double>> numbers;
  std::size_t searched = 0;
  for (std::size_t i = 0; i < study.axes.size(); ++i) {
    const StudyAxis& a = study.axes[i];
    if (a.kind == StudyAxis::Kind::kCases) {
      run.labels.push_back(a.labels[place[i]]);
      for (const StudySetting& s : a.cases[place[i]]) {
        run.settings.push_back(s);
        if (s.key != "scenario") continue;
        file = static_cast<std::size_t>(
            std::find(study.scenarios.begin(), study.scenarios.end(), s.value) -
            study.scenarios.begin());
      }
      continue;
    }
    double value = 0.0;
    if (a.kind == StudyAxis::Kind::kValues) {
      value = a.values[place[i]];
    } else if (a.kind == StudyAxis::Kind::kSearch) {
      value = searchValue(a, searched < task.point.size() ? task.point[searched] : 0.5);
      ++searched;
    } else {
      value = draw(a, study.seed, index);
    }
    run.labels.push_back(yamlNumber(value));
    for (const StudyAxis::Target& target : a.targets) numbers.emplace_back(target, value);
  }

  // factors multiply what the run's scenario has
  Scenario base;
  if (!numbers.empty() && file < study.bases.size()) base = study.bases[file];
  for (const auto& [target, value] : numbers) {
    double number = value;
    if (target.power != 0.0) {
      const double* there = scenarioNumber(base, target.key);
      number = *there * std::pow(value, target.power);
    }
    // YAML's null would be refused as empty
    run.settings.push_back({target.key, std::isfinite(number) ? yamlNumber(number) : "inf"});
  }
  return run;
}

}  // namespace assembly_cell
