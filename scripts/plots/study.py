# Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
"""Results of a study: the figures of docs/results/gallery.md, and a picture of any other study."""
import math
import os

import numpy as np
import yaml

from plots.style import plt, rows_of, save

COLORS = ["tab:blue", "tab:orange", "tab:green", "tab:red", "tab:purple"]


def number(text):
    return float(text) if text else math.nan


def histories(folder):
    """Run -> column -> array; SI units."""
    runs = {}
    for row in rows_of(os.path.join(folder, "history.csv")):
        runs.setdefault(int(row["run"]), []).append(row)
    names = [n for n in next(iter(runs.values()))[0] if n not in ("run", "mode")]
    return {k: {n: np.array([number(r[n]) for r in rows]) for n in names} for k, rows in runs.items()}


def groups(rows, *keys):
    """Values of the keys, in order of appearance -> rows."""
    found = {}
    for row in rows:
        found.setdefault(tuple(row[k] for k in keys), []).append(row)
    return found


def ink(share):
    """Colour of a number on the map RdYlGn, whose ends are dark."""
    return "white" if abs(share - 0.5) > 0.35 else "black"


def fraction(rows):
    return sum(r["assembled"] == "1" for r in rows) / len(rows)


def interval(rows):
    """Wilson's 95 % interval of the fraction of assembled runs."""
    n, p, z = len(rows), fraction(rows), 1.96
    middle = (p + z * z / (2 * n)) / (1 + z * z / n)
    half = z / (1 + z * z / n) * math.sqrt(p * (1 - p) / n + z * z / (4 * n * n))
    return middle - half, middle + half


def chapter_8(folder, title, word):
    """Distance, lean and locus of the centre of mass: corrected model above, the thesis's errors below."""
    rows = rows_of(os.path.join(folder, "results.csv"))
    history = histories(folder)
    figure, axes = plt.subplots(2, 3, figsize=(11, 6.2))
    for line, model in enumerate(["corrected", "thesis"]):
        values = []
        for row in rows:
            if row["model"] != model:
                continue
            points, value = row["scenario"].replace(f"chapter8_{word}_", "").split("_", 1)
            if value not in values:
                values.append(value)
            h, color = history[int(row["run"])], COLORS[values.index(value)]
            style = "-" if points == "one" else "--"
            label = f"{value.replace('_', '.')}, {points}"
            t = 1e3 * h["t"]
            axes[line][0].plot(t, 1e3 * np.hypot(h["x"], h["y"]), style, color=color, lw=1, label=label)
            axes[line][1].plot(t, 1e3 * (h["theta"] - h["theta"][0]), style, color=color, lw=1)
            axes[line][2].plot(1e3 * h["x"], 1e3 * h["y"], style, color=color, lw=0.8)
            if row["status"] == "edge_plane":
                axes[line][0].plot(t[-1], 1e3 * np.hypot(h["x"], h["y"])[-1], "x", color=color, ms=5)
        name = "corrected model" if model == "corrected" else "with the thesis's errors"
        axes[line][0].set(ylabel="distance from the axis [mm]", title=name)
        axes[line][1].set(ylabel="theta - theta(0) [mrad]", title="lean (less: back)")
        axes[line][2].set(xlabel="x [mm]", ylabel="y [mm]", title="locus from above")
        axes[line][2].set_aspect("equal", adjustable="datalim")
    for axis in axes[1][:2]:
        axis.set_xlabel("t [ms]")
    axes[0][0].legend(fontsize=6, ncol=2, title="solid: one point, dashed: two; x: edge on the plane", title_fontsize=6)
    figure.suptitle(title)
    return figure


