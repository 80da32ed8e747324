"""The words and tables of a measured campaign's page: numbers in the units of the laboratory, nothing decided anew."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from ..diagnosis.campaign import Diagnosis
from ..effects import Parameter
from ..inference.fitting import Fit
from ..inference.posterior import Posterior
from ..inference.workbench import Workbench
from ..records import Campaign, Drop
from .campaign_figures import say_projectile
from .campaign_tables import say_missing
from .drop_views import DropView
from .map_views import MapView
from .page import show_number

BADGES = {
    "none": "Nothing is wrong beyond the errors",
    "effect": "A cause is found",
    "unknown": "Wrong, and no listed cause explains it",
}
SHOWN = {"Pa": (1e-3, "kPa"), "m": (1e3, "mm"), "1/m": (1e-3, "1/mm"), "1": (1.0, "")}  # to what people see
RARE = 0.01  # probability below which a cause is only named


def describe_measurement(campaign: Campaign, bench: Workbench, views: Sequence[DropView]) -> dict[str, Any]:
    sample = campaign.sample
    frames = sum(model.observed.time.size for model in bench.models)
    words = (
        f"{_count(len(views), 'drop')} with {frames} frames, {_count(len(campaign.scans), 'CT scan')}, into dust of filling "
        f"factor {sample.filling_factor:g} ± {sample.filling_factor_sigma:g}, {sample.diameter * 1e3:g} mm wide and "
        f"{sample.depth * 1e3:g} mm deep, in gas of {sample.gas_pressure:g} Pa. The nominal simulation is {campaign.geometry}, "
        f"with gravity of {campaign.gravity:g} m/s²."
    )
    groups: dict[tuple, list[DropView]] = {}
    drops = {model.observed.name: model.observed for model in bench.models}
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
                "drops": _list_names([view.name for view in members]),
                "speed": _range([view.speed for view in members], "{:.2f}"),
                "height": _range(heights, "{:.3g}"),
                "rate": show_number(rate, "{:g}"),
                "pixel": show_number(pixel * 1e6 if pixel else None, "{:g}"),
                "used": sum(each.time.size for each in observed),
                "rejected": sum(each.rejected for each in observed),
            }
        )
    return {"words": words, "projectiles": rows, "left_out": "; ".join(_left_out(campaign.drops, drops))}


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
    scatter: tuple[float, float],
    posteriors: Sequence[tuple[str, Posterior]],
    bench: Workbench,
    drops: int,
) -> dict[str, Any]:
    """fit: the one whose p_value this is; posteriors: (name of the model, posterior)."""
    first = posteriors[0][1]
    words = (
        f"{fit.points} data enter the likelihood (free fall averaged over eight frames; the stated heights count). The nominal "
        f"model leaves χ² = {fit.chi_square:.0f}; where it is right, data as far off come with p = "
        f"{show_number(p_value, '{:.2g}')}. "
    )
    if drops > 1:
        words += (
            f"From sample to sample ln p_m scatters by {scatter[0]:.3f} ± {scatter[1]:.3f}; the likelihood allows "
            f"{bench.terms.scatter:g}. "
        )
    words += f"The chain is converged: R-hat {first.r_hat:.3f}, {first.ess:.0f} independent samples."
    if not first.r_hat < 1.05:
        words = words.replace("The chain is converged", "The chain is not converged")
    rows = []
    for model, posterior in posteriors:
        for name in posterior.names:
            if name == "p_m_Pa":
                label, factor, unit = "p_m", 1e-3, "kPa"
            else:
                effect, parameter = name.split(".", 1)
                factor, unit = shown_unit(bench.effects[effect].parameter(parameter))
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
    parts = [
        f"with {_article(label)} {count} of {len(views)} drops"
        for label, count in zip(labels, standing, strict=True)
    ]
    words = (
        "A drop stands out where more than one frame in ten lies beyond two standard deviations of what a true model may "
        f"leave: {', '.join(parts)}. What is left is measured minus simulated: above zero the projectile went deeper than "
        "the simulation says. Contact time, impact speed and surface row are at their best values, within their errors."
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
    return {"words": words, "rows": rows, "text": text}


def describe_maps(campaign: Campaign, bench: Workbench, maps: Sequence[MapView]) -> dict[str, Any]:
    used = {scan.observed.name for scan in bench.scans}
    shown = {view.name for view in maps}
    words = []
    compared = [view.name for view in maps if view.simulated]
    if compared:
        words.append(
            f"The maps of {_list_names(compared)} are part of the likelihood. Simulated dust is seen through the own cells "
            "and the blur of the scan, in the frame of the tip: moved so that its deepest tip lies where the bead ends. Only "
            "cells that are compared carry a simulated value."
        )
    only = [view.name for view in maps if view.name not in used]
    if only:
        words.append(
            f"The compacted zones of {_list_names(only)} are not part of the likelihood, so no simulated map stands beside the "
            "measured one."
        )
    missing = [scan.name for scan in campaign.scans if scan.name not in shown]
    if missing:
        words.append(f"No map could be made of {_list_names(missing)}; the warnings say why.")
    if bench.undisturbed:
        words.append(
            "The undisturbed dust below and beside the beads is compared with the stated filling factor."
        )
    rows: list[list[dict[str, str]]] = []
    for k, view in enumerate(maps):
        dense = float(np.nanmax(view.measured)) if np.isfinite(view.measured).any() else float("nan")
        panels = [
            {
                "title": f"{view.name}: φ measured",
                "figure": f"map{k}",
                "text": f"Undisturbed φ {view.undisturbed:.4f}, up to {show_number(dense)} beside the bead, whose tip lies "
                f"{view.map.tip_depth * 1e3:.2f} mm deep.",
            }
        ]
        for q, name in enumerate(view.simulated):
            panels.append(
                {
                    "title": f"{view.name}: φ simulated, {name}",
                    "figure": f"map{k}_simulated{q}",
                    "text": "On the compared cells.",
                }
            )
            panels.append(
                {
                    "title": f"{view.name}: measured − {name}",
                    "figure": f"map{k}_left{q}",
                    "text": f"Rms {view.rms(name):.4f}; red is denser than simulated.",
                }
            )  # fmt: skip
        rows.append(panels)
    if not compared:  # one map a scan: side by side
        rows = [[panel for row in rows for panel in row]]
    undisturbed = ""
    if bench.undisturbed:
        means = [f"{dust.name} {np.mean(dust.filling_factor):.4f}" for dust in bench.undisturbed]
        sample = campaign.sample
        undisturbed = (
            f"Filling factor of dust that no bead reached, against depth, in the mean {', '.join(means)}; "
            f"stated are {sample.filling_factor:g} ± {sample.filling_factor_sigma:g} (band: two standard deviations)."
        )
    return {"words": " ".join(words), "rows": rows, "undisturbed": undisturbed}


def describe_causes(found: Diagnosis, summary: dict) -> dict[str, Any]:
    rows: list[dict[str, Any]] = []
    rest: list[str] = []
    for cause in summary["causes"]:
        name = " + ".join(cause["causes"])
        if cause["probability"] < RARE and rows:
            rest.append(f"{name} {cause['probability']:.4f}")
            continue
        parameters = []
        for full, q in cause["parameters"].items():
            factor, unit = SHOWN.get(q["unit"], (1.0, q["unit"]))
            middle, low, high = (show_number(q[key] * factor, "{:.4g}") for key in ("q50", "q05", "q95"))
            parameters.append(f"{full.split('.', 1)[1]} = {middle} ({low} to {high}) {unit}".rstrip())
        rows.append(
            {
                "name": name,
                "probability": f"{cause['probability']:.3f}",
                "percent": f"{100 * cause['probability']:.1f}",
                "title": _title(found, cause["causes"]),
                "parameters": parameters,
            }
        )
    words = (
        "Posterior probabilities of every cause alone, of pairs where one is not enough, of the nominal model (none) and of a "
        "smooth law without a name (unknown); together they are one."
    )
    if found.verdict.word == "unknown":
        words += f" {_say_unknown(found)}"
    against = [f"{name}: {reason}" for name, reason in found.bench.reasons.items()]
    return {"words": words, "rows": rows, "rest": rest, "against": against}


def _say_unknown(found: Diagnosis) -> str:
    nearest = " + ".join(found.best.hypothesis) or "the nominal model"
    return (
        f"What is missing looks like {say_missing(found)}; the nearest that the catalogue comes to it is {nearest}, drawn beside "
        "the nominal model."
    )


def _title(found: Diagnosis, causes: Sequence[str]) -> str:
    fixed = {
        "none": "The nominal simulation is right within its errors",
        "unknown": "Something that no listed cause explains",
    }
    known = found.bench.effects
    return "; ".join(fixed.get(name) or (known[name].title if name in known else name) for name in causes)


def list_confusable(found: Diagnosis) -> list[tuple[str, str, str]]:
    return [(first, second, show_number(cosine, "{:+.2f}")) for first, second, cosine in found.confusable]


def describe_gain(found: Diagnosis, summary: dict, labels: Sequence[str]) -> dict[str, Any]:
    gain = summary["gain"]
    nominal, extended, noise = (
        show_number(1e6 * gain[key], "{:.1f}") for key in ("rms_nominal_m", "rms_extended_m", "rms_noise_m")
    )
    words = f"Each drop was predicted once from the others, with its own free fall: the nominal model misses by {nominal} µm rms"
    if len(labels) > 1:
        sigma = gain["log_score_difference_sigma"]
        about = f" ± {show_number(sigma, '{:.1f}')}" if np.isfinite(sigma) else ""
        fraction = show_number(100 * gain["fraction_of_discrepancy_removed"], "{:.0f}")
        words += (
            f", {labels[1]} by {extended} µm, and a true model would by {noise} µm; {fraction} % of the removable discrepancy is "
            f"gone. The ln score of the held-out drops changes by {show_number(gain['log_score_difference'], '{:+.1f}')}{about}."
        )
    else:
        words += (
            f", a true model would by {noise} µm. Nothing is added to the model, so there is nothing to gain."
        )
    columns = [found.held_out_nominal.rms]
    if len(labels) > 1:
        columns.append(found.held_out_extended.rms)
    columns.append(found.held_out_extended.expected)
    rows = [
        (name, *(show_number(1e6 * float(value), "{:.1f}") for value in values))
        for name, *values in zip(found.held_out_nominal.names, *columns, strict=True)
    ]
    text = "Rms of each held-out drop below the surface for each model; the dash is what a true model would leave."
    return {"words": words, "rows": rows, "text": text}


def describe_numerics(error: dict[str, float], bench: Workbench) -> str:
    return (
        f"At {error['spacing_m'] * 1e6:.3g} µm between particles (the smallest tip; as many to every tip) the "
        f"simulated depth is right to {100 * error['depth_relative']:.2g} % rms, measured against an independent solver. The "
        f"likelihood carries {100 * bench.terms.numerical:.2g} % of the depth for it, alike for like drops, and a contact that "
        f"may be off by {100 * bench.terms.contact_offset:.2g} % of the tip radius in all drops together."
    )


def shown_unit(parameter: Parameter) -> tuple[float, str]:
    return SHOWN.get(parameter.unit, (1.0, parameter.unit))


def _article(label: str) -> str:
    return "the nominal model" if label == "nominal" else label


def _count(number: int, noun: str) -> str:
    return f"{number or 'no'} {noun}{'' if number == 1 else 's'}"


def _list_names(names: Sequence[str]) -> str:
    return ", ".join(names)


def _range(values: Sequence[float], form: str) -> str:
    if not values:
        return "–"
    low, high = form.format(min(values)), form.format(max(values))
    return low if low == high else f"{low} to {high}"
