# Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
"""Tables (CSV) and figures of docs/theory/twin_force.md, from the program study_twin_force."""
import os
import subprocess

from plots.style import add_output, plt, program, rows_of, save


def table(folder, name):
    return rows_of(os.path.join(folder, name + ".csv"))


def column(rows, key):
    return [float(row[key]) for row in rows]


def geometries(folder):
    rows = [row for row in table(folder, "twin_force_geometries") if row["ratio_position"]]
    names = list(dict.fromkeys(row["geometry"] for row in rows))
    figure, axes = plt.subplots(1, 2, figsize=(12, 5.5), sharey=True)
    markers = {"thesis": "x", "robust": "s", "ml": "o", "ml with prior": "^"}
    for axis, key, title in zip(axes, ("ratio_position", "ratio_rotation"), ("position", "rotation")):
        for method, marker in markers.items():
            mine = [row for row in rows if row["method"] == method]
            axis.plot(column(mine, key), [names.index(row["geometry"]) for row in mine], marker,
                      label=method, fillstyle="none")
        axis.axvline(1, color="k", lw=0.8)
        axis.axvspan(0.95, 1.05, color="0.9")
        axis.set_xscale("log")
        axis.set_xlabel(f"rms error of {title} / Cramér–Rao bound")
        axis.grid(alpha=0.3)
    axes[0].set_yticks(range(len(names)), names)
    axes[0].invert_yaxis()
    axes[1].legend()
    save(figure, folder, "twin_force_geometries.png")


def figure_10_5(folder):
    angle, arms = table(folder, "twin_force_angle"), table(folder, "twin_force_arms")
    figure, (left, right) = plt.subplots(1, 2, figsize=(11, 4.5))
    beta = column(angle, "beta_deg")
    left.loglog(beta, column(angle, "bound_mm"), "C0-", label="position [mm]")
    left.loglog(beta, column(angle, "rule_mm"), "C0--", label="2.8 σ_M/F / sin²β")
    left.loglog(beta, column(angle, "bound_mrad"), "C1-", label="rotation [mrad]")
    left.loglog(beta, column(angle, "rule_mrad"), "C1--", label="2.0 σ_F/F / sin β")
    left.set_xlabel("angle β between two lines [deg]")
    left.set_ylabel("bound, 3 axes")
    arm = column(arms, "arm_mm")
    for key, style, label in (("two_lines_mrad", "C0-", "2 lines, σ_F 0.05 N"),
                              ("three_lines_mrad", "C1-", "3 lines, σ_F 0.05 N"),
                              ("two_lines_noisy_mrad", "C0--", "2 lines, σ_F 1 N"),
                              ("three_lines_noisy_mrad", "C1--", "3 lines, σ_F 1 N")):
        right.semilogy(arm, column(arms, key), style, label=label)
    right.set_xlabel("distance of the lines from O_A = O_B [mm]")
    right.set_ylabel("bound of rotation [mrad]")
    for axis in (left, right):
        axis.grid(alpha=0.3, which="both")
        axis.legend(fontsize=8)
    save(figure, folder, "twin_force_10_5.png")


def count(folder):
    rows = table(folder, "twin_force_count")
    figure, axis = plt.subplots(figsize=(6.5, 4.5))
    n = column(rows, "contacts")
    for unit, color in (("mm", "C0"), ("mrad", "C1")):
        axis.loglog(n, column(rows, "median_" + unit), color + "o-", label=f"median [{unit}]")
        axis.loglog(n, column(rows, "p90_" + unit), color + "o--", label=f"90 % [{unit}]")
    axis.set_xticks(n, [f"{x:.0f}" for x in n])
    axis.minorticks_off()
    axis.set_xlabel("contacts in random directions")
    axis.set_ylabel("bound, 3 axes")
    axis.grid(alpha=0.3)
    axis.legend()
    save(figure, folder, "twin_force_count.png")


def faults(folder):
    rows = [row for row in table(folder, "twin_force_faults") if row["fault"] != "none"]
    names = list(dict.fromkeys(row["fault"] for row in rows))
    figure, axis = plt.subplots(figsize=(10, 4.5))
    for contacts, marker in (("2", "s"), ("4", "o")):
        mine = [row for row in rows if row["contacts"] == contacts]
        axis.plot([max(1e-3, float(row["chi2"])) / float(row["dof"]) for row in mine],
                  [names.index(row["fault"]) for row in mine], marker, label=f"{contacts} contacts")
    axis.axvline(3.7, color="C3", lw=0.8, label="refused at 6 degrees of freedom")
    axis.axvline(2.35, color="C3", lw=0.8, ls="--", label="at 18")
    axis.set_xscale("log")
    axis.set_yticks(range(len(names)), names)
    axis.set_xlabel("χ² / degrees of freedom, without noise (noise alone adds 1)")
    axis.grid(alpha=0.3)
    axis.legend(fontsize=8)
    save(figure, folder, "twin_force_faults.png")


def add_arguments(parser):
    parser.add_argument("--tool", default=program("study_twin_force"),
                        help="the executable (default: study_twin_force in PATH or in .build; build it with -DASSEMBLY_CELL_BENCHMARK=ON)")
    add_output(parser)


def draw(options):
    subprocess.run([options.tool, options.output], check=True)
    for figure in (geometries, figure_10_5, count, faults):
        figure(options.output)
