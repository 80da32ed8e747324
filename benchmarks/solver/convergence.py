"""Depth, stopping time and compacted volume against the spacing, and the convergence figure of docs/convergence.md.

    python -m benchmarks.solver.convergence                       # a/dx 4 5 6 8 12 16: some four minutes of one core
    python -m benchmarks.solver.convergence 4 5 6 --picture OUT.png

Axisymmetric drops of a 1 mm bead, K0 45 kPa, p_m 1300 Pa, beside the limits of an independent material-point solver of the
same equations (data/reference). The bands are how firm that solver's limits are. Prints Markdown.
"""

from __future__ import annotations

import argparse
import datetime
import math
import time
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from benchmarks.solver.independent_curves import STOPS, set_drop
from benchmarks.speed.solver import commit
from labsim.sph import simulate
from labsim.sph.convergence import COMPACTED, extrapolate

PICTURE = Path(__file__).parents[2] / "docs" / "pictures" / "convergence.png"
RADIUS_MM = 0.5
CELLS = [4.0, 5.0, 6.0, 8.0, 12.0, 16.0]
WORKING = {"fits": 5.0, "single drops": 8.0}  # spacings in a tip radius that labsim uses
SPEEDS = (0.14, 0.20, 0.30, 0.65, 1.00, 1.18)  # m/s; compacted volumes are there for three of them
FIRM = {"D": 1.0, "T_s": 1.5, "V": 8.0}  # %, of the independent solver's limits
COLUMNS = {"D": "depth_mm", "T_s": "stopping_time_ms", "V": "volume20"}
NAMES = {"D": "depth D", "T_s": "stopping time T_s", "V": f"V(φ > {COMPACTED})"}


def read_reference() -> pd.DataFrame:
    """Limits of the independent solver, and its values at its own spacings: quantity, speed, cells (inf: limit), value."""
    table = pd.read_csv(STOPS)
    table = table[(table.tip_radius_mm == RADIUS_MM) & table.speed_m_s.isin(SPEEDS)]
    # a straight line through the two finest, as the limits of the other two are
    table["volume20_limit"] = 4 * table.volume20_h16 - 3 * table.volume20_h12
    rows = []
    for quantity, name in COLUMNS.items():
        for column, cells in (("h8", 8.0), ("h12", 12.0), ("h16", 16.0), ("limit", math.inf)):
            values = table[f"{name}_{column}"]
            known = values.notna() if column == "limit" else values.notna() & table[f"{name}_limit"].notna()
            rows += [
                (quantity, speed, cells, value)
                for speed, value in zip(table.speed_m_s[known], values[known], strict=True)
            ]
    return pd.DataFrame(rows, columns=["quantity", "speed", "cells", "value"])


def run_drops(speeds: list[float], cells: list[float]) -> pd.DataFrame:
    """One row a quantity and drop, in the units of the reference: mm, ms, projectile volumes."""
    rows = []
    for speed in speeds:
        for each in cells:
            began = time.process_time()
            run = simulate(set_drop(RADIUS_MM * 1e-3, speed, 1300.0, each))
            values = {
                "D": run.penetration_depth * 1e3,
                "T_s": run.stopping_time * 1e3,
                "V": run.compacted_volume(COMPACTED) / (4 / 3 * math.pi * (RADIUS_MM * 1e-3) ** 3),
            }
            seconds = time.process_time() - began
            rows += [(quantity, speed, each, value, seconds) for quantity, value in values.items()]
    return pd.DataFrame(rows, columns=["quantity", "speed", "cells", "value", "cpu_s"])


def compare(runs: pd.DataFrame, reference: pd.DataFrame) -> tuple[pd.DataFrame, pd.DataFrame]:
    """Both tables in % of the independent limit, and labsim's own limit (cells: inf) among its runs."""
    limits = reference[np.isinf(reference.cells)].set_index(["quantity", "speed"])["value"]
    mine = []
    for key, group in runs.groupby(["quantity", "speed"]):
        if key in limits.index:
            group = group.sort_values("cells")
            own = extrapolate(1 / group.cells[-3:], group.value[-3:]) if len(group) > 2 else None
            mine.append(group.assign(error=100 * (group.value / limits[key] - 1), sigma=0.0))
            if own:
                error, sigma = 100 * (own.value / limits[key] - 1), 100 * own.sigma / limits[key]
                last = {"quantity": key[0], "speed": key[1], "cells": math.inf, "value": own.value}
                mine.append(pd.DataFrame([last | {"cpu_s": math.nan, "error": error, "sigma": sigma}]))
    theirs = reference.assign(
        error=[100 * (row.value / limits[row.quantity, row.speed] - 1) for row in reference.itertuples()]
    )
    return pd.concat(mine, ignore_index=True), theirs


