# Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
"""The modules and what each stands on, from src/*/CMakeLists.txt: docs/images/architecture.png.

An arrow that follows from others is left out. --check: compares the picture's declarations with those of CMake.
"""
import pathlib
import re

from PIL import Image
from PIL.PngImagePlugin import PngInfo

from plots.style import IMAGES, ROOT, plt, save

PICTURE = pathlib.Path(IMAGES) / "architecture.png"
CORE, ROS = "#cfe3f1", "#f9dcc4"


def declared():
    """Module -> the modules that it names."""
    modules = {}
    for file in sorted(pathlib.Path(ROOT, "src").rglob("CMakeLists.txt")):
        text = file.read_text(encoding="utf-8")
        for prefix, arguments in re.findall(r"^add_(ros_)?module\(([^)]*)\)", text, flags=re.MULTILINE):
            name, *rest = arguments.replace("${second_world}", "second_world").split()
            rest = rest[rest.index("MODULES") + 1:] if "MODULES" in rest else []
            modules[prefix + name] = set(rest[:rest.index("LIBRARIES")] if "LIBRARIES" in rest else rest)
    return modules


def text_of(modules):
    return "\n".join(f"{name}: {' '.join(sorted(below))}" for name, below in sorted(modules.items()))


def reduced(modules):
    """Without the edges that follow from others."""
    def reach(name):
        return {name}.union(*(reach(below) for below in modules[name]))
    return {name: {b for b in below if not any(b in reach(other) for other in below - {b})} for name, below in modules.items()}


def ordered(modules):
    """Rows of nodes from bottom to top, and the edges between neighbouring rows; an edge over several rows gets a node (name,
    name, row) in each. Rows are sorted by the mean place of what a node is joined to, which leaves few crossings."""
    level = {}
    while len(level) < len(modules):
        level.update({n: 1 + max((level[b] for b in below), default=-1) for n, below in modules.items() if below <= level.keys()})
    rows = [[n for n in sorted(modules) if level[n] == k] for k in range(max(level.values()) + 1)]
    edges = []
    for name in sorted(modules):
        for below in sorted(modules[name]):
            path = [below, *((below, name, k) for k in range(level[below] + 1, level[name])), name]
            for k, node in enumerate(path[1:-1], level[below] + 1):
                rows[k].append(node)
            edges += zip(path, path[1:])
    place = {n: i - (len(row) - 1) / 2 for row in rows for i, n in enumerate(row)}
    for sweep in range(40):
        for row in rows if sweep % 2 == 0 else reversed(rows):
            def mean(node):
                joined = [place[a] for a, b in edges if b == node] + [place[b] for a, b in edges if a == node]
                return sum(joined) / len(joined)
            row.sort(key=mean)
            # each node as near to its mean as its neighbours' widths allow
            want = [mean(n) for n in row]
            for k, node in enumerate(row):
                place[node] = want[k] if k == 0 else max(want[k], place[row[k - 1]] + gap(row[k - 1], node))
            shift = sum(w - place[n] for w, n in zip(want, row)) / len(row)
            for node in row:
                place[node] += shift
    return rows, edges, place


def gap(left, right):
    return sum(0.5 if isinstance(node, str) else 0.12 for node in (left, right)) + 0.08


def add_arguments(parser):
    parser.add_argument("--check", action="store_true")
    parser.add_argument("--output", default=str(PICTURE), metavar="PICTURE.png")


def draw(options):
    modules = declared()
    if options.check:
        with Image.open(options.output) as image:
            if image.info.get("modules") != text_of(modules):
                raise ValueError(f"{options.output}: not of these CMakeLists.txt: run scripts/plot architecture")
        return
    rows, edges, place = ordered(reduced(modules))
    height = {node: k for k, row in enumerate(rows) for node in row}
    figure, axes = plt.subplots(figsize=(12, 0.8 * len(rows) + 0.4))
    for low, high in edges:
        axes.plot([place[low], place[high]], [height[low] + (0.16 if isinstance(low, str) else 0), height[high] - (0.16 if isinstance(high, str) else 0)],
                  color="0.45", lw=0.9, zorder=1)
    for name in modules:
        axes.text(place[name], height[name], name, ha="center", va="center", fontsize=9, zorder=2,
                  bbox={"boxstyle": "round,pad=0.35", "facecolor": ROS if name.startswith("ros_") else CORE, "edgecolor": "0.3", "lw": 0.8})
    axes.set(xlim=(min(place.values()) - 0.6, max(place.values()) + 0.6), ylim=(-0.5, len(rows) - 0.5))
    axes.axis("off")
    axes.set_title("a module includes only what is below it along the lines; blue: core, without ROS; orange: ROS", fontsize=9)
    save(figure, options.output)
    with Image.open(options.output) as image:
        image.load()
    notes = PngInfo()
    notes.add_text("modules", text_of(modules))
    image.save(options.output, pnginfo=notes, optimize=True)
