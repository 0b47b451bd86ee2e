# Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
"""Sketches, not to scale: docs/images/strategy_touch.png (touch step by step), docs/images/contact_modes.png (modes and loci),
docs/images/two_point.png (two-point contact, jamming), docs/images/safety.png (who ends what, a stop at a contact)."""
import math

from plots.style import add_output, plt, save

PEG, BLOCK, RED = "#8fbf8f", "#cfe3f1", "#c0392b"
HOLE, DEPTH, PEG_RADIUS, HEIGHT = 1.0, 1.5, 0.93, 1.6
# title, what is shown, x and z of the peg's lowest point, tilt [rad], arrows (from, to) of forces or motion
STEPS = [
    ("1 round", "six light touches of the\ntilted edge: plane, hole", (-1.2, 0.0), 0.16, [((-1.55, 1.0), (-1.55, 0.45))]),
    ("2 drop", "the low edge goes in\nbehind the middle", (-0.55, -0.16), 0.16, [((-1.35, 1.0), (-1.35, 0.45))]),
    ("3 walls", "the low edge against the\nwalls: the middle", (-0.985, -0.18), 0.16, [((-0.45, -0.32), (-0.93, -0.32))]),
    ("4 entry", "upright, down; walls on\nfour sides are the proof", (-0.93, -0.25), 0.0, [((-1.35, 1.0), (-1.35, 0.45))]),
    ("5 insertion", "down, guided by the bore,\nto a depth or the floor", (-0.93, -1.1), 0.0, [((-1.35, 0.9), (-1.35, 0.35))]),
]


def block(axes):
    for side in (-1, 1):
        axes.add_patch(plt.Rectangle((side * HOLE, -DEPTH), side * 0.75, DEPTH, facecolor=BLOCK, edgecolor="0.3", lw=1))
    axes.add_patch(plt.Rectangle((-1.75, -DEPTH - 0.25), 3.5, 0.25, facecolor=BLOCK, edgecolor="0.3", lw=1))


def step(axes, title, text, low, tilt, arrows):
    block(axes)
    c, s = math.cos(tilt), math.sin(tilt)
    corner = [(0, 0), (2 * PEG_RADIUS, 0), (2 * PEG_RADIUS, HEIGHT), (0, HEIGHT)]  # from the lowest point of the edge
    points = [(low[0] + c * x - s * z, low[1] + s * x + c * z) for x, z in corner]
    axes.add_patch(plt.Polygon(points, facecolor=PEG, edgecolor="0.3", lw=1, zorder=2))
    for begin, end in arrows:
        axes.annotate("", end, begin, arrowprops={"arrowstyle": "-|>", "color": RED, "lw": 2}, zorder=3)
    axes.set_title(title, fontsize=11, weight="bold")
    axes.text(0, -DEPTH - 0.45, text, ha="center", va="top", fontsize=9.5)
    axes.set(xlim=(-1.9, 1.9), ylim=(-DEPTH - 1.1, 1.95))
    axes.set_aspect("equal")
    axes.axis("off")


def modes(axes, title, contacts, locus, text):
    """From above: hole, peg's edge, contacts; its centre's motion, much enlarged, beside it."""
    axes.add_patch(plt.Circle((0, 0), 1.0, facecolor="white", edgecolor="k", lw=1.5))
    axes.add_patch(plt.Circle((0.28, 0), 0.95, facecolor="none", edgecolor="#2e7d32", lw=1.5))
    for x, y in contacts:
        axes.plot(x, y, "o", color=RED, ms=8, zorder=4)
    xs, ys = zip(*locus)
    axes.plot([3.1 + x for x in xs], ys, "o" if len(set(locus)) == 1 else "-", color="#a0209a", lw=2, ms=5)
    axes.plot([2.3, 3.9], [0, 0], color="0.8", lw=0.7, zorder=0)
    axes.plot([3.1, 3.1], [-0.8, 0.8], color="0.8", lw=0.7, zorder=0)
    axes.set_title(title, fontsize=11, weight="bold")
    axes.text(1.6, -1.3, text, ha="center", va="top", fontsize=9.5)
    axes.set(xlim=(-1.2, 4.1), ylim=(-1.95, 1.2))
    axes.set_aspect("equal")
    axes.axis("off")


