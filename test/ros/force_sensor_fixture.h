// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <assembly_cell/Ack.h>
#include <assembly_cell/DisplacementSamples.h>
#include <assembly_cell/DisplacementWithCovariance.h>
#include <assembly_cell/GetCalibration.h>
#include <assembly_cell/SensorCalibration.h>
#include <assembly_cell/SetBias.h>
#include <assembly_cell/SetCalibration.h>
#include <assembly_cell/StrainSamples.h>
#include <assembly_cell/WrenchSamples.h>
#include <assembly_cell/WrenchWithCovariance.h>
#include <assembly_cell/ZeroTo.h>
#include <diagnostic_msgs/DiagnosticArray.h>
#include <geometry_msgs/WrenchStamped.h>
#include <gtest/gtest.h>
#include <ros/ros.h>
#include <std_srvs/Trigger.h>
#include <sys/wait.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <cmath>
#include <cstdio>
#include <future>
#include <limits>
#include <map>
#include <mutex>
#include <string>
#include <thread>
#include <vector>

#include "assembly_cell/ros/bridge/calibration_messages.h"
#include "assembly_cell/ros/bridge/conversions.h"
#include "assembly_cell/ros/bridge/service_call.h"
#include "assembly_cell/sensor/bridge.h"
#include "assembly_cell/sensor/calibration.h"
#include "cell_fixture.h"

namespace assembly_cell::ros_bridge {

using test::has;
using test::kPatience;
using test::waitFor;

constexpr double kRounding = 1e-9;  // S C of double precision, condition 10 [N], [N·m]
const double kNaN = std::numeric_limits<double>::quiet_NaN();

// A sensor's topics and services as others see them, and the source that feeds it.
class Sensor {
 public:
  explicit Sensor(const std::string& name)
      : nh_(name), name_(name), bridge_(name == "sensor_a" ? bridgeA(16, 0.0) : bridgeB(16, 0.0)) {
    C_ = strainMatrix(bridge_);
    pub_ = nh_.advertise<StrainSamples>("bridge", 100);
    keep("strain", strain_);
    keep("wrench_samples", wrench_samples_);
    keep("displacement_samples", displacement_samples_);
    keep("wrench_raw", wrench_raw_);
    keep("wrench", wrench_);
    keep("wrench_with_covariance", wrench_with_covariance_);
    keep("displacement", displacement_);
    keep("bias", bias_);
    keep("calibration", calibration_);
  }

  bool connected() const {
    for (const ros::Subscriber& sub : subs_) {
      const bool displacement = sub.getTopic() == nh_.resolveName("displacement_samples") ||
                                sub.getTopic() == nh_.resolveName("displacement");
      if (sub.getNumPublishers() == 0 && !(displacement && name_ == "sensor_a")) return false;
    }
    return pub_.getNumSubscribers() > 0;
  }

  // volts of a load, as the simulator's bridge would give them before conversion
  Vector6 volts(const Vector6& w) const {
    Vector6 v = C_ * w;
    for (int k = 0; k < 6; ++k) v[k] += bridge_.hinges[static_cast<std::size_t>(k)].offset;
    return v;
  }

  StrainSamples block(const std::vector<Vector6>& wrenches, double period = 2e-4) {
    StrainSamples b;
    time_ += period;
    b.header.stamp = ros::Time(time_);
    b.header.frame_id = name_;
    b.period = period;
    b.sequence = ++sequence_;
    for (const Vector6& w : wrenches) {
      const Vector6 v = volts(w);
      b.volts.insert(b.volts.end(), v.data(), v.data() + 6);
    }
    b.saturated.assign(wrenches.size(), 0);
    b.temperature = 21.5;
    time_ += period * static_cast<double>(wrenches.size() - 1);
    return b;
  }
  StrainSamples block(const Vector6& w, std::size_t samples = 100) {
    return block(std::vector<Vector6>(samples, w));
  }

  void send(const StrainSamples& b) { pub_.publish(b); }

  // sends a block and waits for its wrenches
  WrenchSamples pass(const StrainSamples& b) {
    send(b);
    WrenchSamples seen;
    EXPECT_TRUE(waitFor([&] {
      const std::lock_guard<std::mutex> lock(mutex_);
      for (const WrenchSamples& w : wrench_samples_) {
        if (w.sequence == b.sequence) seen = w;
      }
      return !seen.wrench.empty();
    })) << "no wrench_samples for block "
        << b.sequence;
    return seen;
  }
  Vector6 firstOf(const WrenchSamples& w) const { return Vector6::Map(w.wrench.data()); }

  template <class M>
  std::vector<M> copy(const std::vector<M>& messages) {
    const std::lock_guard<std::mutex> lock(mutex_);
    return messages;
  }
  template <class M>
  void clear(std::vector<M>& messages) {
    const std::lock_guard<std::mutex> lock(mutex_);
    messages.clear();
  }
  // the newest message once the condition holds for it
  template <class M, class Condition>
  M newest(const std::vector<M>& messages, const Condition& condition) {
    M found;
    EXPECT_TRUE(waitFor([&] {
      const std::lock_guard<std::mutex> lock(mutex_);
      if (messages.empty() || !condition(messages.back())) return false;
      found = messages.back();
      return true;
    }));
    return found;
  }

