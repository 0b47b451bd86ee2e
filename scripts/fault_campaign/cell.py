# Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
"""A cell as processes of this one, its messages, and goals to it."""
import ctypes
import math
import os
import pathlib
import signal
import subprocess
import threading
import time
import xmlrpc.client

START = 120.0  # for a node, a cell, a service to be there [s wall]
ENDED = 20.0  # a node that was stopped [s wall]
STILL = 1e-5  # in a block: displacement of an arm at rest under a swinging peg [m]
MINE = "/campaign_of_faults"  # this node, an unknown publisher to the cell

SUPERVISOR, SIMULATOR = "assembly_supervisor", "peg_hole_simulator"
LOCUS, TWIN, IDENTIFIER = "locus_estimator", "twin_force_estimator", "mechanism_identifier"
DRIVERS = ("sensor_a/driver", "sensor_b/driver")
RIG, SERVER = "bench/simulated_calibration_rig", "bench/calibration_server"
BENCH_DRIVERS = ("bench/sensor_a/driver", "bench/sensor_b/driver")
NODES = (SUPERVISOR, SIMULATOR, *DRIVERS, LOCUS, TWIN, IDENTIFIER)
BRIDGE, ARM = "arm_bridge", "emulate_arm"


class Broken(Exception):
    """A cell that doesn't get ready."""


def wait_for(ready, limit, pause=0.002):
    """True as soon as the condition holds, False after the limit [s wall]."""
    end = time.monotonic() + limit
    while not ready():
        if time.monotonic() > end:
            return False
        time.sleep(pause)
    return True


def end_with_parent():
    """In a child: the end of the program that started it, however it comes, is its own."""
    ctypes.CDLL(None).prctl(1, signal.SIGKILL)  # PR_SET_PDEATHSIG


class Terminal:
    """What a node writes to: a pipe whose text is copied to the log, unless it is stopped and full."""

    def __init__(self, log):
        self.log, self.going = log, threading.Event()
        self.going.set()
        self.reader, self.writer = os.pipe()
        threading.Thread(target=self.copy, daemon=True).start()

    def copy(self):
        while True:
            text = os.read(self.reader, 4096)
            self.going.wait()
            os.write(self.log.fileno(), text)

    def stop(self):
        self.going.clear()
        # a description of its own: the node's one stays as it is
        full = os.open(f"/proc/self/fd/{self.writer}", os.O_WRONLY | os.O_NONBLOCK)
        try:
            while True:
                os.write(full, b"." * 4095 + b"\n")
        except BlockingIOError:
            os.close(full)


