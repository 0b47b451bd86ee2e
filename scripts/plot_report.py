#!/usr/bin/python3
# Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
"""Earlier name of `plot report`, accepted for one release."""
import os
import sys

print("plot_report.py: deprecated: use `plot report REPORT.yaml PICTURE.png`", file=sys.stderr)
program = os.path.join(os.path.dirname(os.path.realpath(__file__)), "plot")
os.execv(program, [program, "report", *sys.argv[1:]])
