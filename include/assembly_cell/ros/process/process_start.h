// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <atomic>
#include <optional>
#include <string>

namespace assembly_cell::ros_bridge {

/// Before ros::init: a file that reaches the limit of the system is a failed write, which is
/// reported, not the end of the process; as many open files as the system allows. Returns why this
/// process can't work, one line: too few open files, or a master that accepts connections and
/// doesn't respond.
std::optional<std::string> prepareProcess();

/// After ros::init, for a program that isn't a node of the cell: ends the process with 1 and one
/// line when the master doesn't respond while it is `needed`, which must live as long as the
/// process.
void watchMaster(const std::string& name, const std::atomic<bool>& needed);

/// After ros::init: ends a node of the same name and waits for its end, so that it ends its goals
/// while its clients still receive their results. A node that doesn't respond is left to the
/// master.
void replaceNamesake();

/// The request of a namesake, or of rosnode kill, sets `requested` instead of ending ROS at once:
/// the node can still publish its results. After the first NodeHandle.
void acceptShutdownRequests(std::atomic<bool>& requested);

/// Ends the process with this code after `limit` [s]: ROS's own end waits without a limit for a
/// master that is frozen. Returns the code.
int endWithin(double limit, int code);

}  // namespace assembly_cell::ros_bridge
