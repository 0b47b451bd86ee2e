# Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
"""Curves of recorded runs over the depth, from CSV files of `records export`; `records plot` and `records compare` call it."""
import os

import yaml

from plots.style import plt, rows_of, save

PARTS = (("axial", "axial force [N]", 1), ("lateral", "lateral force [N]", 1), ("moment", "moment [N m]", 1), ("tilt", "tilt [mrad]", 1e3))


def add_arguments(parser):
    parser.add_argument("picture", metavar="PICTURE.png")
    parser.add_argument("--band", metavar="RULES.yaml", help="draw its band, and red what leaves it, in place of names")
    parser.add_argument("inputs", metavar="CURVE.csv", nargs="+", help="the file's name without .csv is its label")


def bounds(band, channel):
    """Lower and upper bound of each cell."""
    return ([low - band["limit"] * sd for low, sd in zip(channel["low"], channel["low_sd"])],
            [high + band["limit"] * sd for high, sd in zip(channel["high"], channel["high_sd"])])  # fmt: skip


def leaves(rows, band, key, low, high):
    """Whether a sample lies outside of its cell's bounds."""
    for row in rows:
        cell = int((float(row["depth"]) - band["from"]) / band["step"])
        if float(row["depth"]) >= band["from"] and cell < len(low) and not low[cell] <= float(row[key]) <= high[cell]:
            return True
    return False


def draw_in_band(options, curves):
    """One picture a quantity of the band: what leaves it in red."""
    with open(options.band, encoding="utf-8") as file:
        band = yaml.safe_load(file)["band"]
    figure, axes = plt.subplots(len(band["quantities"]), 1, figsize=(8, 3.4 * len(band["quantities"])), squeeze=False)
    names = {key: label for key, label, _ in PARTS}
    for channel, (axis,) in zip(band["quantities"], axes):
        key, (low, high) = channel["quantity"], bounds(band, channel)
        edges = [1e3 * (band["from"] + band["step"] * k) for k in range(len(low) + 1)]
        axis.fill_between(edges, low + low[-1:], high + high[-1:], step="post", color="#cfe3f1", label="band")
        outside = {name for name, rows in curves.items() if leaves(rows, band, key, low, high)}
        for name in sorted(curves, key=lambda name: name in outside):
            color, label = ("#c0392b", f"{len(outside)} outside") if name in outside else ("#2e7d32", f"{len(curves) - len(outside)} inside")
            known = axis.get_legend_handles_labels()[1]
            axis.plot([1e3 * float(row["depth"]) for row in curves[name]], [float(row[key]) for row in curves[name]], lw=0.8, color=color,
                      label=None if label in known else label)  # fmt: skip
        margin = 0.1 * (max(high[:-1]) - min(low[:-1]))  # the last cell holds the press at the end
        axis.set(xlabel="depth [mm]", ylabel=names[key], xlim=(edges[0] - 1, edges[-1]), ylim=(min(low[:-1]) - margin, max(high[:-1]) + margin))
        axis.grid(alpha=0.3)
        axis.legend(fontsize=9)
    save(figure, options.picture)


def draw(options):
    curves = {os.path.splitext(os.path.basename(path))[0]: rows_of(path) for path in options.inputs}
    if options.band:
        draw_in_band(options, curves)
        return
    measured = [part for part in PARTS if all(rows and part[0] in rows[0] for rows in curves.values())]
    over, unit, scale = ("depth", "depth [mm]", 1e3) if all(rows and "depth" in rows[0] for rows in curves.values()) else ("time", "time [s]", 1)
    figure, axes = plt.subplots(len(measured), 1, figsize=(7, 2.2 * len(measured) + 0.6), sharex=True, squeeze=False)
    for (key, label, factor), (axis,) in zip(measured, axes):
        for name, rows in curves.items():
            axis.plot([scale * float(row[over]) for row in rows], [factor * float(row[key]) for row in rows], lw=1, label=name)
        axis.set_ylabel(label)
        axis.grid(alpha=0.3)
    axes[0][0].legend(fontsize=8)
    axes[-1][0].set_xlabel(unit)
    save(figure, options.picture)
