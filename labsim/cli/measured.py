"""What ``calibrate`` and ``diagnose`` do with campaigns of tracks, videos and scans: call, write, say."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..diagnosis.campaign import Diagnosis, diagnose_campaign
from ..diagnosis.next_experiment import suggest
from ..effects import list_effects
from ..effects.model import write_model
from ..inference.calibrate import Calibration, calibrate
from ..inference.fitting import Fit
from ..inference.runs import RunStore
from ..records import Campaign
from . import options

if TYPE_CHECKING:  # matplotlib is slow to import and only needed at the end
    from ..report.drop_views import DropView
    from ..report.map_views import MapView


def has_tracks(campaign: Campaign) -> bool:
    return any(drop.record.kind != "summary" for drop in campaign.drops)


def calibrate_measured(
    campaign: Campaign, folder: Path, store: RunStore, parameters: tuple[str, ...], settings: dict[str, Any]
) -> tuple[dict, str]:
    """posterior.nc, calibration.json, fit.png, posterior.png; the summary and the lines for people."""
    found = calibrate(campaign, ("p_m", *parameters), store=store, backend=folder / "chain.h5", **settings)
    return write_measured_calibration(found, folder)


def write_measured_calibration(found: Calibration, folder: Path) -> tuple[dict, str]:
    from ..report import campaign_figures as figures
    from ..report.campaign_page import write_calibration_page
    from ..report.campaign_tables import (
        campaign_calibration_lines,
        campaign_calibration_summary,
        is_pushed,
        state_numerical_error,
    )

    summary = campaign_calibration_summary(found)
    options.write_json(folder / "calibration.json", summary)
    (folder / "posterior.nc").unlink(missing_ok=True)
    found.posterior.data.to_netcdf(str(folder / "posterior.nc"), engine="h5netcdf")
    if is_pushed(found.bench):
        from ..report.push_page import write_push_calibration

        write_push_calibration(found, folder)
        return summary, campaign_calibration_lines(found)
    figures.draw_posterior(found.posterior, folder / "corner.png")
    views, maps = _draw_fits(found, [(" + ".join(found.fit.hypothesis) or "nominal", found.fit)], folder)
    (folder / "drops.png").rename(folder / "fit.png")
    figures.draw_p_m([("calibrated", found.posterior)], folder / "posterior.png")
    write_calibration_page(found, summary, state_numerical_error(found.bench), views, maps, folder)
    return summary, campaign_calibration_lines(found)


def diagnose_measured(
    campaign: Campaign, folder: Path, store: RunStore, settings: dict[str, Any]
) -> tuple[dict, str]:
    """diagnosis.json, model.toml, report.html, posterior.nc and pictures; the summary and the lines for people."""
    return write_measured_diagnosis(diagnose_campaign(campaign, store, **settings), folder)


def write_measured_diagnosis(found: Diagnosis, folder: Path) -> tuple[dict, str]:
    from ..report import campaign_figures as figures
    from ..report.campaign_page import write_campaign_page
    from ..report.campaign_tables import (
        campaign_diagnosis_lines,
        campaign_diagnosis_summary,
        extended_model,
        is_pushed,
    )
    from ..report.law_figures import draw_laws

    probabilities = dict(found.verdict.probabilities)
    suggestions = suggest(found.bench, [found.nominal, *found.rivals], probabilities)
    summary = campaign_diagnosis_summary(found, suggestions)
    options.write_json(folder / "diagnosis.json", summary)
    write_model(folder / "model.toml", extended_model(found), list_effects(found.campaign))
    (folder / "posterior.nc").unlink(missing_ok=True)
    found.posterior_extended.data.to_netcdf(str(folder / "posterior.nc"), engine="h5netcdf")
    if is_pushed(found.bench):
        from ..report.push_page import write_push_diagnosis

        write_push_diagnosis(found, summary, suggestions, folder)
        return summary, campaign_diagnosis_lines(found, suggestions)
    fits = [("nominal", found.nominal)]
    posteriors = [("nominal", found.posterior_nominal)]
    if found.best is not found.nominal:
        fits.append((" + ".join(found.best.hypothesis), found.best))
        posteriors.append((fits[1][0], found.posterior_extended))
    views, maps = _draw_fits(found, fits, folder)
    figures.draw_causes(found, folder / "causes.png")
    (folder / "law.png").unlink(missing_ok=True)
    if found.verdict.word == "unknown" and found.unknown.laws:
        learned = found.learned.best if found.learned else None
        draw_laws(found.unknown.laws, folder / "law.png", learned)
    figures.draw_held_out(found, [name for name, _ in fits], folder / "held_out.png")
    figures.draw_p_m(posteriors, folder / "posterior.png")
    figures.draw_posterior(found.posterior_extended, folder / "corner.png")
    write_campaign_page(found, summary, suggestions, views, maps, folder)
    return summary, campaign_diagnosis_lines(found, suggestions)


def _draw_fits(
    found: Calibration | Diagnosis, fits: list[tuple[str, Fit]], folder: Path
) -> tuple[list[DropView], list[MapView]]:
    """Pictures of drops and scans with each named fit, and the views that the page shows of them."""
    from ..report import campaign_figures as figures
    from ..report.drop_views import view_drops
    from ..report.map_views import measure_maps, view_maps

    views = view_drops(found.bench, fits)
    figures.draw_drops(views, folder / "drops.png")
    figures.draw_misfit(views, folder / "misfit.png")
    maps = measure_maps(found.campaign, view_maps(found.bench, fits))
    if maps:
        figures.draw_maps(maps, folder / "maps.png")
    if found.bench.undisturbed:
        figures.draw_undisturbed(found.bench, folder / "undisturbed.png")
    return views, maps
