"""Figures of a calibration and a diagnosis from published figures. Records in, PNG files out; mm, ms and kPa."""

from __future__ import annotations

from pathlib import Path

import matplotlib
import numpy as np

from ...diagnosis.published.campaign import SummaryDiagnosis
from ...diagnosis.published.scan import compacted_area
from ...inference.published.calibrate import SummaryCalibration
from ...inference.published.figures import impact_speed
from ...inference.published.planar import expected_raw_depth, round_depth
from .style import BLUE, GREEN, GREY, INK, ORANGE, PURPLE, new_corner, new_figure


def draw_penetration(calibration: SummaryCalibration, path: Path) -> Path:
    """Raw penetration against time for five p_m, with the published depth and stopping time as target lines."""
    drop = calibration.figures[0].drop
    reference = calibration.runs["spacing", calibration.bulk_modulus][0]
    near = 0.1  # of ln p_m: two such curves would lie on each other
    runs = [reference] + [
        run
        for run in calibration.runs[drop, calibration.bulk_modulus]
        if abs(np.log(run.setting.material.p_m / reference.setting.material.p_m)) > near
    ]
    runs.sort(key=lambda run: run.setting.material.p_m)
    middle = int(
        np.argmin([abs(np.log(run.setting.material.p_m / calibration.quantiles["q50"])) for run in runs])
    )
    first = min(max(middle - 2, 0), len(runs) - 5)
    published = next(d.published for d in calibration.campaign.drops if d.name == drop)
    assert published is not None
    with new_figure(path) as figure:
        axes = figure.add_subplot()
        colours = matplotlib.colormaps["viridis"](np.linspace(0.0, 0.78, 5))
        for run, colour in zip(runs[first : first + 5], colours, strict=True):
            upto = run.time <= 1.12 * run.stopping_time
            axes.plot(
                run.time[upto] * 1e3,
                run.depth[upto] * 1e3,
                color=colour,
                label=f"{run.setting.material.p_m / 1e3:.2f} kPa",
            )
            axes.plot(run.stopping_time * 1e3, run.penetration_depth * 1e3, "o", color=colour, ms=5)
            axes.annotate(
                f"{run.setting.material.p_m / 1e3:.2f} kPa",
                (run.stopping_time * 1e3, run.penetration_depth * 1e3),
                xytext=(6, -14),
                textcoords="offset points",
                ha="center",
                color=colour,
            )
        axes.set(xlabel="time since contact (ms)", ylabel="raw planar depth (mm)", xlim=(0, None))
        bottom = 1.12 * axes.get_ylim()[1]
        axes.set_ylim(bottom, 0.0)
        if published.penetration_depth is not None:
            target = expected_raw_depth(published.penetration_depth.value, calibration.depth_reading) * 1e3
            axes.axhline(target, color=INK, lw=1.0, ls="--")
            axes.text(0.03, target, f"published depth, {target:.2f} mm raw", va="bottom")
        if published.stopping_time is not None:
            at = published.stopping_time
            axes.axvspan(
                (at.value - at.sigma) * 1e3, (at.value + at.sigma) * 1e3, color=GREY, alpha=0.25, lw=0
            )
            axes.axvline(at.value * 1e3, color=INK, lw=1.0, ls="--")
            axes.set_xlim(0.0, max(axes.get_xlim()[1], (at.value + 2.0 * at.sigma) * 1e3))
            axes.text((at.value - 1.3 * at.sigma) * 1e3, 0.01 * bottom, f"published stopping time, {at.value * 1e3:.1f} ms",
                      rotation=90, ha="right", va="top")  # fmt: skip
        setting = runs[middle].setting
        axes.set_title(
            f"{2e3 * setting.projectile.tip_radius:g} mm cylinder at {setting.impact_speed:g} m/s, "
            f"$K_0$ {calibration.bulk_modulus / 1e3:g} kPa; at each stop its $p_\\mathrm{{m}}$"
        )
    return path


