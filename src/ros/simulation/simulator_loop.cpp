// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/ros/simulation/simulator_loop.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "assembly_cell/base/input_error.h"

namespace assembly_cell::ros_bridge {

double Pacer::wait(double time) {
  const auto now = std::chrono::steady_clock::now();
  if (time_ < 0.0) {
    start_ = now;
    time_ = time;
  }
  const double ahead =
      (time - time_) / factor_ - std::chrono::duration<double>(now - start_).count();
  if (ahead >= -1.0) return std::max(ahead, 0.0);
  lost_ -= ahead;
  ROS_WARN_THROTTLE(10.0,
                    "simulation has fallen %.1f s behind the wall clock so far: give a lower "
                    "~real_time_factor (real_time_factor:=0.2), or lockstep:=true",
                    lost_);
  restart();
  return 0.0;
}

void StepRequest::begin(std::uint32_t blocks) {
  left_ = blocks;
  ended_.clear();
}

void StepRequest::count() {
  if (left_ > 0 && --left_ == 0) wakeUp();
}

void StepRequest::end(const std::string& why) {
  if (left_ == 0) return;
  ended_ = std::to_string(left_) + " blocks short: " + why;
  left_ = 0;
  wakeUp();
}

void StepRequest::wait(std::unique_lock<std::mutex>& lock, const std::function<bool()>& over) {
  const auto done = [&] { return left_ == 0 || over(); };
  while (ros::ok() && !done()) changed_.wait_for(lock, std::chrono::milliseconds(100), done);
}

SimulatorLoop::SimulatorLoop(const SimulatorSettings& settings, SimulatorState& state,
                             GuardedCell& cell, SimulatorOutput& output, LockstepAnswers& answers)
    : settings_(settings),
      state_(state),
      cell_(cell),
      output_(output),
      answers_(answers),
      pacer_(settings.real_time_factor) {}

void SimulatorLoop::start() {
  thread_ = std::thread([this] { run(); });
}

void SimulatorLoop::stop() {
  {
    const std::lock_guard<std::mutex> lock(state_.mutex);
    state_.quit = true;
  }
  state_.changed.notify_all();
  steps_.wakeUp();
  if (thread_.joinable()) thread_.join();
}

void SimulatorLoop::run() {
  output_.publishState();
  output_.publishPlantState();
  while (true) {
    std::deque<std::packaged_task<void()>> tasks;
    {
      std::unique_lock<std::mutex> lock(state_.mutex);
      state_.changed.wait(lock, [this] {
        return state_.quit || !tasks_.empty() ||
               (state_.stopped.empty() && (!state_.paused || steps_.left() > 0));
      });
      if (state_.quit) {
        tasks_.clear();
        return;
      }
      tasks.swap(tasks_);
    }
    if (tasks.empty()) {
      runBlock();
    } else {
      for (auto& task : tasks) task();
      pacer_.restart();
    }
  }
}

void SimulatorLoop::runBlock() {
  {
    const std::lock_guard<std::mutex> computing(computing_);
    if (!computeBlock()) return;
  }
  if (settings_.lockstep) {
    answers_.wait([this](std::uint32_t sequence) {
      const std::lock_guard<std::mutex> computing(computing_);
      {
        const std::lock_guard<std::mutex> lock(state_.mutex);
        if (!answers_.awaits(sequence)) return;
      }
      output_.publishBlock(block_, sequence_);
    });
  } else if (const double ahead = pacer_.wait(state_.now); ahead > 0.0) {
    std::unique_lock<std::mutex> lock(state_.mutex);
    state_.changed.wait_for(lock, std::chrono::nanoseconds(std::llround(1e9 * ahead)),
                            [this] { return state_.quit; });
  }
  const std::lock_guard<std::mutex> computing(computing_);
  finishBlock();
}

bool SimulatorLoop::computeBlock() {
  std::string why;
  try {
    cell_.begin();
    output_.publishPlantState();
    // first: roscpp's network thread, which keeps others from publishing, sends it meanwhile
    if (settings_.lockstep) {
      output_.publishClock(state_.stampOf(cell_.base() + cell_.cell().nextEnd()));
    }
    const StopReason reason = cell_.next(block_, output_.wantsAccelerations());
    if (reason != StopReason::kOk) why = toString(reason);
  } catch (const std::exception& error) {
    why = error.what();
  }
  const bool good = why.empty();
  {
    const std::lock_guard<std::mutex> lock(state_.mutex);
    answers_.expect(sequence_, good);
    state_.now = cell_.time();
  }
  output_.publishPlantState();
  if (good) {
    output_.publishBlock(block_, sequence_);
    output_.publishState();
    const std::lock_guard<std::mutex> lock(state_.mutex);
    answers_.notifyIfComplete();  // there may be no participants
    return true;
  }
  ROS_ERROR("simulation stopped at %.6f s: %s; call ~reset to restart it", cell_.world().time(),
            why.c_str());
  const std::lock_guard<std::mutex> lock(state_.mutex);
  state_.stopped = why;
  steps_.count();
  steps_.wakeUp();
  return false;
}

void SimulatorLoop::finishBlock() {
  const std::lock_guard<std::mutex> lock(state_.mutex);
  if (!state_.stopped.empty()) return;
  ++sequence_;
  steps_.count();
}

// Where nodes share a thread, the call of the last answer computes the next block, and no other
// thread needs to wake up.
void SimulatorLoop::goOn() {
  const std::lock_guard<std::mutex> computing(computing_);
  {
    const std::lock_guard<std::mutex> lock(state_.mutex);
    if (!answers_.awaiting() || state_.quit || !answers_.complete()) return;
    if (!tasks_.empty() || (state_.paused && steps_.left() <= 1)) {
      answers_.stopAwaiting();
      return;
    }
  }
  finishBlock();
  if (!computeBlock()) state_.changed.notify_all();
}

// ---- between two blocks ----

void SimulatorLoop::betweenBlocks(const std::function<void()>& task) {
  std::future<void> done;
  {
    const std::lock_guard<std::mutex> lock(state_.mutex);
    if (state_.quit) throw InputError("the simulator is shutting down");
    tasks_.emplace_back(task);
    done = tasks_.back().get_future();
  }
  state_.changed.notify_all();
  // bounded: the loop waits for participants at most ~ack_timeout, then drops its tasks
  done.get();
}

void SimulatorLoop::pause(bool paused) {
  betweenBlocks([this, paused] {
    const std::lock_guard<std::mutex> lock(state_.mutex);
    state_.paused = paused;
    steps_.end("~pause was called");
  });
}

void SimulatorLoop::step(std::uint32_t blocks) {
  std::unique_lock<std::mutex> lock(state_.mutex);
  if (!state_.paused) throw InputError("not paused: call ~pause with data: true first");
  if (blocks == 0) throw InputError("blocks is 0: give the number of blocks to advance");
  if (!state_.stopped.empty()) {
    throw InputError("the simulation has stopped (" + state_.stopped + "): call ~reset first");
  }
  if (steps_.left() > 0) throw InputError("another ~step is under way");
  steps_.begin(blocks);
  state_.changed.notify_all();
  steps_.wait(lock, [this] { return state_.quit || !state_.stopped.empty(); });
  steps_.end(state_.stopped.empty() ? "shutting down" : "stopped: " + state_.stopped);
  if (!steps_.ended().empty()) {
    throw InputError("at " + std::to_string(state_.now) + " s, " + steps_.ended());
  }
}

void SimulatorLoop::restart(std::unique_ptr<SimulatedCell> cell) {
  cell_.replace(std::move(cell));
  {
    const std::lock_guard<std::mutex> lock(state_.mutex);
    state_.now = cell_.time();
    steps_.end("the simulation was restarted");
    state_.stopped.clear();
    state_.gate.onPlantRestart();
  }
  output_.onPlantRestart();
}

}  // namespace assembly_cell::ros_bridge
