// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <boost/signals2/connection.hpp>

#include <chrono>
#include <functional>

namespace assembly_cell::ros_bridge {

/// Calls `beat` once a period from roscpp's own network thread, which looks at the sockets just
/// before each beat, sends what the beat has published, and sleeps for the rest of the period. So a
/// node that acts by the clock alone wakes up once a period, whatever comes in: a thread of its own
/// wakes up the network thread for each message in and for each message out, and a switch of
/// threads costs more than the message (benchmark/README.md, bridge_load).
///
/// For nodes of which nothing is asked sooner than the next beat. While the network thread sleeps,
/// for 5 ms at most, nothing comes in and nothing goes out, services included.
class PollBeat {
 public:
  /// period [s]. A beat that is late is made up for, up to 0.1 s of them. `beat` must neither throw
  /// nor wait, and must not make or destroy a PollBeat.
  PollBeat(double period, std::function<void()> beat);
  /// Returns once no beat is under way, and none comes any more.
  ~PollBeat();
  PollBeat(const PollBeat&) = delete;
  PollBeat& operator=(const PollBeat&) = delete;

 private:
  using Clock = std::chrono::steady_clock;

  void onRound();

  const Clock::duration period_;
  const std::function<void()> beat_;
  Clock::time_point next_;
  boost::signals2::connection listener_;
};

}  // namespace assembly_cell::ros_bridge
