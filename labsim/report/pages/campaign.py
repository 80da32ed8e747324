"""report.html of a measured campaign, diagnosed or calibrated: what stands where on the page."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from ...diagnosis.campaign import Diagnosis
from ...inference.calibrate import Calibration
from ...inference.fits.fitting import DOUBTFUL, Fit
from ...inference.fits.posterior import Posterior
from ...inference.problem import Problem
from ...records import Campaign
from ..campaign_tables import say_verdict
from ..figures.campaign import choose_decisive
from ..figures.interactive import plot_drop, plot_held_out, plot_map, plot_misfit, plot_p_m, plot_undisturbed
from ..figures.laws import plot_law
from ..provenance import trace_origin
from .campaign_words import (
    describe_calibration,
    describe_measurement,
    describe_misfit,
    describe_numerics,
    say_rebounds,
)
from .cause_words import BADGES, describe_causes, describe_gain, describe_untestable, list_confusable
from .drop_views import DropView, list_fits, list_posteriors
from .law_words import comes_nearest, describe_laws, size_of_missing
from .map_views import MapView
from .map_words import describe_maps
from .page import read_picture, show_number, write_html
from .phrases import CERTAIN, say_hypothesis, say_p_value, say_probability, state_p_value, tile_gain

PICTURES = {
    "decisive": "What decides: measured, simulated, and what is left.",
    "drops": "Every drop: measured depth against time, each simulation, and below it what each leaves, with the band of what a "
    "true model may leave. The numbers stand in the table above.",
    "misfit": "Measured minus simulated depth at the stop, in percent, against impact speed.",
    "maps": "Every scan: filling factor measured, simulated, and measured minus simulated.",
    "held_out": "Held-out drops: what each model misses of a drop that no fit has seen.",
    "posterior": "Posterior density of p_m.",
    "corner": "Posterior, every parameter against every other.",
    "law": "The free law of an unknown cause with the band that holds 68 %, a panel a law.",
    "tests": "Static tests: stress against filling factor, measured and by the law of each fit.",
    "undisturbed": "Filling factor of undisturbed dust against depth.",
}


def write_campaign_page(
    found: Diagnosis,
    summary: dict,
    views: Sequence[DropView],
    maps: Sequence[MapView],
    folder: Path,
) -> Path:
    """report.html of a diagnosis, its summary and the static pictures that lie in the folder."""
    labels = list(views[0].simulated)
    posteriors = list_posteriors(found)
    quantiles = summary["p_m_Pa"]
    (first, _), *others = found.verdict.named
    apart = [(other, p) for other, p in others if not set(first) < set(other)]
    nearly = "".join(f"; {say_hypothesis(other)} {say_probability(p)}" for other, p in apart)
    tiles = [
        ("p_m, nominal", f"{quantiles['nominal']['q50'] / 1e3:.2f} kPa", _between(quantiles["nominal"])),
        (
            "p-value of the nominal model",
            say_p_value(found.p_value),
            "it does not explain the data" if found.p_value < DOUBTFUL else "it explains the data",
        ),
        (
            "most probable",
            say_hypothesis(first),
            f"probability {say_probability(found.verdict.of_first)}{nearly}",
        ),
    ]
    if found.verdict.word == "unknown":
        if not comes_nearest(found) and (size := size_of_missing(found)):
            tiles.append(("what is missing", *size))
    elif len(labels) > 1:
        extended = quantiles["extended"]
        tiles.insert(
            1,
            (
                f"p_m with {labels[1].replace('_', ' ')}",
                f"{extended['q50'] / 1e3:.2f} kPa",
                _between(extended),
            ),
        )
        tiles.append(tile_gain(found.gain, "drops"))
    if found.verdict.word != "unknown" and found.verdict.probabilities[0][1] < CERTAIN:
        middle, spread = quantiles["over_causes"]["q50"] / 1e3, _between(quantiles["over_causes"])
        tiles.insert(len(labels), ("p_m, whichever cause", f"{middle:.2f} kPa", spread))
    figures = _figures(found.problem, views, maps, posteriors)
    held = [(labels[0], found.held_out_nominal.rms)]
    if len(labels) > 1:
        held.append((labels[1], found.held_out_extended.rms))
    figures["held_out"] = plot_held_out(found.held_out_nominal.names, held, found.held_out_extended.expected)
    causes, laws = describe_causes(found, summary), describe_laws(found)
    for row, law in zip(laws["rows"] if laws else [], found.unknown.laws, strict=False):
        figures[row["figure"]] = plot_law(law, found.learned.best if found.learned else None)
    confusable = list_confusable(found)
    return _write(
        folder,
        found.campaign,
        found.problem,
        views,
        maps,
        figures,
        page_title="what the simulation gets wrong",
        tone=found.verdict.word,
        badge=BADGES[found.verdict.word],
        sentence=f"{say_verdict(found)} {summary['remedy']}",
        tiles=tiles,
        calibration=describe_calibration(
            found.nominal, found.p_value, found.scatter, posteriors, found.problem, len(views)
        ),
        diagnosed=True,
        cause=found.verdict.probabilities[0][0],
        fits=list_fits(found),
        causes=causes,
        laws=laws,
        confusable=confusable,
        untestable=describe_untestable(found),
        gain=describe_gain(found, summary, labels),
        suggestions=found.suggestions,
        between="formulas" if found.learned and any(each.tells for each in found.suggestions) else "causes",
        numerics=describe_numerics(summary["numerical_error"], found.problem),
        warnings=found.warnings,
        runs=(found.runs_new, found.runs_reused, found.wall),
    )


def write_calibration_page(
    found: Calibration,
    summary: dict,
    numerical_error: dict[str, float],
    views: Sequence[DropView],
    maps: Sequence[MapView],
    folder: Path,
) -> Path:
    """report.html of a calibration alone: no causes are searched."""
    label = next(iter(views[0].simulated))
    posteriors = [(label, found.posterior)]
    q = summary["p_m_Pa"]
    explains = found.p_value >= DOUBTFUL
    sentence = (
        f"p_m = {q['q50'] / 1e3:.2f} kPa, 90 % between {q['q05'] / 1e3:.2f} and {q['q95'] / 1e3:.2f} kPa, from "
        f"{len(views)} drops; the simulation {'explains' if explains else 'does not explain'} them "
        f"({state_p_value(found.p_value)})" + ("." if explains else "; labsim diagnose asks why.")
    )
    others = [name for name in found.posterior.names if name != "p_m_Pa"]
    tiles = [
        ("p_m", f"{q['q50'] / 1e3:.3f} kPa", _between(q)),
        *((name, show_number(summary["parameters"][name]["q50"], "{:.3g}"), "") for name in others[:2]),
        (
            "p-value of the model",
            say_p_value(found.p_value),
            "it explains the data" if explains else "it does not explain the data",
        ),
    ]
    return _write(
        folder,
        found.campaign,
        found.problem,
        views,
        maps,
        _figures(found.problem, views, maps, posteriors),
        page_title="calibration",
        tone="none" if explains else "unknown",
        badge="Calibrated" if explains else "Calibrated, but the model does not explain the data",
        sentence=sentence,
        tiles=tiles,
        calibration=describe_calibration(
            found.fit,
            found.p_value,
            found.scatter,
            posteriors,
            found.problem,
            len(views),
        ),
        diagnosed=False,
        fits=list_fits(found),
        numerics=describe_numerics(numerical_error, found.problem),
        warnings=found.warnings,
        runs=(found.runs_new, found.runs_reused, found.wall),
    )


def _between(q: dict[str, float]) -> str:
    return f"90 %: {q['q05'] / 1e3:.2f} to {q['q95'] / 1e3:.2f} kPa"


def _figures(
    problem: Problem,
    views: Sequence[DropView],
    maps: Sequence[MapView],
    posteriors: Sequence[tuple[str, Posterior]],
) -> dict[str, Any]:
    figures = {"p_m": plot_p_m(posteriors), "misfit": plot_misfit(views)}
    for k, view in enumerate(views):
        figures[f"drop{k}"] = plot_drop(view)
    for k, each in enumerate(maps):
        figures[f"map{k}"] = plot_map(each, each.measured)
        for q, name in enumerate(each.simulated):
            figures[f"map{k}_simulated{q}"] = plot_map(each, each.simulated[name])
            figures[f"map{k}_left{q}"] = plot_map(each, each.left(name), difference=True)
    if problem.undisturbed:
        sample = problem.campaign.sample
        profiles = [(dust.name, dust.depth, dust.filling_factor, dust.sigma) for dust in problem.undisturbed]
        figures["undisturbed"] = plot_undisturbed(
            profiles, (sample.filling_factor, sample.filling_factor_sigma)
        )
    return figures


def _write(
    folder: Path,
    campaign: Campaign,
    problem: Problem,
    views: Sequence[DropView],
    maps: Sequence[MapView],
    figures: dict[str, Any],
    *,
    warnings: Sequence[str],
    runs: tuple[int, int, float],
    diagnosed: bool,
    cause: Sequence[str] = (),
    fits: Sequence[tuple[str, Fit]],
    **values: Any,
) -> Path:
    contents = [
        ("measurement", "What was measured"),
        ("calibration", "Calibration"),
        ("drops", "Drop by drop"),
    ]
    if campaign.scans:
        contents.append(("maps", "Maps of the dust"))
    if diagnosed:
        contents += [
            ("causes", "Causes"),
            ("confusable", "Hard to tell apart"),
            ("gain", "Gain"),
            ("next", "Next experiment"),
        ]
    if (folder / "tests.png").is_file():
        contents.insert(3, ("tests", "Static tests"))
    contents += [("numerics", "Numerical error"), ("warnings", "Warnings"), ("made", "Versions and hashes")]
    notes = {"drops": str(len(views)), "warnings": str(len(warnings)) if warnings else ""}
    shown, decisive = choose_decisive(problem, views, folder, cause, fits)
    pictures = {name: read_picture(folder / f"{name}.png", text) for name, text in PICTURES.items()}
    return write_html(
        folder / "report.html",
        "campaign.html",
        figures,
        name=campaign.name,
        description=campaign.description,
        labels=list(views[0].simulated),
        contents=[(anchor, title, notes.get(anchor, "")) for anchor, title in contents],
        measurement=describe_measurement(campaign, problem, views),
        misfit=describe_misfit(views),
        rebounds=say_rebounds(problem, fits),
        maps=describe_maps(campaign, problem, maps) if campaign.scans else None,
        pictures=pictures | {"decisive": pictures[shown]},
        decisive=decisive,
        diagnosed=diagnosed,
        warnings=warnings,
        made=trace_origin(
            campaign,
            [("runs", f"{runs[0]} new, {runs[1]} from the store"), ("wall time", f"{runs[2]:.0f} s")],
        ),
        **values,
    )
