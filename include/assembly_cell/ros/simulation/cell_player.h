// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <assembly_cell/Ack.h>
#include <geometry_msgs/TransformStamped.h>
#include <ros/ros.h>
#include <rosbag/bag.h>
#include <rosbag/view.h>

#include <atomic>
#include <chrono>
#include <condition_variable>
#include <cstdint>
#include <map>
#include <mutex>
#include <optional>
#include <string>
#include <thread>
#include <vector>

namespace assembly_cell {
class FieldList;
}

namespace assembly_cell::ros_bridge {

/// Parameters of the player.
struct PlayerSettings {
  std::string bag;
  std::string recorded_namespace = "/";
  std::vector<std::string> topics;                  ///< relative to the cell
  std::string rate = "original";                    ///< or fast
  double factor = 1.0;                              ///< times the recorded speed
  bool clock = false;                               ///< publishes /clock
  bool end_launch = false;                          ///< ends the launch file with the bag
  double ack_timeout = 10.0, start_timeout = 60.0;  ///< wall clock [s]
};
void fields(FieldList& f, PlayerSettings& s);

/// Plays the topics of a cell from a bag, in the order in which they were recorded. In lockstep
/// with its participants, so that the same bag gives the same estimates to the last bit: it goes on
/// after a block when the participants have acknowledged it, and a block goes out only when what
/// was recorded before it has arrived. Interfaces: docs/reference/interfaces.md.
class CellPlayer {
 public:
  /// Threads of its callbacks.
  static constexpr unsigned kThreads = 1;

  /// Throws InputError for a bad parameter or bag.
  CellPlayer(const ros::NodeHandle& nh, const ros::NodeHandle& pnh);
  ~CellPlayer();

  int exitCode() const { return exit_code_; }

 private:
  using Clock = std::chrono::steady_clock;

  struct Participant {
    std::string name;                 ///< relative to the namespace
    std::vector<std::string> topics;  ///< as they are called in the bag
    std::uint64_t answers = 0;        ///< acknowledgements so far
    std::uint32_t sequence = 0;       ///< of the latest one
    bool answers_repetition = true;   ///< until it didn't once
  };

  void readParameters();
  void openBag();
  void play();
  void playAll();
  static bool interruptLaunch();
  void publish(const rosbag::MessageInstance& message);
  void publishClock(const ros::Time& time);
  static bool listens(const Participant& participant, const std::string& topic);
  /// Until the participants' connections are there.
  void awaitConnections();
  void awaitAnswers(const std::string& topic, std::uint32_t sequence);
  /// Until all that went out so far has arrived at those who acknowledge `topic`'s blocks.
  void settle(const std::string& topic);
  void onAck(const ros::MessageEvent<Ack const>& event);

  ros::NodeHandle nh_, pnh_;
  PlayerSettings settings_;

  rosbag::Bag bag_;
  std::map<std::string, ros::Publisher> publishers_;                     ///< by name in the bag
  std::map<std::string, rosbag::MessageInstance> latest_;                ///< block of a topic
  std::map<std::string, std::uint32_t> sequences_;                       ///< of these
  std::map<std::string, geometry_msgs::TransformStamped> fixed_frames_;  ///< so far, by child
  bool unsettled_ = false;  ///< something but blocks has gone out since settle()
  std::uint64_t played_ = 0;

  std::mutex mutex_;
  std::condition_variable answered_;
  std::vector<Participant> participants_;
  std::atomic<bool> stopping_{false};
  std::atomic<int> exit_code_{0};

  ros::Publisher clock_pub_;
  ros::Subscriber ack_sub_;
  std::thread thread_;
};

}  // namespace assembly_cell::ros_bridge
