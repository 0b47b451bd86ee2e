#!/usr/bin/env python3
# Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
"""Asks a running cell for an alignment, tells what it does, and how it ended.

usage: align_client.py [STRATEGY]    strategies: docs/strategies.md; none: the cell's own
"""
import sys

import actionlib
import rospy
from assembly_cell.msg import AlignPegAction, AlignPegGoal


def tell(feedback):
    known = f", hole known to {1e3 * feedback.position_sd:.3f} mm" if feedback.position_sd > 0.0 else ""
    print(f"{feedback.time:7.2f} s  {feedback.state}, {feedback.contacts} contacts{known}")


def main():
    if len(sys.argv) > 1 and sys.argv[1].startswith("-"):
        print(__doc__)
        return 0 if sys.argv[1] in ("-h", "--help") else 2
    rospy.init_node("align_client", anonymous=True)
    client = actionlib.SimpleActionClient("align", AlignPegAction)
    if not client.wait_for_server(rospy.Duration(60.0)):
        sys.exit("align_client: no server of the action 'align' within 60 s: is assembly_supervisor running?")
    goal = AlignPegGoal(strategy=rospy.myargv()[1] if len(rospy.myargv()) > 1 else "")
    client.send_goal(goal, feedback_cb=tell)
    client.wait_for_result()
    report = client.get_result().report
    print(report.reason)
    if report.success:
        x, y = report.estimated_offset
        print(f"the hole was at x {1e3 * x:.3f} mm, y {1e3 * y:.3f} mm from the peg")
    return 0 if report.success else 1


if __name__ == "__main__":
    sys.exit(main())
