# Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
"""Common parts of all plots: matplotlib without a display, CSV tables, paths of this source tree, writing a picture."""
import csv
import io
import os
import shutil

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt  # noqa: E402
from PIL import Image  # noqa: E402  comes with matplotlib

ROOT = os.path.dirname(os.path.dirname(os.path.dirname(os.path.abspath(__file__))))
IMAGES = os.path.join(ROOT, "docs", "images")
DPI = 100


def rows_of(path):
    """The rows of a CSV file with a header, as dictionaries of strings."""
    with open(path, encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))


def program(name):
    """Path of a tool: found in PATH, otherwise the one built in this source tree."""
    return shutil.which(name) or os.path.join(ROOT, ".build", "devel", "lib", "assembly_cell", name)


def add_output(parser):
    parser.add_argument("--output", default=IMAGES, metavar="FOLDER", help="where the files go (default: docs/images of this source tree)")


def save(figure, *path, tight=True):
    """Writes the figure as a PNG of 256 colours, a third of the bytes of full colour, and closes it."""
    if tight:
        figure.tight_layout()
    buffer = io.BytesIO()
    figure.savefig(buffer, dpi=DPI, format="png")
    plt.close(figure)
    image = Image.open(buffer).convert("RGB").quantize(256, Image.Quantize.FASTOCTREE, dither=Image.Dither.NONE)
    image.save(os.path.join(*path), format="png", optimize=True)
