// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
// Closed forms of the way into the hole, from a flat YAML file.

#include <algorithm>
#include <iostream>
#include <iterator>
#include <string>

#include "assembly_cell/base/input_error.h"
#include "assembly_cell/base/options.h"
#include "assembly_cell/insertion/forms.h"
#include "closed_forms/program.h"

namespace {

using namespace assembly_cell;

constexpr const char* kHelp =
    R"(Usage: insertion FORM PARAMETERS.yaml [options]

Evaluates a closed form of a round peg's way into its hole, in the plane of its tilt, and prints the result as YAML.
PARAMETERS.yaml is a flat mapping of numbers [m] [rad] [N] [N m]. docs/theory/insertion.md derives the equations.

FORM         parameters -> results
  two_point  peg_radius hole_radius tilt -> depth (along the side, where the peg touches both sides) lowest wall_contact
  tilt       peg_radius hole_radius depth -> tilt (that two-point contact allows)
  wedging    peg_radius hole_radius friction -> depth (down to which a peg can be wedged) tilt (from which on)
  jamming    peg_radius depth friction F_x F_z M -> lambda lateral moment slides margin
  diagram    peg_radius depth friction -> lambda, and lateral moment of the four corners
  rest       peg_radius hole_radius tilt friction F_x F_z M -> rests margin (of that very contact, exact at any tilt)
  chamfer    peg_radius hole_radius hole_chamfer peg_chamfer slope friction -> capture slides force_ratio
  holder     K_x K_theta L_g x turn -> F_x M
F_z points into the hole, x to the right, M is anticlockwise with z up; all at the centre of the peg's base.

  --sweep KEY=VALUES  repeat for these values of one parameter, which the file may leave out; results become lists
                      VALUES: a list 1,2,5 or FIRST:LAST:COUNT
  --output FILE.csv   the lists as CSV
  --help              print this

An undefined result inside valid input is null (an empty cell in CSV).
Exit code: 0 ok, 2 bad input.

Example: insertion two_point fit.yaml --sweep tilt=0.001:0.05:50 --output depth.csv
)";

int run(const Names& arguments) {
  std::string form, file, output;
  Sweep sweep;
  OptionParser parser(kHelp);
  parser.file("form", form, false);
  parser.file("file", file, false);
  parser.text("--output", output);
  addSweep(parser, sweep);
  if (!parser.parse(arguments)) return 0;
  if (form.empty()) throw InputError("FORM: value missing: see --help");
  const ClosedForm* model = insertionForm(form);
  if (!model)
    throw InputError("FORM: value " + form + ": unknown: insertion --help lists the forms");
  if (file.empty()) throw InputError("PARAMETERS.yaml: value missing: see --help");

  Parameters parameters(file);
  Columns results, columns;
  if (sweep.key.empty()) {
    results = evaluate(*model, parameters.read(*model));
    std::copy_if(results.begin(), results.end(), std::back_inserter(columns),
                 [](const Column& result) { return result.list; });
  } else {
    evaluate(*model, parameters, sweep, results, columns);
  }
  if (!output.empty() && columns.empty()) {
    throw InputError("--output: value " + output + ": nothing to list, add --sweep");
  }
  if (!output.empty()) writeOutput(output, csvOf(columns));
  std::cout << yamlOf(results);
  return 0;
}

}  // namespace

int main(int argc, char** argv) { return runTool("insertion", argc, argv, run); }
