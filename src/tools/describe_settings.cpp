// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
// Writes tables and comments of settings, as declared in the code, into pages and parameter files.

#include <fstream>
#include <iostream>
#include <sstream>
#include <string>
#include <vector>

#include "assembly_cell/align/parameters.h"
#include "assembly_cell/arm/arm_settings.h"
#include "assembly_cell/base/fields.h"
#include "assembly_cell/base/files.h"
#include "assembly_cell/base/input_error.h"
#include "assembly_cell/base/options.h"
#include "assembly_cell/scene/scenario.h"
#include "assembly_cell/study/study.h"

namespace {

using namespace assembly_cell;

constexpr const char* kHelp =
    R"(Usage: describe_settings FILE... [options]

Writes the settings that the code declares into pages (.md: a table) and parameter files (.yaml: keys with defaults and
comments), between the lines "settings NAME" and "end of settings" in a comment. NAME: align, arm_bridge (as parameters
of a node), scenario, study.

  --check               write nothing: refuse a file that differs from the code
  --help                print this

Exit code: 0 ok, 1 a file differs (--check), 2 bad input.

Example: describe_settings docs/reference/nodes/assembly_supervisor.md config/supervisor.yaml
)";

template <class Settings>
std::string describe(bool parameters, bool markdown) {
  Settings settings;
  const FieldList list = fieldsOf(settings);
  return markdown ? fieldTable(list, parameters) : commentedParameters(list);
}

std::string describe(const std::string& name, bool markdown, const std::string& where) {
  if (name == "align") return describe<AlignParameters>(true, markdown);
  if (name == "arm_bridge") return describe<BridgeSettings>(true, markdown);
  if (name == "scenario") return describe<Scenario>(false, markdown);
  if (name == "study") return describe<StudyJob>(false, markdown);
  throw InputError(where + ": settings " + name +
                   ": unknown, known are align, arm_bridge, scenario, study");
}

// What a line's comment says: "settings align" of "<!-- settings align -->" or "# settings align".
std::string comment(const std::string& line) {
  for (const std::string& mark : {std::string("<!-- "), std::string("# ")}) {
    if (line.compare(0, mark.size(), mark) != 0) continue;
    const std::size_t end = line.find(" -->");
    return line.substr(mark.size(), end == std::string::npos ? end : end - mark.size());
  }
  return {};
}

std::string rewritten(const std::string& text, const std::string& path) {
  const bool markdown = path.size() > 3 && path.compare(path.size() - 3, 3, ".md") == 0;
  const std::string begin = "settings ";
  std::istringstream in(text);
  std::string out, line;
  bool inside = false;
  while (std::getline(in, line)) {
    const std::string what = comment(line);
    if (inside && what == "end of settings") inside = false;
    if (inside) continue;
    out += line + "\n";
    if (what.compare(0, begin.size(), begin) != 0) continue;
    inside = true;
    out += describe(what.substr(begin.size()), markdown, path);
  }
  if (inside) throw InputError(path + ": settings: no end, add a comment \"end of settings\"");
  return out;
}

std::string contentOf(const std::string& path) {
  std::ifstream in(path, std::ios::binary);
  std::ostringstream text;
  text << in.rdbuf();
  if (!in) throw InputError(path + ": can't be read: give a page or a parameter file");
  return text.str();
}

int run(const std::vector<std::string>& arguments) {
  std::vector<std::string> files;
  bool check = false;
  OptionParser parser(kHelp);
  parser.files("file", files);
  parser.flag("--check", check);
  if (!parser.parse(arguments)) return 0;
  int code = 0;
  for (const std::string& path : files) {
    const std::string before = contentOf(path), after = rewritten(before, path);
    if (before == after) continue;
    if (!check) {
      writeFileAtomically(path, after, path);
      continue;
    }
    code = 1;
    std::cerr << path << " differs from the code: run describe_settings " << path << "\n";
  }
  return code;
}

}  // namespace

int main(int argc, char** argv) {
  return assembly_cell::runTool("describe_settings", argc, argv, run);
}
