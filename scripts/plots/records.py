# Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
"""Curves of recorded runs over the depth, from CSV files of `records export`; `records plot` and `records compare` call it."""
import os

from plots.style import plt, rows_of, save

PARTS = (("axial", "axial force [N]", 1), ("lateral", "lateral force [N]", 1), ("moment", "moment [N m]", 1), ("tilt", "tilt [mrad]", 1e3))


def add_arguments(parser):
    parser.add_argument("picture", metavar="PICTURE.png")
    parser.add_argument("inputs", metavar="CURVE.csv", nargs="+", help="the file's name without .csv is its label")


def draw(options):
    curves = {os.path.splitext(os.path.basename(path))[0]: rows_of(path) for path in options.inputs}
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
