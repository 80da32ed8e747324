"""Figures of a campaign with tracks and scans: every drop with its residuals, maps, posterior, causes. Records in, PNG out."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path

import corner
import matplotlib.pyplot as plt
import numpy as np

from ..diagnosis.campaign import Diagnosis
from ..inference.fitting import Fit, Workbench
from ..inference.forward import predict_depth
from ..inference.likelihood import DropModel
from ..inference.posterior import Posterior
from ..records import FloatArray
from .figures import BLUE, GREY, INK, ORANGE, STYLE, new_figure


def predict_drop(bench: Workbench, fit: Fit, model: DropModel) -> FloatArray:
    """Stated depth (m) at the drop's frames."""
    name = model.observed.name
    instrument = bench.instruments(fit.values)[name]
    log_p_m = fit.log_p_m + bench.log_offsets(fit.values)[name]
    code = model.table.code(log_p_m, model.instant.log_speed, fit.values)
    offset = instrument.row_offset_px * model.observed.pixel
    offset += contact_offset(bench, fit) * model.radius
    time = model.observed.time
    return predict_depth(code, time, model.instant, instrument.pixel_factor, instrument.rate_factor, offset)


def contact_offset(bench: Workbench, fit: Fit) -> float:
    """Best value, in tip radii, of the offset of the contact that the likelihood allows all drops in common."""
    linear, size = fit.linear, bench.terms.contact_offset
    column = np.zeros(linear.residual.size)
    for model in fit.models:
        section = linear.sections[model.observed.name]
        column[section.start : section.start + model.matrix.shape[0]] = size * model.radius
    return size * float(column @ np.linalg.solve(linear.covariance, linear.residual))


