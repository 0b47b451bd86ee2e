#!/usr/bin/python3
"""zones.py MAKE_PEG OUTPUT: the tolerance zones of scripts/make_peg as the table of fit.cpp."""
import importlib.machinery
import importlib.util
import sys

sys.dont_write_bytecode = True
LOADER = importlib.machinery.SourceFileLoader("make_peg", sys.argv[1])
MAKE_PEG = importlib.util.module_from_spec(importlib.util.spec_from_loader("make_peg", LOADER))
LOADER.exec_module(MAKE_PEG)

HOLES = ("D", "E", "F", "G", "H", "JS")
SHAFTS = ("d", "e", "f", "g", "h", "js", "k", "m", "n", "p")

with open(sys.argv[2], "w", encoding="utf-8") as output:
    for diameter in (1e-3 * row[0] for row in MAKE_PEG.FITS):
        for grade in range(5, 12):
            parts = [(letter, MAKE_PEG.zones(f"{letter}{grade}/h6", diameter)[0]) for letter in HOLES]
            parts += [(letter, MAKE_PEG.zones(f"H7/{letter}{grade}", diameter)[1]) for letter in SHAFTS]
            for letter, (low, high) in parts:
                output.write(f'{{"{letter}{grade}", {diameter:.9g}, {low:.9g}, {high:.9g}}},\n')
