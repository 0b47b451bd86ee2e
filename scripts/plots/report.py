# Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
"""Estimated against true misalignment, from the report of an alignment."""
import math

import yaml

from plots.style import plt, save

ESTIMATED = "#d1495b"
TRUE = "#2a6f97"


def pair(report, key):
    """Two numbers of the report; NaN where it has none."""
    value = report.get(key) or [math.nan, math.nan]
    if not isinstance(value, list) or len(value) != 2:
        raise ValueError(f"{key} is {value!r}: expected two numbers")
    return [math.nan if v is None else float(v) for v in value]


def panel(axes, true, estimated, unit, title):
    """One plane: both vectors from the origin, their difference in the title."""
    points = [p for p in (true, estimated) if all(map(math.isfinite, p))]
    reach = 1.3 * max((abs(v) for p in points for v in p), default=1.0) or 1.0
    axes.axhline(0, color="0.8", zorder=0)
    axes.axvline(0, color="0.8", zorder=0)
    for point, color, label, size in ((true, TRUE, "true", 13), (estimated, ESTIMATED, "estimated", 7)):
        if all(map(math.isfinite, point)):
            axes.plot([0, point[0]], [0, point[1]], color=color, linewidth=1.5)
            text = f"{label}: {point[0]:.3f}, {point[1]:.3f} {unit}"
            axes.plot(*point, "o", markersize=size, color=color, label=text)
    error = math.hypot(true[0] - estimated[0], true[1] - estimated[1])
    axes.set_title(title + (f"\nerror {error:.3f} {unit}" if math.isfinite(error) else ""))
    axes.set(xlim=(-reach, reach), ylim=(-reach, reach), xlabel=f"x [{unit}]", ylabel=f"y [{unit}]")
    axes.set_aspect("equal")
    if points:
        axes.legend(loc="upper center", bbox_to_anchor=(0.5, -0.11), fontsize=8)


def forces_over_depth(axes, profile):
    """Measured forces over the depth in the bore: rows of [depth, along, sideways, moment], one a millimetre."""
    rows = [[float(v) for v in row] for row in profile]
    if any(len(row) != 4 for row in rows):
        raise ValueError("insertion.profile: expected rows of four numbers")
    depth = [1e3 * row[0] for row in rows]
    axes.plot(depth, [row[1] for row in rows], color=ESTIMATED, label="along the axis")
    axes.plot(depth, [row[2] for row in rows], color=TRUE, label="across")
    axes.set(xlabel="depth [mm]", ylabel="force [N]", title="measured during insertion")
    axes.legend(loc="upper center", bbox_to_anchor=(0.5, -0.11), fontsize=8)


def plot(report, picture):
    profile = (report.get("insertion") or {}).get("profile")
    count = 3 if profile else 2
    figure, (left, right, *more) = plt.subplots(1, count, figsize=(4.8 * count, 5.8))
    figure.subplots_adjust(left=0.16 / count, right=1 - 0.06 / count, top=0.84, bottom=0.19, wspace=0.25)
    if profile:
        forces_over_depth(more[0], profile)
        more[0].title.set_fontsize(10)
    millimetres = [[1e3 * v for v in pair(report, key)] for key in ("true_offset", "estimated_offset")]
    degrees = [[math.degrees(v) for v in pair(report, key)] for key in ("true_tilt", "estimated_tilt")]
    panel(left, *millimetres, "mm", "hole's centre from the peg's bottom centre, at the start")
    panel(right, *degrees, "°", "tilt of the peg's axis, at the start")
    for axes in (left, right):
        axes.title.set_fontsize(10)
    outcome = "aligned" if report.get("success") else f"not aligned: {report.get('reason', 'unknown')}"
    figure.suptitle(
        f"{outcome} · {report.get('contacts', 0)} contacts measured · {float(report.get('simulated_time') or 0):.2f} s simulated"
    )
    save(figure, picture, tight=False)


def add_arguments(parser):
    parser.add_argument("input", metavar="REPORT.yaml", help="as `report --output` or `scripts/run --report` wrote it")
    parser.add_argument("picture", metavar="PICTURE.png")


def draw(options):
    with open(options.input, encoding="utf-8") as file:
        report = yaml.safe_load(file)
    if not isinstance(report, dict):
        raise ValueError("not a mapping")
    plot(report, options.picture)
