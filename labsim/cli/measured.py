"""What ``calibrate`` and ``diagnose`` do with campaigns of tracks, videos and scans: call, write, say."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from ..diagnosis.campaign import Diagnosis, diagnose_campaign
from ..diagnosis.next_experiment import suggest
from ..effects import list_effects
from ..effects.model import write_model
from ..inference.calibrate import Calibration, calibrate
from ..inference.runs import RunStore
from ..records import Campaign
from . import options


def has_tracks(campaign: Campaign) -> bool:
    return any(drop.record.kind != "summary" for drop in campaign.drops)


def calibrate_measured(
    campaign: Campaign, folder: Path, store: RunStore, parameters: tuple[str, ...], settings: dict[str, Any]
) -> tuple[dict, str]:
    """posterior.nc, calibration.json, corner.png, fit.png; the summary and the lines for people."""
    found = calibrate(campaign, ("p_m", *parameters), store=store, backend=folder / "chain.h5", **settings)
    return write_measured_calibration(found, folder)


def write_measured_calibration(found: Calibration, folder: Path) -> tuple[dict, str]:
    from ..report.campaign_figures import draw_drops, draw_maps, draw_posterior
    from ..report.campaign_tables import campaign_calibration_lines, campaign_calibration_summary

    summary = campaign_calibration_summary(found)
    options.write_json(folder / "calibration.json", summary)
    (folder / "posterior.nc").unlink(missing_ok=True)
    found.posterior.data.to_netcdf(str(folder / "posterior.nc"), engine="h5netcdf")
    draw_posterior(found.posterior, folder / "corner.png")
    draw_drops(found.bench, [("calibrated", found.fit)], folder / "fit.png")
    if found.bench.scans:
        draw_maps(found.bench, [("calibrated", found.fit)], folder / "maps.png")
    return summary, campaign_calibration_lines(found)


def diagnose_measured(
    campaign: Campaign, folder: Path, store: RunStore, settings: dict[str, Any]
) -> tuple[dict, str]:
    """diagnosis.json, model.toml, report.html, posterior.nc and pictures; the summary and the lines for people."""
    return write_measured_diagnosis(diagnose_campaign(campaign, store, **settings), folder)


def write_measured_diagnosis(found: Diagnosis, folder: Path) -> tuple[dict, str]:
    from ..report import campaign_figures as figures
    from ..report.campaign_page import write_campaign_page
    from ..report.campaign_tables import campaign_diagnosis_lines, campaign_diagnosis_summary, extended_model

    probabilities = dict(found.verdict.probabilities)
    suggestions = suggest(found.bench, [found.nominal, *found.rivals], probabilities)
    summary = campaign_diagnosis_summary(found, suggestions)
    options.write_json(folder / "diagnosis.json", summary)
    write_model(folder / "model.toml", extended_model(found), list_effects(found.campaign))
    (folder / "posterior.nc").unlink(missing_ok=True)
    found.posterior_extended.data.to_netcdf(str(folder / "posterior.nc"), engine="h5netcdf")
    fits = [("nominal", found.nominal)]
    if found.best is not found.nominal:
        fits.append((" + ".join(found.best.hypothesis), found.best))
    figures.draw_drops(found.bench, fits, folder / "drops.png")
    if found.bench.scans:
        figures.draw_maps(found.bench, fits, folder / "maps.png")
    figures.draw_causes(found, folder / "causes.png")
    figures.draw_held_out(found, folder / "held_out.png")
    figures.draw_posterior(found.posterior_extended, folder / "corner.png")
    write_campaign_page(found, summary, suggestions, folder)
    return summary, campaign_diagnosis_lines(found, suggestions)
