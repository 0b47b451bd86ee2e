#!/usr/bin/python3
# Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
"""Draws where lines of action cut the tip's plane, from the CSV of the tool contacts.

usage: plot_contacts.py CONTACTS.csv PICTURE.png
"""
import csv
import sys

import matplotlib
matplotlib.use("Agg")
import matplotlib.pyplot as plt  # noqa: E402


def main():
    if len(sys.argv) != 3:
        print(__doc__.strip(), file=sys.stderr)
        return 2
    with open(sys.argv[1]) as file:
        rows = [row for row in csv.DictReader(file) if row["kind"] in ("one", "several")]
    figure, (points, times) = plt.subplots(1, 2, figsize=(9, 3.6), gridspec_kw={"width_ratios": [1, 1.6]})
    for kind, color in (("several", "0.75"), ("one", "tab:blue")):
        some = [row for row in rows if row["kind"] == kind]
        points.plot([1e3 * float(row["x"]) for row in some], [1e3 * float(row["y"]) for row in some], ".", ms=2, color=color, label=kind)
        times.semilogy([float(row["t"]) for row in some], [1e3 * abs(float(row["pitch"])) for row in some], ".", ms=2, color=color)
    points.set(xlim=(-15, 15), ylim=(-15, 15), aspect="equal", xlabel="x [mm]", ylabel="y [mm]", title="lines of action in the tip's plane")
    points.legend(markerscale=4, fontsize=8)
    times.set(ylim=(1e-3, 300), xlabel="t [s]", ylabel="|F·M|/F² [mm]", title="couple over force")
    for axes in (points, times):
        axes.grid(alpha=0.3)
    figure.tight_layout()
    figure.savefig(sys.argv[2], dpi=70)
    return 0


if __name__ == "__main__":
    sys.exit(main())
