// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <assembly_cell/DisplacementSamples.h>
#include <assembly_cell/Exciter.h>
#include <geometry_msgs/PoseStamped.h>

#include <cstdint>
#include <deque>
#include <optional>
#include <string>
#include <vector>

#include "assembly_cell/locus/reading.h"
#include "assembly_cell/locus/sliding_locus.h"
#include "assembly_cell/mechanism/mechanism.h"

namespace assembly_cell::ros_bridge {

/// Recent blocks of displacements of the coupling and poses of the carrier. Not
/// thread-safe.
class LocusHistory {
 public:
  using Block = DisplacementSamples::ConstPtr;
  enum class Arrival { kRepeated, kNext, kClockJumped };

  /// Samples of [start, end) and the exciter's angle at each.
  struct Window {
    ros::Time end;
    std::vector<double> angle, signals;  ///< [rad]; 6 × n [m], [rad]
    double period = 0.0;                 ///< of the samples [s]
    std::string frame_id;
  };

  /// length: of the samples that are kept [s].
  void setLength(double length) { length_ = length; }
  /// kRepeated: the latest block again, not added. kClockJumped: earlier blocks
  /// were dropped.
  Arrival add(const Block& block);
  void addCarrier(const geometry_msgs::PoseStamped::ConstPtr& pose);

  const std::deque<Block>& blocks() const { return blocks_; }
  std::uint64_t blockCount() const { return block_count_; }  ///< added since the start
  std::uint64_t jumpCount() const { return jump_count_; }    ///< of the clock
  ros::Time lastSample() const;
  Window window(const ros::Time& start, const ros::Time& end, const Exciter& exciter) const;
  /// Largest motion of a point `lever` [m] from the carrier's origin between
  /// start and end [m].
  double carrierMotion(const ros::Time& start, const ros::Time& end, double lever) const;

 private:
  double length_ = 0.0;
  std::deque<Block> blocks_;
  std::deque<geometry_msgs::PoseStamped::ConstPtr> carrier_;
  std::uint64_t block_count_ = 0, jump_count_ = 0;
};

/// Locus over a sliding window of whole periods of the exciter, updated with
/// every sample of one exciter message. Restarts where samples are missing. Not
/// thread-safe.
class SlidingLocus {
 public:
  void reset() { stream_.reset(); }
  /// Adds what `history` has received since the last call. window: longest [s],
  /// at most `length`, that of the history. Returns the measurement once the
  /// window is full. Throws InputError if the samples don't determine it.
  std::optional<LocusReading> update(const Mechanism& mechanism, const ReadingLimits& limits,
                                     const Exciter& exciter, const LocusHistory& history,
                                     double window, double length);

 private:
  struct Stream {
    SlidingFit<6> fit;
    Exciter exciter;
    std::optional<ros::Time> last;  // sample in it
    std::optional<LocusMode> mode;
  };
  std::optional<Stream> stream_;
};

}  // namespace assembly_cell::ros_bridge
