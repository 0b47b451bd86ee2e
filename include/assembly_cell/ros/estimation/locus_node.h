// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <assembly_cell/DisplacementSamples.h>
#include <assembly_cell/Exciter.h>
#include <assembly_cell/IdentifyLocusAction.h>
#include <assembly_cell/LocusEstimate.h>
#include <geometry_msgs/PoseStamped.h>
#include <ros/ros.h>
#include <std_srvs/SetBool.h>

#include <condition_variable>
#include <cstdint>
#include <deque>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include "assembly_cell/Ack.h"
#include "assembly_cell/locus/reading.h"
#include "assembly_cell/locus/sliding_locus.h"
#include "assembly_cell/mechanism/mechanism.h"
#include "assembly_cell/ros/bridge/checked_action.h"
#include "assembly_cell/ros/bridge/live_settings.h"
#include "assembly_cell/ros/bridge/publish_shared.h"
#include "assembly_cell/ros/bridge/stream_subscriber.h"

namespace assembly_cell::ros_bridge {

/// Locus of the peg from the coupling's displacement while the exciter runs: a sliding estimate on
/// `locus`, the mode on `contact_mode`, single readings by the action `identify_locus`. All in
/// sensor axes. Interfaces: docs/reference/interfaces.md.
class LocusNode {
 public:
  /// Of its callbacks: one keeps exciter and blocks in order; readings have a thread of their own.
  static constexpr unsigned kThreads = 1;

  /// Throws InputError for a bad parameter or file.
  LocusNode(const ros::NodeHandle& nh, const ros::NodeHandle& pnh);
  ~LocusNode();

 private:
  using Server = CheckedActionServer<IdentifyLocusAction>;

  /// Samples of a window and the exciter's angle at each.
  struct Window {
    ros::Time start, end;                ///< [start, end)
    std::vector<double> angle, signals;  ///< [rad]; 6 × n
    double period = 0.0;                 ///< of the samples [s]
    std::string frame_id;
  };

  void readParameters();

  // the data path
  void onBlock(const DisplacementSamples::ConstPtr& block);
  void onExciter(const Exciter::ConstPtr& exciter);
  void onCarrier(const geometry_msgs::PoseStamped::ConstPtr& pose);
  bool enable(std_srvs::SetBool::Request& request, std_srvs::SetBool::Response& response);
  void acknowledge(std::uint32_t sequence);

  // with mutex_ held
  /// Puts the block into the history; false if it is a repetition.
  bool keep(const DisplacementSamples::ConstPtr& block);
  Window collect(const ros::Time& start, const ros::Time& end, const Exciter& exciter) const;
  ros::Time lastSample() const;
  double carrierMotion(const ros::Time& start, const ros::Time& end) const;  ///< of the tip [m]

  /// Brings the sliding estimate up to the last block; tells the locus if its window is filled.
  void slide();

  /// end: of the window.
  static LocusEstimate message(const LocusReading& reading, const Exciter& exciter,
                               const ros::Time& end, const std::string& frame_id);

  // the action, in its own thread
  void identify(const IdentifyLocusGoal::ConstPtr& goal);
  /// Empty once the window is covered by samples, or why it won't be.
  std::string await(const ros::Time& start, const ros::Time& end, const Exciter& exciter);

  ros::NodeHandle nh_, pnh_;
  Mechanism mechanism_;
  ReadingLimits limits_;
  double carrier_motion_ = 0.0;  // [m]
  double history_ = 0.0;         // [s]
  double data_timeout_ = 0.0;    // [s] wall clock
  bool lockstep_ = false;
  std::unique_ptr<LiveSettings> live_;
  std::string name_in_lockstep_;

  mutable std::mutex mutex_;
  std::condition_variable arrived_;
  bool enabled_ = true;
  std::deque<DisplacementSamples::ConstPtr> blocks_;
  std::uint64_t block_count_ = 0;  // since the start, to see new ones
  std::uint64_t cleared_ = 0;      // times the clock jumped back
  std::deque<geometry_msgs::PoseStamped::ConstPtr> carrier_;
  std::optional<Exciter> exciter_;
  std::optional<std::uint8_t> mode_;  // last on contact_mode

  // the sliding estimate, updated with every sample: of one exciter message, without gaps
  struct Stream {
    SlidingFit<6> fit;
    Exciter exciter;
    std::optional<ros::Time> last;  // sample in it
    std::optional<LocusMode> mode;
  };
  std::optional<Stream> stream_;

  ros::Publisher locus_pub_, mode_pub_;
  LatestPublisher<Ack> ack_pub_;
  StreamSubscriber block_sub_, carrier_sub_;
  ros::Subscriber exciter_sub_;
  ros::ServiceServer enable_srv_;
  Server server_;
};

}  // namespace assembly_cell::ros_bridge
