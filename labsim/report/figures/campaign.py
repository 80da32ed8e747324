"""Figures of a campaign with tracks and scans: every drop with its residuals, maps, posterior, causes. Records in, PNG out."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.gridspec import GridSpec
from matplotlib.patches import Circle

from ...diagnosis.campaign import Diagnosis
from ...inference.fits.fitting import Fit
from ...inference.fits.posterior import Posterior
from ...inference.problem import Problem
from ...records import FloatArray
from ..pages.drop_views import DropView
from ..pages.map_views import MapView
from .strengths import find_tests
from .style import BLUE, COLOURS, GREY, INK, ORANGE, PHI, new_corner, new_figure

DIFFERENCE: dict[str, Any] = {"vmin": -0.03, "vmax": 0.03, "cmap": "RdBu_r"}

P_M = "$p_\\mathrm{m}$ (kPa)"
PANEL = (2.9, 3.1)  # inches a drop, across and down
LEFT, BELOW, ABOVE = 0.62, 0.5, 0.25  # inches, margins of pictures of many panels


def draw_drops(views: Sequence[DropView], path: Path) -> Path:
    """Depth against time of every drop with each fit, and below it what is left, in µm, with its band."""
    with new_figure(path, *size_drops(views), layout=None) as figure:
        lay_drops(views, figure)
    return path


def size_drops(views: Sequence[DropView]) -> tuple[float, float]:
    """Inches across and down of the picture of all drops."""
    columns = min(4, len(views))
    return max(PANEL[0] * columns, 5.0), PANEL[1] * math.ceil(len(views) / columns)


def lay_drops(views: Sequence[DropView], figure: Figure) -> list[tuple[Axes, Axes]]:
    """The panels of ``draw_drops`` on a figure; per drop the axes of the motion and of what is left."""
    columns = min(4, len(views))
    lines = math.ceil(len(views) / columns)
    drawn = []
    grid = _divide(figure, lines, columns, right=0.12, wspace=0.22, hspace=0.28)
    for k, view in enumerate(views):
        cell = grid[k // columns, k % columns].subgridspec(2, 1, height_ratios=[2, 1], hspace=0.12)
        above, below = np.ravel(np.asarray(cell.subplots()))
        clock = view.clock * 1e3
        above.plot(clock, view.measured * view.shown.factor, ".", color=INK, ms=4, label="measured")
        below.axhline(0.0, color=INK, lw=0.6)
        band = 2 * view.shown.left_factor * view.allowed
        below.fill_between(clock, -band, band, color=GREY, alpha=0.25, lw=0)
        for (name, depth), color in zip(view.simulated.items(), COLOURS, strict=False):
            above.plot(
                clock, depth * view.shown.factor, "-", color=color, lw=1.2, label=name.replace("_", " ")
            )
            below.plot(clock, view.left(name) * view.shown.left_factor, ".-", color=color, lw=0.9, ms=3)
        above.set_title(
            f"{view.name}  {2e3 * view.projectile.tip_radius:.3g} mm, {view.speed:.2f} m/s", fontsize=8
        )
        if view.shown.downwards:
            above.invert_yaxis()
        above.tick_params(labelbottom=False, labelsize=7)
        below.tick_params(labelsize=7)
        if k % columns == 0 or view.shown is not views[k - 1].shown:
            above.set_ylabel(view.shown.label, fontsize=8)
            below.set_ylabel(view.shown.left_label, fontsize=8)
        below.set_xlabel("time since contact (ms)", fontsize=8)
        if k == 0:
            above.legend(fontsize=7)
        drawn.append((above, below))
    return drawn


def choose_decisive(
    problem: Problem,
    views: Sequence[DropView],
    folder: Path,
    cause: Sequence[str],
    fits: Sequence[tuple[str, Fit]] = (),
) -> tuple[str, str]:
    """Name and caption of the picture beside a verdict: of the undisturbed dust where the cause is one of the sample and a scan
    shows it, of the static tests where the fits part more in them than in the drops, else of the drop in which the models part
    most (of one model the deepest), which is drawn."""
    kinds = {problem.effects[name].kind for name in cause if name in problem.effects}
    if kinds == {"sample"} and problem.undisturbed:
        return "undisturbed", "Undisturbed dust: its filling factor against depth, as the scans show it."
    _, of_tests = find_tests(problem, fits[:2])
    if len(of_tests) > 1:
        in_tests, in_drops = (
            one.chi_square - other.chi_square for one, other in (of_tests, [fit.drops for _, fit in fits[:2]])
        )
        if in_tests > in_drops:
            return (
                "tests",
                "Static tests, in which the two part most: stress measured, and by the law of each fit.",
            )
    labels = list(views[0].simulated)

    def part(view: DropView) -> float:
        if len(labels) == 1:
            return view.at_stop()
        before, after = (np.sum((view.left(fit) / view.allowed) ** 2) for fit in labels[:2])
        return float(before - after)

    shown = max(views, key=part)
    draw_drops([shown], folder / "decisive.png")
    models = " and ".join(
        "with " + fit.replace("_", " ") if fit != "nominal" else "as stated" for fit in labels
    )
    which = "in which the two part most" if len(labels) > 1 else "that goes deepest"
    seen = f"{shown.name}, the drop {which}: measured, and simulated {models}"
    return "decisive", f"{seen}; below, what is left, and what a true model may leave."


def _divide(
    figure: Figure, lines: int, columns: int, *, right: float, wspace: float, hspace: float
) -> GridSpec:
    """Panels between fixed margins (inches): to lay dozens of them out by the size of their labels takes longer than to draw
    them. wspace, hspace : between two, in panels."""
    width, height = figure.get_size_inches()
    return figure.add_gridspec(
        lines,
        columns,
        left=LEFT / width,
        right=1 - right / width,
        bottom=BELOW / height,
        top=1 - ABOVE / height,
        wspace=wspace,
        hspace=hspace,
    )


def draw_misfit(views: Sequence[DropView], path: Path) -> Path:
    """Measured minus simulated depth at the stop against impact speed, a symbol a projectile, bars of two sigma."""
    with new_figure(path, 7.2, 3.8) as figure:
        ax = figure.subplots()
        ax.axhline(0.0, color=INK, lw=0.8)
        for view, marker in zip(views, projectile_markers(views), strict=True):
            for name, color in zip(view.simulated, COLOURS, strict=False):
                deepest = view.at_stop(name)
                left = 100 * (view.at_stop() - view.at_stop(name)) / deepest
                bar = 200 * view.allowed_at_stop / deepest
                ax.errorbar(view.speed, left, bar, fmt=marker, color=color, ms=5, capsize=2, lw=0.8)
        for name, color in zip(views[0].simulated, COLOURS, strict=False):
            ax.plot([], [], "s", color=color, label=name.replace("_", " "))
        for label, marker in dict(
            zip(map(say_projectile, views), projectile_markers(views), strict=True)
        ).items():
            ax.plot([], [], marker, color=GREY, label=label)
        ax.set_xlabel("impact speed (m/s)")
        ax.set_ylabel("measured − simulated depth (%)")
        ax.legend(fontsize=7, loc="upper left", bbox_to_anchor=(1.0, 1.0))
    return path


def say_projectile(view: DropView) -> str:
    p = view.projectile
    return f"{2e3 * p.tip_radius:.3g} mm {p.tip}, {p.mass * 1e6:.3g} mg"


def projectile_markers(views: Sequence[DropView]) -> list[str]:
    """matplotlib marker per view, one for each projectile."""
    known = list(dict.fromkeys(map(say_projectile, views)))
    return ["osD^vP*X<>"[known.index(say_projectile(view)) % 10] for view in views]


def draw_maps(views: Sequence[MapView], path: Path) -> Path:
    """A row per scan and fit: filling factor measured, simulated, and their difference, on both sides of the axis."""
    rows: list[list[tuple[MapView, str, FloatArray, dict[str, Any]]]] = []
    for view in views:
        measured = (view, f"{view.name}: φ measured", view.measured, PHI)
        rows += [
            [
                measured,
                (view, f"φ simulated, {name.replace('_', ' ')}", view.simulated[name], PHI),
                (view, f"measured − {name.replace('_', ' ')}", view.left(name), DIFFERENCE),
            ]
            for name in view.simulated
        ] or [[measured]]
    columns = max(map(len, rows))
    width, height = max(3.1 * columns, 4.6), 3.0 * len(rows)
    with new_figure(path, width, height, layout=None) as figure:
        axes = _divide(figure, len(rows), columns, right=0.6, wspace=0.3, hspace=0.28).subplots(squeeze=False)
        for ax in axes.flat:
            ax.set_visible(False)
        for line, shown in zip(axes, rows, strict=True):
            for ax, (view, title, values, colours) in zip(line, shown, strict=False):
                _draw_map(ax, view, values, colours)
                ax.set_title(title, fontsize=9)
            line[0].set_ylabel("height above the surface (mm)")
        for ax in axes[-1]:
            ax.set_xlabel("distance from the axis (mm)")
    return path


def _draw_map(ax: Axes, view: MapView, values: FloatArray, colours: dict[str, Any]) -> None:
    found = view.map
    r = np.concatenate([-found.r[::-1], found.r]) * 1e3
    both = np.concatenate([values[:, ::-1], values], axis=1)
    picture = ax.pcolormesh(r, found.z * 1e3, both, **colours)
    ax.figure.colorbar(picture, ax=ax, shrink=0.95)
    radius = found.bead_radius * 1e3
    ax.add_patch(Circle((0, radius - found.tip_depth * 1e3), radius, fill=False, ec=INK, lw=0.8))
    ax.axhline(0.0, color=INK, lw=0.6)
    ax.set(visible=True, aspect="equal", ylim=(found.z.min() * 1e3, found.z.max() * 1e3))


def draw_posterior(posterior: Posterior, path: Path) -> Path | None:
    """Corner plot of the posterior; p_m in kPa. None of a single parameter, whose histogram ``draw_p_m`` draws."""
    path.unlink(missing_ok=True)
    if len(posterior.names) < 2:
        return None
    columns, labels = [], []
    for name in posterior.names:
        values = posterior.samples(name)
        columns.append(values / 1e3 if name == "p_m_Pa" else values)
        labels.append(P_M if name == "p_m_Pa" else name.replace("_", " ").replace(".", ": "))
    values = np.stack(columns, axis=1)[::10]
    with new_corner(path, values, labels=labels, quantiles=[0.05, 0.5, 0.95], title_fmt=".3g"):
        pass
    return path


def draw_causes(found: Diagnosis, path: Path) -> Path:
    """Probabilities of the causes as bars, best first."""
    shown = found.verdict.probabilities[:8]
    with new_figure(path, 6.4, 0.4 * len(shown) + 1.0) as figure:
        ax = figure.subplots()
        names = [" + ".join(hypothesis).replace("_", " ") for hypothesis, _ in shown][::-1]
        values = [probability for _, probability in shown][::-1]
        ax.barh(names, values, color=[BLUE if v == max(values) else GREY for v in values])
        for row, value in enumerate(values):
            ax.text(min(value, 0.9) + 0.01, row, f"{value:.3f}", va="center", fontsize=9)
        ax.set_xlim(0, 1)
        ax.set_xlabel("probability")
    return path


def draw_p_m(
    posteriors: Sequence[tuple[str, Posterior]],
    path: Path,
    parameter: tuple[str, str, float] = ("p_m", "kPa", 1e-3),
) -> Path:
    """Posterior density of p_m in kPa, a line a model. parameter : label, unit and factor of what else is calibrated."""
    label, unit, factor = parameter
    with new_figure(path, 6.4, 2.8) as figure:
        ax = figure.subplots()
        for (name, posterior), color in zip(posteriors, COLOURS, strict=False):
            values = posterior.calibrated * factor
            ax.hist(
                values,
                bins=60,
                density=True,
                histtype="stepfilled",
                alpha=0.35,
                color=color,
                label=name.replace("_", " "),
            )
        ax.set_xlabel(P_M if label == "p_m" else f"{label} ({unit})")
        ax.set_ylabel("density")
        ax.set_yticks([])
        ax.legend(fontsize=8)
    return path


def draw_undisturbed(problem: Problem, path: Path) -> Path:
    """Filling factor of dust that no bead reached, against depth, and what is stated of the sample."""
    sample = problem.campaign.sample
    with new_figure(path, 6.4, 3.2) as figure:
        ax = figure.subplots()
        two = 2 * sample.filling_factor_sigma
        low, high = sample.filling_factor - two, sample.filling_factor + two
        ax.axhspan(low, high, color=GREY, alpha=0.25, lw=0, label="stated, 2σ")
        for dust, color in zip(problem.undisturbed, (BLUE, ORANGE, INK, GREY) * 20, strict=False):
            ax.errorbar(
                dust.depth * 1e3,
                dust.filling_factor,
                dust.sigma,
                fmt=".",
                color=color,
                lw=0.7,
                label=dust.name,
            )
        ax.set_xlabel("depth (mm)")
        ax.set_ylabel("filling factor")
        ax.legend(fontsize=8)
    return path


def draw_held_out(
    found: Diagnosis, labels: Sequence[str], path: Path, shown: tuple[float, str] = (1e6, "µm")
) -> Path:
    """Rms of each held-out drop, a bar a model. shown : factor and unit."""
    factor, unit = shown
    sizes = [found.held_out_nominal.rms, found.held_out_extended.rms][: len(labels)]
    with new_figure(path, 6.4, 3.2) as figure:
        ax = figure.subplots()
        place = np.arange(len(found.held_out_nominal.names))
        width = 0.8 / len(labels)
        for k, (label, rms) in enumerate(zip(labels, sizes, strict=True)):
            ax.bar(
                place - 0.4 + width * (k + 0.5),
                rms * factor,
                width,
                color=COLOURS[k],
                label=label.replace("_", " "),
            )
        ax.plot(
            place,
            found.held_out_extended.expected * factor,
            "_",
            color=INK,
            ms=14,
            label="expected of a true model",
        )
        many = len(place) > 16
        ax.set_xticks(place, found.held_out_nominal.names, fontsize=7 if many else 8, rotation=90 * many)
        ax.set_ylabel(f"rms of what is held out ({unit})")
        ax.legend(fontsize=8)
    return path