def draw_depth_law(diagnosis: SummaryDiagnosis, path: Path) -> Path:
    """Depth against m v/A: the published law and the calibrated simulation for every size."""
    calibration = diagnosis.calibration
    rows = {row.name: row for row in diagnosis.drop_predictions if row.kind == "depth"}
    with new_figure(path) as figure:
        axes = figure.add_subplot()
        top = 0.0
        for radius, colour, marker in zip(
            sorted(diagnosis.runs), (BLUE, ORANGE, GREEN, PURPLE), "osD^", strict=False
        ):
            drops = [
                d for d in calibration.campaign.drops if d.name in rows and d.projectile.tip_radius == radius
            ]
            momentum = [
                d.projectile.mass * impact_speed(d, calibration.campaign) / (np.pi * radius**2) for d in drops
            ]
            found = [rows[d.name] for d in drops]
            axes.errorbar(
                momentum,
                [row.predicted * 1e3 for row in found],
                [row.predicted_sigma * 1e3 for row in found],
                fmt=marker,
                color=colour,
                capsize=2,
                label=f"simulation, {2e3 * radius:g} mm",
            )
            top = max(top, *momentum)
            coefficient = np.mean([row.observed / m for row, m in zip(found, momentum, strict=True)])
            relative = np.mean([row.observed_sigma / row.observed for row in found])
        line = np.array([0.0, 1.08 * top])
        axes.plot(
            line,
            coefficient * line * 1e3,
            color=INK,
            label=f"published law, {coefficient * 1e4:.1f}e-4 m² s/kg · m v/A",
        )
        axes.fill_between(
            line, (1 - relative) * coefficient * line * 1e3, (1 + relative) * coefficient * line * 1e3,
            color=GREY, alpha=0.25, lw=0, label=f"its uncertainty, {relative:.0%}",
        )  # fmt: skip
        axes.axvline(1.0, color=GREY, lw=0.8, ls=":")
        axes.annotate(" stated from here up", (1.0, 0.03), xycoords=("data", "axes fraction"), color=GREY)
        axes.set(xlabel="m v/A (kg m⁻¹ s⁻¹)", ylabel="penetration depth (mm)", xlim=(0, None), ylim=(0, None))
        factor = round_depth(1.0, calibration.depth_reading)
        axes.set_title(
            f"simulated depth = {factor:.3f} x raw planar depth, $p_\\mathrm{{m}}$ from {_used(calibration)}"
        )
        axes.legend(loc="upper left")
    return path


def draw_compacted_volume(diagnosis: SummaryDiagnosis, path: Path) -> Path:
    """Volume compacted beyond a filling factor, with the published statement as a band."""
    calibration = diagnosis.calibration
    run = diagnosis.scan_run
    scan = next(iter(calibration.campaign.published_scans), None)
    with new_figure(path) as figure:
        axes = figure.add_subplot()
        if run is not None and scan is not None:
            phi = np.linspace(0.13, 0.34, 200)
            volume = [
                run.compacted_volume(value) / (np.pi * run.setting.projectile.tip_radius**2) for value in phi
            ]
            axes.semilogy(phi, np.maximum(volume, 1e-3), color=BLUE, label="simulation")
            low, high = scan.filling_factor_low, scan.filling_factor_high
            axes.axvspan(low, high, color=GREY, alpha=0.18, lw=0)
            observed = scan.sphere_volumes
            axes.errorbar(
                [(low + high) / 2], [observed.value], [observed.sigma], [(high - low) / 2],
                fmt="s", color=INK, capsize=2, label=f"published: about one sphere volume at {low:g}-{high:g}",
            )  # fmt: skip
            inside = compacted_area(run, low, high)
            axes.plot(
                [(low + high) / 2],
                [inside],
                "o",
                color=ORANGE,
                label=f"simulation at {low:g}-{high:g}: {inside:.2f}",
            )
            axes.axvline(run.setting.filling_factor, color=GREEN, lw=1.0, ls="--")
            axes.annotate(" undisturbed", (run.setting.filling_factor, 2e-3), color=GREEN)
            axes.set(ylim=(1e-3, None))
            axes.set_title(
                f"{2e3 * run.setting.projectile.tip_radius:g} mm at {run.setting.impact_speed:.2f} m/s, "
                f"$p_\\mathrm{{m}}$ {run.setting.material.p_m / 1e3:.2f} kPa"
            )
        axes.set(
            xlabel="volume filling factor φ",
            ylabel="dust beyond φ (areas of the cylinder ≙ sphere volumes)",
        )
        axes.legend(loc="upper right")
    return path


def draw_corner(calibration: SummaryCalibration, path: Path) -> Path:
    """Posterior of p_m, and of the depth and stopping time that go with it, with the published values as lines."""
    drop = calibration.figures[0].drop
    emulator = calibration.emulators[drop, calibration.bulk_modulus]
    p_m = calibration.posterior.calibrated
    outputs = emulator.predict(p_m[:, None])
    published = next(d.published for d in calibration.campaign.drops if d.name == drop)
    assert published is not None
    columns = [p_m / 1e3, outputs[:, 0] * 1e3, outputs[:, 1] * 1e3]
    truths: list[float | None] = [None, None, None]
    if published.penetration_depth is not None:
        truths[1] = expected_raw_depth(published.penetration_depth.value, calibration.depth_reading) * 1e3
    if published.stopping_time is not None:
        truths[2] = published.stopping_time.value * 1e3
    data = np.column_stack(columns)
    ranges = []
    for column, truth in zip(data.T, truths, strict=True):
        low, high = np.quantile(column, (0.002, 0.998))
        if truth is not None:
            low, high = min(low, truth), max(high, truth)
        ranges.append((low - 0.05 * (high - low), high + 0.05 * (high - low)))
    with new_corner(
        path,
        data,
        labels=[
            "$p_\\mathrm{m}$ (kPa)",
            f"raw depth of {drop} (mm)",
            f"$T_\\mathrm{{s}}$ of {drop} (ms)",
        ],
        truths=truths,
        truth_color=ORANGE,
        range=ranges,
        quantiles=(0.05, 0.5, 0.95),
        title_fmt=".2f",
        title_kwargs={"fontsize": 9},
        plot_contours=False,
        plot_density=False,
        data_kwargs={"alpha": 0.05, "ms": 2.0},
    ) as figure:
        figure.text(
            0.98,
            0.98,
            f"$p_\\mathrm{{m}}$ from {_used(calibration)}\norange: published",
            ha="right",
            va="top",
            color=INK,
        )
    return path


