# Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
"""Where lines of action cut the tip's plane, from the CSV of the tool `contacts`."""
from plots.style import plt, rows_of, save


def add_arguments(parser):
    parser.add_argument("input", metavar="CONTACTS.csv", help="as `contacts --output` wrote it")
    parser.add_argument("picture", metavar="PICTURE.png")


def draw(options):
    rows = [row for row in rows_of(options.input) if row["kind"] in ("one", "several")]
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
    save(figure, options.picture)
