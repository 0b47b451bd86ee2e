#!/usr/bin/python3
# Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
"""Takes the observation file out of a bag: the last message on calibration_server/observations.

usage: observations_from_bag.py SESSION.bag OBSERVATIONS.yaml
exit: 0 ok, 2 bad input
"""
import sys

import rosbag


def main():
    if len(sys.argv) != 3 or sys.argv[1] in ("-h", "--help"):
        print(__doc__.strip(), file=sys.stderr)
        return 0 if len(sys.argv) > 1 and sys.argv[1] in ("-h", "--help") else 2
    text = None
    try:
        with rosbag.Bag(sys.argv[1]) as bag:
            for topic, message, _ in bag.read_messages():
                if topic.endswith("/observations") and message._type == "std_msgs/String" and message.data:
                    text = message.data
        if text is None:
            raise ValueError("no std_msgs/String on a topic that ends in /observations: record calibration_server/observations")
        with open(sys.argv[2], "w", encoding="utf-8") as file:
            file.write(text)
    except (OSError, ValueError, rosbag.ROSBagException) as error:
        print(f"observations_from_bag.py: {sys.argv[1]}: {error}", file=sys.stderr)
        return 2
    return 0


if __name__ == "__main__":
    sys.exit(main())
