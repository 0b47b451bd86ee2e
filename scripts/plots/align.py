# Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
"""Studies of the whole alignment with the tool `align`: figures of docs/results/strategies.md."""
import csv
import os
import subprocess
import sys

import yaml

from plots.style import ROOT, add_output, plt, program, save

SCENARIO = os.path.join(ROOT, "config", "scenarios", "cell.yaml")
STRATEGIES = ["single_contact", "double_contact"]
PEG = 0.025
# what is varied: name, unit of the plot, values there, options for a value
STUDIES = [
    ("start within", "mm", [2.5, 5, 10, 15], lambda v: ["--offset-max", str(v * 1e-3)]),
    ("tilt within", "deg", [0.5, 1, 2, 3], lambda v: ["--tilt-max", str(v * 0.017453292519943295)]),
    ("radial clearance", "mm", [0.03, 0.1, 0.3], lambda v: ["--set", f"hole.radius={PEG + v * 1e-3:.6g}"]),
    ("noise of a strain channel", "mV", [0.5, 2, 8], lambda v: ["--noise", str(v * 1e-3)]),
    ("converter", "bit", [10, 16, 24], lambda v: ["--bits", str(v)]),
]
FIELDS = ["study", "value", "strategy", "runs", "succeeded", "success_low", "success_high", "offset_median", "offset_p95",
          "tilt_median", "tilt_p95", "direction_rms", "time_median", "time_p95"]


def measure(tool, strategy, runs, seed, options):
    command = [tool, SCENARIO, "--strategy", strategy, "--runs", str(runs), "--seed", str(seed), *options]
    run = subprocess.run(command, capture_output=True, text=True, check=False)
    if run.returncode not in (0, 1):
        raise ValueError(run.stderr.strip() or f"{' '.join(command)}: exit code {run.returncode}")
    result = yaml.safe_load(run.stdout)

    def of(key, part):
        return (result[key] or {}).get(part, "")

    return {"runs": result["runs"], "succeeded": result["succeeded"], "success_low": result["success_interval"][0],
            "success_high": result["success_interval"][1], "offset_median": of("offset_error", "median"),
            "offset_p95": of("offset_error", "p95"), "tilt_median": of("tilt_error", "median"),
            "tilt_p95": of("tilt_error", "p95"), "direction_rms": result["direction_error_rms"] or "",
            "time_median": of("simulated_time", "median"), "time_p95": of("simulated_time", "p95")}


def plot(rows, folder):
    figure, axes = plt.subplots(3, len(STUDIES), figsize=(4 * len(STUDIES), 9), squeeze=False)
    for column, (name, unit, _, _) in enumerate(STUDIES):
        for strategy, marker, colour in zip(STRATEGIES, "os", ("C0", "C1")):
            mine = [r for r in rows if r["study"] == name and r["strategy"] == strategy]
            x = [r["value"] for r in mine]
            fraction = [r["succeeded"] / r["runs"] for r in mine]
            axes[0][column].errorbar(x, fraction, [[s - r["success_low"] for s, r in zip(fraction, mine)],
                                                [r["success_high"] - s for s, r in zip(fraction, mine)]],
                                     fmt=marker + "-", color=colour, ms=4, capsize=2, label=strategy)
            for part, line in (("median", "-"), ("p95", ":")):
                known = [r for r in mine if r[f"offset_{part}"] != ""]
                axes[1][column].plot([r["value"] for r in known], [r[f"offset_{part}"] * 1e3 for r in known],
                                     marker + line, color=colour, ms=4, label=f"{strategy}, {part}")
            axes[2][column].plot(x, [r["time_median"] for r in mine], marker + "-", color=colour, ms=4, label=strategy)
        axes[0][column].set(title=f"{name} [{unit}]", ylim=(0, 1.05))
        axes[1][column].set(yscale="log")
        axes[2][column].set(xlabel=f"{name} [{unit}]", ylim=(0, None))
    axes[0][0].set_ylabel("fraction aligned, 95 % interval")
    axes[1][0].set_ylabel("error of the hole's centre [mm]")
    axes[2][0].set_ylabel("simulated time, median [s]")
    axes[1][0].legend(fontsize=7)
    save(figure, folder, "align_study.png")


def add_arguments(parser):
    parser.add_argument("--tool", default=program("align"), help="the executable (default: align in PATH or in .build)")
    parser.add_argument("--runs", type=int, default=20, help="random starts a point (default 20)")
    parser.add_argument("--seed", type=int, default=1, help="of the first start (default 1)")
    add_output(parser)


def draw(options):
    if options.runs < 2 or not os.access(options.tool, os.X_OK):
        raise ValueError("--runs needs at least 2, --tool an executable: build the target align first")
    rows = []
    for name, _, values, arguments in STUDIES:
        for value in values:
            for strategy in STRATEGIES:
                row = {"study": name, "value": value, "strategy": strategy}
                row.update(measure(options.tool, strategy, options.runs, options.seed, arguments(value)))
                rows.append(row)
                print(f"{name} {value}: {strategy} {row['succeeded']} of {row['runs']}", file=sys.stderr)
    with open(os.path.join(options.output, "align_study.csv"), "w", encoding="utf-8", newline="") as file:
        writer = csv.DictWriter(file, FIELDS)
        writer.writeheader()
        writer.writerows(rows)
    plot(rows, options.output)
