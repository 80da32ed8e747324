"""What a measured campaign's page says of drops and calibration: numbers in the units of the laboratory, nothing decided anew."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from ...inference.fits.fitting import Fit
from ...inference.fits.posterior import Posterior
from ...inference.observations.observe import Observed, ObservedDrop
from ...inference.observations.observe_acceleration import ObservedImpact
from ...inference.observations.observe_push import ObservedPush
from ...inference.observations.rebounds import COMMON, OWN, Rebounds
from ...inference.problem import Problem
from ...inference.scatter import ScatterEstimate
from ...records import Campaign, Drop
from ..figures.campaign import say_projectile
from ..figures.interactive import SIGNS
from .drop_views import DEPTH, FELT, DropView
from .page import show_number
from .phrases import add_article, list_names, say_count, say_range, shown_unit, state_p_value


def describe_measurement(campaign: Campaign, problem: Problem, views: Sequence[DropView]) -> dict[str, Any]:
    sample = campaign.sample
    tests = f", {say_count(len(campaign.strength_tests), 'static test')}" if campaign.strength_tests else ""
    words = (
        f"{say_count(len(problem.tracks.samples), 'drop')} with {_say_records(problem.drops)}, "
        f"{say_count(len(campaign.scans), 'CT scan')}{tests}, "
        f"into dust of filling factor {sample.filling_factor:g} ± {sample.filling_factor_sigma:g}, "
        f"{sample.diameter * 1e3:g} mm wide and {sample.depth * 1e3:g} mm deep, in gas of {sample.gas_pressure:g} Pa. "
        f"The nominal simulation is {campaign.geometry}, with gravity of {campaign.gravity:g} m/s²."
    )
    groups: dict[tuple, list[DropView]] = {}
    drops = {drop.name: drop for drop in problem.drops}
    for view in views:
        camera = drops[view.name].drop.camera
        key = (say_projectile(view), camera and camera.frame_rate, camera and camera.pixel_size)
        groups.setdefault(key, []).append(view)
    rows = []
    for (projectile, rate, pixel), members in groups.items():
        observed = [drops[view.name] for view in members]
        heights = [each.drop.height.value * 1e3 for each in observed if each.drop.height is not None]
        rows.append(
            {
                "projectile": projectile,
                "drops": list_names([view.name for view in members]),
                "speed": say_range([view.speed for view in members], "{:.2f}"),
                "height": say_range(heights, "{:.3g}"),
                "rate": show_number(rate, "{:g}"),
                "pixel": show_number(pixel * 1e6 if pixel else None, "{:g}"),
                "used": sum(each.time.size for each in observed if not isinstance(each, ObservedPush)),
                "rejected": sum(each.rejected for each in observed),
            }
        )
    return {"words": words, "projectiles": rows, "left_out": "; ".join(_left_out(campaign.drops, drops))}


def _say_records(drops: Sequence[Observed]) -> str:
    """What is compared of all records, in words."""
    frames = sum(each.time.size for each in drops if isinstance(each, ObservedDrop))
    stretches = sum(each.time.size for each in drops if isinstance(each, ObservedImpact))
    counts = ((frames, "frame"), (stretches, "mean acceleration"))
    return " and ".join(say_count(count, what) for count, what in counts if count) or "no frames"


def _left_out(drops: Sequence[Drop], used: dict[str, Any]) -> list[str]:
    lines = []
    for drop in drops:
        if drop.name not in used:
            why = "published figures only" if drop.record.kind == "summary" else "no usable track"
            lines.append(f"{drop.name} ({why})")
    return lines


def describe_calibration(
    fit: Fit,
    p_value: float,
    scatter: ScatterEstimate,
    posteriors: Sequence[tuple[str, Posterior]],
    problem: Problem,
    drops: int,
) -> dict[str, Any]:
    """fit: the one whose p_value this is; posteriors: (name of the model, posterior)."""
    first = posteriors[0][1]
    filmed = any(isinstance(each, ObservedDrop) for each in problem.drops)
    free_fall = "free fall averaged over eight frames; " if filmed else ""
    words = (
        "p_m says how hard the dust is to compress: its compressive strength is Σ = p_m ((φ − φ₁)/(φ₂ − φ))^(Δ ln 10). "
        f"{fit.points} data enter the likelihood ({free_fall}the stated heights count). The nominal "
        f"model, that of campaign.toml, leaves χ² = {fit.chi_square:.0f}; where it is right, data as far off come with a "
        f"probability {state_p_value(p_value)}. "
    )
    if drops > 1:
        words += (
            f"From drop to drop p_m scatters by {100 * scatter.mean:.1f} ± {100 * scatter.sd:.1f} %; the likelihood allows "
            f"{100 * problem.budget.scatter:.2g} %. "
        )
    words += f"The sampling is converged: R-hat {first.r_hat:.3f}, {first.ess:.0f} independent samples."
    if not first.r_hat < 1.05:
        words = words.replace("sampling is converged", "sampling is not converged")
    rows = []
    for model, posterior in posteriors:
        for name in posterior.names:
            if name == "p_m_Pa":
                label, factor, unit = "p_m", 1e-3, "kPa"
            else:
                effect, parameter = name.split(".", 1)
                factor, unit = shown_unit(problem.effects[effect].parameter(parameter))
                label = name
            low, middle, high = np.quantile(posterior.samples(name), [0.05, 0.5, 0.95]) * factor
            digits = "{:.3f}" if label == "p_m" else "{:.4g}"
            q05, q50, q95 = (show_number(float(v), digits) for v in (low, middle, high))
            rows.append({"name": label, "model": model, "q05": q05, "q50": q50, "q95": q95, "unit": unit})
    return {
        "words": words,
        "rows": rows,
        "text": "Posterior density of p_m: " + "; ".join(
            f"{row['model']} {row['q50']} kPa, 90 % between {row['q05']} and {row['q95']} kPa"
            for row in rows if row["name"] == "p_m"
        ) + ".",
    }  # fmt: skip


def describe_misfit(views: Sequence[DropView]) -> dict[str, Any]:
    labels = list(views[0].simulated)
    standing = [sum(view.stands_out(label) for view in views) for label in labels]
    shown = [each for each in (DEPTH, FELT) if any(view.shown is each for view in views)]
    record = "record" if FELT in shown else "drop"
    parts = [
        f"with {add_article(label)} {count} of {len(views)} {record}s"
        for label, count in zip(labels, standing, strict=True)
    ]
    words = (
        f"A {record} stands out where more than one {' or '.join(each.datum for each in shown)} in ten lies beyond two standard "
        f"deviations of what a true model may leave: {', '.join(parts)}. What is left is measured minus simulated: above zero "
        f"{', or '.join(each.above for each in shown)}. {shown[0].free.capitalize()} are at their best values, within their "
        "errors."
    )
    rows = []
    for k, view in enumerate(views):
        fits, said = [], []
        for label in labels:
            off = 1e6 * (view.at_stop() - view.at_stop(label))
            rms = 1e6 * view.rms(label)
            fits.append(
                {
                    "off": show_number(off, "{:+.1f}"),
                    "off_out": abs(off) > 2e6 * view.allowed_at_stop,
                    "rms": show_number(rms, "{:.1f}"),
                    "out": view.stands_out(label),
                }
            )
            said.append(f"{label} off by {show_number(off, '{:+.1f}')} µm at the stop, rms {rms:.1f} µm")
        rows.append(
            {
                "name": view.name,
                "figure": f"drop{k}",
                "projectile": say_projectile(view),
                "size": f"{2e3 * view.projectile.tip_radius:.3g} mm, {view.projectile.mass * 1e6:.3g} mg",
                "speed": f"{view.speed:.2f}",
                "depth": f"{view.at_stop() * 1e3:.3f}",
                "allowed": f"{2e6 * view.allowed_at_stop:.1f}",
                "fits": fits,
                "text": f"{view.at_stop() * 1e3:.3f} mm deep; {'; '.join(said)}; "
                f"a true model may leave ± {2e6 * view.allowed_at_stop:.1f} µm.",
            }
        )
    text = (
        "Measured minus simulated depth at the stop, in percent, against impact speed; a symbol a projectile, bars two standard "
        "deviations of what a true model may leave. The numbers stand in the table below."
    )
    kinds = list(dict.fromkeys(map(say_projectile, views)))
    return {"words": words, "rows": rows, "text": text, "symbols": list(zip(SIGNS * 9, kinds, strict=False))}


def say_rebounds(problem: Problem, fits: Sequence[tuple[str, Fit]]) -> str:
    """How far drops come back up, measured and by each named fit; empty where no film shows it."""
    found = problem.find(Rebounds)
    if found is None:
        return ""
    place, rebounds = found
    ways = np.array([each.way for each in rebounds.drops])
    simulated = [
        f"{1e6 * float(np.mean(ways - fit.blocks[place].residual)):.1f} µm ({label.replace('_', ' ')})"
        for label, fit in fits
    ]
    return (
        f"After the stop the dust springs back: it lifts {say_count(len(ways), 'drop')} by {1e6 * float(ways.mean()):.1f} µm "
        f"in the mean. Simulated are {', '.join(simulated)}, right to {100 * OWN:.0f} % for one drop and {100 * COMMON:.0f} % "
        "for all. How far says how stiff the dust is."
        + (" Of other drops too few frames show it." if len(ways) < len(problem.tracks.samples) else "")
    )


def describe_numerics(error: dict[str, float], problem: Problem) -> str:
    return (
        f"The particles of the simulation lie {error['spacing_m'] * 1e6:.3g} µm apart under the smallest tip, in proportion "
        f"under larger ones. So the simulated depth is right to {100 * error['depth_relative']:.2g} % rms, measured against an "
        f"independent solver. The likelihood allows {100 * problem.budget.numerical:.2g} % of the depth for it "
        f"and {100 * problem.budget.numerical_change:.2g} % of what an effect changes of it, alike for like drops; in all drops "
        f"together {100 * problem.budget.numerical_slope:.2g} % for every factor of 2.7 in depth over tip radius, "
        f"{100 * problem.budget.numerical_strength:.2g} % of p_m, and a contact that is off by "
        f"{100 * problem.budget.contact_offset:.2g} % of the tip radius. p_m is told wider by "
        f"{100 * problem.budget.other_codes:.2g} %, for other codes differ by more."
    )
