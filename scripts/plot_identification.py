#!/usr/bin/python3
# Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
"""Draws the readings of an identification and what the fit says of them.

usage: plot_identification.py READINGS.csv PICTURE.png
  READINGS.csv  as `identify --readings` wrote it
exit: 0 ok, 2 bad input
"""
import csv
import sys

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt

PANELS = [("hanging: force along x, y", "-1", ("fx", "fy"), "force [N]"),
          ("hanging: torque about x, y", "-1", ("tx", "ty"), "torque [N m]"),
          ("pressed at the first place: force", "0", ("fx", "fy", "fz"), "force [N]"),
          ("pressed at the first place: torque", "0", ("tx", "ty", "tz"), "torque [N m]")]


def size(row, axis):
    return abs(complex(float(row[axis + "_re"]), float(row[axis + "_im"])))


def draw(rows, picture):
    figure, panels = plt.subplots(2, 2, figsize=(11, 7))
    for panel, (title, place, axes, label) in zip(panels.flat, PANELS):
        chosen = [row for row in rows if row["place"] == place and row["direction"] == "1"]
        for number, axis in enumerate(axes):
            color = f"C{number}"
            x = [float(row["frequency"]) for row in chosen]
            panel.plot(x, [size(row, "fit_" + axis) for row in chosen], color=color, label=axis + " fitted")
            for held, face in (("0", color), ("1", "white")):
                part = [row for row in chosen if row["held_out"] == held]
                panel.plot([float(row["frequency"]) for row in part], [size(row, axis) for row in part], "o",
                           color=color, markerfacecolor=face)
        panel.set(title=title, xlabel="exciter, anticlockwise [rad/s]", ylabel=label)
        panel.legend()
    figure.suptitle("Amplitudes of sensor_b's wrench; open: left out of the fit")
    figure.tight_layout()
    figure.savefig(picture, dpi=80)


def main():
    if len(sys.argv) != 3 or sys.argv[1].startswith("-"):
        sys.exit(__doc__ if "--help" in sys.argv else "plot_identification.py: give READINGS.csv PICTURE.png")
    try:
        with open(sys.argv[1], encoding="utf-8") as file:
            rows = list(csv.DictReader(file))
        draw(rows, sys.argv[2])
    except (OSError, KeyError, ValueError) as error:
        print(f"{sys.argv[1]}: {error!r}: give what identify --readings wrote", file=sys.stderr)
        return 2
    return 0


if __name__ == "__main__":
    sys.exit(main())