  template <class Service>
  typename Service::Response call(const std::string& service,
                                  const typename Service::Request& request = {}) {
    Service s;
    s.request = request;
    const std::string name = nh_.resolveName("driver/" + service);
    EXPECT_TRUE(ros::service::waitForService(name, ros::Duration(kPatience)));
    EXPECT_TRUE(callService(name, s)) << name;
    return s.response;
  }
  std_srvs::Trigger::Response trigger(const std::string& service) {
    return call<std_srvs::Trigger>(service);
  }

  ros::NodeHandle nh_;
  std::vector<StrainSamples> strain_;
  std::vector<WrenchSamples> wrench_samples_;
  std::vector<DisplacementSamples> displacement_samples_;
  std::vector<geometry_msgs::WrenchStamped> wrench_raw_, wrench_, bias_;
  std::vector<WrenchWithCovariance> wrench_with_covariance_;
  std::vector<DisplacementWithCovariance> displacement_;
  std::vector<SensorCalibration> calibration_;
  std::mutex mutex_;
  std::uint32_t sequence_ = 0;  // last sent

 private:
  template <class M>
  void keep(const std::string& topic, std::vector<M>& messages) {
    const boost::function<void(const boost::shared_ptr<const M>&)> callback =
        [this, &messages](const boost::shared_ptr<const M>& m) {
          const std::lock_guard<std::mutex> lock(mutex_);
          messages.push_back(*m);
        };
    subs_.push_back(nh_.subscribe<M>(topic, 1000, callback));
  }

  std::string name_;
  Bridge bridge_;
  Matrix6 C_;
  double time_ = 1.0;
  ros::Publisher pub_;
  std::vector<ros::Subscriber> subs_;
};

// Feeds blocks of a load at about 200 a second until it goes out of scope.
class Feeder {
 public:
  Feeder(Sensor& sensor, const Vector6& w, double noise = 0.0)
      : thread_([this, &sensor, w, noise] {
          NormalSource normal(5);
          while (!stop_) {
            std::vector<Vector6> wrenches(20, w);
            for (Vector6& x : wrenches) {
              for (int k = 0; k < 6; ++k) x[k] += noise * normal();
            }
            sensor.send(sensor.block(wrenches));
            ros::WallDuration(0.005).sleep();
          }
        }) {}
  ~Feeder() {
    stop_ = true;
    thread_.join();
  }

 private:
  std::atomic<bool> stop_{false};
  std::thread thread_;
};

// Latest diagnostics by name.
class Diagnostics {
 public:
  Diagnostics() {
    const boost::function<void(const diagnostic_msgs::DiagnosticArray::ConstPtr&)> callback =
        [this](const diagnostic_msgs::DiagnosticArray::ConstPtr& array) {
          const std::lock_guard<std::mutex> lock(mutex_);
          for (const auto& status : array->status) {
            all_[status.name].push_back(status);
          }
        };
    sub_ = nh_.subscribe<diagnostic_msgs::DiagnosticArray>("/diagnostics", 100, callback);
  }
  // a report that began after the call and for which the condition holds
  template <class Condition>
  diagnostic_msgs::DiagnosticStatus next(const std::string& name, const Condition& condition) {
    const std::size_t before = count(name);
    diagnostic_msgs::DiagnosticStatus found;
    EXPECT_TRUE(waitFor([&] {
      const std::lock_guard<std::mutex> lock(mutex_);
      const auto& all = all_[name];
      for (std::size_t i = before; i < all.size(); ++i) {
        found = all[i];
        if (condition(found)) return true;
      }
      return false;
    })) << name
        << ": " << found.message;
    return found;
  }
  std::size_t count(const std::string& name) {
    const std::lock_guard<std::mutex> lock(mutex_);
    return all_[name].size();
  }

 private:
  ros::NodeHandle nh_;
  ros::Subscriber sub_;
  std::mutex mutex_;
  std::map<std::string, std::vector<diagnostic_msgs::DiagnosticStatus>> all_;
};

inline std::string value(const diagnostic_msgs::DiagnosticStatus& status, const std::string& key) {
  for (const auto& pair : status.values) {
    if (pair.key == key) return pair.value;
  }
  ADD_FAILURE() << "no key '" << key << "' in " << status.name;
  return "nan";
}
inline double number(const diagnostic_msgs::DiagnosticStatus& status, const std::string& key) {
  return std::stod(value(status, key));
}

const Vector6 kLoad = (Vector6() << 3, -4, 12, 0.2, -0.1, 0.05).finished();
constexpr auto kAnything = [](const auto&) { return true; };

class ForceSensorDriver : public ::testing::Test {
 protected:
  void SetUp() override {
    ASSERT_TRUE(waitFor([&] { return a_.connected() && b_.connected(); }));
    a_.trigger("clear_bias");
    b_.trigger("clear_bias");
  }
  Sensor a_{"sensor_a"}, b_{"sensor_b"};

  ForceSensorDriver() { a_.sequence_ = b_.sequence_ = next_sequence_ += 100000; }
  static std::uint32_t next_sequence_;  // blocks of all tests count on, as those of one source
};
inline std::uint32_t ForceSensorDriver::next_sequence_ = 0;

}  // namespace assembly_cell::ros_bridge
