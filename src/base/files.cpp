// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/base/files.h"

#include <fcntl.h>
#include <unistd.h>

#include <cerrno>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <system_error>
#include <utility>

#include "assembly_cell/base/input_error.h"

namespace assembly_cell {

namespace {

// A new file of our own. What stands under the name, left by an earlier process or put there by
// somebody (a link to a file of ours), is taken away, never written through.
int openTemporary(const std::string& path) {
  constexpr int kFlags = O_WRONLY | O_CREAT | O_EXCL | O_NOFOLLOW | O_CLOEXEC;
  int file = ::open(path.c_str(), kFlags, 0644);
  if (file < 0 && errno == EEXIST && ::unlink(path.c_str()) == 0) {
    file = ::open(path.c_str(), kFlags, 0644);
  }
  return file;
}

std::string temporaryOf(const std::string& path) {
  return path + ".tmp" + std::to_string(::getpid());
}

[[noreturn]] void failToWrite(const std::string& where, const char* what) {
  throw InputError(where + " can't be written (" + what + ": " + std::strerror(errno) +
                   "): give a writable folder");
}

}  // namespace

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
  namespace fs = std::filesystem;
  std::error_code none;
  const fs::file_status status = fs::status(path, none);
  if (fs::is_directory(status)) {
    errno = EISDIR;
    fail("cannot be written");
  }
  if (fs::exists(status)) path_ = fs::canonical(path, none).string();
  const bool in_place = fs::exists(status) && !fs::is_regular_file(status);
  written_ = in_place ? path_ : path_ + ".part" + std::to_string(::getpid());
  const int opened =
      in_place ? ::open(path_.c_str(), O_WRONLY | O_CLOEXEC) : openTemporary(written_);
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
  namespace fs = std::filesystem;
  std::error_code none;
  const fs::file_status status = fs::status(path, none);
  if (fs::exists(status) && !fs::is_regular_file(status)) {
    throw InputError(where + " can't be written (it is a folder or a device): name a file");
  }
  const std::string temporary = temporaryOf(path);
  const int file = openTemporary(temporary);
  if (file < 0) failToWrite(where, "open");
  ::close(file);
  ::unlink(temporary.c_str());
}

void writeFileAtomically(const std::string& path, const std::string& content,
                         const std::string& where) {
  const std::string temporary = temporaryOf(path);
  const auto fail = [&](const char* what) {
    const int error = errno;
    ::unlink(temporary.c_str());
    errno = error;
    failToWrite(where, what);
  };
  const int file = openTemporary(temporary);
  if (file < 0) fail("open");
  if (!writeAll(file, content)) {
    const int error = errno;
    ::close(file);
    errno = error;
    fail("write");
  }
  const bool synced = ::fsync(file) == 0;
  const bool closed = ::close(file) == 0;
  if (!synced || !closed) fail("fsync");
  if (std::rename(temporary.c_str(), path.c_str()) != 0) fail("rename");
  const std::size_t slash = path.rfind('/');
  const std::string folder = slash == std::string::npos ? "." : path.substr(0, slash + 1);
  const int directory = ::open(folder.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC);
  if (directory >= 0) {
    ::fsync(directory);
    ::close(directory);
  }
}

}  // namespace assembly_cell
