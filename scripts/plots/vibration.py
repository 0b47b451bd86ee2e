# Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
"""Figures of docs/results/vibration.md from the tool `vibration`, or one design map."""
import math
import os
import subprocess
import tempfile

import yaml
from matplotlib.colors import ListedColormap

from plots.style import add_output, plt, program, rows_of, save

OUTCOMES = ["sticks", "assembles", "slides_both", "slides_out", "lifts", "walks_out"]
COLORS = ["#e8e8e8", "#2a9d8f", "#a8dadc", "#d1495b", "#f4a261", "#7b2d8b"]

# thesis Tables 4.1 to 4.3; kg, mm, s, mN
PEG = {"m": 0.766, "r": 25.0, "h": 25.0, "g": 9806.6}
CHORD = {"K": 1e7, "I": 877.7083, "h": 25.0, "l": 12.5, "m": 0.766, "g": 9806.6, "d": 12.5}


class Tool:
    def __init__(self, path):
        self.path = path

    def __call__(self, model, parameters, *options):
        with tempfile.NamedTemporaryFile("w", suffix=".yaml", encoding="utf-8") as file:
            yaml.safe_dump({k: v if isinstance(v, str) else float(v) for k, v in parameters.items()}, file)
            file.flush()
            run = subprocess.run([self.path, model, file.name, *options], capture_output=True, text=True, check=False)
        if run.returncode:
            raise ValueError(run.stderr.strip())
        return yaml.safe_load(run.stdout)


def numbers(values):
    return [math.nan if v is None else v for v in values]


def sliding(tool, folder, name, title, cases):
    """Force ratios over the amplitude; thesis form drawn, complete form dashed."""
    figure, rows = plt.subplots(1, len(cases), figsize=(4.6 * len(cases), 4.0), sharey=True, squeeze=False)
    for axes, (w, kx) in zip(rows[0], cases):
        for phi, color in ((0.05, "#2a6f97"), (0.1, "#d1495b"), (0.2, "#2a9d8f")):
            x = tool("sliding_ratio", {**CHORD, "w": w, "kx": kx, "phi": phi}, "--sweep", "theta=0:0.02:81")
            mrad = [1e3 * v for v in x["theta"]]
            axes.plot(mrad, numbers(x["p1"]), color=color, label=f"p1, φ = {phi}")
            axes.plot(mrad, numbers(x["p2"]), color=color, linewidth=0.8)
            axes.plot(mrad, numbers(x["p1_inertia"]), "--", color=color)
            axes.plot(mrad, numbers(x["p2_inertia"]), "--", color=color, linewidth=0.8)
        axes.set(title=f"ω = {w} rad/s, kx = {kx} mN/mm: {x['band'][0]}", xlabel="amplitude θ [mrad]", ylim=(-0.3, 1.6))
        axes.axhline(0.2, color="0.6", linestyle=":")
    rows[0][0].set_ylabel("p1 (thick), p2 (thin)")
    rows[0][0].legend(fontsize=8, loc="upper left")
    figure.suptitle(title + "; dashed: with inertia forces; dotted: μ = 0.2", fontsize=10)
    save(figure, folder, name)


def walking(tool, folder):
    figure, (left, right) = plt.subplots(1, 2, figsize=(10, 4.2))
    case = {**PEG, "K": 1e7, "F": 1500, "cos_alpha": 0.96}
    x = tool("walk", {**case, "w": 60, "cycles": 4}, "--times", "0:0.418:800")
    for key, scale, label in (("theta_X", 1e3, "θX"), ("theta_Y", 1e3, "θY"), ("theta_Z", 1e3, "θZ")):
        left.plot(x["t"], [scale * v for v in x[key]], label=label)
    left.set(xlabel="t [s]", ylabel="rotation [mrad]", title="ω = 60 rad/s, F = 1500 mN")
    left.legend()
    for w in (40, 60, 80, 120, 200):
        y = tool("walk", {**case, "w": w, "cycles": 40})
        steps, total = [0.0], 0.0
        for step in y["outward_step"]:
            total += step
            steps.append(total)
        cycles = [0.0] + [t * w / 2 / math.pi for t in y["t_lift"]]
        right.step(cycles, steps, where="post", label=f"{w} rad/s: {y['mean_step']:.4f} mm a cycle")
    right.set(xlabel="force cycles", ylabel="step of the peg's axis toward the hole [mm]", title="sum of the steps")
    right.legend(fontsize=8)
    save(figure, folder, "vibration_4_23.png")


