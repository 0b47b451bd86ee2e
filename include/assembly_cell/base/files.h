// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <cstdio>
#include <string>
#include <vector>

namespace assembly_cell {

/// A file that appears under its name only when it's complete. A link keeps pointing to its file; a
/// device or pipe is written as it is. Throws InputError "<what>: cannot be written (why),
/// <remedy>".
class NewFile {
 public:
  NewFile(const std::string& path, std::string what, std::string remedy);
  ~NewFile();
  NewFile(const NewFile&) = delete;
  NewFile& operator=(const NewFile&) = delete;

  void write(const std::string& text);
  void finish();

 private:
  [[noreturn]] void fail(const char* how) const;

  std::string path_, written_, what_, remedy_;
  std::FILE* file_ = nullptr;
};

/// Temporary file, fsync, rename, fsync of the folder: a reader sees the old content or the new
/// one. Links, devices and pipes as for NewFile. Throws InputError beginning with `where`.
void writeFileAtomically(const std::string& path, const std::string& content,
                         const std::string& where);

/// Could a file be written there? Leaves nothing behind. Throws InputError beginning with `where`.
void checkWritable(const std::string& path, const std::string& where);

/// The package's folder for data: ~/.ros/assembly_cell, or below ROS_HOME where that is set. Throws
/// InputError beginning with `where` when neither HOME nor ROS_HOME is.
std::string dataFolder(const std::string& where);

/// Writes all bytes into an open file, also when signals arrive; false (errno says why) when they
/// can't be written.
bool writeAll(int file, const std::string& bytes);

/// What the script from_bag.py, which stands beside the running tool, takes out of a bag: the core
/// knows no ROS. what: observations, locus (samples as CSV) or wrench, topics as the script takes
/// them; empty ones: the only ones. notes: gets the script's lines about what it read. Throws
/// InputError with the script's line.
std::string textFromBag(const std::string& what, const std::string& path,
                        const std::vector<std::string>& topics = {},
                        std::vector<std::string>* notes = nullptr);

}  // namespace assembly_cell
