# Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
"""Share seated, time and force of each cell of docs/results/tables/insertion_1.csv, with what is wanted: docs/images/insertion.png."""
import os

from plots.levels import draw_medians, draw_shares, numbers
from plots.style import ROOT, add_output, plt, rows_of, save

TABLE = os.path.join(ROOT, "docs", "results", "tables", "insertion_1.csv")
TIME, FORCE = "start to seated, median (95 %)", "force 99 % (max)"


def draw(options):
    rows = rows_of(options.input)
    cells = list(dict.fromkeys(row["radial clearance"] for row in rows))
    levels = list(dict.fromkeys(row["level"] for row in rows))
    figure, panels = plt.subplots(1, 3, figsize=(11, 4))
    for number, level in enumerate(levels):
        of_level = [row for row in rows if row["level"] == level]
        x = [cells.index(row["radial clearance"]) + 0.24 * (number - 0.5 * (len(levels) - 1)) for row in of_level]
        style = {"fmt": "os^D"[number % 4], "color": f"C{number}", "ms": 5, "capsize": 3}
        counts = [numbers(row["seated"]) for row in of_level]
        wanted = [numbers(row["wanted"]) for row in of_level]  # share [%], time [s], force [N]
        draw_shares(panels[0], x, of_level, [100 * good / runs for good, runs in counts], label=f"level {level}", **style)
        draw_medians(panels[1], x, [numbers(row[TIME]) for row in of_level], **style)
        draw_medians(panels[2], x, [numbers(row[FORCE]) for row in of_level], **style)
        for panel, place in zip(panels, range(3)):
            known = [(at, values[place]) for at, values in zip(x, wanted) if len(values) > place]
            panel.plot([at for at, _ in known], [value for _, value in known], "_", color="k", ms=14, label="wanted" if number == 0 else None)
    for panel, title, unit, limits in zip(panels, ("seated, 95 % intervals", "start to seated: median, bar to 95 %", "force: 99 %, bar to the largest"),
                                          ("[%]", "[s]", "[N]"), ((None, None), (0, None), (0, None))):  # fmt: skip
        panel.set(title=title, ylabel=unit, ylim=limits)
        panel.title.set_fontsize(11)
        panel.set_xlim(-0.5, len(cells) - 0.5)
        panel.set_xticks(range(len(cells)), cells, rotation=30, ha="right")
        panel.grid(alpha=0.3)
    panels[0].legend(fontsize=9)
    save(figure, options.output, "insertion.png")


def add_arguments(parser):
    parser.add_argument("input", nargs="?", default=TABLE, help="table of `scripts/results/make insertion` (default: the stored one)")
    add_output(parser)
