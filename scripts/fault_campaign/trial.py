# Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
"""A goal, a fault, and what became of the promises."""
import copy
import math
import queue
import signal
import threading
import time

from .cell import (
    ARM, BENCH_DRIVERS, BRIDGE, DRIVERS, IDENTIFIER, LOCUS, MINE, NODES, RIG, SERVER, SIMULATOR, START, SUPERVISOR, TWIN, Broken, Client, Ears, Goal, Nodes, wait_for)
from .hostile import HOSTILE, be_hostile

# what docs/reference/safety.md promises
HOLD = 0.1 + 0.02  # from the last heartbeat; a block is the resolution of this tool [s cell]
NAME = 0.5  # a node that is missed to its name in the result [s]
STAND = 0.1 + 0.1 + 0.02  # through an arm: its timeout, braking, and a block [s cell]
FREEING = 2.0  # the peg is freed before the result comes [s cell]
LOST = 2.0  # a client learns that its server is gone [s]
GONE = 1.0  # in lockstep: a node that is gone [s wall]
FORCE_LIMIT = 40.0  # ~force_limit of the supervisor [N]
OVERSHOOT = 1.1

BLOCK_TIMEOUT = 10.0  # ~block_timeout of the supervisor [s wall]

# how a strategy may end from an unusual start
STRATEGY = (
    "edge_in_hole", "no_hole_under_edge", "no_contact", "no_plane_reading", "one_edge_only", "lost_contact", "not_inserted", "edge_not_resolved",
    "gave_way", "both_edges", "wedged", "not_double", "too_tight")

GOALS = {  # goal: (action, moments)
    "move_to_contact": ("move_to_contact", ("time", "down", "pressed")),
    "align": ("align", ("time", "down", "pressed", "shaken", "shaken")),
    "twin_force": ("align", ("time", "down", "pressed", "pressed")),
    "assemble": ("assemble", ("time", "down", "pressed", "inside", "inside")),
    "identify": ("identify", ("time", "pressed", "shaken")),
    "calibrate": ("bench/calibrate", ("time",)),
}
LONGEST = {"move_to_contact": 0.8, "align": 20.0, "twin_force": 12.0, "assemble": 12.0, "identify": 40.0, "calibrate": 0.7}  # of "time" [s]


def holder_of(goal):
    """The node that the goal is sent to."""
    return {"calibrate": SERVER, "identify": IDENTIFIER}.get(goal, SUPERVISOR)


def faults_of(goal, arm=False):
    if arm:
        # without those of the simulator itself
        nodes = [node for node in NODES if node not in (SIMULATOR, IDENTIFIER)] + [BRIDGE, ARM]
        found = [(kind, node) for kind in ("kill", "restart", "stall") for node in nodes]
        return found + [("stall", SUPERVISOR), ("stall", BRIDGE), ("kill", BRIDGE), ("restart", BRIDGE), ("ctrl-c", SUPERVISOR), ("ctrl-c", BRIDGE)]
    if goal == "calibrate":
        nodes = (RIG, SERVER, *BENCH_DRIVERS)
        return [(kind, node) for kind in ("kill", "restart", "stall") for node in nodes] + [("ctrl-c", SERVER)]
    found = [(kind, node) for kind in ("kill", "restart", "stall") for node in NODES]
    found += [("terminal", node) for node in NODES] + [("kill-without-master", node) for node in (*DRIVERS, LOCUS, TWIN)]
    found += [("second", holder_of(goal)), ("replace", holder_of(goal))]
    found += [("stall", holder_of(goal))] * 2 + [("ctrl-c", holder_of(goal))] * 2 + [("ctrl-c", "all")]
    return found + [("hostile", what) for what in HOSTILE]