def flight(tool, folder):
    figure, (left, right) = plt.subplots(1, 2, figsize=(10, 4.0))
    for kx in (2300, 1280, 2000):
        tip = tool("tip_bounce", {**PEG, "l": 12.5, "kx": kx, "K_chord": 1e7, "F": 2500, "w": 60,
                                  "alpha": math.pi / 3, "restitution": 0.3})
        end = tip["t_flight"]
        x = tool("free_flight", {"m": 0.766, "I": 279.2708, "kx": kx, "Krot": 1e7 - kx * 62.5**2, "h": 25, "l": 12.5,
                                 "r": 25, "J": tip["impulse"], "g": 9806.6}, "--times", f"0:{end}:60")
        ms = [1e3 * t for t in x["t"]]
        left.plot(ms, [1e7 * v for v in x["X"]], label=f"kx = {kx} mN/mm")
        right.plot(ms, [1e3 * (z - 12.5 * a) for z, a in zip(x["Z"], x["theta"])], label=f"kx = {kx} mN/mm")
    left.set(xlabel="t after impact [ms]", ylabel="X [1e-7 mm]", title="toward the hole")
    right.set(xlabel="t after impact [ms]", ylabel="gap at the chord [µm]", title="flight ends when it closes")
    left.legend(fontsize=8)
    save(figure, folder, "vibration_4_29.png")


def rig(tool, folder):
    base = {"K": 0.075, "g": 9806.6}
    figure, axes = plt.subplots(figsize=(6.6, 4.6))
    for x0 in range(5, 50, 5):
        x = tool("rig", {**base, "x0": x0, "f_hz": 4}, "--sweep", "M_over_L=10:25:301")
        axes.plot(x["M_over_L"], numbers(x["time"]), label=f"{x0} mm")
    axes.set(xlabel="M/L [mm]", ylabel="assembly time [s]", title="frequency 4 Hz", ylim=(0, 6))
    axes.legend(title="misalignment", fontsize=8)
    save(figure, folder, "vibration_5_3.png")
    figure, axes = plt.subplots(figsize=(6.6, 4.2))
    for f, style in ((4, "-"), (1, "--"), (0.5, ":")):
        x = tool("rig", {**base, "x0": 25, "f_hz": f}, "--sweep", "M_over_L=12.6:25:249")
        axes.plot(x["M_over_L"], numbers(x["time"]), style, label=f"{f} Hz")
    axes.set(xlabel="M/L [mm]", ylabel="assembly time [s]", title="misalignment 25 mm", ylim=(0, 5))
    axes.legend()
    save(figure, folder, "vibration_5_4.png")


def design_map(table, picture):
    rows = rows_of(table)
    frequencies = sorted({float(row["w"]) for row in rows})
    forces = sorted({float(row["F"]) for row in rows})
    if len(rows) != len(frequencies) * len(forces) or min(len(frequencies), len(forces)) < 2:
        raise ValueError(f"{table}: not a map of at least 2 by 2 points")
    column, line = ({v: i for i, v in enumerate(values)} for values in (frequencies, forces))
    grid = [[0] * len(frequencies) for _ in forces]
    for row in rows:
        grid[line[float(row["F"])]][column[float(row["w"])]] = OUTCOMES.index(row["outcome"])
    figure, axes = plt.subplots(figsize=(7.0, 4.8))
    axes.pcolormesh(frequencies, forces, grid, cmap=ListedColormap(COLORS), vmin=-0.5, vmax=5.5, shading="nearest",
                    rasterized=True)
    for name, color in zip(OUTCOMES, COLORS):
        axes.plot([], [], "s", color=color, markeredgecolor="0.4", label=name.replace("_", " "))
    axes.set(xlabel="ω [rad/s]", ylabel="F")
    axes.legend(loc="upper right", fontsize=8)
    save(figure, picture)


def maps(tool, folder):
    for mu, name in ((0.2, "vibration_map.png"), (0.5, "vibration_map_rough.png")):
        with tempfile.NamedTemporaryFile("r", suffix=".csv") as table:
            tool("map", {**PEG, "K": 1e7, "kx": 1280, "l": 12.5, "d": 12.5, "phi": 0.1, "mu": mu},
                 "--frequency", "1:200:400", "--force", "0:5000:400", "--output", table.name)
            design_map(table.name, os.path.join(folder, name))


def add_arguments(parser):
    parser.add_argument("--tool", default=program("vibration"), help="the executable (default: vibration in PATH or in .build)")
    add_output(parser)
    parser.add_argument("--map", nargs=2, metavar=("MAP.csv", "PICTURE.png"), help="draws this design map only")


def draw(options):
    if options.map:
        design_map(*options.map)
        return
    tool, folder = Tool(options.tool), options.output
    sliding(tool, folder, "vibration_4_11.png", "low band", [(50, 0), (50, 1280)])
    sliding(tool, folder, "vibration_4_14.png", "intermediate band", [(95, 1280), (95, 2560)])
    sliding(tool, folder, "vibration_4_17.png", "high band", [(120, 1280), (150, 1280), (200, 1280)])
    walking(tool, folder)
    flight(tool, folder)
    rig(tool, folder)
    maps(tool, folder)
