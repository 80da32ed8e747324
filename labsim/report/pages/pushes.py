"""What is written of a campaign of pushes, calibrated or diagnosed: pictures and one page, report.html."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import LogNorm

from ...calibrated import say_law, show_parameter
from ...diagnosis.campaign import Diagnosis
from ...diagnosis.next_experiment import Suggestion
from ...inference.calibrate import Calibration
from ...inference.fits.fitting import DOUBTFUL, Fit
from ...inference.observations.push_model import PushModel
from ...inference.observations.sleeve_friction import SOLVER, SleeveFriction
from ...inference.problem import Problem
from ...records import FloatArray
from ..campaign_tables import say_calibrated, say_verdict
from ..figures.campaign import draw_causes, draw_held_out, draw_p_m
from ..figures.style import COLOURS, GREY, INK, new_figure
from ..provenance import trace_origin
from .cause_words import BADGES, describe_causes
from .drop_views import list_fits, list_posteriors
from .page import read_picture, show_number, write_html
from .phrases import say_hypothesis, say_p_value, say_probability, state_p_value, tile_gain

PICTURES = {
    "pushes": "Net resistance against depth of every push, coloured by its speed; the depths that are compared are drawn strong.",
    "misfit": "Measured over simulated resistance minus one, the mean over the windows of each push, against its speed; what all "
    "pushes share at a depth is taken out. Bars: two standard deviations of what a true model may leave.",
    "causes": "Probabilities of the causes.",
    "held_out": "Held-out pushes: what each model misses of a push that no fit has seen.",
    "posterior": "Posterior density of what is calibrated.",
}


@dataclass(frozen=True)
class PushView:
    """One push. left : name of the fit -> (n,) measured minus simulated ln resistance, without what all pushes share; allowed :
    standard deviation of its mean that a true model may leave."""

    name: str
    speed: float  # m/s
    model: PushModel
    left: dict[str, FloatArray]
    allowed: float

    def mean(self, fit: str) -> float:
        """Relative, over all windows."""
        return math.expm1(float(np.mean(self.left[fit])))


def view_pushes(problem: Problem, fits: Sequence[tuple[str, Fit]]) -> list[PushView]:
    """Every push with each named fit."""
    models = [model for model in problem.tracks.models if isinstance(model, PushModel)]
    left: list[dict[str, FloatArray]] = [{} for _ in models]
    for label, fit in fits:
        residuals = [fit.drops.residual[fit.drops.sections[m.observed.name]][: m.data.size] for m in models]
        windows: dict[int, list[float]] = {}
        for model, residual in zip(models, residuals, strict=True):
            for number, value in zip(model.observed.windows, residual, strict=True):
                windows.setdefault(int(number), []).append(float(value))
        shared = {number: float(np.mean(values)) for number, values in windows.items()}
        for own, model, residual in zip(left, models, residuals, strict=True):
            own[label] = residual - np.array([shared[int(number)] for number in model.observed.windows])
    views = []
    for model, own in zip(models, left, strict=True):
        ground = model.ground_noise
        mean = np.full(model.data.size, 1.0 / model.data.size)
        variance = problem.budget.scatter**2 + float(mean @ (ground @ ground.T) @ mean)
        views.append(
            PushView(model.observed.name, model.observed.impact_speed, model, own, math.sqrt(variance))
        )
    return views


def draw_pushes(views: Sequence[PushView], path: Path) -> Path:
    """Net resistance against depth, a line a push."""
    with new_figure(path, 6.4, 5.2) as figure:
        lay_pushes(views, figure.subplots())
    return path


def lay_pushes(views: Sequence[PushView], ax: Axes) -> None:
    """Net resistance against depth, a line a push, on axes."""
    speeds = [1e3 * view.speed for view in views]
    norm = LogNorm(min(speeds) * 0.95, max(speeds) * 1.05)
    for view, speed in sorted(zip(views, speeds, strict=True), key=lambda each: each[1]):
        observed, colour = view.model.observed, colormaps["viridis"](norm(speed))
        net = observed.record.pressure - observed.weight * observed.record.depth
        ax.plot(net / 1e6, observed.record.depth, color=colour, lw=0.5, alpha=0.5)
        ax.plot(np.exp(observed.resistance) / 1e6, observed.depth, ".-", color=colour, lw=1.1, ms=4)
    top = np.quantile([np.exp(view.model.data.max()) for view in views], 0.9)
    ax.set_xlim(0.0, 1.5 * top / 1e6)
    ax.invert_yaxis()
    ax.set_xlabel("net resistance (MPa)")
    ax.set_ylabel("depth (m)")
    bar = ax.figure.colorbar(ScalarMappable(norm, "viridis"), ax=ax)
    bar.set_label("speed (mm/s)")
    ticks = sorted({round(speed, 3) for speed in speeds})
    bar.set_ticks(ticks, labels=[f"{tick:g}" for tick in ticks])
    bar.ax.minorticks_off()


def draw_misfit(views: Sequence[PushView], path: Path) -> Path:
    """Mean misfit of every push against its speed, one colour a model."""
    with new_figure(path, 6.4, 3.6) as figure:
        lay_misfit(views, figure.subplots())
    return path


def lay_misfit(views: Sequence[PushView], ax: Axes) -> None:
    """Mean misfit of every push against its speed, on axes."""
    ax.axhline(0.0, color=INK, lw=0.8)
    for k, (label, colour) in enumerate(zip(views[0].left, COLOURS, strict=False)):
        ax.errorbar(
            [1e3 * view.speed * (1.0 + 0.03 * k) for view in views],
            [100 * view.mean(label) for view in views],
            [200 * view.allowed for view in views],
            fmt="o",
            ms=4,
            lw=0.7,
            capsize=2,
            color=colour,
            label=label.replace("_", " "),
        )
    ax.set_xscale("log")
    ticks = sorted({round(1e3 * view.speed, 3) for view in views})
    ax.set_xticks(ticks, [f"{tick:g}" for tick in ticks], fontsize=8)
    ax.minorticks_off()
    ax.set_xlabel("speed (mm/s)")
    ax.set_ylabel("measured over simulated − 1 (%)")
    ax.legend(fontsize=8)
    ax.grid(axis="y", color=GREY, alpha=0.2)


def write_push_diagnosis(found: Diagnosis, summary: dict, folder: Path) -> Path:
    """Pictures and report.html of a diagnosis."""
    fits = list_fits(found)
    views = _draw(found, fits, folder)
    law = found.campaign.material.law
    draw_causes(found, folder / "causes.png")
    draw_held_out(found, [label for label, _ in fits], folder / "held_out.png", (100.0, "%"))
    draw_p_m(list_posteriors(found), folder / "posterior.png", show_parameter(law))
    first, _ = found.verdict.named[0]
    gain, label = found.gain, show_parameter(law)[0]
    tiles = [
        (
            f"{label}, nominal",
            say_calibrated(found.campaign, float(np.median(found.posterior_nominal.calibrated))),
            "",
        ),
        (
            "p-value of the nominal model",
            say_p_value(found.p_value),
            "it does not explain the data" if found.p_value < DOUBTFUL else "it explains the data",
        ),
        ("most probable", say_hypothesis(first), f"probability {say_probability(found.verdict.of_first)}"),
    ]
    if found.best is not found.nominal:
        tiles.append(tile_gain(gain, "pushes"))
    words = (
        f"Each push is held out once and predicted from the others: rms {100 * gain.rms_nominal:.1f} % with the nominal model, "
        f"{100 * gain.rms_extended:.1f} % with {fits[-1][0]}, {100 * gain.rms_noise:.1f} % expected of a true model."
    )
    return _write(
        found, views, folder, tiles, found.verdict.word, BADGES[found.verdict.word],
        f"{say_verdict(found)} {summary['remedy']}", causes=describe_causes(found, summary), gain=words,
        suggestions=found.suggestions,
    )  # fmt: skip


def write_push_calibration(found: Calibration, folder: Path) -> Path:
    """Pictures and report.html of a calibration."""
    views = _draw(found, list_fits(found), folder)
    label, unit, factor = show_parameter(found.campaign.material.law)
    draw_p_m([("calibrated", found.posterior)], folder / "posterior.png", (label, unit, factor))
    low, middle, high = np.quantile(found.posterior.calibrated, [0.05, 0.5, 0.95]) * factor
    explains = found.p_value >= DOUBTFUL
    sentence = (
        f"{label} = {middle:.3g} {unit}, 90 % between {low:.3g} and {high:.3g} {unit}, from {len(views)} pushes; the simulation "
        f"{'explains' if explains else 'does not explain'} them ({state_p_value(found.p_value)})"
        + ("." if explains else "; labsim diagnose asks why.")
    )
    tiles = [
        (label, f"{middle:.3g} {unit}", f"90 %: {low:.3g} to {high:.3g} {unit}"),
        ("p-value of the model", say_p_value(found.p_value), ""),
    ]
    badge = "Calibrated" if explains else "Calibrated, but the model does not explain the data"
    return _write(found, views, folder, tiles, "none" if explains else "unknown", badge, sentence)


def say_sleeve(problem: Problem, fits: Sequence[tuple[str, Fit]]) -> str:
    """What the sleeves read beside what each named fit simulates; empty where no record has one."""
    ratios = [
        model.observed.friction_ratio for model in problem.tracks.models if isinstance(model, PushModel)
    ]
    measured = np.concatenate(ratios) if ratios else np.empty(0)
    measured = measured[np.isfinite(measured)]
    if not measured.size:
        return ""
    text = (
        f" The sleeve feels {100 * np.median(measured):.2g} % of the net resistance (median of all windows)"
    )
    found = problem.find(SleeveFriction)
    if found is None:
        return text + "; that is shown alone, and compared where the record says sleeve = true."
    place, sleeves = found
    simulated = [
        f"{100 * float(np.median(sleeves.data - fit.blocks[place].residual)):.2g} % ({label.replace('_', ' ')})"
        for label, fit in fits
    ]
    return text + f"; simulated are {', '.join(simulated)}, to {100 * SOLVER:.0f} % of that."


def _draw(found: Diagnosis | Calibration, fits: Sequence[tuple[str, Fit]], folder: Path) -> list[PushView]:
    views = view_pushes(found.problem, fits)
    draw_pushes(views, folder / "pushes.png")
    draw_misfit(views, folder / "misfit.png")
    return views


def _write(
    found: Diagnosis | Calibration,
    views: Sequence[PushView],
    folder: Path,
    tiles: list[tuple[str, str, str]],
    tone: str,
    badge: str,
    sentence: str,
    causes: dict[str, Any] | None = None,
    gain: str = "",
    suggestions: Sequence[Suggestion] = (),
) -> Path:
    campaign = found.campaign
    label, _, _ = show_parameter(campaign.material.law)
    ground = views[0].model.ground
    deepest, speeds = max(view.model.deepest for view in views), [1e3 * view.speed for view in views]
    measurement = (
        f"{len(views)} pushes of a {campaign.drops[0].projectile.tip} at {min(speeds):g} to {max(speeds):g} mm/s, compared down "
        f"to {deepest:.3g} m. The simulation pushes the same tip deep into even matter ({say_law(campaign.material.law)}); "
        f"what it says of the resistance, in units of {label}, holds at every depth. How the strength grows with depth is free: "
        "each window of depth has a value that all pushes share. Beside that each push may differ by a factor, "
        f"{100 * found.problem.budget.scatter:.2g} % from one to the next, and along its depth by {100 * ground.size:.2g} % over "
        f"{ground.length:.2g} m, as these records show." + say_sleeve(found.problem, list_fits(found))
    )
    labels = list(views[0].left)
    rows = [
        (
            view.name,
            f"{1e3 * view.speed:g}",
            *(show_number(100 * view.mean(each), "{:+.1f}") for each in labels),
        )
        for view in sorted(views, key=lambda view: view.speed)
    ]
    contents = [("measurement", "What was measured"), ("pushes", "Push by push")]
    contents += [("causes", "Causes"), ("gain", "Gain"), ("next", "Next experiment")] * (causes is not None)
    contents += [("warnings", "Warnings"), ("made", "Versions and hashes")]
    return write_html(
        folder / "report.html",
        "pushes.html",
        {},
        name=campaign.name,
        description=campaign.description,
        page_title="what the simulation gets wrong" if causes else "calibration",
        tone=tone,
        badge=badge,
        sentence=sentence,
        tiles=tiles,
        contents=[(anchor, title, "") for anchor, title in contents],
        measurement=measurement,
        assumed=sorted(campaign.source.items()),
        labels=labels,
        rows=rows,
        pictures={name: read_picture(folder / f"{name}.png", text) for name, text in PICTURES.items()},
        causes=causes,
        gain=gain,
        suggestions=suggestions,
        warnings=found.warnings,
        made=trace_origin(campaign, [("runs", f"{found.runs_new} new, {found.runs_reused} from the store")]),
    )
