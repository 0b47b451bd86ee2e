// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <assembly_cell/StrainSamples.h>
#include <ros/time.h>
#include <rosbag/bag.h>
#include <rosbag/view.h>

#include <cstdint>
#include <memory>
#include <optional>
#include <string>

#include "assembly_cell/sensor/strain_source.h"

namespace assembly_cell::ros_bridge {

/// Plays the StrainSamples of a bag: volts. device_time counts from start(). Keys: file, topic
/// (default: the only one of that type), rate [original, fast].
class BagSource : public StrainSource {
 public:
  BagSource();
  ~BagSource() override { close(); }

  /// Stamp of the first sample; of the latest open().
  ros::Time start() const { return start_; }

 protected:
  void doConfigure(const YAML::Node& parameters) override;
  void doOpen() override;
  ReadResult doRead(SourceBlock& block, Clock::time_point deadline) override;
  void doClose() noexcept override;

 private:
  /// The next sound block; null at the end, or where the file can't be read: damage_ says why.
  StrainSamples::ConstPtr load();

  std::string file_, topic_;
  std::string damage_;  // found since open(); empty: none
  bool paced_ = true;

  std::unique_ptr<rosbag::Bag> bag_;
  std::unique_ptr<rosbag::View> view_;
  std::optional<rosbag::View::iterator> position_;
  StrainSamples::ConstPtr due_;
  std::size_t sample_ = 0;  // of due_, to be played next
  ros::Time start_;
  Clock::time_point begun_;
  std::uint64_t sequence_ = 0;
  std::uint32_t stream_ = 0;
};

}  // namespace assembly_cell::ros_bridge
