# Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
"""What the tables of alignments share: runs of the tool `align`, their reports, rows in Markdown."""
import collections
import os
import pathlib
import shutil
import subprocess

import yaml

ROOT = pathlib.Path(__file__).resolve().parents[2]
BUILT = ROOT / ".build/devel/lib/assembly_cell/align"
LOADER = getattr(yaml, "CSafeLoader", yaml.SafeLoader)  # libyaml, where there is one: reports of 1000 runs


class Refused(Exception):
    """Message of `align` about bad input, one line."""


def align(arguments, report, program=None):
    """The report of `align ARGUMENTS`, kept as a file; one that is there already is taken. Throws Refused."""
    report = pathlib.Path(report)
    if not report.exists():
        command = [program] if program else [str(BUILT)] if BUILT.exists() else ["rosrun", "assembly_cell", "align"]
        part = report.with_suffix(".part")
        try:
            done = subprocess.run([*command, *map(str, arguments), "--report", str(part)], stdin=subprocess.DEVNULL,
                                  stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True, check=False)
        except OSError as error:
            raise Refused(f"{error.filename}: {error.strerror}") from error
        if done.returncode not in (0, 1):
            raise Refused((done.stderr.strip().splitlines() or [f"{command[0]} ended with {done.returncode}"])[-1])
        os.rename(part, report)
    with open(report, encoding="utf-8") as file:
        return yaml.load(file, Loader=LOADER)


def level_file(level):
    """Of config/mismatch."""
    return str(ROOT / f"config/mismatch/level_{level}.yaml")


def late_arm(folder, latency):
    """A copy of the emulated arm of config/arm in FOLDER, at 125 Hz and so late [s]: its file for `align --arm`."""
    late = pathlib.Path(folder) / f"late_{1e3 * latency:g}ms"
    shutil.copytree(ROOT / "config/arm", late / "config/arm", dirs_exist_ok=True)
    shutil.copytree(ROOT / "urdf", late / "urdf", dirs_exist_ok=True)
    for file, values in {"emulate_arm.yaml": {"latency": latency, "rate": 125.0},
                         "arm_bridge.yaml": {"following_time": latency + 0.15, "rate": 125.0, "delay": latency}}.items():
        path = late / "config/arm" / file
        lines = path.read_text(encoding="utf-8").splitlines()
        path.write_text("\n".join(f"{text.split(':')[0]}: {values[text.split(':')[0]]}" if text.split(":")[0] in values else text
                                  for text in lines) + "\n", encoding="utf-8")
    return late / "config/arm/emulated.yaml"


def interval(report):
    """The 95 % interval of the successes, in per cent."""
    low, high = report["success_interval"]
    return f"{100 * low:.1f}–{100 * high:.1f}"


def quantile(values, share):
    """Of a list that isn't empty, as `align` has it."""
    ordered = sorted(values)
    return ordered[int(share * (len(ordered) - 1) + 0.5)]


def endings(results):
    """Names of what ended otherwise, the most frequent first."""
    names = collections.Counter(result["reason"].split(":")[0] for result in results if not result["success"])
    return ", ".join(f"{name} {count}" for name, count in names.most_common()) or "–"


def line(cells):
    return "| " + " | ".join(cells) + " |"


def head(cells):
    return line(cells) + "\n|" + "---|" * len(cells)
