// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include <ros/ros.h>

#include <algorithm>
#include <array>
#include <deque>
#include <memory>
#include <mutex>
#include <string>

#include "assembly_cell/ros/bridge/message_guard.h"
#include "assembly_cell/ros/bridge/parameters.h"
#include "assembly_cell/ros/process/node_main.h"
#include "assembly_cell/sensor/calibration.h"
#include "emulators.h"

namespace assembly_cell::ros_bridge {

namespace {

/// Node simulated_netft: an emulated Net F/T box that measures what a simulated sensor does, so
/// that the driver of a real box can be tried in the whole cell. One record for each sample on
/// `bridge`.
class SimulatedNetft {
 public:
  static constexpr unsigned kThreads = 1;

  /// Throws InputError for a bad parameter or calibration file, SourceError for a port in use.
  SimulatedNetft(ros::NodeHandle& nh, ros::NodeHandle& pnh) {
    Parameters parameters(pnh);
    NetftEmulator::Options box;
    box.amplitude = 0.0;
    box.bind_address = parameters.text("address", box.bind_address);
    box.port = parameters.integer("port", 1, 65535, 49152);
    box.http_port = parameters.integer("http_port", 1, 65535, 49153);
    const std::string file = parameters.text("calibration_file");  // of the simulated sensor
    calibration_ = loadCalibration(file);
    box.rate = box.configuration.rate = parameters.number("rate", positive("Hz"), 5000.0);
    parameters.refuseUnknown();
    box.measure = [this] { return next(); };
    emulator_ = std::make_unique<NetftEmulator>(box);
    bridge_sub_ = subscribeStream<StrainSamples>(
        nh, "bridge", 100, [this](const StrainSamples::ConstPtr& block) { add(*block); });
  }

 private:
  using Load = std::array<double, 6>;

  void add(const StrainSamples& block) {
    const std::lock_guard<std::mutex> lock(mutex_);
    for (std::size_t k = 0; k < block.volts.size(); k += 6) {
      const Vector6 wrench =
          wrenchFromVolts(calibration_, Eigen::Map<const Vector6>(&block.volts[k]));
      std::copy_n(wrench.data(), 6, measured_.emplace_back().begin());
    }
    // what the box's clock is behind the simulator's
    while (measured_.size() > 2 * block.volts.size() / 6) measured_.pop_front();
  }

  // Load of the next record. A device measures at its own rate, not a block at a time.
  Load next() {
    const std::lock_guard<std::mutex> lock(mutex_);
    if (!measured_.empty()) {
      last_ = measured_.front();
      measured_.pop_front();
    }
    return last_;
  }

  Calibration calibration_;
  std::mutex mutex_;
  std::deque<Load> measured_;
  Load last_{};
  std::unique_ptr<NetftEmulator> emulator_;
  StreamSubscriber bridge_sub_;  // last: its callbacks use the other members
};

}  // namespace

}  // namespace assembly_cell::ros_bridge

int main(int argc, char** argv) {
  return assembly_cell::ros_bridge::run<assembly_cell::ros_bridge::SimulatedNetft>(
      argc, argv, "simulated_netft");
}
