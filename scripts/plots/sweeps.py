# Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
"""Success, time and force over clearance, latency and compliance, from docs/results/tables/sweeps_1.csv and _2.csv: docs/images/sweeps.png."""
import os

from plots.levels import draw_medians, draw_shares, numbers
from plots.style import ROOT, add_output, plt, rows_of, save

DRAWN = ("clearance [drawn]", "latency [ms]", "compliance [µm/N]")
TABLES = os.path.join(ROOT, "docs", "results", "tables")


def draw(options):
    figure, panels = plt.subplots(3, 3, figsize=(10, 7.5), sharex="col")
    for number, (file, name) in enumerate((("sweeps_1.csv", "this simulation"), ("sweeps_2.csv", "MuJoCo"))):
        swept = {}
        for row in rows_of(os.path.join(options.input, file)):
            if row["of"] in DRAWN:
                swept.setdefault(row["of"], []).append(row)
        style = {"fmt": "os"[number] + "-", "color": f"C{number}", "ms": 5, "capsize": 3, "label": name}
        for (success, time, force), (of, rows) in zip(panels.T, swept.items()):
            x = [float(row["value"]) for row in rows]
            counts = [numbers(row["succeeded"]) for row in rows]
            draw_shares(success, x, rows, [100 * good / runs for good, runs in counts], **style)
            draw_medians(time, x, [numbers(row["time [s], median (95 %)"]) for row in rows], **style)
            draw_medians(force, x, [numbers(row["force [N], median (most)"]) for row in rows], **style)
            expected = [(value, float(row["expected [N]"])) for value, row in zip(x, rows) if row["expected [N]"] != "–"]
            if expected and number == 0:
                force.plot(*zip(*expected), "k--", label="expected of a touch")
            if number == 0:
                force.set(xlabel=of, xscale="log", xticks=x, xticklabels=[f"{value:g}" for value in x])
                force.minorticks_off()
    for label, line, limits in zip(("succeeded [%]", "time [s]", "force [N]"), panels, ((-3, 103), (0, None), (0, None))):
        line[0].set_ylabel(label)
        for axes in line:
            axes.set(ylim=limits)
            axes.grid(alpha=0.3)
    panels[0][0].legend(loc="lower right")
    panels[2][1].legend(loc="upper left")
    save(figure, options.output, "sweeps.png")


def add_arguments(parser):
    parser.add_argument("input", nargs="?", default=TABLES, help="folder of the tables of `scripts/results/make sweeps` (default: the stored ones)")
    add_output(parser)
