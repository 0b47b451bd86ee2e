#!/usr/bin/python3
# Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
"""Takes out of a bag what a tool of this package reads, on standard output.

usage: from_bag.py observations SESSION.bag
       from_bag.py locus RECORDING.bag [TOPIC]
       from_bag.py wrench RECORDING.bag [TOPIC [POSE_TOPIC]]
observations  the observation file: the last message on calibration_server/observations
locus         samples as CSV: of the coupling's displacement (t,x,y,z,rx,ry,rz) or, where the bag has none, of the peg's two
              accelerometers (t,ax,ay); TOPIC chooses among several. With messages of the exciter in the bag: of the last
              stretch in which it was on, t = 0 at its phase zero, its settings in a first line that starts with #
wrench        t,fx,fy,fz,tx,ty,tz,x,y,z,qx,qy,qz,qw: a topic of wrenches (WrenchStamped, or WrenchSamples), each with the last
              pose (PoseStamped) before it; TOPIC and POSE_TOPIC ('' for the only one) choose among several. Messages that share
              a stamp are spread evenly to the next one; where a topic's stamps are all 0 or stand still, the times of recording are used.
              Samples that are marked as saturated, not finite or beyond what any sensor measures (90 kN, 9 kN m) are left
              out. Each of these is printed on standard error with its number
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
MOST = 10  # messages of one stamp: a clock that stands has more
LONGEST_GAP = 10 ** 10  # between the spans of two topics of one clock [ns]


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


def only_topic(bag, types, wanted):
    found = {name: info.msg_type for name, info in bag.get_type_and_topic_info().topics.items()}
    topics = sorted(name for name in found if found[name] in types)
    if wanted is not None:
        named = [name for name in topics if name.strip("/") == wanted.strip("/")]
        if not named:
            raise ValueError(f"no {' or '.join(types)} on {wanted}: give one of {', '.join(topics) or 'none'}")
        return named[0]
    if not topics:
        raise ValueError(f"no topic of {' or '.join(types)}: record one")
    if len(topics) > 1:
        option = "--pose-topic" if "geometry_msgs/PoseStamped" in types else "--topic"
        raise ValueError(f"{len(topics)} topics of {' or '.join(types)}: name one of {', '.join(topics)} with {option}")
    return topics[0]


def note(text):
    print(text, file=sys.stderr)


def stamped(entries, topic, use_arrival):
    """Messages of a topic as (time [ns], message), rising: by stamps, those that share one spread evenly to the next."""
    if use_arrival:
        entries = [(arrival, arrival, message) for _, arrival, message in entries]
    else:
        without = sum(1 for stamp, _, _ in entries if stamp == 0)
        if without:
            note(f"{without} messages of {topic} left out: header.stamp is 0")
        entries = [entry for entry in entries if entry[0] != 0]
    # sort() keeps the order of recording within a stamp
    entries.sort(key=lambda entry: entry[0])
    groups, again = [], 0
    for stamp, _, message in entries:
        if not groups or groups[-1][0] != stamp:
            groups.append((stamp, [message]))
        elif message in groups[-1][1]:
            again += 1
        else:
            groups[-1][1].append(message)
    if again:
        note(f"{again} messages of {topic} left out: recorded twice")
    shared = len(entries) - again - len(groups)
    if shared:
        note(f"{shared} of {len(entries)} messages of {topic} share the stamp of another: spread evenly to the next stamp")
    steps = sorted(after[0] - group[0] for group, after in zip(groups, groups[1:]))
    usual = steps[len(steps) // 2] if steps else 10 ** 7
    out = []
    for i, (stamp, messages) in enumerate(groups):
        until = min(groups[i + 1][0] - stamp, usual) if i + 1 < len(groups) else usual
        out += [(stamp + k * until // len(messages), message) for k, message in enumerate(messages)]
    return out


def check_overlap(wrenches, poses):
    first, last = max(wrenches[0][0], poses[0][0]), min(wrenches[-1][0], poses[-1][0])
    if first > last + LONGEST_GAP:
        spans = [f"{1e-9 * part[0][0]:.3f} to {1e-9 * part[-1][0]:.3f} s" for part in (wrenches, poses)]
        raise ValueError(f"wrenches are of {spans[0]}, poses of {spans[1]}: give both one clock")


def wrench(bag, wrench_topic, pose_topic):
    topics = [only_topic(bag, ("geometry_msgs/WrenchStamped", "assembly_cell/WrenchSamples"), wrench_topic),
              only_topic(bag, ("geometry_msgs/PoseStamped",), pose_topic)]
    entries = {name: [] for name in topics}
    for name, message, arrival in bag.read_messages(topics=topics):
        entries[name].append((message.header.stamp.to_nsec(), arrival.to_nsec(), message))
    for name in topics:
        if not entries[name]:
            raise ValueError(f"no message on {name}: record it again")
    # one clock for both: that of the bag where one of them has none
    unstamped = [name for name in topics if all(entry[0] == 0 for entry in entries[name])]
    if unstamped:
        note(f"header.stamp of {' and '.join(unstamped)} is 0: times of recording in the bag are used")
    # a stamp of more than MOST messages is that of a clock that stands
    for name in set(topics) - set(unstamped):
        if len(entries[name]) > MOST * len({entry[0] for entry in entries[name]}):
            note(f"header.stamp of {name} stands still: times of recording in the bag are used")
            unstamped.append(name)
    found, poses = [stamped(entries[name], name, bool(unstamped)) for name in topics]
    check_overlap(found, poses)
    rows, refused = [], []

    def keep(stamp, values, saturated=0):
        bad = [k for k, value in enumerate(values) if saturated >> k & 1 or not abs(value) <= LARGEST[k]]
        if bad:
            refused.append((stamp, bad[0], values[bad[0]]))
        else:
            rows.append((stamp, values))

    for stamp, message in found:
        if message._type == "geometry_msgs/WrenchStamped":
            f, m = message.wrench.force, message.wrench.torque
            keep(stamp, [f.x, f.y, f.z, m.x, m.y, m.z])
            continue
        for k in range(len(message.wrench) // 6):
            at = stamp + (round(1e9 * k * message.period) if math.isfinite(message.period) else k)
            keep(at, list(message.wrench[6 * k:6 * k + 6]), message.saturated[k] if k < len(message.saturated) else 0)
    if refused:
        stamp, channel, value = min(refused)
        text = (f"{len(refused)} samples left out: saturated, or beyond what a sensor measures; "
                f"the first: {('fx', 'fy', 'fz', 'tx', 'ty', 'tz')[channel]} {value!r} at {1e-9 * stamp:.6f} s")
        if not rows:
            raise ValueError(text + "; none are left")
        note(text)
    times = [stamp for stamp, _ in poses]
    lines = ["t,fx,fy,fz,tx,ty,tz,x,y,z,qx,qy,qz,qw"]
    # a later block that begins within one before it goes on after it
    last = None
    overlapping = 0
    for stamp, values in sorted(rows, key=lambda row: row[0]):
        if last is not None and stamp <= last:
            overlapping += 1
            continue
        last = stamp
        k = bisect.bisect_right(times, stamp)
        if k > 0:
            p, q = poses[k - 1][1].pose.position, poses[k - 1][1].pose.orientation
            pose = [p.x, p.y, p.z, q.x, q.y, q.z, q.w]
            lines.append(",".join(map(repr, [1e-9 * (stamp - times[0])] + values + pose)))
    if overlapping:
        note(f"{overlapping} samples left out: at the time of another")
    return "\n".join(lines) + "\n"


def main():
    arguments = sys.argv[1:]
    if arguments[:1] in (["-h"], ["--help"]):
        print(__doc__.strip())
        return 0
    most = {"observations": 2, "locus": 3, "wrench": 4}
    if not 2 <= len(arguments) <= most.get(arguments[0] if arguments else "", 0):
        given = " ".join(arguments) or "none"
        print(f"from_bag.py: arguments {given}: give observations, locus or wrench and a bag, see --help", file=sys.stderr)
        return 2
    try:
        with rosbag.Bag(arguments[1]) as bag:
            topics = [topic or None for topic in arguments[2:]] + [None, None]
            if arguments[0] == "locus":
                text = locus(bag, topics[0])
            elif arguments[0] == "wrench":
                text = wrench(bag, topics[0], topics[1])
            else:
                text = observations(bag)
        sys.stdout.write(text)
    except rosbag.ROSBagUnindexedException:
        print(f"{arguments[1]}: has no index, its recording was cut off: run rosbag reindex {arguments[1]}", file=sys.stderr)
        return 2
    except (OSError, ValueError, rosbag.ROSBagException) as error:
        print(f"{arguments[1]}: {error}", file=sys.stderr)
        return 2
    return 0


if __name__ == "__main__":
    sys.exit(main())
