# Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
"""Measurements of an identification and their fit, from the CSV of `identify --readings`."""
from plots.style import plt, rows_of, save

PANELS = [("hanging: force along x, y", "-1", ("fx", "fy"), "force [N]"),
          ("hanging: torque about x, y", "-1", ("tx", "ty"), "torque [N m]"),
          ("pressed at the first place: force", "0", ("fx", "fy", "fz"), "force [N]"),
          ("pressed at the first place: torque", "0", ("tx", "ty", "tz"), "torque [N m]")]


def size(row, axis):
    return abs(complex(float(row[axis + "_re"]), float(row[axis + "_im"])))


def add_arguments(parser):
    parser.add_argument("input", metavar="READINGS.csv", help="as `identify --readings` wrote it")
    parser.add_argument("picture", metavar="PICTURE.png")


def draw(options):
    rows = rows_of(options.input)
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
    save(figure, options.picture)
