#!/usr/bin/python3
# Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
"""Has a running calibration_server measure plans one after another, from no observations on, and store one calibration
of both sensors from all of them.

usage: calibrate_client.py PLAN...    plans: recommended, quadratic, displacement (docs/how_to/calibration.md)
Standard output: the id of what was stored. What it does and what comes of it: standard error.
exit: 0 stored, 1 not
example: calibrate_client.py recommended displacement
"""
import sys

import actionlib
import rosgraph
import rospy
from assembly_cell.msg import CalibrateSensorsAction, CalibrateSensorsGoal

START = 120.0  # for the server, wall clock [s]
SHOW_EVERY = 25  # steps


def show(text):
    print(text, file=sys.stderr, flush=True)


class Progress:
    def __init__(self, plan):
        self.plan, self.shown = plan, 0

    def __call__(self, feedback):
        if feedback.step >= self.shown + SHOW_EVERY:
            self.shown = feedback.step
            show(f"{self.plan}: step {feedback.step} of {feedback.steps}")


def main():
    plans = rospy.myargv()[1:]
    if not plans:
        sys.exit("calibrate_client: no plan: give recommended, quadratic or displacement, or several")
    if plans[0].startswith("-"):
        print(__doc__.strip())
        return 0 if plans[0] in ("-h", "--help") else 2
    if not rosgraph.is_master_online():
        sys.exit(f"calibrate_client: no ROS master at {rosgraph.get_master_uri()}: start the rig first, or set ROS_MASTER_URI")
    rospy.init_node("calibrate_client", anonymous=True)
    client = actionlib.SimpleActionClient("calibrate", CalibrateSensorsAction)
    if not client.wait_for_server(rospy.Duration(START)):
        sys.exit(f"calibrate_client: no server of the action 'calibrate' within {START:g} s: is calibration_server running?")
    for plan in plans:
        # only the last one stores: it solves with the observations of all
        client.send_goal(CalibrateSensorsGoal(plan=plan, restart=plan == plans[0], dry_run=plan != plans[-1]), feedback_cb=Progress(plan))
        client.wait_for_result()
        result = client.get_result()
        if result is None:
            sys.exit(f"calibrate_client: {plan}: the server has ended without a result")
        show(f"{plan}: {result.observations} observations; {result.message}")
        if not result.success:
            return 1
    print(result.id)
    return 0


if __name__ == "__main__":
    sys.exit(main())
