# Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
"""The mounting with its frames, to the scale of config/scenarios/cell.yaml: docs/images/mounting.png."""
import os

import yaml

from plots.style import ROOT, add_output, plt, save

STEEL, SENSOR, PEG, BLOCK = "#b8bfc6", "#f9dcc4", "#8fbf8f", "#cfe3f1"
SIDE = 16.0  # the peg is drawn so far beside the hole [mm]
ARM = 22.0  # length of an axis [mm]


def box(axes, middle, bottom, width, height, color):
    axes.add_patch(plt.Rectangle((middle - width / 2, bottom), width, height, facecolor=color, edgecolor="0.25", lw=1))


def frame(axes, x, z, name, text, side):
    """Origin with its x and z axes; the words beside it, on the side given (-1 or 1), with a line to the origin."""
    for (dx, dz), color in (((ARM, 0), "#c0392b"), ((0, ARM), "#1f4fbf")):
        axes.annotate("", (x + dx, z + dz), (x, z), arrowprops={"arrowstyle": "-|>", "color": color, "lw": 2}, zorder=5)
    axes.plot(x, z, "o", color="k", ms=5, zorder=6)
    place = 84.0 * side
    axes.annotate(f"$\\bf{{{name.replace('_', chr(92) + '_')}}}$\n{text}", (x, z), (place, z), ha="left" if side > 0 else "right", va="center",
                  fontsize=9.5, arrowprops={"arrowstyle": "-", "color": "0.55", "lw": 0.8}, zorder=4)


def add_arguments(parser):
    add_output(parser)


def draw(options):
    with open(os.path.join(ROOT, "config", "scenarios", "cell.yaml"), encoding="utf-8") as file:
        cell = yaml.safe_load(file)
    mm = 1e3
    peg, hole = cell["peg"], cell["hole"]
    radius, half, depth = peg["radius"] * mm, peg["half_height"] * mm, hole["depth"] * mm
    coupling, exciter = (peg["half_height"] + peg["coupling_height"]) * mm, (peg["half_height"] + peg["exciter_height"]) * mm
    tip = cell["coupling"]["rest"]["z"] * mm - coupling + 26  # drawn higher than it hangs, so that the frames are apart
    point = tip + coupling
    figure, axes = plt.subplots(figsize=(9.6, 7.4))

    # from the bench up: sensor_a, block with its bore
    box(axes, 0, -depth - 42, 150, 10, STEEL)
    box(axes, 0, -depth - 32, 80, 32, SENSOR)
    for side in (-1, 1):
        axes.add_patch(plt.Rectangle((side * hole["radius"] * mm, -depth), side * 20, depth, facecolor=BLOCK, edgecolor="0.25", lw=1))
    axes.text(0, -depth - 37, "bench", ha="center", va="center", fontsize=9)
    axes.text(0, -depth - 24, "force sensor", ha="center", va="center", fontsize=9)
    axes.text(-hole["radius"] * mm - 10, -depth / 2, "block", ha="center", va="center", fontsize=9, rotation=90)

    # peg, coupling with its sensor, flange
    box(axes, SIDE, tip, 2 * radius, 2 * half, PEG)
    box(axes, SIDE, tip + 2 * half, 12, point - 12 - tip - 2 * half, STEEL)
    box(axes, SIDE, point - 12, 36, 24, SENSOR)
    box(axes, SIDE, point + 12, 30, 26, STEEL)
    box(axes, SIDE, point + 38, 56, 10, STEEL)
    axes.text(SIDE + 3, tip + 2 * half - 8, "peg", ha="left", va="center", fontsize=9)
    axes.text(SIDE, point + 43, "flange of the arm", ha="center", va="center", fontsize=9)
    axes.text(SIDE, point + 31, "tool mount", ha="center", va="center", fontsize=8)
    axes.annotate("coupling and\nforce sensor", (SIDE - 18, point - 10), (SIDE - 34, point - 24), ha="right", va="center", fontsize=9,
                  arrowprops={"arrowstyle": "-", "color": "0.55", "lw": 0.8})
    axes.annotate("exciter's force", (SIDE, tip + exciter), (84, point + 26), fontsize=9, ha="left", va="center",
                  arrowprops={"arrowstyle": "-|>", "color": "0.3"})

    frame(axes, SIDE, point, "carrier", "= sensor_b: coupling point at rest,\nz up the peg's axis", 1)
    frame(axes, SIDE, tip, "peg", "middle of the bottom edge,\nz up its axis", 1)
    frame(axes, 0, 0, "hole", "middle of the rim, z out of the hole", 1)
    frame(axes, 0, -depth, "sensor_a", "under the block, z up", 1)
    base = point - 4
    frame(axes, 0, base, "carrier_base", "carrier_height over hole, upright:\ncommands and limits are in it", -1)
    axes.annotate("", (-66, 0), (-66, base), arrowprops={"arrowstyle": "<->", "color": "0.4", "lw": 1})
    axes.text(-68, base / 2 - 10, "carrier_height", ha="right", va="center", fontsize=9)
    axes.plot([-70, -46], [0, 0], color="0.6", lw=0.8)
    axes.plot([-70, 0], [base, base], color="0.6", lw=0.8)

    # signs
    axes.text(86, -depth - 30, "Press the peg on the block:\nsensor_b reads fz > 0, sensor_a fz < 0.", fontsize=9.5, va="center",
              bbox={"boxstyle": "round,pad=0.4", "facecolor": "#fff7d6", "edgecolor": "0.5"})  # fmt: skip
    axes.text(-150, point + 40, "x red, z blue, y into the picture", fontsize=9.5, va="center")
    axes.set(xlim=(-152, 186), ylim=(-depth - 46, point + 52))
    axes.set_aspect("equal")
    axes.axis("off")
    save(figure, options.output, "mounting.png")
