# Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
"""Bias with its uncertainty and residuals, from the CSV of `calibrate payload --trace`."""
import numpy as np

from plots.style import plt, save


def add_arguments(parser):
    parser.add_argument("input", metavar="TRACE.csv", help="as `calibrate payload --trace` wrote it")
    parser.add_argument("picture", metavar="PICTURE.png")


def draw(options):
    data = np.genfromtxt(options.input, delimiter=",", names=True)
    order = data["order"]
    figure, plots = plt.subplots(2, 3, figsize=(12, 6), sharex=True)
    for plot, axis in zip(plots.flat, ("fx", "fy", "fz", "tx", "ty", "tz")):
        bias, sd = data["bias_" + axis], data["sd_" + axis]
        plot.plot(order, bias + data["residual_" + axis], ".", label="reading less weight")
        plot.plot(order, bias, label="bias")
        plot.fill_between(order, bias - 2 * sd, bias + 2 * sd, alpha=0.3, label="2 sd")
        plot.set_title(f"sensor {axis} [{'N' if axis[0] == 'f' else 'N m'}]")
    plots[0, 0].legend()
    for plot in plots[1]:
        plot.set_xlabel("order")
    save(figure, options.picture)