def draw_fit(calibration: SummaryCalibration, path: Path) -> Path:
    """Depth and stopping time against p_m (runs, emulator, targets), and p_m from every reading side by side."""
    drop = calibration.figures[0].drop
    published = next(d.published for d in calibration.campaign.drops if d.name == drop)
    assert published is not None
    moduli = sorted({k0 for name, k0 in calibration.emulators if name == drop}, reverse=True)
    with new_figure(path, 10.5, 6.2) as figure:
        grid = figure.add_gridspec(2, 2, width_ratios=(1.0, 1.25))
        depth, stop = figure.add_subplot(grid[0, 0]), figure.add_subplot(grid[1, 0])
        for k0, colour in zip(moduli, (BLUE, ORANGE, GREEN, PURPLE), strict=False):
            emulator = calibration.emulators[drop, k0]
            p_m = np.geomspace(float(emulator.low[0]), float(emulator.high[0]), 200)
            outputs = emulator.predict(p_m[:, None])
            runs = calibration.runs[drop, k0]
            for axes, column, name in ((depth, 0, "penetration_depth"), (stop, 1, "stopping_time")):
                axes.loglog(
                    p_m / 1e3, outputs[:, column] * 1e3, color=colour, label=f"$K_0$ {k0 / 1e3:g} kPa"
                )
                axes.plot(
                    [run.setting.material.p_m / 1e3 for run in runs],
                    [getattr(run, name) * 1e3 for run in runs], "o", ms=4, color=colour,
                )  # fmt: skip
        if published.penetration_depth is not None:
            for reading, style in (("multiply_exp", "-"), ("none", "--"), ("multiply_sim", ":")):
                target = expected_raw_depth(published.penetration_depth.value, reading) * 1e3
                depth.axhline(target, color=INK, lw=1.0, ls=style, label=f"{target:.2f} mm, {reading}")
        if published.stopping_time is not None:
            at = published.stopping_time
            stop.axhspan(
                (at.value - at.sigma) * 1e3, (at.value + at.sigma) * 1e3, color=GREY, alpha=0.3, lw=0
            )
            stop.axhline(at.value * 1e3, color=INK, lw=1.0, label=f"{at.value * 1e3:.1f} ms, published")
        for axes, label in ((depth, "raw depth (mm)"), (stop, "stopping time (ms)")):
            axes.set(xlabel="$p_\\mathrm{m}$ (kPa)", ylabel=label)
            axes.set_xticks([0.2, 0.5, 1, 2, 5], ["0.2", "0.5", "1", "2", "5"])
            for axis in (axes.xaxis, axes.yaxis):
                axis.set_minor_formatter(matplotlib.ticker.NullFormatter())
            low, high = axes.get_ylim()
            ticks = [t for t in (0.2, 0.3, 0.5, 0.7, 1, 1.5, 2, 3, 5, 10, 20) if low <= t <= high]
            axes.set_yticks(ticks, [f"{t:g}" for t in ticks])
            axes.legend(fontsize=7.5, loc="upper right", framealpha=0.85, frameon=True, edgecolor="none")
        forest = figure.add_subplot(grid[:, 1])
        rows = sorted(calibration.readings, key=lambda r: (-r.bulk_modulus, len(r.use), r.use, r.q50))
        for place, row in enumerate(rows):
            own = (row.bulk_modulus, row.use) == (calibration.bulk_modulus, calibration.use) and (
                "depth" not in row.use or row.depth_reading == calibration.depth_reading
            )
            colour = ORANGE if own else GREY if row.misfit > 6.63 else BLUE
            forest.plot([row.q05 / 1e3, row.q95 / 1e3], [place, place], color=colour, lw=2.2)
            forest.plot(row.q50 / 1e3, place, "o", color=colour, ms=5)
        forest.set_yticks(range(len(rows)), [row.name for row in rows], fontsize=8)
        forest.invert_yaxis()
        forest.set_xscale("log")
        ticks = [t for t in (0.2, 0.3, 0.5, 1, 2, 3, 5) if forest.get_xlim()[0] <= t <= forest.get_xlim()[1]]
        forest.set_xticks(ticks, [f"{t:g}" for t in ticks])
        forest.xaxis.set_minor_formatter(matplotlib.ticker.NullFormatter())
        forest.set(xlabel="$p_\\mathrm{m}$ (kPa), median and 90 %")
        forest.set_title("orange: this one; grey: no $p_\\mathrm{m}$ fits both (χ² > 6.6)")
        depth.set_title(f"{drop}: emulator (lines) and its runs (dots)")
    return path


def _used(calibration: SummaryCalibration) -> str:
    return " and ".join(kind.replace("_", " ") for kind in calibration.use)
