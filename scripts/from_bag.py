#!/usr/bin/python3
# Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
"""Takes out of a bag what a tool of this package reads, on standard output.

usage: from_bag.py observations SESSION.bag
       from_bag.py locus RECORDING.bag [TOPIC]
       from_bag.py wrench RECORDING.bag
observations  the observation file: the last message on calibration_server/observations
locus         samples as CSV: of the coupling's displacement (t,x,y,z,rx,ry,rz) or, where the bag has none, of the peg's two
              accelerometers (t,ax,ay); TOPIC chooses among several. With messages of the exciter in the bag: of the last
              stretch in which it was on, t = 0 at its phase zero, its settings in a first line that starts with #
wrench        t,fx,fy,fz,tx,ty,tz,x,y,z,qx,qy,qz,qw: the one topic of wrenches (WrenchStamped, or WrenchSamples), each with the
              last pose (PoseStamped, one topic) before it; without samples that are marked as saturated, not finite or beyond
              what any sensor measures (90 kN, 9 kN m): their number is printed on standard error
exit: 0 ok, 2 bad input
"""
import bisect
import math
import sys

import rosbag

MOTIONS = {"assembly_cell/DisplacementSamples": ("displacement", "t,x,y,z,rx,ry,rz"),
           "assembly_cell/AccelerometerSamples": ("acceleration", "t,ax,ay")}
# as the driver's ~range_force and ~range_torque: beyond is a code for a fault, or an end of the numbers
LARGEST = [9e4] * 3 + [9e3] * 3  # [N], [N m]


def observations(bag):
    text = None
    for topic, message, _ in bag.read_messages():
        if topic.endswith("/observations") and message._type == "std_msgs/String" and message.data:
            text = message.data
    if text is None:
        raise ValueError("no std_msgs/String on a topic that ends in /observations: record calibration_server/observations")
    return text


def stretch(exciters):
    """The last message that switches on, and the time [ns] at which another one ends it."""
    for i in range(len(exciters) - 1, -1, -1):
        if exciters[i].on:
            end = exciters[i + 1].header.stamp.to_nsec() if i + 1 < len(exciters) else None
            return exciters[i], end
    raise ValueError("the exciter is never on: record the topic exciter from before it is switched on, or not at all")


