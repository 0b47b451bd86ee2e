// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <deque>
#include <optional>
#include <random>
#include <utility>

namespace assembly_cell {

/// Commands on their way to a drive: each takes effect `latency` after its stamp, and up to
/// `jitter` later, drawn uniformly. They keep their order. Times in [s].
template <class Command>
class CommandQueue {
 public:
  void add(Command command, double stamp, double latency, double jitter, std::mt19937_64& random) {
    double due = stamp + latency;
    if (jitter > 0.0) due += std::uniform_real_distribution<double>(0.0, jitter)(random);
    if (!queue_.empty()) due = std::max(due, queue_.back().first);
    queue_.emplace_back(due, std::move(command));
  }
  /// Removes the first command if it has taken effect by `time`.
  std::optional<Command> take(double time) {
    if (queue_.empty() || queue_.front().first > time) return {};
    std::optional<Command> command(std::move(queue_.front().second));
    queue_.pop_front();
    return command;
  }
  bool empty() const { return queue_.empty(); }
  void clear() { queue_.clear(); }

 private:
  std::deque<std::pair<double, Command>> queue_;
};

/// Gap between a drive and what it carries, axis by axis: the load stays in its place until the
/// drive has crossed the gap. It begins in the middle.
class Backlash {
 public:
  Backlash() = default;
  /// gap: the whole width of each axis, not negative [m]
  explicit Backlash(const Eigen::Vector3d& gap) : half_(0.5 * gap) {}

  /// The drive has moved by `step` [m].
  void move(const Eigen::Vector3d& step) {
    lost_ = (lost_ - step).cwiseMax(-half_).cwiseMin(half_);
  }
  /// Position of the load less that of the drive [m].
  const Eigen::Vector3d& lost() const { return lost_; }
  /// Whether a drive that moves along axis i in this direction takes the load along.
  bool carries(int i, double direction) const {
    return direction * lost_(i) <= 0.0 && std::abs(lost_(i)) >= half_(i);
  }

 private:
  Eigen::Vector3d half_ = Eigen::Vector3d::Zero();
  Eigen::Vector3d lost_ = Eigen::Vector3d::Zero();
};

}  // namespace assembly_cell
