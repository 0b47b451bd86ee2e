// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/ros/driver/bag_source.h"

#include <yaml-cpp/yaml.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <set>

#include "assembly_cell/base/input_error.h"
#include "assembly_cell/ros/bridge/bag_check.h"
#include "assembly_cell/ros/bridge/message_guard.h"
#include "assembly_cell/sensor/source_parameters.h"

namespace assembly_cell::ros_bridge {

BagSource::BagSource() {
  info_.type = "bag";
  info_.quantity = SampleQuantity::kVolts;
  info_.recorded = true;
}

void BagSource::doConfigure(const YAML::Node& map) {
  SourceParameters parameters(map, info_.type);
  file_ = parameters.text("file");
  topic_ = parameters.text("topic", std::string());
  paced_ = parameters.choice("rate", {"original", "fast"}, "original") == "original";
  parameters.refuseUnknown();
  info_.device = file_;
  info_.paced = paced_;
}

void BagSource::doOpen() {
  const std::string where = "source bag: file '" + file_ + "'";
  if (std::filesystem::exists(file_)) checkBag(file_, where);
  try {
    bag_ = std::make_unique<rosbag::Bag>(file_, rosbag::bagmode::Read);
    // the topic to play: as named, or the only one with strain
    rosbag::View all(*bag_);
    std::set<std::string> topics;
    for (const rosbag::ConnectionInfo* connection : all.getConnections()) {
      if (connection->md5sum == ros::message_traits::MD5Sum<StrainSamples>::value()) {
        topics.insert(connection->topic);
      }
    }
    std::string list;
    for (const std::string& topic : topics) list += (list.empty() ? "" : ", ") + topic;
    if (topics.empty()) throw InputError(where + " has no StrainSamples: record a strain topic");
    if (topic_.empty() && topics.size() > 1) {
      throw InputError(where + " has several topics of strain: set topic to one of " + list);
    }
    const std::string topic = topic_.empty() ? *topics.begin() : topic_;
    if (topics.count(topic) == 0) {
      throw InputError(where + " has no StrainSamples on '" + topic_ + "': set topic to one of " +
                       list);
    }
    view_ = std::make_unique<rosbag::View>(*bag_, rosbag::TopicQuery(topic));
    position_ = view_->begin();
    info_.note = "topic " + topic;
    damage_.clear();
    due_ = load();
    if (!damage_.empty()) throw InputError("source bag: " + damage_);
    if (!due_) throw InputError(where + ": no sound block on " + topic + ": record it again");
  } catch (const rosbag::BagException& error) {
    doClose();
    throw InputError(where + " can't be read: " + printable(error.what()) +
                     ": give a bag file, or mend it with `rosbag reindex`");
  } catch (const InputError&) {
    doClose();
    throw;
  } catch (const std::exception& error) {
    doClose();
    throw InputError(where + " can't be read: " + printable(error.what()) + ": give a whole bag");
  }
  info_.rate = 1.0 / due_->period;
  sample_ = 0;
  start_ = due_->header.stamp;
  begun_ = Clock::now();
  ++stream_;
}

StrainSamples::ConstPtr BagSource::load() {
  while (*position_ != view_->end()) {
    StrainSamples::ConstPtr block;
    try {
      block = (**position_).instantiate<StrainSamples>();
    } catch (const rosbag::BagException& error) {
      damage_ = "file '" + file_ + "' can't be read any more: " + printable(error.what()) +
                ": was it cut, or written, while it was played?";
      return nullptr;
    } catch (const ros::Exception&) {
      // lengths within the message don't fit
    }
    ++*position_;
    if (block && check(*block).good()) return block;
    ++counts_.malformed;
  }
  return nullptr;
}

ReadResult BagSource::doRead(SourceBlock& block, Clock::time_point deadline) {
  if (!due_) return damage_.empty() ? ReadResult::kEnd : lost(damage_);
  const std::size_t count = std::min(due_->saturated.size() - sample_, kBlockCapacity);

  // a block is due with its last sample
  const double first =
      (due_->header.stamp - start_).toSec() + static_cast<double>(sample_) * due_->period;
  const double last = first + static_cast<double>(count - 1) * due_->period;
  const Clock::time_point due =
      paced_ ? begun_ + std::chrono::nanoseconds(static_cast<std::int64_t>(1e9 * last))
             : Clock::now();
  if (paced_) {
    if (wait(-1, std::min(due, deadline)) == Wait::kStopped) return ReadResult::kClosed;
    if (Clock::now() < due) return ReadResult::kTimeout;
  }

  block.count = count;
  std::copy_n(due_->volts.begin() + static_cast<std::ptrdiff_t>(6 * sample_), 6 * count,
              block.values.begin());
  std::copy_n(due_->saturated.begin() + static_cast<std::ptrdiff_t>(sample_), count,
              block.saturated.begin());
  block.sequence = sequence_;
  block.stream = stream_;
  block.period = due_->period;
  block.device_time = first;
  block.temperature = due_->temperature;
  block.received.steady = due;
  block.received.system =
      std::chrono::system_clock::now() -
      std::chrono::duration_cast<std::chrono::system_clock::duration>(Clock::now() - due);
  sequence_ += count;
  counts_.samples += count;

  // what was lost when the bag was recorded is lost here, too
  sample_ += count;
  if (sample_ < due_->saturated.size()) return ReadResult::kSamples;
  const std::uint32_t number = due_->sequence;
  const ros::Time end = due_->header.stamp +
                        ros::Duration(due_->period * static_cast<double>(due_->saturated.size()));
  sample_ = 0;
  due_ = load();
  if (due_) {
    const auto step = static_cast<std::int32_t>(due_->sequence - number);
    if (step > 1) {
      const double missing = std::round((due_->header.stamp - end).toSec() / due_->period);
      const auto gap = static_cast<std::uint64_t>(std::max(missing, step - 1.0));
      counts_.lost += gap;
      sequence_ += gap;
    } else if (step < 1) {
      ++stream_;
      ++counts_.restarts;
    }
  }
  return ReadResult::kSamples;
}

void BagSource::doClose() noexcept {
  due_.reset();
  position_.reset();
  view_.reset();
  bag_.reset();
}

}  // namespace assembly_cell::ros_bridge