class Nodes:
    def __init__(self, options, folder, log):
        import roslaunch.config

        self.options, self.folder, self.log = options, folder, log
        self.terminals = {}
        self.ns = "" if options.namespace == "root" else "/" + options.namespace
        self.nodes, self.running, self.ours = {}, {}, set()  # ours: those that this tool has ended
        package = pathlib.Path(__import__("rospkg").RosPack().get_path("assembly_cell"))
        self.package = package
        lockstep = options.mode == "lockstep"
        cell = ["record:=off", "lockstep:=" + str(lockstep).lower(), f"real_time_factor:={1.0 / options.factor}"]
        cell += ["arm:=true"] if options.arm else ["identification:=true"]
        self.load(roslaunch.config, package / "launch/cell.launch", cell, "")
        if not lockstep and not options.arm:
            bench = ["store:=" + folder + "/store"]
            self.load(roslaunch.config, package / "launch/calibration.launch", bench, "/bench")
        parameters = {
            SUPERVISOR + "/slow_factor": float(options.factor), IDENTIFIER + "/slow_factor": float(options.factor), SIMULATOR + "/ack_timeout": START,
            SIMULATOR + "/start_timeout": START, RIG + "/real_time_factor": 5.0 / options.factor}
        for driver in BENCH_DRIVERS:
            parameters[driver + "/rate_tolerance"] = 10.0  # faster than a sensor
        for name, value in parameters.items():
            if name.rsplit("/", 1)[0] in self.nodes:
                self.master().setParam(f"{self.ns}/{name}", value)

    def master(self):
        import rosgraph

        return rosgraph.Master(MINE)

    def load(self, config_of, file, arguments, below):
        """Parameters to the master; its nodes under their names relative to the cell."""
        os.environ["ROS_NAMESPACE"] = (self.ns + below) or "/"
        config = config_of.load_config_default([(str(file), arguments)], None)
        for param in config.params.values():
            self.master().setParam(param.key, param.value)
        for node in config.nodes:
            if node.package == "assembly_cell" and node.type != "contact_markers":
                self.nodes[(node.namespace + node.name)[len(self.ns) + 1:]] = node

    def start(self, name):
        from roslaunch.core import setup_env
        from roslaunch.node_args import create_local_process_args

        node = self.nodes[name]
        environment = setup_env(node, node.machine, os.environ["ROS_MASTER_URI"])
        terminal = self.terminal_of(name).writer
        self.running[name] = subprocess.Popen(
            create_local_process_args(node, node.machine), env=environment, stdin=subprocess.DEVNULL, stdout=terminal, stderr=terminal,
            start_new_session=True, preexec_fn=end_with_parent)
        self.ours.discard(name)

    def terminal_of(self, name):
        if name not in self.terminals:
            self.terminals[name] = Terminal(self.log)
        return self.terminals[name]

    def start_second(self, name):
        """The same node under another name; its exit code."""
        from roslaunch.core import setup_env
        from roslaunch.node_args import create_local_process_args

        node, other = self.nodes[name], "second_" + name
        self.master().setParam(f"{self.ns}/{other}", self.master().getParam(f"{self.ns}/{name}"))
        command = [f"__name:={other}" if word.startswith("__name:=") else word for word in create_local_process_args(node, node.machine)]
        environment = setup_env(node, node.machine, os.environ["ROS_MASTER_URI"])
        return subprocess.run(command, env=environment, stdin=subprocess.DEVNULL, stdout=self.log, stderr=self.log, preexec_fn=end_with_parent,
                              timeout=ENDED * self.options.factor, check=False).returncode

    def up(self, name):
        """Is the process that was started the one that is registered at the master?"""
        try:
            uri = self.master().lookupNode(f"{self.ns}/{name}")
            return xmlrpc.client.ServerProxy(uri).getPid(MINE)[2] == self.running[name].pid
        except Exception:  # not there yet
            return False

    def signal(self, name, number):
        if number in (signal.SIGKILL, signal.SIGINT):
            self.ours.add(name)
        if self.running[name].poll() is None:
            self.running[name].send_signal(number)

    def end(self, names):
        """Ctrl-C to all of them; names those that don't end, or not well."""
        for name in names:
            self.signal(name, signal.SIGINT)
        return [wrong for name in names for wrong in self.wait_for_end(name, self.running[name])]

    def wait_for_end(self, name, program):
        """A line if it doesn't end, or not well."""
        try:
            code = program.wait(ENDED * self.options.factor)
            return [f"{name} ends with {code}"] if code != 0 else []
        except subprocess.TimeoutExpired:
            program.kill()
            program.wait()
            return [f"{name} doesn't end"]

    def crashed(self):
        """Nodes that have ended by themselves."""
        return [f"{n} has ended with {p.returncode}" for n, p in self.running.items() if p.poll() is not None and n not in self.ours]


