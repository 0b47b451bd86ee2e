// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/calibration/reference/reference.h"

#include "assembly_cell/base/input_error.h"
#include "assembly_cell/base/options.h"
#include "assembly_cell/calibration/common/store.h"
#include "commands.h"
#include "print.h"

namespace assembly_cell {

namespace {

constexpr const char* kHelp =
    R"(Usage: calibrate reference RUN... [--holdout RUN] [options]

Map of a six-axis sensor's raw channels to wrenches, from recordings in series with a reference sensor under any loads.
RUN: columns t, ch1 ... chN (N >= 6), fx fy fz tx ty tz of the reference [N, N m] by a header, or in this order without
one; further columns are passed over. Comma, tab or blanks between them. t in s, ms, us or ns. Begin
each run unloaded. Bursts are averaged; the lag between the two sensors, and each run's tare, offset and drift are found.

  --holdout RUN         validate the model with this run, which the map doesn't rest on (default: by each RUN in turn)
  --model M             linear, squares (and each channel's square), quadratic (and all products); default: which predicts
                        the run left out best
  --lag S               of the raw channels after the reference [s] (default: estimated)
  --time-unit U         of t: s, ms, us or ns (default auto: by the header, by magnitude since 1970, or by spacing)
  --channels N          raw channels of a file without a header (default 6)
  --save FOLDER         writes FOLDER/SENSOR/ID.yaml as the other calibrations, volts being the raw unit
  --sensor SENSOR       (default sensor)
  --serial NUMBER       the sensor's serial number in it (default unknown)
  --id ID               (default: date and time)
  --help                print this

Exit code: 0 ok, 1 refused by a check, 2 bad input.

Example: calibrate reference run1.txt run2.txt --holdout run3.txt --save calibrations
)";

std::string errorText(const ReferenceError& e) {
  return "{force: " + yamlNumber(e.force) + ", torque: " + yamlNumber(e.torque) +
         ", axes: " + list(e.axis) + "}";
}

void printRun(const ReferenceRunResult& run) {
  std::cout << "{run: " << yamlQuoted(run.name) << ", time_unit: " << yamlQuoted(run.time_unit)
            << ", samples: " << run.samples << ", bursts: " << run.bursts
            << ", tared: " << (run.tared ? "true" : "false") << ", error: " << errorText(run.error)
            << ",\n    raw_tare: " << list(run.raw_tare)
            << ", wrench_tare: " << list(run.wrench_tare) << ",\n    offset: " << list(run.offset)
            << ", offset_sd: " << list(run.offset_sd) << ",\n    drift: " << list(run.drift)
            << ", drift_sd: " << list(run.drift_sd) << "}\n";
}

void print(const ReferenceSolution& s) {
  line("accepted", s.accepted ? "true" : "false");
  line("model", toString(s.model));
  line("lag", yamlNumber(s.lag));
  line("lag_sd", yamlNumber(s.lag_sd));
  line("cells", std::to_string(s.cells));
  line("coefficients", std::to_string(s.coefficients));
  line("residual_sd", list(s.residual_sd));
  line("hold_out_rms", errorText(s.left_out[static_cast<std::size_t>(s.model)]));
  line("plain_hold_out_rms", errorText(s.plain));
  std::cout << "models:\n";
  for (const ReferenceModel model : kReferenceModels) {
    std::cout << "  " << toString(model) << ": "
              << errorText(s.left_out[static_cast<std::size_t>(model)]) << "\n";
  }
  std::cout << "runs:\n";
  for (const ReferenceRunResult& run : s.runs) {
    std::cout << "  - ";
    printRun(run);
  }
  std::cout << "hold_out: ";
  if (s.hold_out) printRun(*s.hold_out);
  if (!s.hold_out) std::cout << "null\n";
  printMatrix("matrix", s.map);
  printMatrix("products", s.products);
  printMatrix("sd",
              s.covariance.diagonal().cwiseSqrt().reshaped(s.covariance.rows() / 6, 6).transpose());
  printGates(s.gates);
}

}  // namespace

int reference(const std::vector<std::string>& arguments) {
  std::vector<std::string> files;
  std::string hold_out, store, sensor = "sensor", serial = "unknown", id;
  int channels = 6;
  TimeUnit unit = TimeUnit::kFound;
  ReferenceOptions options;
  OptionParser parser(kHelp);
  parser.files("RUN", files);
  parser.text("--holdout", hold_out);
  parser.choice("--model", options.model,
                {{"linear", ReferenceModel::kLinear},
                 {"squares", ReferenceModel::kSquares},
                 {"quadratic", ReferenceModel::kQuadratic}});
  parser.number("--lag", options.lag, -0.1, 0.1);
  parser.choice("--time-unit", unit, kTimeUnitChoices);
  parser.integer("--channels", channels, 6, 100);
  parser.text("--save", store);
  parser.text("--sensor", sensor);
  parser.text("--serial", serial);
  parser.text("--id", id);
  if (!parser.parse(arguments)) return 0;
  parser.onlyWith("--save", {"--sensor", "--serial", "--id"});
  std::vector<ReferenceRun> runs;
  for (const std::string& file : files) {
    if (file == hold_out) throw InputError("--holdout: value " + file + ": is a RUN as well");
    runs.push_back(readReferenceRun(file, channels, unit));
  }
  std::optional<ReferenceRun> held;
  if (!hold_out.empty()) held = readReferenceRun(hold_out, channels, unit);
  const ReferenceSolution solution = solveReference(runs, held ? &*held : nullptr, options);
  print(solution);
  if (!solution.accepted) {
    std::cerr << "calibrate: " << gateTexts(solution.gates, Verdict::kRefuse) << "\n";
    return 1;
  }
  if (store.empty()) return 0;
  Calibration calibration = referenceCalibration(solution, runs);
  calibration.id = id.empty() ? newCalibrationId(storedCalibrations(store, sensor)) : id;
  calibration.serial_number = serial;
  calibration.date = calibrationDate();
  for (const std::string& taken : storedCalibrations(store, sensor)) {
    if (taken == calibration.id) throw InputError("--id: value " + taken + ": id is taken");
  }
  makeCalibrationFolder(store, sensor);
  const std::string path = calibrationPath(store, sensor, calibration.id);
  saveCalibration(calibration, path);
  line("saved", yamlQuoted(path));
  return 0;
}

}  // namespace assembly_cell
