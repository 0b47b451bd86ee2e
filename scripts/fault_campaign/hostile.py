# Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
"""Messages of unknown publishers, and changes during a goal."""
import copy

from .cell import MINE, START, wait_for

HOSTILE = {  # fault: part of the reason of the goal's end; None: the goal goes on, the diagnostics name the publisher
    "unknown publisher's carrier_command": MINE + " published carrier_command",
    "unknown publisher's exciter": MINE + " published exciter",
    "unknown publisher's exciter, absurd stamp": MINE + " published exciter",
    "unknown publisher's lease": None,
    "unknown publisher's plant_state": None,
    "unknown publisher's blocks, NaN": None,
    "unknown publisher's blocks, stamp 4294967295": None,
    "unknown publisher's blocks, sequence near 2^32": None,
    "unknown publisher's blocks, period 1e300": None,
    "unknown publisher's blocks, stale": None,
    "unknown publisher's strain, 100 V": None,
    "unknown publisher's carrier_pose": None,
    "unknown publisher's calibration, 1e300": None,
    "zero changed": "zero of sensor_b changed",
    "calibration changed": "calibration of sensor_b changed",
}


def be_hostile(campaign, what):
    """Does it; what undoes it."""
    import genpy
    import rospy
    from assembly_cell.msg import Exciter, Lease, PlantState, SensorCalibration, StrainSamples, WrenchSamples
    from assembly_cell.srv import GetCalibration, SetBias, SetCalibration
    from std_srvs.srv import Trigger

    nothing = lambda: None
    driver = "sensor_b/driver/"
    if what == "zero changed":
        campaign.call(driver + "set_bias", SetBias, [0.0, 0.0, 20.0, 0.0, 0.0, 0.0])
        return lambda: campaign.call(driver + "clear_bias", Trigger)
    if what == "calibration changed":
        answer = campaign.call(driver + "get_calibration", GetCalibration)
        if answer is None:
            return nothing
        other = copy.deepcopy(answer.calibration)
        other.volts_to_wrench = [1.001 * value for value in other.volts_to_wrench]
        campaign.call(driver + "set_calibration", SetCalibration, other)
        return lambda: campaign.call(driver + "set_calibration", SetCalibration, answer.calibration)
    stamp = rospy.Time.from_sec(campaign.ears.time)
    absurd = genpy.Time(4294967295, 0)
    if "carrier" in what:
        topic, message = "carrier_command" if "command" in what else "carrier_pose", copy.deepcopy(campaign.ears.samples["carrier_pose"])
        message.pose.position.z -= 0.02
    elif "exciter" in what:
        topic, message = "exciter", Exciter(on=True, amplitude=5.0, frequency=450.0, direction=1)
        message.header.stamp = absurd if "absurd" in what else stamp
    elif "lease" in what:
        topic, message = "lease", Lease(session=77)
        message.header.stamp = stamp
    elif "plant_state" in what:
        topic, message = "plant_state", PlantState(life=77, session=77, holder="none", held=True)
        message.header.stamp = stamp
    elif "calibration" in what:
        topic, message = "sensor_b/calibration", SensorCalibration(volts_to_wrench=[1e300] * 36)
    else:
        strain = "strain" in what
        topic = "sensor_b/bridge" if strain else "sensor_b/wrench_samples"
        message = StrainSamples(period=2e-4, volts=[100.0] * 600) if strain else WrenchSamples(period=2e-4, wrench=[1.0] * 600)
        message.saturated = bytes(100)
        message.header.stamp = absurd if "stamp" in what else stamp - rospy.Duration(2.0 if "stale" in what and stamp.secs > 2 else 0.0)
        message.sequence = 4294967290 if "sequence" in what else 5
        message.period = 1e300 if "period" in what else 2e-4
        if "NaN" in what:
            message.wrench = [float("nan")] * 600
    publisher = campaign.strange[topic]
    wait_for(lambda: publisher.get_num_connections() > 0, START)
    for _ in range(5):
        publisher.publish(message)
    return nothing
