#!/usr/bin/python3
# Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
"""Requests an alignment from a running cell, prints its status and the result.

usage: align_client.py [STRATEGY]    strategies: docs/reference/strategies.md; none: the cell's own
"""
import sys
import time

import actionlib
import rosgraph
import rospy
from actionlib_msgs.msg import GoalStatus
from assembly_cell.msg import AlignPegAction, AlignPegGoal


def show(feedback):
    known = f", hole known to {1e3 * feedback.position_sd:.3f} mm" if feedback.position_sd > 0.0 else ""
    print(f"{feedback.time:7.2f} s  {feedback.state}, {feedback.contacts} contacts{known}")


def server_comes(client, patience):
    """By the wall clock: a cell in lockstep makes a minute of its own in seconds."""
    end = time.monotonic() + patience
    while not client.wait_for_server(rospy.Duration(1.0)):
        if rospy.is_shutdown() or time.monotonic() > end:
            return False
    return True


def request(client, goal):
    """True with a result. What is sent while ROS makes a connection may be lost: a goal of which the server publishes nothing
    for 10 s is requested again."""
    while not rospy.is_shutdown():
        client.send_goal(goal, feedback_cb=show)
        end = time.monotonic() + 10.0
        while client.get_state() != GoalStatus.PENDING or time.monotonic() < end:
            if client.wait_for_result(rospy.Duration(1.0)):
                return True
            if rospy.is_shutdown():
                return False
    return False


def main():
    words = rospy.myargv()[1:]
    if len(words) > 1 or words and words[0].startswith("-"):
        print(__doc__.strip())
        return 0 if words[0] in ("-h", "--help") else 2
    if not rosgraph.is_master_online():
        sys.exit(f"align_client: no ROS master at {rosgraph.get_master_uri()}: start the cell first, or set ROS_MASTER_URI")
    rospy.init_node("align_client", anonymous=True)
    client = actionlib.SimpleActionClient("align", AlignPegAction)
    if not server_comes(client, 60.0):
        sys.exit("align_client: no server of the action 'align' within 60 s: is assembly_supervisor running?")
    goal = AlignPegGoal(strategy=words[0] if words else "")
    if not request(client, goal):
        return 1
    report = client.get_result().report
    print(report.reason)
    if report.success:
        x, y = report.estimated_offset
        print(f"the hole was at x {1e3 * x:.3f} mm, y {1e3 * y:.3f} mm from the peg")
    return 0 if report.success else 1


if __name__ == "__main__":
    sys.exit(main())
