# Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
"""Success and cycle time over the level of model error, from docs/results/tables/levels_1.csv: docs/images/levels.png."""
import os
import re

from plots.style import ROOT, add_output, plt, rows_of, save

TABLE = os.path.join(ROOT, "docs", "results", "tables", "levels_1.csv")


def numbers(cell):
    """Of `12.2 (13.1)` or `96.3–100.0`; none of `–`."""
    return [float(number) for number in re.findall(r"\d[\d.]*", cell)]


def draw(options):
    strategies = {}
    for row in rows_of(options.input):
        name, _, level = row["start"].partition(", level ")
        strategies.setdefault(name, []).append((int(level), row))
    figure, (success, time) = plt.subplots(1, 2, figsize=(9, 3.6))
    for number, (name, rows) in enumerate(strategies.items()):
        beside = 0.06 * (number - 0.5 * (len(strategies) - 1))
        colour, marker = f"C{number}", "os^Dv"[number % 5]
        aligned = [100 * float(row["fraction"]) for _, row in rows]
        ends = [numbers(row["95 %"]) for _, row in rows]
        success.errorbar([level + beside for level, _ in rows], aligned, [[max(0.0, a - low) for a, (low, _) in zip(aligned, ends)],
                                                                          [max(0.0, high - a) for a, (_, high) in zip(aligned, ends)]],
                         fmt=marker + "-", color=colour, ms=5, capsize=3, label=name)  # fmt: skip
        # runs that mostly fail have no cycle time
        known = [(level + beside, *numbers(row["time [s], median (95 %)"])) for level, row in rows if float(row["fraction"]) >= 0.5]
        time.errorbar([x for x, *_ in known], [median for _, median, _ in known],
                      [[0.0] * len(known), [p95 - median for _, median, p95 in known]], fmt=marker + "-", color=colour, ms=5, capsize=3)  # fmt: skip
    success.set(title="aligned, with 95 % intervals", ylabel="[%]", ylim=(-3, 103))
    time.set(title="cycle time: median, bar to the 95th percentile", ylabel="[s]", ylim=(0, None))
    for axes in (success, time):
        axes.set(xlabel="level of model error", xticks=[0, 1, 2, 3])
        axes.grid(alpha=0.3)
    success.legend(loc="lower left")
    save(figure, options.output, "levels.png")


def add_arguments(parser):
    parser.add_argument("input", nargs="?", default=TABLE, help="table of `scripts/results/make levels` (default: the stored one)")
    add_output(parser)
