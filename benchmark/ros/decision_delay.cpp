// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
// Delay between a block and the command decided on it: both are received here, over the
// same kind of connection. A command's stamp is the end of the block.
// usage: decision_delay: prints the delay of each command [ms], a line each, until it is ended.
#include <assembly_cell/Exciter.h>
#include <assembly_cell/StrainSamples.h>
#include <geometry_msgs/PoseStamped.h>
#include <ros/ros.h>

#include <chrono>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <map>

namespace {

using Clock = std::chrono::steady_clock;

constexpr int kQueue = 1000;
constexpr double kKept = 1.0;  // of blocks that a command may follow [s]

std::int64_t microseconds(double time) { return std::llround(1e6 * time); }

class Delays {
 public:
  explicit Delays(ros::NodeHandle& nh) {
    const ros::TransportHints hints = ros::TransportHints().tcpNoDelay();
    block_sub_ = nh.subscribe<assembly_cell::StrainSamples>(
        "sensor_b/bridge", kQueue, [this](const auto& m) { onBlock(*m); }, ros::VoidConstPtr(),
        hints);
    carrier_sub_ = nh.subscribe<geometry_msgs::PoseStamped>(
        "carrier_command", kQueue, [this](const auto& m) { onCommand(m->header.stamp); },
        ros::VoidConstPtr(), hints);
    exciter_sub_ = nh.subscribe<assembly_cell::Exciter>(
        "exciter", kQueue, [this](const auto& m) { onCommand(m->header.stamp); },
        ros::VoidConstPtr(), hints);
  }

 private:
  void onBlock(const assembly_cell::StrainSamples& block) {
    const double last = static_cast<double>(block.saturated.size()) - 1.0;
    const double end = block.header.stamp.toSec() + last * block.period;
    ends_[microseconds(end)] = Clock::now();
    ends_.erase(ends_.begin(), ends_.lower_bound(microseconds(end - kKept)));
  }

  void onCommand(const ros::Time& stamp) {
    const std::int64_t end = microseconds(stamp.toSec());
    const auto block = ends_.lower_bound(end - 50);
    if (block == ends_.end() || block->first > end + 50) return;  // of before the first block
    const std::chrono::duration<double, std::milli> delay = Clock::now() - block->second;
    std::printf("%.4f\n", delay.count());
    std::fflush(stdout);
  }

  std::map<std::int64_t, Clock::time_point> ends_;  // by the last sample's time [us]
  ros::Subscriber block_sub_, carrier_sub_, exciter_sub_;
};

}  // namespace

int main(int argc, char** argv) {
  ros::init(argc, argv, "decision_delay");
  ros::NodeHandle nh;
  const Delays delays(nh);
  ros::spin();
  return 0;
}
