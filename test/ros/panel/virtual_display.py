# Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
"""What the tests of rviz share: a virtual display, programs that end with the test, waiting for conditions."""
import os
import pathlib
import re
import signal
import subprocess
import sys
import tempfile
import time

ROOT = pathlib.Path(__file__).resolve().parents[3]
TRIES = 3


def environment(devel, folder):
    """That of the devel space, with a home of its own."""
    base = {**os.environ, "PATH": "/usr/bin:" + os.environ.get("PATH", "/bin"), "LC_ALL": "C.UTF-8"}
    for name in ("PYTHONPATH", "CMAKE_PREFIX_PATH", "ROS_PACKAGE_PATH"):
        base.pop(name, None)
    text = subprocess.run(
        ["bash", "-c", '. "$1/setup.bash" && env -0', "bash", devel], env=base, check=True, stdout=subprocess.PIPE
    ).stdout
    variables = dict(entry.split("=", 1) for entry in text.decode().split("\0") if "=" in entry)
    port = int(subprocess.check_output([ROOT / "scripts/free_port"]))
    variables.update(
        HOME=folder, XDG_RUNTIME_DIR=folder, ROS_HOME=folder, ROS_LOG_DIR=folder + "/log", ROS_HOSTNAME="localhost"
    )
    variables["ROS_MASTER_URI"] = f"http://localhost:{port}"
    return variables, port


class Session:
    """Programs that are stopped, last first, when the block ends."""

    def __init__(self):
        self.programs = []

    def __enter__(self):
        return self

    def start(self, *arguments, **options):
        program = subprocess.Popen(arguments, stdin=subprocess.DEVNULL, **options)
        self.programs.append(program)
        return program

    def __exit__(self, *_):
        for program in reversed(self.programs):
            program.send_signal(signal.SIGINT)
            try:
                program.wait(20)
            except subprocess.TimeoutExpired:
                program.kill()
                program.wait()


class RvizDied(Exception):
    """What roslaunch says of it."""


def tried(run):
    """run(folder, log), with files of its own; again where rviz died. Prints the log's end when it fails.

    In some starts of a hundred Mesa's software renderer draws into a window that has no size yet, past a buffer of no
    bytes, and rviz ends by a damaged heap: with none of our plug-ins, too (valgrind, Mesa 22.3).
    """
    for left in reversed(range(TRIES)):
        with tempfile.TemporaryDirectory() as folder, open(folder + "/session.log", "w+", encoding="utf-8") as log:
            try:
                return run(folder, log)
            except BaseException as error:
                log.seek(0)
                print("".join(log.readlines()[-60:]))
                if not isinstance(error, RvizDied) or not left:
                    raise
                print(f"again, {left} left: {error}", flush=True)


def wait_for(condition, limit, what, *programs, log):
    """Ends the test where a program ends or the limit [s] is over; raises RvizDied by what the log says."""
    end = time.monotonic() + limit
    while not condition():
        died = re.search(r"\[rviz-\d+\] process has died.*", pathlib.Path(log.name).read_text("utf-8", "replace"))
        if died:
            raise RvizDied(died.group())
        for program in programs:
            if program.poll() is not None:
                sys.exit(f"{program.args[0]} ended with {program.returncode} while waiting for {what}")
        if time.monotonic() > end:
            sys.exit(f"{what}: not within {limit:.0f} s")
        time.sleep(0.3)


def start_display(session, variables, log, size):
    """Starts Xvfb and sets DISPLAY; one that doesn't answer is tried again."""
    for _ in range(5):
        reader, writer = os.pipe()
        server = session.start("Xvfb", "-displayfd", str(writer), "-screen", "0", f"{size}x24", "-nolisten", "tcp",
                               pass_fds=[writer], stdout=log, stderr=log)  # fmt: skip
        os.close(writer)
        with os.fdopen(reader) as number:
            variables["DISPLAY"] = ":" + number.readline().strip()
        answer = subprocess.run(["xwininfo", "-root"], env=variables, capture_output=True)
        if answer.returncode == 0 and server.poll() is None:
            break


def has_window(variables):
    """Is rviz's window there?"""
    tree = subprocess.run(["xwininfo", "-root", "-tree"], env=variables, capture_output=True, text=True)
    return "RViz" in tree.stdout
