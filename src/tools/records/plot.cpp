// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
// Pictures, drawn by the script plot beside the tool.
#include <sys/wait.h>
#include <unistd.h>

#include <cstdlib>
#include <filesystem>

#include "assembly_cell/base/files.h"
#include "assembly_cell/base/input_error.h"
#include "commands.h"

namespace assembly_cell {
namespace {

namespace fs = std::filesystem;

constexpr const char* kPlotHelp = R"(Usage: records plot N [options]

A picture of the curve of run N: axial and lateral force, moment and tilt over the depth.

  --output PICTURE.png   where it goes (default: run_N.png)
  --store FILE           the store (default: ~/.ros/assembly_cell/records.db, or below ROS_HOME)
  --help                 print this

Example: records plot 17
)";
constexpr const char* kCompareHelp = R"(Usage: records compare N M... [options]

A picture of the curves of several runs over each other: axial and lateral force, moment and tilt over the depth.

  --output PICTURE.png   where it goes (default: runs.png)
  --store FILE           the store (default: ~/.ros/assembly_cell/records.db, or below ROS_HOME)
  --help                 print this

Example: records compare 17 23
)";

// A folder with a random name, removed with its content.
class Folder {
 public:
  Folder() : path_((fs::temp_directory_path() / "records_XXXXXX").string()) {
    if (::mkdtemp(path_.data()) == nullptr) {
      throw InputError(path_ + ": can't be made: free space in the temporary folder");
    }
  }
  ~Folder() {
    std::error_code ignored;
    fs::remove_all(path_, ignored);
  }
  Folder(const Folder&) = delete;
  Folder& operator=(const Folder&) = delete;
  std::string operator/(const std::string& name) const { return path_ + "/" + name; }

 private:
  std::string path_;
};

// Returns its exit code; what it has to report is on standard error.
int runScript(std::vector<std::string> words) {
  std::vector<char*> argv;
  for (std::string& word : words) argv.push_back(word.data());
  argv.push_back(nullptr);
  const pid_t child = ::fork();
  if (child == 0) {
    ::execv(argv[0], argv.data());
    ::_exit(127);
  }
  int status = 0;
  if (child < 0 || ::waitpid(child, &status, 0) < 0 || !WIFEXITED(status) ||
      WEXITSTATUS(status) == 127) {
    throw InputError(words[0] + ": can't be run: install the package again");
  }
  return WEXITSTATUS(status);
}

// Installed, it is beside the tool; in a build, a hidden link to it, which rosrun doesn't find.
std::string plotScript() {
  const fs::path folder = fs::read_symlink("/proc/self/exe").parent_path();
  const fs::path link = folder / ".plot";
  return (fs::exists(link) ? link : folder / "plot").string();
}

int draw(const RunStore& store, const std::vector<std::string>& numbers,
         const std::string& output) {
  checkWritable(output, "--output: value " + output);
  const Folder folder;
  std::vector<std::string> words{plotScript(), "records", output};
  for (const std::string& number : numbers) {
    const Run run = store.read(runNumber(number));
    if (run.curve.size() == 0) {
      throw InputError("run " + number + ": has no curve: give a run with an insertion");
    }
    words.push_back(folder / ("run " + number + ", " + run.result + ".csv"));
    writeFileAtomically(words.back(), curveText(run.curve), words.back());
  }
  return runScript(words);
}

}  // namespace

int plotRun(const std::vector<std::string>& arguments) {
  std::string number, output;
  OptionParser parser(kPlotHelp);
  parser.file("number of a run", number);
  parser.text("--output", output);
  StoreOption store(parser);
  if (!parser.parse(arguments)) return 0;
  if (output.empty()) output = "run_" + std::to_string(runNumber(number)) + ".png";
  return draw(store.open(), {number}, output);
}

int compareRuns(const std::vector<std::string>& arguments) {
  std::vector<std::string> numbers;
  std::string output = "runs.png";
  OptionParser parser(kCompareHelp);
  parser.files("number of a run", numbers);
  parser.text("--output", output);
  StoreOption store(parser);
  if (!parser.parse(arguments)) return 0;
  if (numbers.size() < 2) throw InputError("argument: value missing: give the numbers of two runs");
  return draw(store.open(), numbers, output);
}

}  // namespace assembly_cell