class Campaign:
    def __init__(self, options, folder, log):
        import rospy
        import assembly_cell.msg as m
        import yaml
        from geometry_msgs.msg import PoseStamped

        self.options, self.lockstep = options, options.mode == "lockstep"
        self.factor = 1.0 if self.lockstep else options.factor
        self.nodes = Nodes(options, folder, log)
        self.ns = self.nodes.ns
        self.arm = options.arm
        self.ears = Ears(self.ns, self.arm)
        self.last_boot = 0  # boot id before the last restart
        types = {"move_to_contact": (m.MoveToContactActionGoal, m.MoveToContactActionResult), "align": (m.AlignPegActionGoal, m.AlignPegActionResult),
                 "retreat": (m.RetreatActionGoal, m.RetreatActionResult), "assemble": (m.AssemblePegActionGoal, m.AssemblePegActionResult),
                 "identify": (m.IdentifyActionGoal, m.IdentifyActionResult), "bench/calibrate": (m.CalibrateSensorsActionGoal, m.CalibrateSensorsActionResult)}
        self.clients = {name: Client(self.ns, name, of) for name, of in types.items()}
        advertise = lambda topic, cls: rospy.Publisher(f"{self.ns}/{topic}", cls, queue_size=100, tcp_nodelay=True)
        self.strange = {
            topic: advertise(topic, cls) for topic, cls in {
                "carrier_command": PoseStamped, "exciter": m.Exciter, "lease": m.Lease, "plant_state": m.PlantState,
                "sensor_b/wrench_samples": m.WrenchSamples, "sensor_b/bridge": m.StrainSamples, "carrier_pose": PoseStamped,
                "sensor_b/calibration": m.SensorCalibration}.items()}
        if self.arm:
            # a publisher of a missing topic would be expected to answer, too
            for topic in [topic for topic in self.strange if topic != "carrier_command"]:
                self.strange.pop(topic).unregister()
        with open(self.nodes.package / "config/scenarios/cell.yaml", encoding="utf-8") as file:
            scenario = yaml.safe_load(file)
        self.radii = scenario["peg"]["radius"], scenario["hole"]["radius"]
        self.cell = [name for name in self.nodes.nodes if not name.startswith("bench/")]
        self.bench = [name for name in self.nodes.nodes if name.startswith("bench/")]

    def start(self, names):
        """Messages from now on count."""
        for name in names:
            if name == (BRIDGE if self.arm else SIMULATOR) and self.ears.plant:
                self.last_boot = self.ears.state().life
            if name == SUPERVISOR:
                self.ears.supervisor = None
            self.nodes.start(name)

    def ready(self, bench):
        nodes = self.nodes
        if not all(nodes.up(name) for name, program in nodes.running.items() if program.poll() is None):
            return False
        if bench:
            return self.clients["bench/calibrate"].connected()
        clients = [self.clients[name] for name in ("align", "move_to_contact", "retreat", "assemble", *(() if self.arm else ("identify",)))]
        ears = self.ears
        received = ears.plant and ears.supervisor and ears.state().life != self.last_boot
        received = received and all(s.get_num_connections() > 0 for s in ears.subscribers)
        return received and all(client.connected() for client in clients)

    def wait_until_ready(self, bench=False):
        if not wait_for(lambda: self.ready(bench), START, 0.05):
            raise Broken("the cell doesn't get ready: " + ", ".join(self.nodes.crashed()))

    def send(self, action, **fields):
        return Goal(self.clients[action], fields)

    def call(self, name, cls, *arguments):
        """A service, with a limit; None when there is no answer."""
        import rospy

        answers = queue.Queue()

        def request():
            try:
                answers.put(rospy.ServiceProxy(f"{self.ns}/{name}", cls)(*arguments))
            except Exception:  # no such service at present, or it died
                answers.put(None)

        threading.Thread(target=request, daemon=True).start()
        try:
            return answers.get(timeout=10.0 * self.factor)
        except queue.Empty:
            return None

    # -- before a trial --

    def prepare(self, trial):
        if trial["goal"] == "calibrate":
            if self.bench[0] not in self.nodes.running:
                self.nodes.end([name for name in self.cell if name in self.nodes.running])
                self.start(self.bench)
            self.wait_until_ready(bench=True)
            return
        if self.cell[0] not in self.nodes.running:
            self.start(self.cell)
        self.wait_until_ready()
        if trial["reset"] or trial["goal"] == "identify":  # which begins from a peg that hangs free
            self.reset()

    def reset(self):
        from std_srvs.srv import Trigger

        retreat = self.send("retreat")
        wait_for(retreat.done, 20.0 * self.factor)
        if self.arm:
            self.go_home()
        else:
            self.call(SIMULATOR + "/reset", Trigger)

    def go_home(self):
        """With an arm: up, and over to where it began, commanded while it has no owner."""
        import rospy

        ears = self.ears
        wait_for(lambda: not ears.state().holder, 10.0 * self.factor)
        there = lambda pose: math.dist([getattr(ears.samples["carrier_pose"].pose.position, a) for a in "xyz"], pose) < 1e-4
        for x, y in (None, None), (0.0, 0.0):
            message = copy.deepcopy(ears.samples["carrier_pose"])
            position, turn = message.pose.position, message.pose.orientation
            position.z = 0.0
            if x is not None:
                position.x, position.y, turn.x, turn.y, turn.z, turn.w = x, y, 0.0, 0.0, 0.0, 1.0
            if there((position.x, position.y, 0.0)):
                continue
            message.header = type(message.header)(stamp=rospy.Time.from_sec(ears.time), frame_id="carrier_base")
            self.strange["carrier_command"].publish(message)
            wait_for(lambda: there((position.x, position.y, 0.0)), 10.0 * self.factor)

    # -- a trial --

    def begin(self, trial):
        goal = trial["goal"]
        fields = {"move_to_contact": {"force": trial["force"]}, "align": {"strategy": "single_contact"}, "twin_force": {"strategy": "twin_force"},
                  "assemble": {"strategy": "twin_force", "depth": 0.01}, "identify": {}, "calibrate": {"dry_run": True, "restart": True}}[goal]
        return self.send(GOALS[goal][0], **fields)

    def reach_moment(self, trial, goal):
        """Until the moment of the fault, or the goal's end."""
        ears, moment = self.ears, trial["moment"]
        height, peak = ears.height, 60.0 * self.factor
        conditions = {
            "time": lambda: True, "down": lambda: ears.height < height - 5e-4, "pressed": lambda: ears.force > 1.0,
            "shaken": lambda: ears.state().exciter, "inside": lambda: ears.pose is not None and ears.pose.position.z < -1e-3}
        wait_for(lambda: goal.done() or conditions[moment](), peak)
        if trial["goal"] == "calibrate":
            wait_for(goal.done, trial["delay"] * self.factor)
            return
        start = ears.time
        wait_for(lambda: goal.done() or not start <= ears.time < start + trial["delay"], peak)

    def inject(self, trial):
        """The fault; what undoes it."""
        kind, node = trial["kind"], trial["node"]
        nodes = self.nodes
        nothing = lambda: None
        if kind == "kill":
            if trial["without_master"]:
                self.options.master.send_signal(signal.SIGSTOP)
            nodes.signal(node, signal.SIGKILL)
            nodes.running[node].wait()

            def undo():
                self.options.master.send_signal(signal.SIGCONT)
                self.start([node])

            return undo
        if kind == "terminal":
            nodes.terminal_of(node).stop()

            def resume():
                time.sleep(trial["stall"] * self.factor)
                nodes.terminal_of(node).going.set()

            return resume
        if kind == "second":
            code = nodes.start_second(node)
            trial["stubborn"] = [] if code == 1 else [f"a second {node} ends with {code}"]
            return nothing
        if kind == "replace":
            first = nodes.running[node]
            self.start([node])
            trial["stubborn"] = nodes.wait_for_end(node, first)
            return nothing
        if kind == "restart":
            nodes.signal(node, signal.SIGKILL)
            nodes.running[node].wait()
            self.start([node])
            return nothing
        if kind == "stall":
            nodes.signal(node, signal.SIGSTOP)
            timer = threading.Timer(trial["stall"] * self.factor, lambda: nodes.signal(node, signal.SIGCONT))
            timer.start()
            return timer.join
        if kind == "ctrl-c":
            names = self.cell if node == "all" else [node]
            trial["stubborn"] = nodes.end(names)
            return lambda: self.start(names)
        return be_hostile(self, node)

    def goes_on(self, trial):
        """May the goal go on, as far as the fault is concerned?"""
        kind, node = trial["kind"], trial["node"]
        if kind == "hostile":
            return HOSTILE[node] is None
        if kind in ("terminal", "second") or not self.is_needed(trial):
            return True
        return kind == "stall" or kind == "restart" and node not in (holder_of(trial["goal"]), SIMULATOR, BRIDGE, ARM)

    def must_stand(self, trial):
        """Is the arm without commands as long as the fault lasts?"""
        return self.arm and trial["kind"] == "kill" and trial["node"] in (SUPERVISOR, BRIDGE, ARM, *DRIVERS)

    def is_needed(self, trial):
        """Does the goal need this node? In lockstep time waits for every node."""
        node, goal = trial["node"], trial["goal"]
        needed = {LOCUS: ("align",), TWIN: ("twin_force", "assemble"), IDENTIFIER: ("identify",), SUPERVISOR: [g for g in GOALS if g != "identify"]}
        return self.lockstep or goal in needed.get(node, GOALS)

    def expected(self, trial):
        """Parts of a reason that names the fault; "" where no name is due."""
        kind, node = trial["kind"], trial["node"]
        if kind == "hostile":
            return [HOSTILE[node]]
        if kind in ("ctrl-c", "replace"):
            if node == BRIDGE:
                return [node + " (gone)"]
            return ["shutting down", "server lost"] + (["gone", "silent"] if node == "all" else [])
        if node == holder_of(trial["goal"]):
            return ["server lost"]
        if node == SIMULATOR:
            return [SIMULATOR, "restarted", "boot id"]
        if node == BRIDGE:
            return [BRIDGE, "restarted", "boot id"] + (["the plant stopped itself"] if kind == "stall" else [])
        if node == ARM:
            return ["no_state", "following"]
        if self.arm and node in DRIVERS:
            return [node, "no_wrench_" + node[7], "changed during the goal"]
        if kind == "restart" and node in DRIVERS:
            return [node, "changed during the goal"]
        return [node.replace("bench/", "").split("/")[-1 if node == RIG else 0]]

    def await_end(self, trial, goal, undo):
        """Until the client has learnt what became of the goal, or it is seen to go on. True: it has ended by itself."""
        factor, ears = self.factor, self.ears
        if not self.goes_on(trial):
            return wait_for(goal.done, 3.0 * BLOCK_TIMEOUT * factor + FREEING)
        undo()
        if trial["wait"] or trial["goal"] == "calibrate":
            if wait_for(goal.done, 240.0 * factor):
                return True
        else:
            start = ears.time
            wait_for(lambda: goal.done() or ears.time > start + 1.5, 20.0 * factor)
            if goal.done():
                return True
        goal.cancel()
        wait_for(goal.done, 30.0 * factor)
        return False

    def run(self, trial):
        ears = self.ears
        self.prepare(trial)
        ears.peak, ears.named = 0.0, {}
        goal = self.begin(trial)
        self.reach_moment(trial, goal)
        idle, shaken = goal.done(), bool(ears.plant) and ears.state().exciter
        mark, begun, since = len(ears.plant), time.monotonic(), ears.time
        undo = self.inject(trial)
        by_itself = self.await_end(trial, goal, undo)
        stand = None
        if self.must_stand(trial) and not idle:
            wait_for(lambda: ears.time > since + 2.0 * STAND, 20.0 * self.factor)
            stand = max(0.0, ears.moving - since)
        unseen = "-without-master" if trial["without_master"] else ""
        row = {"goal": trial["goal"], "fault": f"{trial['kind']}{unseen} {trial['node']}" + (f" {trial['stall']:.2f} s" if trial["kind"] == "stall" else ""),
               "moment": "idle" if idle else trial["moment"], "hold": None, "stand": stand, "name": None, "peak": ears.peak, "result": goal.reason()[:200], "broken": []}
        broken = row["broken"]
        if not goal.done():
            broken.append("result: none")
        broken += [f"end: {text}" for text in trial.get("stubborn", [])]
        if trial["goal"] != "calibrate":
            self.check_plant(trial, row, mark)
            if stand is not None and stand > STAND:
                broken.append(f"stand: the carrier moved until {stand:.3f} s after the fault")
            self.check_truth(row, goal)
        if not idle:
            self.check_name(trial, row, goal, by_itself, begun, shaken)
        if not self.goes_on(trial):
            undo()
        self.wait_until_ready(trial["goal"] == "calibrate")
        if trial["goal"] != "calibrate":
            self.check_rest(trial, row)
        row["next"] = self.check_next(trial, row, trial["goal"] in ("align", "twin_force", "assemble") and goal.succeeded())
        broken += [f"crash: {text}" for text in self.nodes.crashed()]
        return row

    # -- promises of docs/reference/safety.md --

    def check_plant(self, trial, row, mark):
        ears, broken = self.ears, row["broken"]
        fault_of_holder = trial["node"] == holder_of(trial["goal"]) and trial["kind"] in ("kill", "restart")
        if not self.lockstep and fault_of_holder and row["moment"] != "idle":
            wait_for(lambda: any(s.held or not s.session for s, _ in ears.plant[mark:]), 5.0 * self.factor)
        held = mark > 0 and ears.plant[mark - 1][0].held
        for state, sign in list(ears.plant[mark:]):
            begins, held = state.held and not held, state.held
            if not self.lockstep and begins and (self.arm or not state.overload) and state.reason.startswith("expired") and sign:
                row["hold"] = max(row["hold"] or 0.0, state.header.stamp.to_sec() - sign)
            if state.held and state.exciter:
                broken.append("hold: held with the exciter on")
        # a bridge that stands still itself sends no points: the arm stands meanwhile
        frozen = trial["stall"] if self.arm and (trial["kind"], trial["node"]) == ("stall", BRIDGE) else 0.0
        if row["hold"] is not None and row["hold"] > HOLD + frozen:
            broken.append(f"hold: {row['hold']:.3f} s after the last heartbeat")
        limit = OVERSHOOT * FORCE_LIMIT
        if row["peak"] > limit:
            broken.append(f"peak: {row['peak']:.1f} N, promised are {limit:.0f} N")

    def check_rest(self, trial, row):
        """After a goal, with every node there: nothing shakes, and a pressing peg is reported."""
        ears, broken = self.ears, row["broken"]
        limit = FREEING * self.factor + 5.0
        if not wait_for(lambda: not ears.state().exciter, limit):
            broken.append("exciter: still on")
        reported = lambda: ears.force < 0.5 or ears.supervisor.in_contact or ears.state().held
        # a supervisor that was started again reports that it isn't known
        silent = {holder_of(trial["goal"]), SIMULATOR, "all"} - {SUPERVISOR}
        if trial["node"] not in silent and "pressing" not in row["result"] and not wait_for(reported, limit):
            broken.append(f"contact: {ears.force:.1f} N without a report")

    def check_truth(self, row, goal):
        if goal.result is None or not hasattr(goal.result, "report") or not goal.result.report.success:
            return
        reach = self.reach()
        if reach > self.radii[1]:
            row["broken"].append(f"false success: the edge reaches {1e3 * reach:.3f} mm from the hole's axis")

    def reach(self):
        """Of the peg's edge from the hole's axis, or far off when it is above the plane [m]."""
        # the pose of the goal's last block, and some more
        time.sleep(0.3)
        pose = self.ears.pose
        x, y, z, w = (getattr(pose.orientation, name) for name in "xyzw")
        R = ((1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - w * z)), (2.0 * (x * y + w * z), 1.0 - 2.0 * (x * x + z * z)))
        if pose.position.z > 0.0:
            return 1.0
        angles = [2.0 * math.pi * k / 90 for k in range(90)]
        points = [[self.radii[0] * (R[i][0] * math.cos(a) + R[i][1] * math.sin(a)) for i in range(2)] for a in angles]
        return max(math.hypot(pose.position.x + x, pose.position.y + y) for x, y in points)

    def check_name(self, trial, row, goal, by_itself, begun, shaken):
        """Is it named, and in time?"""
        kind, node, broken = trial["kind"], trial["node"], row["broken"]
        holder = holder_of(trial["goal"])
        if kind == "hostile" and HOSTILE[node] is None:
            of_plant = lambda: MINE in self.ears.state().refusal
            if wait_for(lambda: self.ears.named or of_plant(), 10.0 * self.factor):
                row["name"] = time.monotonic() - begun if not trial["wait"] else None
            else:
                broken.append("name: the unknown publisher isn't named")
            if by_itself and not goal.succeeded():
                broken.append(f"disturbed: {row['result']}")
            return
        if self.goes_on(trial) and kind not in ("terminal", "second") and (kind == "stall" or self.is_needed(trial)):
            # a short one may cost time only; a goal that ended because of it names it
            named = any(text in row["result"] for text in self.expected(trial)) or node == holder
            if by_itself and not goal.succeeded() and not named:
                broken.append("name: " + row["result"])
            if by_itself and named and node != holder and not goal.succeeded():
                row["name"] = goal.end - begun
            return
        if self.goes_on(trial):
            if by_itself and not goal.succeeded():
                broken.append(f"disturbed: {row['result']}")
            return
        if goal.end is None or goal.succeeded():
            return
        row["name"] = goal.end - begun
        if not any(text in row["result"] for text in self.expected(trial)):
            broken.append("name: " + (row["result"] or "none"))
        freed = (FREEING + NAME) * self.factor
        limit = {holder: LOST * self.factor, LOCUS: freed + NAME * self.factor, TWIN: freed + NAME * self.factor}.get(node, freed)
        if kind == "kill" and self.lockstep:
            limit = GONE + freed
        if node in (LOCUS, TWIN) and not shaken:
            limit = None  # from when on it was missed isn't known
        if kind == "kill" and limit is not None and trial["goal"] != "calibrate" and row["name"] > limit:
            broken.append(f"name: after {row['name']:.1f} s, promised are {limit:.1f} s")

    def second(self, row, align):
        goal = self.send("align") if align else self.send("move_to_contact", force=8.0)
        wait_for(goal.done, (300.0 if align else 40.0) * self.factor)
        self.check_truth(row, goal)
        return goal

    def check_next(self, trial, row, aligned):
        """The next goal, from wherever the peg is."""
        factor = self.factor
        if trial["goal"] == "calibrate":
            self.wait_until_ready(bench=True)
            goal = self.send("bench/calibrate", dry_run=True)
            if not wait_for(goal.done, 300.0 * factor) or not goal.succeeded():
                row["broken"].append(f"recovery: calibrate: {goal.reason() or 'no result'}")
            return goal.succeeded()
        self.wait_until_ready()
        if aligned:
            self.reset()
        # a lease without a goal owns the plant for a second
        wait_for(lambda: self.ears.state().holder != MINE, 10.0 * factor)
        if trial["retreat"] or (self.ears.supervisor is not None and self.ears.supervisor.stuck):
            goal = self.send("retreat")
            if not wait_for(goal.done, 30.0 * factor) or not goal.succeeded():
                row["broken"].append(f"recovery: retreat: {goal.reason() or 'no result'}")
        align = trial["next"] == "align"
        goal = self.second(row, align)
        if goal.reason().split(":")[0] in STRATEGY:
            # an honest end from where a goal was cut off; from the start it must work
            self.reset()
            goal = self.second(row, align)
        if goal.reason().endswith("call the action retreat first"):
            retreat = self.send("retreat")
            wait_for(retreat.done, 30.0 * factor)
            goal = self.second(row, align)
        if not goal.succeeded():
            row["broken"].append(f"recovery: {trial['next']}: {goal.reason() or 'no result'}")
            goal.cancel()
            wait_for(goal.done, 30.0 * factor)
        if align or not goal.succeeded():
            self.reset()
        return goal.succeeded()
