# Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
"""Plots the CSV of bench_work_precision; prints the slopes and the comparison with the peers.

Writes FOLDER/work_precision_evaluations.png, _time.png, _tolerance.png.
"""
import math
import os

import numpy

from plots.style import plt, rows_of, save

STYLES = {"dopri5": ("#2a6f97", "o-"), "dop853": ("#d1495b", "s-"), "hamming": ("#e76f51", "P-"), "rk4, fixed": ("#2a9d8f", "^-"),
          "hamming, fixed": ("#f4a261", "v-"),
          "odeint dopri5": ("#2a6f97", "o:"), "odeint rkf78": ("#7b2d8b", "D:")}
ADAPTIVE = ("dopri5", "dop853", "hamming", "odeint dopri5", "odeint rkf78")
CEILING = 1e-2  # errors above, and failed runs, are drawn here [m]
FLOOR = 1e-14   # rounding: positions of 0.05 m, some digits lost [m]


def load(path):
    rows = rows_of(path)
    for row in rows:
        for key in ("control", "error", "evaluations", "seconds"):
            row[key] = float(row[key])
    panels = {}
    for row in rows:
        panels.setdefault((row["scene"], row["law"]), {}).setdefault(row["method"], []).append(row)
    return panels


def good(row):
    return row["status"] == "ok" and math.isfinite(row["error"]) and row["error"] < CEILING


def grid(panels, x, label, path):
    columns = 4
    lines = math.ceil(len(panels) / columns)
    figure, axes = plt.subplots(lines, columns, figsize=(4.2 * columns, 3.3 * lines), squeeze=False)
    for ax in axes.flat[len(panels):]:
        ax.axis("off")
    for ax, ((scene, law), methods) in zip(axes.flat, panels.items()):
        for method, rows in methods.items():
            if method not in STYLES:
                continue
            if x == "control" and method not in ADAPTIVE:
                continue
            color, style = STYLES[method]
            kept = [r for r in rows if good(r)]
            ax.loglog([r[x] for r in kept], [max(r["error"], 1e-17) for r in kept], style, color=color, markersize=4, label=method)
            failed = [r for r in rows if not good(r)]
            ax.loglog([max(r[x], 1e-6 if x == "seconds" else 1e-16) for r in failed], [CEILING] * len(failed), "x", color=color)
        for row in methods.get("reference", []):
            if math.isfinite(row["error"]) and row["error"] > 0:
                ax.axhline(max(row["error"], 1e-18), color="0.7", linewidth=0.8)
        ax.set(title=f"{scene}, {law}", ylim=(1e-17, 5e-2))
        ax.title.set_fontsize(9)
        ax.grid(alpha=0.3)
        ax.tick_params(labelsize=7)
    axes[0][0].legend(fontsize=7)
    figure.supxlabel(label)
    figure.supylabel("largest error of the peg's position [m]; x: failed or beyond the scale")
    figure.tight_layout(rect=(0.015, 0, 1, 1))
    save(figure, path, tight=False)


def slope(rows, x):
    kept = [r for r in rows if good(r) and r["error"] > FLOOR and r[x] > 0]
    if len(kept) < 3:
        return math.nan
    return numpy.polyfit(numpy.log10([r[x] for r in kept]), numpy.log10([r["error"] for r in kept]), 1)[0]


def at_error(rows, error, key):
    """Cost at an error, interpolated in logarithms between the tolerances."""
    kept = sorted((r for r in rows if good(r) and r["error"] > 0), key=lambda r: r["error"])
    for low, high in zip(kept, kept[1:]):
        if low["error"] <= error <= high["error"] and high["error"] > low["error"]:
            part = math.log(error / low["error"]) / math.log(high["error"] / low["error"])
            return math.exp(math.log(low[key]) + part * (math.log(high[key]) - math.log(low[key])))
    return math.nan


def report(panels):
    print("| scene, law | method | error ~ evaluations^ | error ~ tolerance^ or step^ | smallest error [m] | failed |")
    print("|---|---|---|---|---|---|")
    for (scene, law), methods in panels.items():
        for method, rows in methods.items():
            if method == "reference":
                continue
            errors = [r["error"] for r in rows if good(r)]
            print(f"| {scene}, {law} | {method} | {slope(rows, 'evaluations'):.1f} | {slope(rows, 'control'):.2f} | "
                  f"{min(errors, default=math.nan):.1e} | {sum(not good(r) for r in rows)} |")
    print("\n| at an error of | ours | peer | evaluations ours : peer | time ours : peer |\n|---|---|---|---|---|")
    free = panels.get(("free", "none"), {})
    for error in (1e-11, 1e-12, 1e-13, 1e-14):
        for ours, peer in (("dopri5", "odeint dopri5"), ("dop853", "odeint rkf78")):
            if ours in free and peer in free:
                ratios = [at_error(free[ours], error, k) / at_error(free[peer], error, k) for k in ("evaluations", "seconds")]
                if any(math.isnan(ratio) for ratio in ratios):  # one of them is better at any tolerance, or never so good
                    continue
                print(f"| {error:.0e} m | {ours} | {peer} | {ratios[0]:.2f} | {ratios[1]:.2f} |")


def add_arguments(parser):
    parser.add_argument("input", metavar="RUN.csv", help="as bench_work_precision printed it")
    parser.add_argument("folder", metavar="FOLDER")


def draw(options):
    panels = load(options.input)
    base = os.path.join(options.folder, "work_precision_")
    grid(panels, "evaluations", "evaluations of the right-hand side", base + "evaluations.png")
    grid(panels, "seconds", "time [s]", base + "time.png")
    adaptive = {k: v for k, v in panels.items() if any(m in ADAPTIVE for m in v)}
    grid(adaptive, "control", "tolerance [m]", base + "tolerance.png")
    report(panels)
