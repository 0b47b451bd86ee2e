# Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
"""Runs the studies of the locus estimator: figures and tables of docs/theory/locus.md."""
import csv
import io
import os
import subprocess

from plots.style import add_output, plt, program, save

MODES = ["none", "segment", "ellipse", "circle", "undecided"]


def study(tool, folder, name, *arguments):
    run = subprocess.run([tool, name, *arguments], capture_output=True, text=True, check=False)
    if run.returncode:
        raise ValueError(run.stderr.strip() or f"{tool} {name}: exit code {run.returncode}")
    with open(os.path.join(folder, f"locus_{name}.csv"), "w", encoding="utf-8") as file:
        file.write(run.stdout)
    return list(csv.DictReader(io.StringIO(run.stdout)))


def plot_accuracy(rows, folder):
    ellipses = sorted({(float(r["a"]), float(r["b"])) for r in rows}, reverse=True)
    figure, axes = plt.subplots(1, len(ellipses), figsize=(4 * len(ellipses), 4), sharey=True)
    for axis, (a, b) in zip(axes, ellipses):
        mine = [r for r in rows if (float(r["a"]), float(r["b"])) == (a, b)]
        sigma = [float(r["sigma"]) for r in mine]
        for key, label, style in [("fit", "harmonic fit", "o-"), ("principal_axes", "principal axes", "s-"),
                                  ("ellipse_fit", "direct ellipse fit", "^-"), ("fit_phase", "fit, phase known", "o--")]:
            bound = "bound_phase" if key == "fit_phase" else "bound_shape"
            axis.plot(sigma, [float(r[key]) / float(r[bound]) for r in mine], style, ms=3, label=label)
        axis.axhline(1.05, color="0.6", lw=0.8)
        axis.set(xscale="log", ylim=(0.9, 2.5), xlabel="noise of one sample, sigma/a", title=f"b/a = {b:g}")
    axes[0].set_ylabel("rms error of the direction / Cramér–Rao bound")
    axes[0].legend(fontsize=8)
    save(figure, folder, "locus_accuracy.png")


def plot_modes(rows, folder):
    figure, axis = plt.subplots(figsize=(9, 6))
    labels = [f"{r['true']}{'' if r['true'] != 'ellipse' else ' ' + r['b_over_a']}, {r['sigma_over_a']}" for r in rows]
    left = [0.0] * len(rows)
    for mode, color in zip(MODES, ["#bbbbbb", "#2a9d8f", "#457b9d", "#f4a261", "#e63946"]):
        values = [float(r[mode]) for r in rows]
        axis.barh(labels, values, left=left, color=color, label=mode, height=0.9)
        left = [a + b for a, b in zip(left, values)]
    axis.invert_yaxis()
    axis.set(xlim=(0, 1), xlabel="fraction of decisions", ylabel="true mode, sigma/a")
    axis.tick_params(axis="y", labelsize=7)
    axis.legend(ncol=5, loc="lower center", bbox_to_anchor=(0.5, 1.0), fontsize=8)
    save(figure, folder, "locus_modes.png")


def add_arguments(parser):
    parser.add_argument("--tool", default=program("study_locus"),
                        help="the executable (default: study_locus in PATH or in .build; build it with -DASSEMBLY_CELL_BENCHMARK=ON)")
    parser.add_argument("--runs", default="4000", help="Monte Carlo runs a point (default 4000)")
    add_output(parser)


def draw(options):
    os.makedirs(options.output, exist_ok=True)
    plot_accuracy(study(options.tool, options.output, "accuracy", options.runs), options.output)
    plot_modes(study(options.tool, options.output, "modes", options.runs), options.output)
    study(options.tool, options.output, "alarms", options.runs)
    for name in ("settling", "bias", "friction", "cost"):
        study(options.tool, options.output, name)
