// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <actionlib/client/simple_action_client.h>
#include <assembly_cell/CalibrateSensorsAction.h>
#include <assembly_cell/CalibrationStatus.h>
#include <gtest/gtest.h>
#include <ros/ros.h>
#include <signal.h>
#include <std_srvs/Trigger.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <fstream>
#include <iterator>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include "assembly_cell/ros/bridge/service_call.h"
#include "cell_fixture.h"
#include "temporary_folder.h"

namespace assembly_cell::ros_bridge {

using test::has;
using test::kPatience;
using test::waitFor;

inline std::string contentOf(const std::string& path) {
  std::ifstream in(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(in), {}};
}

/// A calibration_server of its own process in namespace `ns`, its services and its latched status.
class Server {
 public:
  using Client = actionlib::SimpleActionClient<CalibrateSensorsAction>;

  Server(const std::string& ns, const std::string& store) : ns_(ns), nh_(ns), store_(store) {
    subscribe();
  }
  ~Server() { end(SIGTERM); }

  void start(const std::vector<std::string>& arguments = {}) {
    {
      const std::lock_guard<std::mutex> lock(mutex_);
      status_.reset();
      started_ = ros::Time::now();
    }
    std::vector<std::string> words = {ASSEMBLY_CELL_BIN_DIR "/calibration_server", "__ns:=" + ns_,
                                      "_store:=" + store_};
    words.insert(words.end(), arguments.begin(), arguments.end());
    std::vector<char*> argv;
    for (std::string& word : words) argv.push_back(word.data());
    argv.push_back(nullptr);
    child_ = fork();
    if (child_ == 0) {
      execv(argv[0], argv.data());
      _exit(127);
    }
    // its own status and the last service it advertises
    const std::string last = nh_.resolveName("calibration_server/get_calibration");
    const auto reported = [&] { return status().has_value() || !alive(); };
    // roscpp contacts a new publisher once; at the port of one that ended it may get no answer
    for (int i = 0; i < 6 && !waitFor(reported, 10.0); ++i) subscribe();
    ASSERT_TRUE(reported());
    ASSERT_TRUE(alive()) << "the server ended";
    ASSERT_TRUE(waitFor([&] { return ros::service::exists(last, false); }));
  }

  bool alive() {
    if (child_ <= 0) return false;
    int state = 0;
    if (waitpid(child_, &state, WNOHANG) == 0) return true;
    child_ = 0;
    exit_code_ = WIFEXITED(state) ? WEXITSTATUS(state) : -1;
    return false;
  }
  void end(int signal) {
    if (child_ <= 0) return;
    kill(child_, signal);
    waitpid(child_, nullptr, 0);
    child_ = 0;
  }
  int exitCode() const { return exit_code_; }

  std::optional<CalibrationStatus> status() {
    const std::lock_guard<std::mutex> lock(mutex_);
    return status_;
  }

  /// Bad transport (a server that is gone) is success: false with an empty message.
  template <class Service>
  typename Service::Response call(const std::string& service,
                                  const typename Service::Request& request = {}) {
    Service s;
    s.request = request;
    if (!callService(nh_.resolveName("calibration_server/" + service), s)) {
      return typename Service::Response();
    }
    return s.response;
  }
  std_srvs::Trigger::Response trigger(const std::string& service) {
    return call<std_srvs::Trigger>(service);
  }

  ros::NodeHandle& nh() { return nh_; }
  std::string journal() const { return store_ + "/observations.yaml"; }
  const std::string& store() const { return store_; }

 private:
  void subscribe() {
    const boost::function<void(const CalibrationStatus::ConstPtr&)> callback =
        [this](const CalibrationStatus::ConstPtr& status) {
          const std::lock_guard<std::mutex> lock(mutex_);
          if (status->header.stamp >= started_) status_ = *status;
        };
    status_sub_.shutdown();
    status_sub_ = nh_.subscribe<CalibrationStatus>("calibration_server/status", 100, callback);
  }

  std::string ns_;
  ros::NodeHandle nh_;
  std::string store_;
  ros::Subscriber status_sub_;
  std::mutex mutex_;
  std::optional<CalibrationStatus> status_;
  ros::Time started_;  ///< older messages are of the life before
  pid_t child_ = 0;
  int exit_code_ = 0;
};

/// Complete records of a journal, seals left out.
inline std::vector<std::string> recordsOf(const std::string& path) {
  std::vector<std::string> records;
  const std::string content = contentOf(path);
  for (std::size_t begin = 0, end; (end = content.find('\n', begin)) != std::string::npos;
       begin = end + 1) {
    const std::string line = content.substr(begin, end - begin);
    if (line.rfind("- {", 0) == 0) records.push_back(line.substr(0, line.rfind("  # ")));
  }
  return records;
}

inline std::size_t countOf(const std::vector<std::string>& records, const std::string& part) {
  return static_cast<std::size_t>(std::count_if(
      records.begin(), records.end(), [&](const std::string& r) { return has(r, part); }));
}

}  // namespace assembly_cell::ros_bridge