def draw(mine: pd.DataFrame, theirs: pd.DataFrame) -> Figure:
    """One panel a quantity: error against dx/a, labsim filled, the independent solver at its own spacings open."""
    figure, axes = plt.subplots(1, 3, figsize=(12, 4.4), layout="constrained")
    speeds = sorted(mine.speed.unique())
    colour = {speed: plt.get_cmap("viridis")(0.9 * k / (len(speeds) - 1)) for k, speed in enumerate(speeds)}
    for ax, quantity in zip(axes, NAMES, strict=True):
        ax.axhspan(-FIRM[quantity], FIRM[quantity], color="grey", alpha=0.2, lw=0)
        ax.axhline(0, color="grey", lw=0.8)
        for cells in WORKING.values():
            ax.axvline(1 / cells, color="tab:red", lw=0.8, ls="--")
        for number, (speed, group) in enumerate(mine[mine.quantity == quantity].groupby("speed")):
            runs, limit = group[np.isfinite(group.cells)], group[np.isinf(group.cells)]
            ax.plot(1 / runs.cells, runs.error, "o-", color=colour[speed], ms=4, label=f"{speed:g} m/s")
            place = 0.002 * (number - 2.5)  # the bars of different speeds side by side
            ax.errorbar(place + 0 * limit.error, limit.error, limit.sigma, fmt="s", ms=5, capsize=3,
                        color=colour[speed])  # fmt: skip
            other = theirs[
                (theirs.quantity == quantity) & (theirs.speed == speed) & np.isfinite(theirs.cells)
            ]
            ax.plot(1 / other.cells, other.error, "o:", color=colour[speed], mfc="white", ms=5, lw=0.8)
        ax.set(xlabel="dx/a", ylabel=f"{NAMES[quantity]}, % from the independent limit", xlim=(-0.012, 0.262))
    for name, cells in WORKING.items():
        axes[0].annotate(f" {name}", (1 / cells, 0.02), xycoords=("data", "axes fraction"), color="tab:red",
                         rotation=90, va="bottom", ha="right", fontsize=8)  # fmt: skip
    figure.legend(
        *axes[0].get_legend_handles_labels(), fontsize=9, loc="outside lower center", ncol=len(speeds)
    )
    figure.suptitle("filled: labsim, square at 0: its limit from the three finest; open: the independent solver at "
                    "its own spacings; grey: how firm its limits are", fontsize=9)  # fmt: skip
    return figure


def print_tables(mine: pd.DataFrame) -> None:
    for quantity in NAMES:
        part = mine[mine.quantity == quantity]
        table = part.pivot_table(index="speed", columns="cells", values="error")
        sigma = part[np.isinf(part.cells)].set_index("speed")["sigma"]
        heads = ["limit" if math.isinf(cells) else f"{cells:g}" for cells in table.columns]
        print(f"\n| {quantity}, % from the independent limit, m/s \\ a/dx | {' | '.join(heads)} |")
        print(f"|{' --- |' * (len(heads) + 1)}")
        for speed, row in table.iterrows():
            cells = [
                f"{value:+.2f}" + (f" ± {sigma[speed]:.2f}" if math.isinf(at) else "")
                for at, value in row.items()
            ]
            print(f"| {speed:g} | {' | '.join(cells)} |")
    seconds = mine[(mine.quantity == "D") & np.isfinite(mine.cells)].groupby("cells")["cpu_s"].mean()
    print(
        "\nCPU seconds a drop, mean of the speeds: "
        + ", ".join(f"{s:.1f} at {c:g}" for c, s in seconds.items())
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("cells", nargs="*", type=float, default=CELLS, help="spacings in a tip radius")
    parser.add_argument("--picture", type=Path, default=PICTURE)
    options = parser.parse_args()
    reference = read_reference()
    simulate(set_drop(RADIUS_MM * 1e-3, 0.14, 1300.0, 4.0))  # compiles
    mine, theirs = compare(run_drops(sorted(reference.speed.unique()), sorted(options.cells)), reference)
    print(f"{datetime.date.today()}, commit {commit()}")
    print_tables(mine)
    options.picture.parent.mkdir(parents=True, exist_ok=True)
    draw(mine, theirs).savefig(options.picture, dpi=110)


if __name__ == "__main__":
    main()
