// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <geometry_msgs/PoseWithCovarianceStamped.h>

#include <optional>
#include <string>
#include <vector>

#include "assembly_cell/SolveTwinForce.h"
#include "assembly_cell/TwinForceState.h"
#include "assembly_cell/align/estimation/twin_contacts.h"
#include "assembly_cell/ros/estimation/twin_force_streams.h"

namespace assembly_cell::ros_bridge {

/// Throws InputError for numbers that are not positive or a bad capacity.
TwinForceTask fromMessage(const ContactTask& task);

/// Contacts of a task with the windows that they are from, the zero, the pose and the advice. A
/// window that was added before, with the same zero, is recognized: a call whose answer was lost
/// may be repeated. Not thread-safe.
class TwinForceSession {
 public:
  explicit TwinForceSession(const TwinForceSetup& setup) : contacts_(setup) {}

  /// Covariances for tasks that begin from now on, see TwinForceContacts.
  void setGainCovariances(const PerSide<Eigen::MatrixXd>& gains) {
    contacts_.setGainCovariances(gains.a, gains.b);
  }
  /// Drops contacts and zero. task: `message` in the core's terms.
  void begin(const TwinForceTask& task, const ContactTask& message);
  std::size_t contactCount() const { return origins_.size(); }

  /// The answer of the call that took the zero from this window; nothing: no call did.
  std::optional<std::string> tareAnswer(const BlockWindow& window) const;
  /// Takes the zero and returns the answer. Throws InputError with the reason of a refusal.
  std::string tare(const BlockWindow& window, const TwinForceStreams::Average& average);
  /// The same of a contact.
  std::optional<std::string> addAnswer(const BlockWindow& window) const;
  std::string add(const BlockWindow& window, const TwinForceStreams::Average& average);

  /// Estimates the pose and the next contact.
  void solve(SolveTwinForce::Response& response);
  bool hasPose() const { return has_pose_; }

  TwinForceState state() const;
  /// Pose of the peg in the hole with the carrier as it is now.
  Pose pose(const TwinForceHistory::Now& now) const;
  /// Sets the covariance of its coordinates, 6 × 6.
  void setCovariance(const Pose& X_HP, boost::array<double, 36>& out) const;

 private:
  /// What a contact is from.
  struct Origin {
    TwinForceStreams::Average pressed;
    std::optional<TwinForceStreams::Average> free;  ///< the zero
    BlockWindow window;                             ///< as it was named
    std::string answer;
  };

  FeltContact contactMessage(std::size_t i) const;
  void setPose(TwinForceState& out) const;

  TwinForceContacts contacts_;
  std::vector<Origin> origins_;                    // of the contacts
  std::optional<TwinForceStreams::Average> free_;  // the latest zero
  BlockWindow free_window_;                        // as it was named
  ContactTask task_;
  bool has_pose_ = false;
  std::optional<ReachableContact> advised_;
};

}  // namespace assembly_cell::ros_bridge