def impact(folder):
    rows = rows_of(os.path.join(folder, "results.csv"))
    history = histories(folder)
    figure, axes = plt.subplots(1, 3, figsize=(11, 3.6))
    w, z0, stretch = 33.753, 31.96, 8.4979  # closed form of the free flight [rad/s], [mm], [mm]
    t = np.linspace(0, 20.02e-3, 100)
    axes[0].plot(1e3 * t, z0 - stretch * (1 - np.cos(w * t)), "k:", lw=2, label="closed form")
    axes[1].plot(1e3 * t, -stretch * w * np.sin(w * t), "k:", lw=2)
    for row, color in zip(rows, COLORS):
        h = history[int(row["run"])]
        t = 1e3 * h["t"]
        axes[0].plot(t, 1e3 * h["z"], color=color, lw=1, label=row["law"])
        axes[1].plot(t, 1e3 * h["z_rate"], color=color, lw=1)
        axes[2].plot(t[1:], np.diff(h["z_rate"]) / np.diff(h["t"]), color=color, lw=1)
    axes[0].set(ylabel="height of the centre of mass [mm]", title="displacement (Fig 7.4)")
    axes[1].set(ylabel="speed [mm/s]", title="velocity (Fig 7.5)")
    axes[2].set(ylabel="acceleration, mean of 0.2 ms [m/s²]", title="acceleration (Fig 7.6)", ylim=(-30, 250))
    axes[0].legend(fontsize=7)
    for axis in axes:
        axis.set_xlabel("t [ms]")
    return figure


def sliding(folder):
    rows = rows_of(os.path.join(folder, "results.csv"))
    history = histories(folder)
    figure, axes = plt.subplots(1, 2, figsize=(9, 3.8))
    t = np.linspace(0, 0.3, 100)
    for acceleration, style, label in [(0.35765, "k:", "closed form, 357.65 mm/s²"),
                                       (1.353, "k-.", "closed form, no friction")]:
        axes[0].plot(1e3 * t, 1e3 * acceleration * t**2 / 2, style, lw=2, label=label)
        axes[1].plot(1e3 * t, 1e3 * acceleration * t, style, lw=2)
    for row in rows:
        h = history[int(row["run"])]
        color = COLORS[["program A", "program B", "rigid"].index(row["law"])]
        style = "-" if row["friction"] != "none" else "--"
        axes[0].plot(1e3 * h["t"], 1e3 * (h["y"][0] - h["y"]), style, color=color, lw=1,
                     label=f"{row['law']}, friction {row['friction']}")
        axes[1].plot(1e3 * h["t"], -1e3 * h["y_rate"], style, color=color, lw=1)
    axes[0].set(ylabel="way [mm]", title="displacement (Fig 7.9)", ylim=(-2, 50))
    axes[1].set(ylabel="speed [mm/s]", title="velocity (Fig 7.10)", ylim=(-20, 450))
    axes[0].legend(fontsize=7)
    for axis in axes:
        axis.set_xlabel("t [ms]")
    return figure


def misalignment(folder):
    rows = rows_of(os.path.join(folder, "results.csv"))
    x, y = (1e3 * np.array([number(r[k]) for r in rows]) for k in ("start.x", "start.y"))
    good = np.array([r["assembled"] == "1" for r in rows])
    time = np.array([number(r["time_to_assemble"]) for r in rows])
    figure, axes = plt.subplots(1, 2, figsize=(10, 4.6))
    wedged = np.array([r["status"] == "force_limit" for r in rows])
    axes[0].plot(x[~good & ~wedged], y[~good & ~wedged], ".", color="0.75", ms=1.2)
    axes[0].plot(x[wedged], y[wedged], ".", color="tab:red", ms=1.2)
    picture = axes[0].scatter(x[good], y[good], c=1e3 * time[good], s=1.5, cmap="viridis")
    figure.colorbar(picture, ax=axes[0], label="time to assemble [ms]")
    axes[0].set(title=f"{len(rows)} starts: {100 * good.mean():.1f} % assembled,\n{100 * wedged.mean():.1f} % wedged (red)")
    bins = 24
    done, xs, ys = np.histogram2d(x[good], y[good], bins=bins, range=[[x.min(), x.max()], [y.min(), y.max()]])
    tried, _, _ = np.histogram2d(x, y, bins=(xs, ys))
    picture = axes[1].pcolormesh(xs, ys, (done / np.maximum(tried, 1)).T, cmap="RdYlGn", vmin=0, vmax=1)
    figure.colorbar(picture, ax=axes[1], label="fraction assembled")
    axes[1].set(title="fraction in cells of 0.5 mm")
    for axis in axes:
        axis.set(xlabel="start x [mm]", ylabel="start y [mm]")
        axis.set_aspect("equal")
    return figure