class Ears:
    """Messages of the cell, as they arrive."""

    def __init__(self, ns, arm):
        import rospy
        from assembly_cell.msg import ContactArray, Exciter, Lease, PlantState, SupervisorState
        from diagnostic_msgs.msg import DiagnosticArray
        from geometry_msgs.msg import PoseStamped

        self.plant, self.supervisor, self.pose = [], None, None  # states of the plant with the owner's last heartbeat
        self.sign, self.time, self.height, self.force, self.peak = None, 0.0, 0.0, 0.0, 0.0
        self.named = {}  # what nodes have refused, by their name in the diagnostics
        self.samples = {}
        self.at, self.moving = None, 0.0  # true carrier, and when it moved last [s]

        def on_contacts(message):
            force = [sum(getattr(c.force, axis) for c in message.contacts if c.state) for axis in "xyz"]
            self.force = math.sqrt(sum(f * f for f in force))
            self.peak = max(self.peak, self.force)

        def on_carrier(message):
            if message._connection_header["callerid"] == MINE:
                return
            self.height = message.pose.position.z
            if not arm:
                self.time = message.header.stamp.to_sec()
            self.samples["carrier_pose"] = message

        def on_simulated(message):
            at, self.time = [getattr(message.pose.position, axis) for axis in "xyz"], message.header.stamp.to_sec()
            if self.at is not None and math.dist(at, self.at) > STILL:
                self.moving = self.time
            self.at = at

        def on_heartbeat(message):
            if message._connection_header["callerid"] != MINE:
                self.sign = max(self.sign or 0.0, message.header.stamp.to_sec())

        def on_plant(message):
            if message._connection_header["callerid"] == MINE:
                return
            if self.plant and self.plant[-1][0].session != message.session and message.session:
                self.sign = None
            self.plant.append((message, self.sign))

        def on_diagnostics(message):
            for status in message.status:
                if status.name.endswith(": messages") and MINE in status.message:
                    self.named[status.name] = status.message

        subscribe = lambda topic, cls, what: rospy.Subscriber(ns + "/" + topic, cls, what, queue_size=200, tcp_nodelay=True)
        self.subscribers = [
            subscribe("truth/contacts", ContactArray, on_contacts), subscribe("carrier_pose", PoseStamped, on_carrier),
            subscribe("lease", Lease, on_heartbeat), subscribe("carrier_command", PoseStamped, on_heartbeat), subscribe("exciter", Exciter, on_heartbeat),
            subscribe("plant_state", PlantState, on_plant),
            subscribe(SUPERVISOR + "/state", SupervisorState, lambda message: setattr(self, "supervisor", message)),
            subscribe("truth/pose", PoseStamped, lambda message: setattr(self, "pose", message.pose)),
            rospy.Subscriber("/diagnostics", DiagnosticArray, on_diagnostics, queue_size=50)]
        if arm:
            self.subscribers.append(subscribe("arm/simulated_pose", PoseStamped, on_simulated))

    def state(self):
        return self.plant[-1][0] if self.plant else None


class Goal:
    """A goal and what its client learns."""

    def __init__(self, client, fields):
        self.client = client
        message = client.goal_class()
        for name, value in fields.items():
            setattr(message.goal, name, value)
        client.count += 1
        self.id = message.goal_id.id = f"faults {os.getpid()} {client.count}"
        self.result = self.status = self.end = None
        client.goal = self
        client.send.publish(message)

    def lost(self):
        """The server's connections have ended."""
        if self.result is None and self.end is None and self.client.results.get_num_connections() == 0:
            self.end = time.monotonic()
        return self.result is None and self.end is not None

    def done(self):
        return self.result is not None or self.lost()

    def cancel(self):
        from actionlib_msgs.msg import GoalID

        self.client.stop.publish(GoalID(id=self.id))

    def succeeded(self):
        return self.status == 3

    def reason(self):
        if self.result is None:
            return "server lost" if self.lost() else ""
        return self.result.report.reason if hasattr(self.result, "report") else self.result.message


class Client:
    def __init__(self, ns, action, types):
        import rospy
        from actionlib_msgs.msg import GoalID

        self.goal_class, result_class = types
        self.goal, self.count = None, 0
        self.send = rospy.Publisher(f"{ns}/{action}/goal", self.goal_class, queue_size=10, tcp_nodelay=True)
        self.stop = rospy.Publisher(f"{ns}/{action}/cancel", GoalID, queue_size=10, tcp_nodelay=True)
        self.results = rospy.Subscriber(f"{ns}/{action}/result", result_class, self.on_result, queue_size=20, tcp_nodelay=True)

    def on_result(self, message):
        goal = self.goal
        if goal is not None and message.status.goal_id.id == goal.id and goal.result is None:
            goal.end = time.monotonic()
            goal.status, goal.result = message.status.status, message.result

    def connected(self):
        return all(p.get_num_connections() > 0 for p in (self.send, self.stop, self.results))