def draw_drops(bench: Workbench, fits: Sequence[tuple[str, Fit]], path: Path) -> Path:
    """Depth against time of every drop with each fit, and below it what is left, in µm."""
    count = len(bench.models)
    columns = min(5, count)
    lines = math.ceil(count / columns)
    with plt.rc_context(STYLE):
        figure, axes = plt.subplots(
            2 * lines,
            columns,
            figsize=(2.7 * columns, 3.0 * lines),
            height_ratios=[2, 1] * lines,
            layout="constrained",
            squeeze=False,
        )
        for ax in axes.flat:
            ax.set_visible(False)
        for k, model in enumerate(fits[0][1].models):
            above, below = axes[2 * (k // columns), k % columns], axes[2 * (k // columns) + 1, k % columns]
            above.set_visible(True)
            below.set_visible(True)
            observed = model.observed
            clock = (observed.time - model.instant.contact_time) * 1e3
            seen = clock > -0.3 * clock.max()
            above.plot(clock[seen], observed.depth[seen] * 1e3, ".", color=INK, ms=3, label="measured")
            for (name, fit), color in zip(fits, (ORANGE, BLUE), strict=False):
                other = next(m for m in fit.models if m.observed.name == observed.name)
                depth = predict_drop(bench, fit, other)
                above.plot(clock[seen], depth[seen] * 1e3, "-", color=color, lw=1.2, label=name)
                left = (observed.depth - depth)[seen] * 1e6
                below.plot(clock[seen], left, "-", color=color, lw=1.0)
            below.axhspan(-1e6 * observed.sigma, 1e6 * observed.sigma, color=GREY, alpha=0.25, lw=0)
            above.set_title(
                f"{observed.name}  {2e3 * model.radius:.3g} mm, {math.exp(model.instant.log_speed):.2f} m/s",
                fontsize=8,
            )
            above.invert_yaxis()
            above.tick_params(labelbottom=False, labelsize=7)
            below.tick_params(labelsize=7)
            if k % columns == 0:
                above.set_ylabel("depth (mm)", fontsize=8)
                below.set_ylabel("left (µm)", fontsize=8)
            below.set_xlabel("time (ms)", fontsize=8)
        axes[0, 0].legend(fontsize=7)
        figure.savefig(path)
        plt.close(figure)
    return path


def draw_maps(bench: Workbench, fits: Sequence[tuple[str, Fit]], path: Path) -> Path:
    """Filling factor measured, and measured minus simulated for each fit, per scan."""
    count = len(bench.scans)
    with plt.rc_context(STYLE):
        figure, axes = plt.subplots(
            count,
            1 + len(fits),
            figsize=(3.4 * (1 + len(fits)), 3.2 * count),
            layout="constrained",
            squeeze=False,
        )
        for k, scan in enumerate(bench.scans):
            found = scan.observed.reduced.map
            picture = axes[k, 0].pcolormesh(
                found.r * 1e3, found.z * 1e3, found.filling_factor, vmin=0.13, vmax=0.28, cmap="viridis"
            )
            axes[k, 0].set_title(f"{scan.observed.name}: φ measured")
            figure.colorbar(picture, ax=axes[k, 0], shrink=0.8)
            for q, (name, fit) in enumerate(fits, start=1):
                code = scan.table.code(fit.log_p_m, scan.log_speed, fit.values)
                scale = bench.instruments(fit.values)[scan.observed.name].ct_scale
                left = np.full(scan.observed.cells.shape, np.nan)
                left[scan.observed.cells] = scan.observed.filling_factor - scale * code[1:]
                picture = axes[k, q].pcolormesh(
                    found.r * 1e3, found.z * 1e3, left, vmin=-0.02, vmax=0.02, cmap="RdBu_r"
                )
                axes[k, q].set_title(f"measured − {name}")
                figure.colorbar(picture, ax=axes[k, q], shrink=0.8)
            for ax in axes[k]:
                ax.set_aspect("equal")
                ax.set_xlabel("r (mm)")
            axes[k, 0].set_ylabel("z (mm)")
        figure.savefig(path)
        plt.close(figure)
    return path


def draw_posterior(posterior: Posterior, path: Path) -> Path:
    """Corner plot of the posterior; p_m in kPa."""
    columns, labels = [], []
    for name in posterior.names:
        values = posterior.samples(name)
        columns.append(values / 1e3 if name == "p_m_Pa" else values)
        labels.append("p_m (kPa)" if name == "p_m_Pa" else name)
    with plt.rc_context(STYLE):
        figure = corner.corner(
            np.stack(columns, axis=1)[::10],
            labels=labels,
            quantiles=[0.05, 0.5, 0.95],
            show_titles=True,
            title_fmt=".3g",
            color=BLUE,
        )
        figure.savefig(path)
        plt.close(figure)
    return path


def draw_causes(found: Diagnosis, path: Path) -> Path:
    """Probabilities of the causes as bars, best first."""
    shown = found.verdict.probabilities[:8]
    with new_figure(path, 6.4, 0.4 * len(shown) + 1.0) as figure:
        ax = figure.subplots()
        names = [" + ".join(hypothesis) for hypothesis, _ in shown][::-1]
        values = [probability for _, probability in shown][::-1]
        ax.barh(names, values, color=[BLUE if v == max(values) else GREY for v in values])
        for row, value in enumerate(values):
            ax.text(min(value, 0.9) + 0.01, row, f"{value:.3f}", va="center", fontsize=9)
        ax.set_xlim(0, 1)
        ax.set_xlabel("probability")
    return path


def draw_held_out(found: Diagnosis, path: Path) -> Path:
    """Rms of each held-out drop, nominal against extended."""
    with new_figure(path, 6.4, 3.2) as figure:
        ax = figure.subplots()
        place = np.arange(len(found.held_out_nominal.names))
        ax.bar(place - 0.2, found.held_out_nominal.rms * 1e6, 0.4, color=ORANGE, label="nominal")
        ax.bar(place + 0.2, found.held_out_extended.rms * 1e6, 0.4, color=BLUE, label="extended")
        ax.plot(
            place,
            found.held_out_extended.expected * 1e6,
            "_",
            color=INK,
            ms=14,
            label="expected of a true model",
        )
        ax.set_xticks(place, found.held_out_nominal.names, fontsize=8)
        ax.set_ylabel("rms of the held-out drop (µm)")
        ax.legend(fontsize=8)
    return path