def clearance(folder):
    rows = rows_of(os.path.join(folder, "results.csv"))
    figure, axes = plt.subplots(1, 2, figsize=(9, 3.6))
    for (amplitude,), mine in groups(rows, "exciter.amplitude").items():
        cells = groups(mine, "hole.radius")
        gap = [1e3 * (float(k[0]) - 0.025) for k in cells]
        fractions = [fraction(c) for c in cells.values()]
        limits = [interval(c) for c in cells.values()]
        errors = [[s - a for s, (a, b) in zip(fractions, limits)], [b - s for s, (a, b) in zip(fractions, limits)]]
        axes[0].errorbar(gap, fractions, np.maximum(errors, 0), fmt="o-", ms=3, capsize=2, label=f"{amplitude} N")
        times = [np.nanmedian([number(r["time_to_assemble"]) for r in c]) if fraction(c) > 0 else math.nan
                 for c in cells.values()]
        axes[1].plot(gap, 1e3 * np.array(times), "o-", ms=3)
    axes[0].set(ylabel="fraction assembled, 95 % interval", ylim=(-0.03, 1.03))
    axes[1].set(ylabel="median time to assemble [ms]")
    axes[0].legend(title="exciting force", fontsize=8)
    for axis in axes:
        axis.set(xscale="log", xlabel="radial clearance [mm]")
    return figure


def excitation(folder):
    rows = rows_of(os.path.join(folder, "results.csv"))
    frictions = groups(rows, "friction")
    figure, axes = plt.subplots(1, len(frictions), figsize=(3.6 * len(frictions), 3.6), sharey=True)
    for axis, ((friction,), mine) in zip(axes, frictions.items()):
        frequencies = list(groups(mine, "exciter.frequency"))
        amplitudes = list(groups(mine, "exciter.amplitude"))
        cells = groups(mine, "exciter.amplitude", "exciter.frequency")
        table = np.array([[fraction(cells[a + f]) for f in frequencies] for a in amplitudes])
        axis.imshow(table, origin="lower", cmap="RdYlGn", vmin=0, vmax=1, aspect="auto")
        for i, line in enumerate(table):
            for k, value in enumerate(line):
                axis.text(k, i, f"{100 * value:.0f} %", ha="center", va="center", fontsize=8, color=ink(value))
        axis.set_xticks(range(len(frequencies)), [f[0] for f in frequencies])
        axis.set_yticks(range(len(amplitudes)), [a[0] for a in amplitudes])
        axis.set(xlabel="frequency [rad/s]", title=f"friction {friction}")
    axes[0].set_ylabel("amplitude [N]")
    return figure


def optimum(folder):
    rows = rows_of(os.path.join(folder, "results.csv"))
    otherwise = 1.0  # config/studies/optimum.yaml
    points = []
    for (frequency, stiffness), mine in groups(rows, "exciter.frequency", "stiffness").items():
        times = [number(r["time_to_assemble"]) for r in mine]
        points.append((float(frequency), float(stiffness), np.mean([otherwise if math.isnan(t) else t for t in times])))
    points = np.array(points)
    best = points[points[:, 2].argmin()]
    figure, axes = plt.subplots(1, 2, figsize=(9.5, 3.8))
    picture = axes[0].scatter(points[:, 0], points[:, 1], c=1e3 * points[:, 2], s=25, cmap="viridis_r")
    figure.colorbar(picture, ax=axes[0], label="mean time to assemble [ms]")
    axes[0].plot(best[0], best[1], "r+", ms=14, mew=2)
    axes[0].set(xscale="log", yscale="log", xlabel="frequency [rad/s]", ylabel="stiffness, factor",
                title=f"best: {best[0]:.0f} rad/s, factor {best[1]:.2g}, {1e3 * best[2]:.0f} ms")
    axes[0].set_xticks([200, 500, 1000, 2000], ["200", "500", "1000", "2000"])
    axes[0].set_yticks([0.2, 0.5, 1, 2, 5], ["0.2", "0.5", "1", "2", "5"])
    axes[0].minorticks_off()
    axes[1].plot(1e3 * points[:, 2], ".", color="0.6")
    axes[1].plot(1e3 * np.minimum.accumulate(points[:, 2]))
    axes[1].set(xlabel="evaluation", ylabel="mean time to assemble [ms]", title="tried, and best so far")
    return figure