def ellipse(a, b, angle=0.0):
    turns = [2 * math.pi * k / 90 for k in range(91)]
    return [(a * math.cos(t) * math.cos(angle) - b * math.sin(t) * math.sin(angle),
             a * math.cos(t) * math.sin(angle) + b * math.sin(t) * math.cos(angle)) for t in turns]  # fmt: skip


def two_point(axes):
    """A peg that touches the left wall with its edge and the mouth on the right, with d, D, l and theta."""
    block(axes)
    tilt, d = 0.19, 1.8
    c, s = math.cos(tilt), math.sin(tilt)
    length = (2 * HOLE - d * c) / s  # from the base to the right contact along the side: l sin + d cos = D
    low = (-HOLE, -(length * c - d * s))  # the left end of the base; the right contact is at the face
    corner = [(0, 0), (d, 0), (d, 2.2), (0, 2.2)]
    at = [(low[0] + c * x + s * z, low[1] - s * x + c * z) for x, z in corner]
    axes.add_patch(plt.Polygon(at, facecolor=PEG, edgecolor="0.3", lw=1, zorder=2, alpha=0.9))
    base_right = (low[0] + c * d, low[1] - s * d)
    for x, z in (low, (HOLE, 0.0)):
        axes.plot(x, z, "o", color=RED, ms=8, zorder=4)
    axes.annotate("", (HOLE, 0.0), base_right, arrowprops={"arrowstyle": "<->", "color": "k"}, zorder=5)
    axes.text((HOLE + base_right[0]) / 2 - 0.16, base_right[1] / 2, "$l$", fontsize=12, zorder=5)
    axes.text((low[0] + base_right[0]) / 2, (low[1] + base_right[1]) / 2 + 0.1, "$d$", fontsize=12, zorder=5)
    axes.annotate("", (HOLE, -DEPTH + 0.12), (-HOLE, -DEPTH + 0.12), arrowprops={"arrowstyle": "<->", "color": "k"})
    axes.text(-0.5, -DEPTH + 0.17, "$D$", fontsize=12)
    axes.set(xlim=(-1.9, 1.9), ylim=(-DEPTH - 0.4, 2.0))
    axes.set_title("two-point contact: $l \\sin\\theta + d \\cos\\theta = D$", fontsize=11)
    axes.set_aspect("equal")
    axes.axis("off")


def jamming(axes, friction=0.3):
    """Whitney's parallelogram for two depths."""
    for ratio, color in ((1.0, "#c0392b"), (3.0, "#1f4fbf")):  # lambda = l/(2 r mu)
        side = [x / friction for x in (-1, 1)]
        points = [(side[0], ratio + (1 + ratio)), (side[1], ratio - (1 + ratio)), (side[1], -ratio - (1 + ratio)), (side[0], -ratio + (1 + ratio))]
        axes.add_patch(plt.Polygon(points, facecolor=color, edgecolor=color, alpha=0.2))
        axes.plot(*zip(*points, points[0]), color=color, lw=1.5, label=f"$\\lambda$ = {ratio:g}")
    axes.plot(0, 0, "k+", ms=9)
    axes.set(xlabel="$F_x/F_z$", ylabel="$M/(r F_z)$", title=f"inside it slides in, outside it jams; friction {friction}")
    axes.title.set_fontsize(11)
    axes.grid(alpha=0.3)
    axes.legend(fontsize=9)


# what stands between a goal and the arm: name, what it ends by itself; colour
DEFENCE = [
    ("assembly_supervisor", "ends a goal: no data, saturation,\ndisturbance, time limit, cancel", "#f9dcc4"),
    ("guard of the plant\n(simulator or arm_bridge)", "stops the carrier, exciter off: lease out,\nload, old or foreign command, workspace", "#f9dcc4"),
    ("drive of the arm, exciter's driver", "stop without fresh commands;\ntheir own limits of speed and force", BLOCK),
    ("emergency stop", "takes the power away", BLOCK),
]


