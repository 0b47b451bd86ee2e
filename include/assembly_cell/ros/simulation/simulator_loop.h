// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <chrono>
#include <condition_variable>
#include <cstdint>
#include <deque>
#include <functional>
#include <future>
#include <memory>
#include <mutex>
#include <string>
#include <thread>

#include "assembly_cell/cell/guarded_cell.h"
#include "assembly_cell/ros/simulation/lockstep_answers.h"
#include "assembly_cell/ros/simulation/simulator_output.h"
#include "assembly_cell/ros/simulation/simulator_state.h"

namespace assembly_cell::ros_bridge {

/// Keeps the cell's time to the wall clock.
class Pacer {
 public:
  explicit Pacer(double real_time_factor) : factor_(real_time_factor) {}
  /// How long to wait at node time `time` [s]; 0 when it is late. [s]
  double wait(double time);
  /// The pace starts again with the next block.
  void restart() { time_ = -1.0; }

 private:
  const double factor_;
  std::chrono::steady_clock::time_point start_;
  double time_ = -1.0;  // node time at start_ [s]; negative: not pacing yet
  double lost_ = 0.0;   // against the wall clock so far [s]
};

/// Blocks still to do of a ~step while paused. Guarded by the state's mutex.
class StepRequest {
 public:
  std::uint32_t left() const { return left_; }
  void begin(std::uint32_t blocks);
  /// A block is done.
  void count();
  /// Ends a request that is under way.
  void end(const std::string& why);
  void wakeUp() { changed_.notify_all(); }
  /// Until it is done or `over`, or ROS ends.
  void wait(std::unique_lock<std::mutex>& lock, const std::function<bool()>& over);
  /// Why the last request came short; empty: it didn't.
  const std::string& ended() const { return ended_; }

 private:
  std::uint32_t left_ = 0;
  std::string ended_;
  std::condition_variable changed_;
};

/// Computes block after block in a thread of its own, paced by the wall clock or by the answers of
/// a lockstep. Pauses, steps and tasks take effect between two blocks.
class SimulatorLoop {
 public:
  /// All are referred to.
  SimulatorLoop(const SimulatorSettings& settings, SimulatorState& state, GuardedCell& cell,
                SimulatorOutput& output, LockstepAnswers& answers);
  ~SimulatorLoop() { stop(); }

  void start();
  void stop();

  /// Computes the next block once the last one is answered, in the caller's thread.
  void goOn();

  /// Runs `task` between two blocks and waits for it. Throws what it throws, and InputError when
  /// the loop has ended.
  void betweenBlocks(const std::function<void()>& task);
  void pause(bool paused);
  /// Advances by so many blocks while paused, and waits for them. Throws InputError.
  void step(std::uint32_t blocks);
  /// Continues with another cell at the present time. In a task between two blocks.
  void restart(std::unique_ptr<SimulatedCell> cell);

 private:
  void run();
  void runBlock();
  bool computeBlock();  // and publishes it; false: the simulation has stopped; with computing_
  void finishBlock();   // with computing_

  const SimulatorSettings& settings_;
  SimulatorState& state_;
  GuardedCell& cell_;
  SimulatorOutput& output_;
  LockstepAnswers& answers_;

  // locked by the thread that computes: the loop's, or in lockstep that of goOn(); before the state
  std::mutex computing_;
  StrainBlock block_;
  std::uint32_t sequence_ = 0;  // of the next block

  // with the state locked
  StepRequest steps_;
  std::deque<std::packaged_task<void()>> tasks_;

  Pacer pacer_;  // by the loop's thread
  std::thread thread_;
};

}  // namespace assembly_cell::ros_bridge