def locus(bag, topic):
    found = {name: info.msg_type for name, info in bag.get_type_and_topic_info().topics.items()}
    if topic is not None:
        topics = [name for name in found if name.strip("/") == topic.strip("/") and found[name] in MOTIONS]
    else:
        for kind in MOTIONS:
            topics = [name for name in found if found[name] == kind]
            if topics:
                break
    if not topics:
        raise ValueError(f"no samples{'' if topic is None else ' on ' + topic}: record sensor_b/displacement_samples or accelerometers")
    if len(topics) > 1:
        raise ValueError(f"samples on {' and '.join(sorted(topics))}: name the topic")
    field, header = MOTIONS[found[topics[0]]]
    width = header.count(",")

    # latched messages come again: each once, in the order of their time
    blocks, exciters = {}, {}
    for name, message, _ in bag.read_messages():
        if name == topics[0]:
            blocks[message.header.stamp.to_nsec()] = message
        elif message._type == "assembly_cell/Exciter":
            exciters[message.header.stamp.to_nsec()] = message
    lines = []
    start, end, zero = None, None, min(blocks)
    if exciters:
        exciter, end = stretch([exciters[key] for key in sorted(exciters)])
        if not exciter.frequency > 0.0:
            raise ValueError(f"the exciter's frequency is {exciter.frequency}: it must be positive")
        start = exciter.header.stamp.to_nsec()
        if start == 0:
            raise ValueError("the exciter's message has no stamp, so its phase is unknown: record one with a stamp")
        zero = start - round(1e9 * exciter.phase / exciter.frequency)
        lines.append(f"# frequency={exciter.frequency!r} amplitude={exciter.amplitude!r} direction={exciter.direction}")
    lines.append(header)
    for stamp in sorted(blocks):
        values = getattr(blocks[stamp], field)
        if len(values) % width:
            raise ValueError(f"a block of {topics[0]} has {len(values)} values: a multiple of {width} is needed")
        period = 1e9 * blocks[stamp].period
        for k in range(len(values) // width):
            at = stamp + k * period
            if (start is None or at >= start) and (end is None or at < end):
                row = [f"{1e-9 * (at - zero):.10f}"] + [repr(v) for v in values[k * width:(k + 1) * width]]
                lines.append(",".join(row))
    return "\n".join(lines) + "\n"


def only_topic(bag, types):
    topics = sorted(name for name, info in bag.get_type_and_topic_info().topics.items() if info.msg_type in types)
    if len(topics) != 1:
        raise ValueError(f"{' and '.join(topics) or 'no topic'} of {' or '.join(types)}: record one")
    return topics[0]


def wrench(bag):
    topics = {kind: only_topic(bag, types) for kind, types in
              {"wrench": ("geometry_msgs/WrenchStamped", "assembly_cell/WrenchSamples"), "pose": ("geometry_msgs/PoseStamped",)}.items()}
    poses, wrenches, refused = {}, {}, []

    def keep(stamp, values, saturated=0):
        bad = [k for k, value in enumerate(values) if saturated >> k & 1 or not abs(value) <= LARGEST[k]]
        if bad:
            refused.append((stamp, bad[0], values[bad[0]]))
        else:
            wrenches[stamp] = values

    for name, message, _ in bag.read_messages(topics=list(topics.values())):
        stamp = message.header.stamp.to_nsec()
        if name == topics["pose"]:
            p, q = message.pose.position, message.pose.orientation
            poses[stamp] = [p.x, p.y, p.z, q.x, q.y, q.z, q.w]
        elif message._type == "geometry_msgs/WrenchStamped":
            f, m = message.wrench.force, message.wrench.torque
            keep(stamp, [f.x, f.y, f.z, m.x, m.y, m.z])
        else:
            for k in range(len(message.wrench) // 6):
                at = stamp + (round(1e9 * k * message.period) if math.isfinite(message.period) else k)
                keep(at, list(message.wrench[6 * k:6 * k + 6]), message.saturated[k] if k < len(message.saturated) else 0)
    if refused:
        stamp, channel, value = min(refused)
        text = (f"{len(refused)} samples left out: saturated, or beyond what a sensor measures; "
                f"the first: {('fx', 'fy', 'fz', 'tx', 'ty', 'tz')[channel]} {value!r} at {1e-9 * stamp:.6f} s")
        if not wrenches:
            raise ValueError(text + "; none are left")
        print(text, file=sys.stderr)
    times = sorted(poses)
    lines = ["t,fx,fy,fz,tx,ty,tz,x,y,z,qx,qy,qz,qw"]
    for stamp in sorted(wrenches):
        k = bisect.bisect_right(times, stamp)
        if k > 0:
            lines.append(",".join(map(repr, [1e-9 * (stamp - times[0])] + wrenches[stamp] + poses[times[k - 1]])))
    return "\n".join(lines) + "\n"


def main():
    arguments = sys.argv[1:]
    if arguments[:1] in (["-h"], ["--help"]):
        print(__doc__.strip())
        return 0
    if not (len(arguments) == 2 and arguments[0] in ("observations", "locus", "wrench") or len(arguments) == 3 and arguments[0] == "locus"):
        given = " ".join(arguments) or "none"
        print(f"from_bag.py: arguments {given}: give observations, locus or wrench and a bag, see --help", file=sys.stderr)
        return 2
    try:
        with rosbag.Bag(arguments[1]) as bag:
            if arguments[0] == "locus":
                text = locus(bag, arguments[2] if arguments[2:] else None)
            else:
                text = {"observations": observations, "wrench": wrench}[arguments[0]](bag)
        sys.stdout.write(text)
    except (OSError, ValueError, rosbag.ROSBagException) as error:
        print(f"{arguments[1]}: {error}", file=sys.stderr)
        return 2
    return 0


if __name__ == "__main__":
    sys.exit(main())
