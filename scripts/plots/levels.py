# Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
"""Success and cycle time over the level of model error, from docs/results/tables/levels_1.csv: docs/images/levels.png."""
import os
import re

from plots.style import ROOT, add_output, plt, rows_of, save

TABLE = os.path.join(ROOT, "docs", "results", "tables", "levels_1.csv")


def numbers(cell):
    """Of `12.2 (13.1)` or `96.3–100.0`; none of `–`."""
    return [float(number) for number in re.findall(r"\d[\d.]*", cell)]


def draw_shares(axes, x, rows, shares, **style):
    """Shares [%] with the interval of each row's column `95 %`."""
    ends = [numbers(row["95 %"]) for row in rows]
    axes.errorbar(x, shares, [[max(0.0, share - low) for share, (low, _) in zip(shares, ends)],
                              [max(0.0, high - share) for share, (_, high) in zip(shares, ends)]], **style)  # fmt: skip


def draw_medians(axes, x, pairs, **style):
    """Medians, with a bar up to the second number of each pair; none where a pair is empty."""
    known = [(at, *pair) for at, pair in zip(x, pairs) if pair]
    axes.errorbar([at for at, _, _ in known], [low for _, low, _ in known], [[0.0] * len(known), [high - low for _, low, high in known]], **style)


def draw(options):
    strategies = {}
    for row in rows_of(options.input):
        name, _, level = row["start"].partition(", level ")
        strategies.setdefault(name, []).append((int(level), row))
    figure, (success, time) = plt.subplots(1, 2, figsize=(9, 3.6))
    for number, (name, rows) in enumerate(strategies.items()):
        beside = 0.06 * (number - 0.5 * (len(strategies) - 1))
        colour, marker = f"C{number}", "os^Dv"[number % 5]
        style = {"fmt": marker + "-", "color": colour, "ms": 5, "capsize": 3}
        x = [level + beside for level, _ in rows]
        draw_shares(success, x, [row for _, row in rows], [100 * float(row["fraction"]) for _, row in rows], label=name, **style)
        # runs that mostly fail have no cycle time
        draw_medians(time, x, [numbers(row["time [s], median (95 %)"]) if float(row["fraction"]) >= 0.5 else [] for _, row in rows], **style)
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