def defence(axes):
    for k, (name, ends, color) in enumerate(DEFENCE):
        y = 3.0 - k
        axes.text(0.0, y, name, ha="center", va="center", fontsize=10, weight="bold",
                  bbox={"boxstyle": "round,pad=0.45", "facecolor": color, "edgecolor": "0.3", "lw": 0.8})  # fmt: skip
        axes.text(1.0, y, ends, ha="left", va="center", fontsize=9.5)
        if k in (1, 2):
            axes.annotate("", (0.0, y + 0.3), (0.0, y + 0.7), arrowprops={"arrowstyle": "-|>", "color": "0.45"})
    axes.text(-0.05, 2.5, "leases, commands ", ha="right", va="center", fontsize=9)
    axes.text(-0.05, 1.5, "set points ", ha="right", va="center", fontsize=9)
    axes.set(xlim=(-1.1, 3.3), ylim=(-0.5, 3.5))
    axes.axis("off")
    axes.set_title("each stops without the ones above; orange: this package", fontsize=11)


def stop_at_contact(axes):
    """Force of a move at v that meets a contact of stiffness K, seen after T, and stops at a: K v T + K v^2/(2 a) at the end."""
    delay, braking = 1.0, 1.2  # times; v = K = 1
    rise = [(t, t) for t in (0.0, delay)]
    stop = [(delay + t, delay + t - t * t / (2 * braking)) for t in (braking * k / 30 for k in range(31))]
    most = stop[-1][1]
    axes.plot(*zip((-0.6, 0.0), rise[0]), *zip(*rise), color="#1f4fbf", lw=2)
    axes.plot(*zip(*stop, (delay + braking + 0.8, most)), color=RED, lw=2)
    axes.plot([delay, delay], [0, delay], "k:", lw=1)
    axes.plot([delay + braking] * 2, [0, most], "k:", lw=1)
    for low, high, words in ((0.0, delay, "$T$: delay"), (delay, delay + braking, "$v/a$: braking")):
        axes.annotate("", (low, 0.08), (high, 0.08), arrowprops={"arrowstyle": "<->", "color": "k"})
        axes.text(0.4 * low + 0.6 * high, 0.13, words, ha="center", fontsize=10)
    axes.text(delay + braking + 0.75, most + 0.05, "$K v T + K v^2/(2a)$", ha="right", va="bottom", fontsize=11)
    axes.text(-0.55, 0.06, "free", fontsize=10)
    axes.set(xlim=(-0.6, delay + braking + 0.8), ylim=(0, 1.25 * most), xticks=[], yticks=[], xlabel="time", ylabel="force")
    axes.set_title("a free move meets a contact of stiffness $K$ at speed $v$", fontsize=11)


def add_arguments(parser):
    add_output(parser)


def draw(options):
    figure, axes = plt.subplots(1, len(STEPS), figsize=(12, 3.1))
    for ax, one in zip(axes, STEPS):
        step(ax, *one)
    save(figure, options.output, "strategy_touch.png")

    x = 0.28 / 2 + (1 - 0.95 ** 2) / (2 * 0.28)  # where both circles cross
    y = math.sqrt(1 - x * x)
    figure, axes = plt.subplots(1, 4, figsize=(12, 2.5))
    modes(axes[0], "one contact", [(x, y)], ellipse(0.75, 0.3, math.atan2(y, x - 0.28)), "ellipse: an axis points\nto the contact")
    modes(axes[1], "two contacts", [(x, y), (x, -y)], ellipse(0.75, 0.0), "segment: across the line\nthrough the contacts")
    modes(axes[2], "sliding", [(1.23, 0)], ellipse(0.6, 0.6), "circle with the exciter:\nno direction, but friction")
    modes(axes[3], "three contacts", [(x, y), (x, -y), (1.23, 0)], [(0.0, 0.0)], "no motion")
    save(figure, options.output, "contact_modes.png")

    figure, axes = plt.subplots(1, 2, figsize=(10, 4.2))
    two_point(axes[0])
    jamming(axes[1])
    save(figure, options.output, "two_point.png")

    figure, axes = plt.subplots(1, 2, figsize=(12, 3.6), gridspec_kw={"width_ratios": (1.4, 1)})
    defence(axes[0])
    stop_at_contact(axes[1])
    save(figure, options.output, "safety.png")
