// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <diagnostic_msgs/DiagnosticArray.h>
#include <ros/ros.h>

#include <map>
#include <mutex>
#include <string>
#include <vector>

#include "cell_fixture.h"

// A driver as a child process, and what it says in its diagnostics.
namespace assembly_cell::test {

/// A force_sensor_driver named `driver` in the namespace `group`.
class Driver : public Child {
 public:
  Driver(const std::string& group, const std::vector<std::string>& parameters,
         const std::vector<std::string>& environment = {})
      : Child(command(group, parameters), environment) {}

 private:
  static std::vector<std::string> command(const std::string& group,
                                          const std::vector<std::string>& parameters) {
    std::vector<std::string> words = {executable("force_sensor_driver"), "__ns:=/" + group,
                                      "__name:=driver", "_frame_id:=sensor",
                                      "_diagnostic_period:=0.1"};
    words.insert(words.end(), parameters.begin(), parameters.end());
    return words;
  }
};

/// The newest status of each name.
class Diagnoses {
 public:
  explicit Diagnoses(ros::NodeHandle& nh)
      : sub_(nh.subscribe<diagnostic_msgs::DiagnosticArray>(
            "/diagnostics", 1000,
            boost::function<void(const diagnostic_msgs::DiagnosticArray::ConstPtr&)>(
                [this](const diagnostic_msgs::DiagnosticArray::ConstPtr& array) {
                  const std::lock_guard<std::mutex> lock(mutex_);
                  for (const auto& status : array->status) {
                    latest_[status.name] = status;
                    ++count_[status.name];
                  }
                }))) {}

  diagnostic_msgs::DiagnosticStatus latest(const std::string& name) {
    const std::lock_guard<std::mutex> lock(mutex_);
    return latest_[name];
  }
  int count(const std::string& name) {
    const std::lock_guard<std::mutex> lock(mutex_);
    return count_[name];
  }
  /// Waits for a report for which the condition holds; `fresh`: one that began after the call.
  template <class Condition>
  bool await(const std::string& name, const Condition& condition, bool fresh = false,
             double patience = kPatience) {
    const int before = fresh ? count(name) + 1 : 0;
    return waitFor([&] { return count(name) > before && condition(latest(name)); }, patience);
  }

 private:
  std::mutex mutex_;
  std::map<std::string, diagnostic_msgs::DiagnosticStatus> latest_;
  std::map<std::string, int> count_;
  ros::Subscriber sub_;
};

inline std::string value(const diagnostic_msgs::DiagnosticStatus& status, const std::string& key) {
  for (const auto& pair : status.values) {
    if (pair.key == key) return pair.value;
  }
  return "no key " + key;
}
inline double number(const diagnostic_msgs::DiagnosticStatus& status, const std::string& key) {
  for (const auto& pair : status.values) {
    if (pair.key == key) return std::stod(pair.value);
  }
  return -1e300;
}

}  // namespace assembly_cell::test
