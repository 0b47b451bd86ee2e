// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <fcntl.h>
#include <ros/ros.h>
#include <signal.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <functional>
#include <mutex>
#include <string>
#include <vector>

// What the rostests of the cell share: waiting for conditions, and programs as child processes.
namespace assembly_cell::test {

constexpr double kPatience = 60.0;  // wall clock, for a busy machine [s]

/// Waits until the condition holds; false after kPatience.
template <class Condition>
bool waitFor(const Condition& condition, double patience = kPatience) {
  const ros::WallTime end = ros::WallTime::now() + ros::WallDuration(patience);
  while (ros::ok() && ros::WallTime::now() < end) {
    if (condition()) return true;
    ros::WallDuration(0.002).sleep();
  }
  return condition();
}

inline bool has(const std::string& text, const std::string& part) {
  return text.find(part) != std::string::npos;
}

/// Keeps all messages of a topic.
template <class M>
class Record {
 public:
  Record(ros::NodeHandle& nh, const std::string& topic)
      : sub_(nh.subscribe<M>(
            topic, 1000,
            [this](const typename M::ConstPtr& message) {
              std::lock_guard<std::mutex> lock(mutex_);
              all_.push_back(message);
            },
            ros::VoidConstPtr(), ros::TransportHints().tcpNoDelay())) {}

  std::vector<typename M::ConstPtr> all() const {
    std::lock_guard<std::mutex> lock(mutex_);
    return all_;
  }
  std::size_t size() const { return all().size(); }
  typename M::ConstPtr last() const {
    std::lock_guard<std::mutex> lock(mutex_);
    return all_.empty() ? nullptr : all_.back();
  }
  void clear() {
    std::lock_guard<std::mutex> lock(mutex_);
    all_.clear();
  }
  bool connected() const { return sub_.getNumPublishers() > 0; }

 private:
  mutable std::mutex mutex_;
  std::vector<typename M::ConstPtr> all_;
  ros::Subscriber sub_;
};

/// A program of this package, or any other, as a child process with its output.
class Child {
 public:
  explicit Child(const std::vector<std::string>& command,
                 const std::vector<std::string>& environment = {}) {
    int pipe_ends[2];
    if (pipe(pipe_ends) != 0) return;
    pid_ = fork();
    if (pid_ == 0) {
      setpgid(0, 0);
      dup2(pipe_ends[1], STDOUT_FILENO);
      dup2(pipe_ends[1], STDERR_FILENO);
      close(pipe_ends[0]);
      for (const auto& entry : environment) putenv(strdup(entry.c_str()));
      std::vector<char*> arguments;
      for (const auto& word : command) arguments.push_back(const_cast<char*>(word.c_str()));
      arguments.push_back(nullptr);
      execvp(arguments[0], arguments.data());
      _exit(127);
    }
    close(pipe_ends[1]);
    output_fd_ = pipe_ends[0];
    fcntl(output_fd_, F_SETFL, O_NONBLOCK);
  }
  ~Child() {
    stop();
    if (output_fd_ >= 0) close(output_fd_);
  }
  Child(const Child&) = delete;
  Child& operator=(const Child&) = delete;

  bool running() {
    read();
    if (ended_) return false;
    int status = 0;
    if (waitpid(pid_, &status, WNOHANG) != pid_) return true;
    ended_ = true;
    exit_code_ = WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status);
    read();
    return false;
  }

  /// Exit code once it has ended; −1 (and it is killed) when it doesn't within kPatience.
  int wait(double patience = kPatience) {
    if (waitFor([this] { return !running(); }, patience)) return exit_code_;
    stop();
    return -1;
  }

  /// To the process itself.
  void signal(int number) {
    if (pid_ > 0 && running()) kill(pid_, number);
  }

  /// Ends its process group, by force after a while.
  void stop() {
    if (pid_ <= 0 || !running()) return;
    kill(pid_, SIGINT);
    if (waitFor([this] { return !running(); }, 30.0)) return;
    kill(-pid_, SIGKILL);
    waitFor([this] { return !running(); }, 10.0);
  }

  const std::string& output() const { return output_; }

  /// Lines of the output that contain a text.
  std::vector<std::string> lines(const std::string& text) const {
    std::vector<std::string> found;
    std::size_t from = 0;
    while (from < output_.size()) {
      const std::size_t to = std::min(output_.find('\n', from), output_.size());
      const std::string line = output_.substr(from, to - from);
      if (line.find(text) != std::string::npos) found.push_back(line);
      from = to + 1;
    }
    return found;
  }

 private:
  void read() {
    char buffer[4096];
    ssize_t n = 0;
    while ((n = ::read(output_fd_, buffer, sizeof buffer)) > 0) {
      output_.append(buffer, static_cast<std::size_t>(n));
    }
  }

  pid_t pid_ = -1;
  int output_fd_ = -1;
  bool ended_ = false;
  int exit_code_ = -1;
  std::string output_;
};

/// An executable of this package.
inline std::string executable(const std::string& name) {
  return std::string(ASSEMBLY_CELL_BIN_DIR) + "/" + name;
}

inline std::string sourceFile(const std::string& path) {
  return std::string(ASSEMBLY_CELL_SOURCE_DIR) + "/" + path;
}

}  // namespace assembly_cell::test
