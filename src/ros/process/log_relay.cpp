// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/ros/process/log_relay.h"

#include <fcntl.h>
#include <poll.h>
#include <sys/ioctl.h>
#include <unistd.h>
#include <ext/stdio_sync_filebuf.h>

#include <array>
#include <atomic>
#include <cerrno>
#include <chrono>
#include <cstdio>
#include <exception>
#include <iostream>
#include <string>
#include <thread>

namespace assembly_cell::ros_bridge {

namespace {

constexpr std::chrono::milliseconds kDrain{500};
constexpr std::chrono::milliseconds kDrainCheck{1};

void waitUntil(int fd, short events) {
  pollfd waiting{fd, events, 0};
  poll(&waiting, 1, -1);
}

// One of both streams. Never destroyed: its thread may wait for the terminal for ever.
class Stream {
 public:
  Stream(std::FILE*& variable, std::ostream& stream)
      : variable_(variable), stream_(stream), direct_(variable), direct_buffer_(stream.rdbuf()) {
    if (pipe2(pipe_, O_CLOEXEC) != 0) return;
    fcntl(pipe_[1], F_SETFL, O_NONBLOCK);
    relay_ = fopencookie(this, "w", {nullptr, &Stream::put, nullptr, nullptr});
    if (relay_ == nullptr) return;
    setvbuf(relay_, nullptr, _IOLBF, 0);
    relay_buffer_ = new __gnu_cxx::stdio_sync_filebuf<char>(relay_);
    std::thread([this] { forward(); }).detach();
  }

  void begin() {
    if (relay_buffer_ == nullptr) return;
    std::fflush(direct_);
    variable_ = relay_;
    stream_.rdbuf(relay_buffer_);
  }

  // At the end of the process. A terminal that doesn't read would block the relay.
  void end(std::chrono::steady_clock::time_point deadline) {
    if (relay_buffer_ == nullptr) return;
    std::fflush(relay_);
    while (!isDrained()) {
      if (std::chrono::steady_clock::now() > deadline) return;
      std::this_thread::sleep_for(kDrainCheck);
    }
    variable_ = direct_;
    stream_.rdbuf(direct_buffer_);
  }

 private:
  // Under the lock of relay_; a line at a time, of which up to PIPE_BUF bytes are written or none.
  static ssize_t put(void* cookie, const char* data, std::size_t size) {
    Stream& stream = *static_cast<Stream*>(cookie);
    if (stream.lost_ > 0) {
      const std::string note = "... " + std::to_string(stream.lost_) +
                               " lines lost here: the terminal, or what reads this, was stopped\n";
      if (write(stream.pipe_[1], note.data(), note.size()) > 0) stream.lost_ = 0;
    }
    if (stream.lost_ > 0 || write(stream.pipe_[1], data, size) < 0) ++stream.lost_;
    return static_cast<ssize_t>(size);
  }

  bool isDrained() const {
    int waiting = 0;
    return ioctl(pipe_[0], FIONREAD, &waiting) == 0 && waiting == 0 && !writing_;
  }

  void forward() {
    std::array<char, 4096> buffer{};
    while (true) {
      waitUntil(pipe_[0], POLLIN);
      writing_ = true;
      const ssize_t size = read(pipe_[0], buffer.data(), buffer.size());
      for (ssize_t done = 0; done < size;) {
        const auto rest = static_cast<std::size_t>(size - done);
        const ssize_t n = write(fileno(direct_), buffer.data() + done, rest);
        if (n >= 0) done += n;
        if (n >= 0 || errno == EINTR) continue;
        if (errno != EAGAIN) break;
        waitUntil(fileno(direct_), POLLOUT);
      }
      writing_ = false;
    }
  }

  std::FILE*& variable_;
  std::ostream& stream_;
  std::FILE* const direct_;
  std::streambuf* const direct_buffer_;
  std::FILE* relay_ = nullptr;
  std::streambuf* relay_buffer_ = nullptr;
  int pipe_[2] = {-1, -1};
  std::atomic<bool> writing_{false};
  std::size_t lost_ = 0;  // lines
};

struct Streams {
  Stream out{stdout, std::cout}, error{stderr, std::cerr};

  void end() {
    const auto deadline = std::chrono::steady_clock::now() + kDrain;
    out.end(deadline);
    error.end(deadline);
  }
};

Streams& streams() {
  static auto* const both = new Streams;
  return *both;
}

std::terminate_handler default_handler = nullptr;

}  // namespace

LogRelay::LogRelay() {
  streams().out.begin();
  streams().error.begin();
  default_handler = std::set_terminate([] {
    streams().end();
    default_handler();
  });
}

LogRelay::~LogRelay() {
  std::set_terminate(default_handler);
  streams().end();
}

}  // namespace assembly_cell::ros_bridge
