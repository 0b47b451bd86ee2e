// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/base/files.h"

#include <fcntl.h>
#include <stdlib.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <iostream>
#include <iterator>
#include <sstream>
#include <system_error>
#include <utility>

#include "assembly_cell/base/input_error.h"

namespace assembly_cell {

namespace {

// A new file of our own. What stands under the name, left by an earlier process or put there by
// another program (a link to a file of ours), is removed, never written through.
int openTemporary(const std::string& path) {
  constexpr int kFlags = O_WRONLY | O_CREAT | O_EXCL | O_NOFOLLOW | O_CLOEXEC;
  int file = ::open(path.c_str(), kFlags, 0644);
  if (file < 0 && errno == EEXIST && ::unlink(path.c_str()) == 0) {
    file = ::open(path.c_str(), kFlags, 0644);
  }
  return file;
}

// Where a file is written to.
struct Place {
  std::string path;       // behind links, also one to a file that isn't there yet
  bool in_place = false;  // a device, a pipe or what a standard stream goes to
  int stream = -1;        // that stream
};

Place placeOf(const std::string& path) {
  namespace fs = std::filesystem;
  struct stat file {};
  Place place{path, false, -1};
  if (::stat(path.c_str(), &file) == 0) {
    for (const int stream : {STDOUT_FILENO, STDERR_FILENO}) {
      struct stat standard {};
      if (::fstat(stream, &standard) != 0 || standard.st_dev != file.st_dev ||
          standard.st_ino != file.st_ino) {
        continue;
      }
      return {path, true, stream};
    }
    if (S_ISDIR(file.st_mode)) return place;
    if (!S_ISREG(file.st_mode)) return {path, true, -1};
  }
  std::error_code none;
  constexpr int kMostLinks = 40;  // the kernel's
  fs::path at = path;
  for (int i = 0; i < kMostLinks && fs::is_symlink(at, none); ++i) {
    at = at.parent_path() / fs::read_symlink(at, none);
  }
  place.path = at.string();
  return place;
}

// the stream itself knows how far it has been written
int openInPlace(const Place& place) {
  if (place.stream < 0) return ::open(place.path.c_str(), O_WRONLY | O_CLOEXEC);
  std::cout.flush();
  return ::fcntl(place.stream, F_DUPFD_CLOEXEC, 0);
}

void syncFolderOf(const std::string& path) {
  const std::size_t slash = path.rfind('/');
  const std::string folder = slash == std::string::npos ? "." : path.substr(0, slash + 1);
  const int directory = ::open(folder.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC);
  if (directory < 0) return;
  ::fsync(directory);
  ::close(directory);
}

std::string temporaryOf(const Place& place) {
  return place.path + ".tmp" + std::to_string(::getpid());
}

[[noreturn]] void failToWrite(const std::string& where, const char* what) {
  throw InputError(where + " can't be written (" + what + ": " + std::strerror(errno) +
                   "): give a writable folder");
}

}  // namespace

std::string dataFolder(const std::string& where) {
  namespace fs = std::filesystem;
  const char* ros_home = std::getenv("ROS_HOME");
  if (ros_home != nullptr && *ros_home != '\0')
    return (fs::path(ros_home) / "assembly_cell").string();
  const char* home = std::getenv("HOME");
  if (home == nullptr || *home == '\0') {
    throw InputError(where + ": neither ROS_HOME nor HOME is set: set one of them");
  }
  return (fs::path(home) / ".ros/assembly_cell").string();
}

bool writeAll(int file, const std::string& bytes) {
  std::size_t done = 0;
  while (done < bytes.size()) {
    const ssize_t n = ::write(file, bytes.data() + done, bytes.size() - done);
    if (n < 0 && errno == EINTR) continue;
    if (n < 0) return false;
    done += static_cast<std::size_t>(n);
  }
  return true;
}

NewFile::NewFile(const std::string& path, std::string what, std::string remedy)
    : path_(path), what_(std::move(what)), remedy_(std::move(remedy)) {
  if (std::filesystem::is_directory(path)) {
    errno = EISDIR;
    fail("cannot be written");
  }
  const Place place = placeOf(path);
  path_ = place.path;
  written_ = place.in_place ? path_ : path_ + ".part" + std::to_string(::getpid());
  const int opened = place.in_place ? openInPlace(place) : openTemporary(written_);
  file_ = opened < 0 ? nullptr : ::fdopen(opened, "w");
  if (file_ == nullptr) fail("cannot be written");
}

NewFile::~NewFile() {
  if (file_ == nullptr) return;
  std::fclose(file_);
  if (written_ != path_) ::unlink(written_.c_str());
}

void NewFile::write(const std::string& text) {
  if (std::fwrite(text.data(), 1, text.size(), file_) != text.size()) fail("writing failed");
}

void NewFile::finish() {
  if (std::fflush(file_) != 0) fail("writing failed");
  if (written_ == path_) return;
  if (::fsync(::fileno(file_)) != 0 || std::rename(written_.c_str(), path_.c_str()) != 0)
    fail("writing failed");
  std::fclose(std::exchange(file_, nullptr));
}

void NewFile::fail(const char* how) const {
  throw InputError(what_ + ": " + how + " (" + std::strerror(errno) + "), " + remedy_);
}

void checkWritable(const std::string& path, const std::string& where) {
  const Place place = placeOf(path);
  if (std::filesystem::is_directory(place.path)) {
    errno = EISDIR;
    failToWrite(where, "open");
  }
  const std::string temporary = temporaryOf(place);
  const int file = place.in_place ? openInPlace(place) : openTemporary(temporary);
  if (file < 0) failToWrite(where, "open");
  ::close(file);
  if (!place.in_place) ::unlink(temporary.c_str());
}

void writeFileAtomically(const std::string& path, const std::string& content,
                         const std::string& where) {
  const Place place = placeOf(path);
  const std::string temporary = temporaryOf(place);
  const auto fail = [&](const char* what) {
    const int error = errno;
    if (!place.in_place) ::unlink(temporary.c_str());
    errno = error;
    failToWrite(where, what);
  };
  const int file = place.in_place ? openInPlace(place) : openTemporary(temporary);
  if (file < 0) fail("open");
  if (!writeAll(file, content)) {
    const int error = errno;
    ::close(file);
    errno = error;
    fail("write");
  }
  const bool synced = place.in_place || ::fsync(file) == 0;
  const bool closed = ::close(file) == 0;
  if (!synced || !closed) fail("fsync");
  if (place.in_place) return;
  if (std::rename(temporary.c_str(), place.path.c_str()) != 0) fail("rename");
  syncFolderOf(place.path);
}

namespace {

std::string inQuotes(const std::string& text) {
  std::string out = "'";
  for (const char c : text) out += c == '\'' ? std::string("'\\''") : std::string(1, c);
  return out + "'";
}

}  // namespace

std::string textFromBag(const std::string& what, const std::string& path,
                        const std::vector<std::string>& topics, std::vector<std::string>* notes) {
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
  std::size_t given = topics.size();
  while (given > 0 && topics[given - 1].empty()) --given;
  for (std::size_t k = 0; k < given; ++k) command += " " + inQuotes(topics[k]);
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
  std::istringstream lines(complaint);
  for (std::string line; notes != nullptr && std::getline(lines, line);) notes->push_back(line);
  return text;
}

}  // namespace assembly_cell
