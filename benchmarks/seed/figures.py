"""The pictures of docs/seed-study.md from docs/seed-study.csv: ``python -m benchmarks.seed.figures [FOLDER]``."""

from __future__ import annotations

import math
import sys
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.figure import Figure

from benchmarks.seed.study import LARGE, MOMENTA, SMALL, TABLE, speed_at
from benchmarks.seed.tables import Fit, Study, fit, fit_all, list_needed

PUBLISHED = {SMALL: (3.0, 0.1), LARGE: (6.2, 0.1)}  # ms
COLOUR = {SMALL: "tab:blue", LARGE: "tab:red"}
STYLE = {"round": "-", "planar": "--"}


def draw_shapes(study: Study) -> Figure:
    """Stopping time, depth over the law and v T_s/D against m v/A, nominal model with its best p_m."""
    p_m = fit("nominal", *study.hypotheses()["nominal"]).p_m
    figure, axes = plt.subplots(1, 3, figsize=(12, 4.1), layout="constrained")
    momentum = np.geomspace(0.2, 2.99, 60)
    for radius, (time, sigma) in PUBLISHED.items():
        axes[0].axhspan(time - sigma, time + sigma, color=COLOUR[radius], alpha=0.25, lw=0)
        axes[2].axhline(speed_at(1.0, radius) * time * 1e-3 / 8e-4, color=COLOUR[radius], alpha=0.4, lw=5)
        for kind, grid, strength in (("round", study.round, p_m), ("planar", study.planar, 1300.0)):
            v = speed_at(1.0, radius) * momentum
            t = 1e3 * radius * np.exp(grid.log("stopping_time_ms", strength, v))
            d = 1e3 * radius * np.exp(grid.log("depth_mm", strength, v))
            label = f"{2e3 * radius:g} mm, {kind}, p_m {strength:.0f} Pa"
            line = {"color": COLOUR[radius], "ls": STYLE[kind], "label": label}
            axes[0].plot(momentum, t, **line)
            axes[1].plot(momentum, d / (0.8 * momentum), **line)
            axes[2].plot(momentum, v * t / d, **line)
    axes[1].axhspan(0.95, 1.05, color="grey", alpha=0.25, lw=0)
    axes[1].axhline(8 / (3 * math.pi), color="grey", ls=":", lw=1)
    for ax, text in zip(
        axes, ("stopping time T_s, ms", "depth over 8e-4 m v/A (planar: raw)", "v T_s / D"), strict=True
    ):
        ax.set(xscale="log", xlabel="m v/A, kg/(m s)", ylabel=text)
        ax.axvline(1.0, color="grey", lw=0.6)
        ax.set_xticks([0.2, 0.5, 1, 2, 3], ["0.2", "0.5", "1", "2", "3"], minor=False)
        ax.minorticks_off()
    axes[0].set_ylim(0, 7.6)
    figure.legend(*axes[0].get_legend_handles_labels(), fontsize=8, loc="outside lower center", ncol=4)
    return figure


def draw_needed(study: Study) -> Figure:
    """p_m that each published figure asks for."""
    figure, ax = plt.subplots(figsize=(8.5, 4.2), layout="constrained")
    rows = list_needed(study)
    marks = (
        ("round", "o", "k"),
        ("planar, raw = measured", "s", "tab:grey"),
        ("planar, raw = 8/(3π) x measured", "v", "tab:orange"),
        ("planar, 8/(3π) x raw = measured", "^", "tab:green"),
    )
    for column, (label, mark, colour) in enumerate(marks):
        ax.plot(
            [row[2 + column] for row in rows],
            np.arange(len(rows)) + 0.12 * (column - 1.5),
            mark,
            color=colour,
            label=label,
        )
    ax.axvline(1300, color="tab:orange", ls=":", lw=1)
    ax.set(
        xscale="log",
        xlabel="p_m that the figure asks for, Pa (dotted: the paper's 1.3 kPa)",
        xlim=(150, 4000),
    )
    ax.set_xticks([200, 500, 1000, 2000], ["200", "500", "1000", "2000"])
    ax.minorticks_off()
    ax.grid(axis="y", lw=0.3)
    ax.set_yticks(range(len(rows)), [f"{row[0]}, m v/A {row[1]:.3g}" for row in rows])
    ax.invert_yaxis()
    figure.legend(fontsize=8, loc="outside lower center", ncol=2)
    return figure


def draw_effects(study: Study) -> Figure:
    """What each hypothesis reaches of four figures with p_m refitted, best on top."""
    fits: list[Fit] = fit_all(study)
    figure, axes = plt.subplots(1, 5, figsize=(13, 0.26 * len(fits) + 1.2), layout="constrained", sharey=True)
    ratio = [math.exp(f.figures[2] - f.figures[0]) for f in fits]
    columns = (
        ("χ² of nine numbers", [f.chi2 for f in fits], None),
        ("T_s ratio 3 mm : 1 mm", ratio, (2.067, 0.077)),
        (
            "d ln T_s / d ln v, 1 mm",
            [f.figures[1] for f in fits],
            (0.0, math.sqrt(2) * 0.1 / 3 / math.log(MOMENTA[1])),
        ),
        ("D/(m v/A) of 3 mm over 1 mm", [math.exp(f.figures[6] - f.figures[4]) for f in fits], (1.0, 0.05)),
        ("volume at φ 0.20-0.25, spheres", [f.figures[8] for f in fits], (1.0, 0.3)),
    )
    for ax, (title, values, wanted) in zip(axes, columns, strict=True):
        if wanted is not None:
            ax.axvspan(wanted[0] - wanted[1], wanted[0] + wanted[1], color="tab:green", alpha=0.25, lw=0)
        ax.plot(values, range(len(fits)), "ko", ms=4)
        ax.set_title(title, fontsize=8)
        ax.grid(axis="y", lw=0.3)
    axes[0].set_yticks(range(len(fits)), [f.name for f in fits], fontsize=8)
    axes[0].set_xlim(0, None)
    axes[0].invert_yaxis()
    return figure


def main() -> None:
    folder = Path(sys.argv[1]) if len(sys.argv) > 1 else TABLE.parent / "pictures"
    study = Study(TABLE)
    for name, draw in (("shapes", draw_shapes), ("needed", draw_needed), ("effects", draw_effects)):
        draw(study).savefig(folder / f"seed-{name}.png", dpi=110)
        print(folder / f"seed-{name}.png")


if __name__ == "__main__":
    main()