def strategies(folder):
    rows = rows_of(os.path.join(folder, "results.csv"))
    names = list(groups(rows, "align.strategy"))
    figure, axes = plt.subplots(len(names), 2, figsize=(9, 3.0 * len(names)), squeeze=False)
    for line, (name,) in zip(axes, names):
        mine = [r for r in rows if r["align.strategy"] == name]
        tilts_noises = list(groups(mine, "start.tilt", "cell.noise"))
        offsets = list(groups(mine, "start.offset"))
        cells = groups(mine, "start.tilt", "cell.noise", "start.offset")
        table = np.array([[fraction(cells[tn + o]) for o in offsets] for tn in tilts_noises])
        line[0].imshow(table, origin="lower", cmap="RdYlGn", vmin=0, vmax=1, aspect="auto")
        for i, row in enumerate(tilts_noises):
            for k, offset in enumerate(offsets):
                some = cells[row + offset]
                done = sum(r["assembled"] == "1" for r in some)
                line[0].text(k, i, f"{done}/{len(some)}", ha="center", va="center", fontsize=8, color=ink(done / len(some)))
        line[0].set_xticks(range(len(offsets)), [f"{1e3 * float(o[0]):g}" for o in offsets])
        line[0].set_yticks(range(len(tilts_noises)), [f"{math.degrees(float(t)):.2g}°, {1e3 * float(n):g} mV"
                                                      for t, n in tilts_noises])
        line[0].set(xlabel="misalignment [mm]", ylabel="tilt, noise", title=f"{name}: aligned")
        for (noise,), some in groups(mine, "cell.noise").items():
            error = [1e6 * number(r["offset_error"]) for r in some]
            tilt = [math.degrees(number(r["tilt_error"])) for r in some]
            line[1].loglog(error, tilt, "o", ms=3, label=f"{1e3 * float(noise):g} mV")
        line[1].set(xlabel="error of the centre [µm]", ylabel="error of the tilt [°]", title="estimator")
        line[1].legend(fontsize=7, title="noise")
    return figure


def spread(folder):
    """Any study: the first outcome that varies over the first axis that is a number."""
    rows = rows_of(os.path.join(folder, "results.csv"))
    with open(os.path.join(folder, "manifest.yaml"), encoding="utf-8") as file:
        manifest = yaml.safe_load(file)
    numeric = [a for a in manifest["axes"] if all(is_number(r[a]) for r in rows)]
    outcomes = [c for c in manifest["columns"][manifest["columns"].index("reason") + 1:]
                if all(r[c] == "" or is_number(r[c]) for r in rows) and len({r[c] for r in rows}) > 1]
    if not outcomes:
        raise ValueError(f"{folder}: no outcome varies, there is nothing to plot")
    figure, axes = plt.subplots(1, min(3, len(outcomes)), figsize=(11, 3.6), squeeze=False)
    x = [float(r[numeric[0]]) for r in rows] if numeric else range(len(rows))
    for axis, outcome in zip(axes[0], outcomes):
        axis.plot(x, [number(r[outcome]) for r in rows], ".", ms=2)
        axis.set(xlabel=numeric[0] if numeric else "run", ylabel=outcome)
    figure.suptitle(manifest["study"])
    return figure


def is_number(text):
    try:
        float(text)
        return True
    except ValueError:
        return False


FIGURES = {
    "stiffness": lambda f: chapter_8(f, "Coupling stiffness, 0.3 N, no damping (Figs 8.3–8.6)", "stiffness"),
    "damping": lambda f: chapter_8(f, "Coupling damping, 10 N, high stiffness (Figs 8.8–8.14)", "damping"),
    "exciting_force": lambda f: chapter_8(f, "Exciting force, high stiffness, medium damping (Figs 8.15–8.18)", "force"),
    "contact_force": lambda f: chapter_8(f, "Contact force, 10 N, high damping (Figs 8.19–8.22)", "contact_force"),
    "rotation": lambda f: chapter_8(f, "Direction of rotation, 10 N, high damping (Figs 8.23–8.26)", "rotation"),
    "impact": impact,
    "sliding": sliding,
    "success_misalignment": misalignment,
    "success_clearance": clearance,
    "success_excitation": excitation,
    "optimum": optimum,
    "strategies": strategies,
}


def add_arguments(parser):
    parser.add_argument("input", metavar="FOLDER", help="with results.csv, manifest.yaml and, for some figures, history.csv")
    parser.add_argument("picture", metavar="PICTURE.png")


def draw(options):
    save(FIGURES.get(os.path.basename(os.path.normpath(options.input)), spread)(options.input), options.picture)
