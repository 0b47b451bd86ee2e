// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/base/bag.h"

#include <stdlib.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <iterator>

#include "assembly_cell/base/input_error.h"

namespace assembly_cell {
namespace {

std::string inQuotes(const std::string& text) {
  std::string out = "'";
  for (const char c : text) out += c == '\'' ? std::string("'\\''") : std::string(1, c);
  return out + "'";
}

}  // namespace

std::string textFromBag(const std::string& what, const std::string& path,
                        const std::string& option) {
  namespace fs = std::filesystem;
  if (!fs::is_regular_file(path)) {
    throw InputError(path + ": no " + what + " read: there is no such file");
  }
  std::string file = (fs::temp_directory_path() / "from_bag_XXXXXX").string();
  const int opened = mkstemp(file.data());
  if (opened < 0) throw InputError(file + ": can't be written: free space in the temporary folder");
  close(opened);

  // its output into the file, its complaint through the pipe
  const fs::path script = fs::read_symlink("/proc/self/exe").parent_path() / "from_bag.py";
  std::string command = inQuotes(script.string()) + " " + what + " " + inQuotes(path);
  if (!option.empty()) command += " " + inQuotes(option);
  FILE* pipe = popen((command + " 2>&1 >" + inQuotes(file)).c_str(), "r");
  std::string complaint;
  std::array<char, 512> buffer{};
  while (pipe && fgets(buffer.data(), buffer.size(), pipe)) complaint += buffer.data();
  const int status = pipe ? pclose(pipe) : -1;
  std::ifstream in(file);
  std::string text(std::istreambuf_iterator<char>(in), {});
  fs::remove(file);
  if (status != 0) {
    // the last line says why
    while (!complaint.empty() && complaint.back() == '\n') complaint.pop_back();
    complaint.erase(0, complaint.rfind('\n') + 1);
    throw InputError(complaint.empty() ? path + ": can't be read: give a bag" : complaint);
  }
  return text;
}

}  // namespace assembly_cell
