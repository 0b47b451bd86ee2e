#!/usr/bin/python3
# Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
"""Bias with its uncertainty and residuals of `calibrate payload --trace FILE.csv`."""
import sys

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np


def main():
    if len(sys.argv) != 3 or sys.argv[1] in ("-h", "--help"):
        print("Usage: plot_payload.py TRACE.csv OUTPUT.png", file=sys.stderr)
        return 0 if "--help" in sys.argv or "-h" in sys.argv else 2
    try:
        data = np.genfromtxt(sys.argv[1], delimiter=",", names=True)
        order = data["order"]
        figure, plots = plt.subplots(2, 3, figsize=(12, 6), sharex=True)
        for plot, axis in zip(plots.flat, ("fx", "fy", "fz", "tx", "ty", "tz")):
            bias, sd = data["bias_" + axis], data["sd_" + axis]
            plot.plot(order, bias + data["residual_" + axis], ".", label="reading less weight")
            plot.plot(order, bias, label="bias")
            plot.fill_between(order, bias - 2 * sd, bias + 2 * sd, alpha=0.3, label="2 sd")
            plot.set_title("sensor %s [%s]" % (axis, "N" if axis[0] == "f" else "N m"))
        plots[0, 0].legend()
        for plot in plots[1]:
            plot.set_xlabel("order")
        figure.tight_layout()
        figure.savefig(sys.argv[2])
    except (OSError, ValueError, KeyError) as error:
        print("plot_payload.py: %s: %s" % (sys.argv[1], error), file=sys.stderr)
        return 2
    return 0


if __name__ == "__main__":
    sys.exit(main())
